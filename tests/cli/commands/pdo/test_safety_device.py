"""A safety device (EN 50325-5): its SRDOs are named, no PDO carries its configuration, and their CAN-IDs are taken."""

from __future__ import annotations

from pathlib import Path

import pytest

from dvtcli.domain.cob_id import taken_by_channels
from tests.cli.commands.bench import Bench

SRDO = "CAN-ID 0x101 is SRDO1 of node 1 (1301:05)"


@pytest.mark.parametrize(
    ("line", "said"),
    [
        ("map tpdo2 6000:01 --cob-id 0x101", SRDO),
        ("map tpdo2 6000:01 --cob-id 0x102", "CAN-ID 0x102 is SRDO1 of node 1 (1301:06)"),
        ("set 2:tpdo1 --cob-id 0x101", SRDO),
        ("write 1801:01 0x101", SRDO),
        ("write 1301:05 0x181", "CAN-ID 0x181 for an SRDO is that of TPDO1 of node 1"),
        ("map tpdo2 1301:05", "1301:05 belongs to the safety configuration"),
        ("map tpdo2 1381:01", "1381:01 belongs to the safety configuration"),
        ("map rpdo1 13FE", "13FE:00 belongs to the safety configuration"),
    ],
)
def test_what_would_disturb_it_is_refused(line: str, said: str) -> None:
    with Bench(("safety@1", "generic@2"), {"yes": True}) as bench:
        ran = bench.run(line)
    assert (ran.code, said in " ".join(ran.stderr.split())) == (1, True), ran


@pytest.mark.parametrize("index", ["1301:05", "1382:01", "13FE:00", "13FF:01"])
def test_its_configuration_is_no_process_data_even_where_the_file_says_so(index: str, tmp_path: Path) -> None:
    from dvtcli.simulator.network.family_file import family_eds

    text = family_eds("safety").read_text()
    section = f"[{index[:4]}]" if index.endswith(":00") else f"[{index[:4]}sub{int(index[5:], 16):X}]"
    start = text.index(section)
    changed = text[start:].replace("PDOMapping=0", "PDOMapping=1", 1).replace("AccessType=rw", "AccessType=rwr", 1)
    (tmp_path / "odd.eds").write_text(text[:start] + changed)
    with Bench((f"{tmp_path}/odd.eds",), {"yes": True}) as bench:
        assert index not in bench.run("objects --mappable tpdo").stdout
        refused = bench.run(f"map tpdo2 {index}")
        refused.failed(1, "safety-object")
        forced = bench.run(f"map tpdo2 {index} --force")
        forced.failed(1, "0x06040041")


@pytest.mark.parametrize(
    ("frame", "said"),
    [
        ("581#4301130501010000", "1301:05 SRDO communication parameter 1.COB-ID 1 = 0x101"),
        ("101#05", "SRDO1, node 1"),
        ("102#FA", "SRDO1 inverted, node 1"),
        ("581#4F01130101000000", "Information direction = transmitted (1)"),
        ("581#4381130108010021", "Mapped object 1 = 2100:01 Safety input.Door, 8 bits"),
        ("581#4FFE1300A5000000", "13FE:00 Configuration valid = 165"),
    ],
)
def test_explain_names_its_objects(frame: str, said: str) -> None:
    with Bench(("safety",)) as bench:
        ran = bench.run(f"explain {frame}")
    assert said in ran.stdout, ran


@pytest.mark.parametrize(
    ("place", "name"),
    [("1302:06", "COB-ID 2 (inverted)"), ("1383:02", "mapped object 2"), ("13FF:03", "signature of SRDO 3"),
     ("13FE:00", "configuration valid"), ("1300:00", "global fail-safe command")],
)  # fmt: skip
def test_explain_names_them_without_an_eds(place: str, name: str) -> None:
    index, sub_index = int(place[:4], 16), int(place[5:], 16)
    with Bench(("generic",)) as bench:
        ran = bench.run(f"explain 67F#40{index & 0xFF:02X}{index >> 8:02X}{sub_index:02X}00000000")
    assert name in ran.stdout, ran


def test_a_network_file_is_checked_with_its_can_ids(tmp_path: Path) -> None:
    text = "nodes:\n  s: {node_id: 1, dcf: safety}\n  g: {node_id: 2, dcf: generic, tpdo: {1: {cob_id: 0x102}}}\n"
    (tmp_path / "net.yaml").write_text(text)
    with Bench() as bench:
        ran = bench.run(f"check {tmp_path}/net.yaml")
        fine = (tmp_path / "fine.yaml").write_text(text.replace("0x102", "0x182"))
        assert (fine > 0, bench.run(f"check {tmp_path}/fine.yaml").code) == (True, 0)
    assert (ran.code, "SRDO1 of node 1" in ran.stdout + ran.stderr) == (4, True), ran


def test_an_srdo_without_direction_takes_no_can_id() -> None:
    held = {(0x1301, 1): 0, (0x1301, 5): 0x301, (0x1302, 1): 2, (0x1302, 5): 0x303, (0x1302, 6): 0, (0x1303, 5): 0x305}
    assert taken_by_channels(5, held) == {
        (0x303, False): "SRDO2 of node 5 (1302:05)", (0x305, False): "SRDO3 of node 5 (1303:05)"
    }  # fmt: skip


def test_its_configuration_is_never_written_back(tmp_path: Path) -> None:
    with Bench(("safety",), {"yes": True}) as bench:
        assert bench.run(f"backup {tmp_path}/kept.dcf").code == 0
        assert bench.run("write 13FE 0").code == 0
        assert bench.run(f"apply {tmp_path}/kept.dcf").code in (0, 1)
        assert "= 0 " in bench.run("read 13FE").stdout


@pytest.mark.parametrize("line", ["write 1301:01 0", "write 1382:01 0x21000108", "write 13FE 0"])
def test_a_write_to_its_configuration_is_warned_of(line: str) -> None:
    with Bench(("safety",), {"yes": True}) as bench:
        ran = bench.run(f"{line} --json")
    assert ran.code == 0, ran
    assert "safety-configuration" in [finding["rule"] for finding in ran.document["findings"]], ran


def test_a_plan_that_writes_its_configuration_is_warned_of(tmp_path: Path) -> None:
    text = "nodes:\n  s: {node_id: 1, dcf: safety, sdo: [{index: 0x1302, sub_index: 2, value: 30}]}\n"
    (tmp_path / "net.yaml").write_text(text)
    with Bench(("safety",), {"yes": True}) as bench:
        ran = bench.run(f"plan {tmp_path}/net.yaml")
    assert (ran.code, "0x1302:02 belongs to the safety configuration" in ran.stdout + ran.stderr) == (0, True), ran
