"""What is write-only, in a network file, a DCF and a concise DCF: written each time, and said to be not compared."""

from __future__ import annotations

import re
from pathlib import Path

import pytest

from dvtcli.files.device_file import device_file_bytes, parse_device_file
from dvtcli.operations.network.concise_network import concise_dcf, read_concise_file
from tests.commands.bench import Bench
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
        assert "--include 2052: it is not written all the same: it is part of a login" in ran.stderr
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
        ("eds convert bare.dcf x.cdcf", "does not say of which node it is"),
        ("eds convert bare.dcf x.cdcf --for a", "by node-ID"),
    ],
)
def test_what_is_no_dcf_of_a_node_is_refused(line: str, said: str) -> None:
    Path("bare.dcf").write_text(Path("device.dcf").read_text().replace("NodeID=5\n", ""))
    with Bench() as bench:
        ran = bench.run(line)
    assert (ran.code, said in ran.stderr) == (2, True), ran
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
