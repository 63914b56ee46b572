"""Concise DCFs: the bytes that masters' tools write for the same file, and a device that gets them is as wanted."""

from __future__ import annotations

import json
from pathlib import Path

import pytest
from hypothesis import given
from hypothesis import strategies as st

from dvtcli.domain.network.concise_dcf import ConciseEntry, concise_bytes, concise_entries, read_concise_dcf
from dvtcli.operations.network.concise_network import concise_dcf
from tests.cli.commands.bench import Bench
from tests.small_eds import plain, var

#: Every shape of record: a parameter of one, two, four and eight bytes, a PDO that was on, one that was off, one that
#: stays off, one without a mapping, one with an empty mapping, and single objects.
FILE = """valve:
  dcf: lely
  node_id: 5
  heartbeat_producer: 250
  rpdo:
    1: {enabled: true, cob_id: 0x205, transmission: 1, mapping: [{index: 0x2005}, {index: 0x2006}]}
    2: {enabled: false, cob_id: 0x80000305}
    3: {enabled: false, cob_id: 0x444}
  tpdo:
    1: {enabled: true, cob_id: auto, transmission: 1, inhibit_time: 100, event_timer: 50,
        mapping: [{index: 0x2007}, {index: 0x2002}]}
    2: {enabled: true, cob_id: 0x290, mapping: [{index: 0x2008}]}
    3: {enabled: false, cob_id: 0x385, transmission: 254, sync_start: 3}
  sdo:
    - {index: 0x2006, value: 0x1234}
    - {index: 0x2008, value: 5}
"""
#: Written by hand from the published layout: index, sub-index, length, data.
RECORDS = """
1710 00 02000000 FA00
0014 01 04000000 05020080   0014 02 01000000 01
0016 00 01000000 00   0016 01 04000000 08000520   0016 02 04000000 10000620   0016 00 01000000 02
0014 01 04000000 05020000
0214 01 04000000 44040080
0018 02 01000000 01   0018 03 02000000 6400   0018 05 02000000 3200
001A 00 01000000 00   001A 01 04000000 20000720   001A 02 04000000 08000220   001A 00 01000000 02
0018 01 04000000 85010000
0118 01 04000000 90020080   011A 00 01000000 00   011A 01 04000000 40000820   011A 00 01000000 01
0118 01 04000000 90020000
0218 02 01000000 FE   0218 06 01000000 03
0620 00 02000000 3412   0820 00 08000000 0500000000000000
"""
COUNT = 26


@pytest.fixture
def file(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> str:
    monkeypatch.chdir(tmp_path)
    Path("net.yaml").write_text(FILE)
    return "net.yaml"


def test_the_bytes_are_those_of_the_published_layout(file: str) -> None:
    found = concise_dcf(file)
    assert (found.node_id, found.name) == (5, "valve")
    wanted = concise_entries(COUNT.to_bytes(4, "little") + bytes.fromhex(RECORDS))
    assert [(one.object, one.data.hex()) for one in found.entries] == [(one.object, one.data.hex()) for one in wanted]
    assert found.data == COUNT.to_bytes(4, "little") + bytes.fromhex(RECORDS)


def test_a_device_that_gets_them_is_as_wanted(file: str) -> None:
    with Bench(("lely@5",)) as bench:
        assert bench.run(f"plan {file} --exit-code").code == 3
    with Bench(("lely@5",)) as bench:
        sdo = bench.session.open_network().bus.sdo(5)
        for one in concise_dcf(file).entries:
            sdo.download(one.index, one.sub_index, one.data)
        ran = bench.run(f"plan {file} --exit-code --json")
    assert (ran.code, ran.document["writes"]) == (0, 0), ran


def test_it_is_written_and_shown(file: str) -> None:
    with Bench() as bench:
        ran = bench.run(f"eds convert {file} node5.cdcf --json")
        assert (ran.code, ran.document["node"], len(ran.document["entries"])) == (0, 5, COUNT)
        assert Path("node5.cdcf").read_bytes() == concise_dcf(file, 5).data
        shown = bench.run("eds show node5.cdcf --json").document["entries"]
        assert shown == ran.document["entries"]
        assert shown[1] == {"object": "1400:01", "data": "05 02 00 80"}
        text = bench.run("eds show node5.cdcf").stdout
    assert "1017:00  0x00FA" in text
    assert "2008:00  0x0000000000000005" in text


def test_with_an_eds_its_names_are_shown(file: str) -> None:
    with Bench(("lely@5",)) as bench:
        assert bench.run(f"eds convert {file} node5.cdcf --for valve").code == 0
        assert "Producer heartbeat time" in bench.run("eds show node5.cdcf").stdout


@pytest.mark.parametrize(
    ("line", "code", "said"),
    [
        ("eds convert two.yaml a.cdcf", 2, "for one node"),
        ("eds convert net.yaml a.cdcf --for 9", 2, "no node is '9'"),
        ("eds convert two.yaml a.cdcf --for other", 2, "other has no EDS"),
        ("eds convert none.yaml a.cdcf", 2, "none.yaml"), ("eds show bad.cdcf", 4, "ends in entry 1 of 2"),
        ("eds show none.cdcf", 2, "none.cdcf"), ("eds show net.yaml --for 5", 2, "belongs to eds convert"),
        ("eds convert a.eds a.xdd --for 5", 2, "of a network file"), ("eds convert net.yaml bad.cdcf", 6, "overwrite"),
    ],
)  # fmt: skip
def test_what_cannot_be_made_or_shown(line: str, code: int, said: str, file: str) -> None:
    two = FILE + "other:\n  node_id: 6\n  tpdo:\n    1: {enabled: false}\n"
    Path("two.yaml").write_text(two)
    Path("bad.cdcf").write_bytes(bytes([2, 0, 0, 0, 1]))
    with Bench() as bench:
        ran = bench.run(line)
    ran.failed(code, said)
    assert file
    assert not Path("a.cdcf").exists()


def test_the_node_that_is_described_has_one_beside_one_that_is_not(file: str) -> None:
    alone = concise_dcf(file).data
    Path("two.yaml").write_text(FILE + "other:\n  node_id: 6\n  tpdo:\n    1: {enabled: false}\n")
    assert concise_dcf("two.yaml", "valve").data == alone


def manager() -> str:
    """A file of a device that is a manager of five nodes."""
    eds = plain()
    eds.record(0x1F22, "Concise DCF", {sub: var(f"Node {sub}", 0xF) for sub in range(1, 6)})
    Path("manager.eds").write_text(eds.text())
    return "manager.eds@10"


def test_a_manager_gets_it_with_consent_only(file: str) -> None:
    data = concise_dcf(file).data
    Path("node5.cdcf").write_bytes(data)
    Path("cut.cdcf").write_bytes(data[:-1])
    with Bench((manager(),)) as bench:
        asked = bench.run("write 1F22:5 @node5.cdcf")
        assert (asked.code, f"download {COUNT} values to node 5 whenever that boots" in asked.stderr) == (6, True), (
            asked
        )
    with Bench((manager(),), {"yes": True}) as bench:
        cut = bench.run("write 1F22:5 @cut.cdcf")
        cut.failed(4, "ends in entry 26 of 26")
        assert bench.session.node().sdo.upload(0x1F22, 5) != data
        assert bench.run("write 1F22:5 @node5.cdcf").code == 0
        assert bench.session.node().sdo.upload(0x1F22, 5) == data


def test_it_is_asked_about_on_every_road(file: str) -> None:
    data = concise_dcf(file).data
    cut = bytes([2, 0, 0, 0, 1])
    with Bench((manager(),)) as bench:
        assert bench.run("backup m.jsonl").code == 0
    kept = [json.loads(line) for line in Path("m.jsonl").read_text("utf-8").splitlines()]
    for name, held in (("good", data), ("cut", cut)):
        lines = [one | {"raw": held.hex()} if one.get("object") == "1F22:05" else one for one in kept]
        Path(f"{name}.jsonl").write_text("".join(json.dumps(one) + "\n" for one in lines), "utf-8")
    value = f"{{index: 0x1F22, sub_index: 5, value: 0x{cut.hex()}}}"
    Path("cut.yaml").write_text(f"m:\n  node_id: 10\n  sdo:\n    - {value}\n", "utf-8")
    for form in ("jsonl", "yaml"):
        with Bench((manager(),), {"yes": True}) as bench:
            refused = bench.run(f"apply cut.{form}")
            refused.failed(4, "not a concise DCF")
            assert bench.session.node().sdo.upload(0x1F22, 5) != cut
    asks = f"download {COUNT} values to node 5 whenever that boots"
    with Bench((manager(),)) as bench:
        asked = bench.run("apply good.jsonl")
        assert (asked.code, asks in asked.stderr) == (6, True), asked
        assert bench.run("plan good.jsonl -o plan.json").code == 0
        assert asks in bench.run("apply plan.json").stderr
        assert bench.run("apply good.jsonl --yes").code == 0
        assert bench.session.node().sdo.upload(0x1F22, 5) == data


ENTRIES = st.builds(ConciseEntry, st.integers(0, 0xFFFF), st.integers(0, 0xFF), st.binary(max_size=20))


@given(st.lists(ENTRIES, max_size=5))
def test_what_was_written_reads_the_same(entries: list[ConciseEntry]) -> None:
    data = concise_bytes(entries)
    assert concise_entries(data) == tuple(entries)
    assert read_concise_dcf(data) == {(one.index, one.sub_index): one.data for one in entries}


@given(st.binary(max_size=40))
def test_any_bytes_are_read_to_the_last_or_refused(data: bytes) -> None:
    try:
        entries = concise_entries(data)
    except ValueError:
        return
    assert concise_bytes(entries) == data
