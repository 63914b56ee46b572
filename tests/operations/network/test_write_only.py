"""What is write-only, in a network file, a DCF and a concise DCF: written each time, and said to be not compared."""

from __future__ import annotations

import re
from pathlib import Path

import pytest

from dvtcli.files.device_file import device_file_bytes, parse_device_file
from dvtcli.operations.network.concise_network import concise_dcf, read_concise_file
from tests.cli.commands.bench import Bench
from tests.small_eds import U8, U16, U32, plain, var

FILE = """a:
  node_id: 5
  dcf: device.eds
  sdo:
    - {object: "2050:00", value: 1}
    - {object: "2051:00", value: 7}
"""


@pytest.fixture(autouse=True)
def device(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """An EDS with a write-only object, and a DCF of node 5 that sets it."""
    monkeypatch.chdir(tmp_path)
    eds = plain()
    eds.variable(0x2050, var("Trim", U8, None, "wo"))
    eds.variable(0x2051, var("Limit", U16, 0))
    eds.variable(0x2052, var("Passcode", U32, None, "wo"))
    Path("device.eds").write_text(eds.text())
    text = eds.text() + "\n[DeviceComissioning]\nNodeID=5\nNodeName=press\n"
    for index, value in (("2050", 1), ("2051", 7), ("2052", 9), ("1010sub1", 1), ("1018sub1", 1), ("1017", 100)):
        assert text.count(f"[{index}]\n") == 1
        text = text.replace(f"[{index}]\n", f"[{index}]\nParameterValue={value}\n")
    for place, value in (("1800sub2", 254), ("1A00sub0", 1), ("1A00sub1", 0x60000208)):
        text = text.replace(f"[{place}]\n", f"[{place}]\nParameterValue={value}\n")
    Path("device.dcf").write_text(text)
    Path("net.yaml").write_text(FILE)


def test_a_network_file_writes_it_each_time_without_force() -> None:
    with Bench(("device.eds@5",), {"yes": True}) as bench:
        planned = bench.run("plan net.yaml")
        assert planned.code == 0, planned
        assert "0x2050:00  not compared (write-only): 1 is written each time  Trim" in planned.stdout
        for writes in ("2 writes, 1 read back equal, 1 acknowledged (write-only)", "1 write, 1 acknowledged"):
            applied = bench.run("apply net.yaml")
            assert (applied.code, writes in applied.stdout) == (0, True), applied
        assert bench.session.node().sdo.upload(0x2051, 0) == b"\x07\0"
        verified = bench.run("verify net.yaml")
        assert (verified.code, "2050:00 cannot be read back: not compared" in verified.stdout) == (0, True), verified


def test_diff_ends_well_if_only_write_only_values_are_left() -> None:
    with Bench(("device.eds@5",), {"yes": True}) as bench:
        differing = bench.run("diff net.yaml")
        assert differing.code == 3, differing
        Path("drift.dvt").write_text("diff net.yaml\n")
        script = bench.run("run drift.dvt")
        script.failed(3, "error: 2051:00 of node 5 differs")
        assert bench.run("apply net.yaml").code == 0
        equal = bench.run("diff net.yaml")
        assert (equal.code, "1 write-only value not compared" in equal.stdout) == (0, True), equal
        junit = bench.run("diff net.yaml --format junit").stdout
        assert ('skipped="1"' in junit, 'failures="0"' in junit, "not compared" in junit) == (True, True, True), junit
        assert bench.run("diff net.yaml --format github").code == 0


def test_all_values_that_cannot_be_written_are_named_at_once() -> None:
    rows = ('"1000:00", value: 1', '"2051:00", value: 70000', '"3000:00", value: 1')
    Path("net.yaml").write_text(FILE.partition("    -")[0] + "".join(f"    - {{object: {row}}}\n" for row in rows))
    with Bench(("device.eds@5",), {"yes": True}) as bench:
        for command in ("plan", "apply"):
            ran = bench.run(f"{command} net.yaml")
            assert ran.code in (1, 4), ran
            missing = [row[1:8] for row in rows if row[1:8] not in ran.stderr + ran.stdout]
            assert missing == [], ran
        assert bench.session.node().sdo.upload(0x2051, 0) == b"\0\0"


def test_a_dcf_writes_it_if_it_is_named_as_configuration() -> None:
    with Bench(("device.eds@5",), {"yes": True}) as bench:
        (node,) = bench.run("plan device.dcf --json").document["nodes"]
        assert "2050:00" in [row["object"] for row in node["left_out"]], node
        ran = bench.run("apply device.dcf --include 2050 --include 2051 --include 2052")
        assert (ran.code, "acknowledged (write-only)" in ran.stdout) == (0, True), ran
        assert "--include 2052: it is not written nevertheless: it is part of a login" in ran.stderr
        assert "--include 2050" not in ran.stderr
        verified = bench.run("verify device.dcf")
        assert "2050:00" in verified.stdout, verified


def test_a_concise_dcf_of_a_network_file_needs_no_reading() -> None:
    assert [(one.object, one.data) for one in concise_dcf("net.yaml").entries] == [
        ("2050:00", b"\x01"),
        ("2051:00", b"\x07\0"),
    ]


def test_a_dcf_becomes_a_concise_dcf() -> None:
    with Bench() as bench:
        ran = bench.run("eds convert device.dcf device.cdcf")
    assert ran.code == 0, ran
    assert "node 5 press, 10 downloads" in ran.stdout
    assert "left out: 1018:01 (read-only)" in ran.stdout
    assert "left out: 1010:01 (commands)" in ran.stdout
    assert [(one.object, one.data.hex()) for one in read_concise_file("device.cdcf")] == [
        ("1017:00", "6400"),
        ("1800:01", "85010080"), ("1800:02", "fe"),
        ("1A00:00", "00"), ("1A00:01", "08020060"), ("1A00:00", "01"), ("1800:01", "85010000"),
        ("2050:00", "01"), ("2051:00", "0700"), ("2052:00", "09000000"),
    ]  # fmt: skip


def test_a_device_that_gets_it_is_as_the_dcf_says() -> None:
    with Bench(("device.eds@5",)) as bench:
        assert bench.run("eds convert device.dcf device.cdcf").code == 0
        sdo = bench.session.node().sdo
        for one in read_concise_file("device.cdcf"):
            sdo.download(one.index, one.sub_index, one.data)
        again = bench.run("plan device.dcf --include 2051 --json").document
        (node,) = again["nodes"]
        assert (again["writes"], node["unchanged"]) == (0, 3), again


@pytest.mark.parametrize(
    ("line", "said"),
    [
        ("eds convert device.eds x.cdcf", "has no ParameterValue"),
        ("eds convert device.dcf x.cdcf --for 6", "is of node 5"),
        ("eds convert none.dcf x.cdcf", "none.dcf"),
        ("eds convert bare.dcf x.cdcf", "has no node-ID"),
        ("eds convert bare.dcf x.cdcf --for a", "by node-ID"),
    ],
)
def test_what_is_no_dcf_of_a_node_is_refused(line: str, said: str) -> None:
    Path("bare.dcf").write_text(Path("device.dcf").read_text().replace("NodeID=5\n", ""))
    with Bench() as bench:
        ran = bench.run(line)
    ran.failed(2, said)
    assert not Path("x.cdcf").exists()


def test_without_a_node_id_it_is_given() -> None:
    read = parse_device_file(Path("device.dcf").read_bytes(), "device.dcf").dictionary
    Path("bare.xdc").write_bytes(device_file_bytes(read, "bare.xdc", "made for a test", None))
    Path("bare.dcf").write_text(Path("device.dcf").read_text().replace("NodeID=5\n", ""))
    with Bench() as bench:
        assert bench.run("eds convert bare.dcf six.cdcf --for 6").code == 0
        assert bench.run("eds convert bare.xdc five.cdcf").code == 0
    found = {name: read_concise_file(f"{name}.cdcf") for name in ("six", "five")}
    assert [one.data.hex() for one in found["six"] if one.object == "1800:01"] == ["86010080", "86010000"]
    assert len(found["five"]) == len(found["six"])


@pytest.mark.parametrize(
    ("place", "value"),
    [("1A00sub1", "0x6064oo20"), ("1A00sub0", "two"), ("1800sub1", "xyz"), ("1017", "hello"), ("2051", "70000")],
)
def test_a_value_that_cannot_be_known_refuses_the_file_as_plan_does(place: str, value: str) -> None:
    head, section, rest = Path("device.dcf").read_text().partition(f"[{place}]\n")
    rest = re.sub(r"^ParameterValue=.*\n", "", rest, count=1) if rest.startswith("ParameterValue") else rest
    Path("odd.dcf").write_text(f"{head}{section}ParameterValue={value}\n{rest}")
    with Bench(("device.eds@5",)) as bench:
        made, planned = bench.run("eds convert odd.dcf x.cdcf"), bench.run("plan odd.dcf")
    assert (made.code, value in made.stderr) == (planned.code, True), made
    assert made.code == 4
    assert not Path("x.cdcf").exists()


def in_dcf(*keys: tuple[str, str, object]) -> None:
    """Set keys in sections of device.dcf: (section, key, value)."""
    text = Path("device.dcf").read_text()
    for section, key, value in keys:
        head, mark, rest = text.partition(f"[{section}]\n")
        body, *more = rest.split("\n\n", 1)
        kept = [line for line in body.splitlines() if not line.startswith(f"{key}=")]
        assert mark, section
        text = "\n\n".join([f"{head}{mark}" + "\n".join([*kept, f"{key}={value}"]), *more])
    Path("device.dcf").write_text(text)


def of_pdos(bench: Bench) -> tuple[str, list[tuple[str, str]]]:
    """What `eds convert device.dcf` prints, and the downloads to PDOs that it makes."""
    ran = bench.run("eds convert device.dcf x.cdcf --yes")
    assert ran.code == 0, ran
    found = [(one.object, one.data.hex()) for one in read_concise_file("x.cdcf") if 0x1400 <= one.index < 0x1C00]
    return ran.stdout, found


@pytest.mark.parametrize("count", [0xFE, 0xFF])
@pytest.mark.parametrize("entry", [0x60000108, 0x60000208])
def test_a_multiplexed_pdo_of_a_dcf_has_its_count_and_keeps_its_object(count: int, entry: int) -> None:
    in_dcf(("1A00sub0", "ParameterValue", count), ("1A00sub1", "ParameterValue", entry))
    text = Path("device.eds").read_text()
    Path("device.eds").write_text(text.replace("[DeviceInfo]\n", "[DeviceInfo]\nGroupMessaging=1\n"))
    with Bench(("device.eds@5",)) as bench:
        _, found = of_pdos(bench)
        sdo = bench.session.node().sdo
        for index, data in found:
            sdo.download(int(index[:4], 16), int(index[5:], 16), bytes.fromhex(data))
        assert sdo.upload(0x1A00, 0) == bytes([count])
        assert sdo.upload(0x1A00, 1) == entry.to_bytes(4, "little")
    another = [("1A00:01", "08020060")] if entry == 0x60000208 else []
    assert [row for row in found if row[0][:4] == "1A00"] == [
        ("1A00:00", "00"), *another, ("1A00:00", f"{count:02x}"),
    ]  # fmt: skip


@pytest.mark.parametrize("access", ["ro", "const"])
def test_a_cob_id_that_cannot_be_written_is_not_downloaded(access: str) -> None:
    in_dcf(("1800sub1", "AccessType", access), ("1A00sub1", "ParameterValue", "0x60000108"))
    with Bench() as bench:
        said, found = of_pdos(bench)
        assert ("TPDO1" in said, found) == (False, [("1800:02", "fe")])
        in_dcf(("1800sub1", "ParameterValue", "0x190"))
        said, found = of_pdos(bench)
        assert ("left out: TPDO1 (its COB-ID 1800:01 is read-only)" in said, found) == (True, [])
        in_dcf(("1800sub1", "ParameterValue", "0x185"), ("1A00sub1", "ParameterValue", "0x60000208"))
        said, found = of_pdos(bench)
        assert ("left out: TPDO1 (its COB-ID 1800:01 is read-only)" in said, found) == (True, [])


@pytest.mark.parametrize("place", ["1A00sub0", "1A00sub1"])
def test_a_mapping_with_one_object_that_cannot_be_written_is_not_downloaded(place: str) -> None:
    in_dcf((place, "AccessType", "ro"), ("1A00sub1", "ParameterValue", "0x60000108"))
    with Bench() as bench:
        said, found = of_pdos(bench)
        assert "TPDO1" not in said
        assert found == [("1800:01", "85010080"), ("1800:02", "fe"), ("1800:01", "85010000")]
        in_dcf(("1A00sub1", "ParameterValue", "0x60000208"))
        said, found = of_pdos(bench)
        assert ("left out: TPDO1 (its mapping 1A00 is read-only)" in said, found) == (True, [])


def test_a_parameter_of_a_pdo_that_cannot_be_written_is_left_out_by_name() -> None:
    in_dcf(("1800sub2", "AccessType", "ro"))
    with Bench() as bench:
        said, found = of_pdos(bench)
    assert "left out: 1018:01, 1800:02 (read-only)" in said
    assert ("1A00:01", "08020060") in found
    assert "1800:02" not in dict(found)


def test_a_pdo_whose_count_has_no_entries_is_left_out() -> None:
    text = re.sub(r"\[1A00sub2\]\n.*?\n\n", "", Path("device.dcf").read_text(), flags=re.DOTALL)
    Path("device.dcf").write_text(text)
    in_dcf(("1A00sub0", "ParameterValue", 2))
    with Bench() as bench:
        said, found = of_pdos(bench)
    assert "left out: TPDO1 (its count is 2, but 0x1A00:02 cannot be read)" in said
    assert found == []


@pytest.mark.parametrize("access", ["ro", "const"])
def test_a_network_file_downloads_no_cob_id_and_no_mapping_that_cannot_be_written(access: str) -> None:
    text = Path("device.eds").read_text()
    for section in ("1800sub1", "1A00sub0"):
        head, mark, rest = text.partition(f"[{section}]\n")
        text = head + mark + rest.replace("AccessType=rw", f"AccessType={access}", 1)
    Path("device.eds").write_text(text)
    tpdo = "  tpdo:\n    1: {enabled: true, transmission: 254, mapping: [{index: 0x6000, sub_index: 1}]}\n"
    Path("net.yaml").write_text("a:\n  node_id: 5\n  dcf: device.eds\n" + tpdo)
    assert [(one.object, one.data.hex()) for one in concise_dcf("net.yaml").entries] == [("1800:02", "fe")]
