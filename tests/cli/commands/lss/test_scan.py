"""`scan` lists every node, also beside one that answers oddly; met over a bus."""

from __future__ import annotations

import time
from collections import Counter

import pytest

from dvtcli.domain.abort import Abort
from dvtcli.files.eds.reader import read_eds
from dvtcli.simulator.device.memory import Refusal
from dvtcli.simulator.device.strict_device import StrictDevice
from dvtcli.simulator.network.family_file import family_eds, load_family
from tests.bus.devices import device as small_device
from tests.cli.commands.bench import Bench
from tests.cli.commands.bus import Wire, device
from tests.harness.sample import heavy
from tests.virtual_time import VirtualTimeBus


class Odd(StrictDevice):
    """Refuses or garbles what every other device answers."""

    odd: tuple[int, ...] = (0x1018, 0x1008)
    answer: bytes | None = None

    def upload(self, index: int, sub_index: int) -> bytes:
        if index not in self.odd:
            return super().upload(index, sub_index)
        if self.answer is None:
            raise Refusal(Abort.GENERAL)
        return self.answer


def odd_device(node_id: int, answer: bytes | None, *odd: int) -> Odd:
    made = Odd(read_eds(family_eds("generic")).dictionary, load_family("generic"), node_id)
    made.odd, made.answer = odd, answer
    return made


def test_an_odd_node_hides_no_other() -> None:
    nodes = [
        odd_device(3, None, 0x1018, 0x1008),
        odd_device(4, b"12345678", 0x1018),
        odd_device(5, b"", 0x1000),
        device("gen4", 6),
    ]
    with Wire(*nodes) as wire, Bench((), dict(wire.options)) as bench:
        ran = bench.run("scan --json")
        assert ran.code == 0, ran.stderr
        rows = {row["node"]: row for row in ran.document["nodes"]}
    assert sorted(rows) == [3, 4, 5, 6]
    assert (rows[3]["vendor_id"], rows[3]["note"]) == (None, "")
    assert "1018:01 answered 8 bytes" in rows[4]["note"]
    assert rows[6]["vendor_id"] == 0x1E


class LateOnce(StrictDevice):
    """Thinks longer about its first answer than each node-ID has."""

    asked = 0

    def upload(self, index: int, sub_index: int) -> bytes:
        self.asked += 1
        if self.asked == 1:
            time.sleep(0.1)
        return super().upload(index, sub_index)


@pytest.mark.parametrize("node_id", [5, 127])
def test_a_node_whose_answer_comes_late_is_asked_again(node_id: int) -> None:
    slow = LateOnce(read_eds(family_eds("generic")).dictionary, load_family("generic"), node_id)
    with Wire(device("gen4", 3), slow) as wire, Bench((), dict(wire.options)) as bench:
        ran = bench.run("scan --json")
    assert [row["node"] for row in ran.document["nodes"]] == [3, node_id], ran.stderr
    assert ran.document["nodes"][1]["device_type"] is not None


class AbortsItsName(StrictDevice):
    """Aborts the upload of its name as often as *times* says."""

    times, asked = 1, 0

    def upload(self, index: int, sub_index: int) -> bytes:
        if index == 0x1008:
            self.asked += 1
            if self.asked <= self.times:
                raise Refusal(Abort.GENERAL)
        return super().upload(index, sub_index)


@pytest.mark.parametrize(("times", "name", "asked"), [(0, True, 1), (1, True, 2), (2, False, 2)])
def test_a_name_whose_upload_is_aborted_is_asked_for_once_more(times: int, name: bool, asked: int) -> None:
    odd = AbortsItsName(read_eds(family_eds("gen4")).dictionary, load_family("gen4"), 3)
    odd.times = times
    with Wire(odd) as wire, Bench((), dict(wire.options)) as bench:
        (row,) = bench.run("scan --json").document["nodes"]
    assert (bool(row["name"]), odd.asked) == (name, asked)


def test_a_refused_identity_is_none() -> None:
    with Wire(odd_device(1, None, 0x1018)) as wire, Bench((), dict(wire.options)) as bench:
        ran = bench.run("pdo tpdo1 --json")
        assert ran.code == 0, ran.stderr


class Slow(StrictDevice):
    """Answers what it is as late as a busy node does."""

    def upload(self, index: int, sub_index: int) -> bytes:
        if index == 0x1000:
            time.sleep(0.2)
        return super().upload(index, sub_index)


def test_a_node_that_was_heard_has_the_time_out_to_answer() -> None:
    slow = Slow(read_eds(family_eds("generic")).dictionary, load_family("generic"), 3)
    with Wire(slow) as wire, Bench((), dict(wire.options)) as bench:
        (row,) = bench.run("scan --json").document["nodes"]
    assert (row["node"], row["note"]) == (3, "")
    assert row["device_type"] is not None


@pytest.mark.parametrize("option", ["", "--dry-run"])
def test_absent_nodes_are_asked_once(option: str) -> None:
    with Wire(device("generic", 9)) as wire, Bench((), dict(wire.options)) as bench:
        wire.frames()
        ran = bench.run(f"scan --json {option}")
        asked = Counter(frame.arbitration_id - 0x600 for frame in wire.frames() if frame.data[:3] == b"\x40\x00\x10")
        assert [row["node"] for row in ran.document["nodes"]] == [9]
    assert {node: asked[node] for node in range(1, 128) if node != 9} == {n: 1 for n in range(1, 128) if n != 9}


@heavy
def test_a_full_bus_loses_no_answer() -> None:
    """All 127 nodes, in virtual time; each is found, and none is asked anything twice."""
    bus = VirtualTimeBus([small_device(node_id) for node_id in range(1, 128)])
    asked: Counter[tuple[int, bytes]] = Counter()
    bus.tap(lambda frame, ours: asked.update([(frame.can_id, frame.data)]) if ours else None)
    with Bench((), {"sim": ()}, bus) as bench:
        rows = bench.run("scan --json").document["nodes"]
    assert [row["node"] for row in rows] == list(range(1, 128))
    assert all(row["vendor_id"] is not None and row["note"] == "" for row in rows)
    uploads = {key: count for key, count in asked.items() if key[1][:1] == b"\x40"}
    assert set(uploads.values()) == {1}


def test_who_is_known_by_which_file_fits_a_terminal() -> None:
    """Columns give way in turn, and what is not known is said in words."""
    from dvtcli.cli.view.answers.node_lines import node_lines
    from dvtcli.operations.results import NodeListing, NodeRow

    who = (0x20192, 0xFB, 0x65520000, 1, 2)
    rows = (
        NodeRow(1, "PRE-OPERATIONAL", *who, "A long device name", "generic", f"{'0000000A-' * 2}0000000A_epos.eds"),
        NodeRow(2, "OPERATIONAL", *who, "Gen4", "gen4", f"{'0000000A-' * 2}0000000A_a file with a long name.dcf"),
        NodeRow(3, "state unknown", *who, "", "tmcm", ""),
        NodeRow(4, "no heartbeat", *who, "", "generic", ""),
        NodeRow(5, "STOPPED", note="node 5: no answer"),
    )
    for width in (80, 100):
        lines = ["".join(map(_text, line)) for line in node_lines(NodeListing("can0", rows), width)]
        assert all(len(line.rstrip()) <= width for line in lines[: len(rows) + 1]), lines
        assert lines[1].rstrip().endswith("epos.eds")
        assert lines[2].rstrip().endswith("gen4: a fil…e.dcf" if width == 80 else "gen4: a file with…ong name.dcf")
        assert [line.rstrip().rpartition("  ")[2] for line in lines[3:6]] == ["tmcm: no EDS", "no EDS", "-"]
        assert lines[6] == "  no EDS for nodes 3 and 4: `eds add FILE`, or --eds FILE"
    lines = ["".join(map(_text, line)) for line in node_lines(NodeListing("can0", rows), 60)]
    assert lines[0].endswith("PRODUCT     NAME")
    assert lines[2] == "        known by epos.eds"
    assert lines[4] == "        known by gen4: a file with a long name.dcf"


def _text(cell: object) -> str:
    return cell if isinstance(cell, str) else str(getattr(cell, "text", ""))
