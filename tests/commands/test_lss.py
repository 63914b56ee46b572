"""`lss`: nodes without a node-ID are found, get one that is seen, and keep it; nothing is sent in a dry run."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import pytest

from dvtcli.domain.lss_services import REQUEST_ID
from dvtcli.domain.nmt import UNCONFIGURED, NmtState
from dvtcli.domain.ports import Frame
from dvtcli.simulator.device.strict_device import StrictDevice
from tests.commands.bench import Bench, Ran
from tests.lss_nodes import address_of, unconfigured
from tests.virtual_time import ANSWER_S, VirtualTimeBus


def bench(*nodes: StrictDevice, **options: Any) -> Bench:
    return Bench((), {"yes": True, **options}, VirtualTimeBus(nodes, simulated=False))


def sent(bus: Any) -> list[Frame]:
    """The frames that are sent from now on."""
    frames: list[Frame] = []
    bus.tap(lambda frame, ours: frames.append(frame) if ours else None)
    return frames


def test_a_node_is_found_named_and_stored() -> None:
    one = unconfigured(0xC0FFEE)
    with bench(one) as desk:
        found = desk.run("lss scan --json").document
        (row,) = found["nodes"]
        assert (row["serial"], row["node"], row["confirmed"]) == (0xC0FFEE, None, True)
        assert (found["requests"], found["without_node_id"]) == (1 + 133 + 3 + 5 + 1, 1)
        given = desk.run(f"lss node-id 5 {address_of(one)} --json").document
        assert (given["nodes"][0]["before"], given["nodes"][0]["node"]) == (None, 5)
        assert (one.node_id, one.lss.stored, one.state) == (5, UNCONFIGURED, NmtState.PRE_OPERATIONAL)
        assert desk.run("lss store 5 --json").document["nodes"][0]["stored"]
        assert one.lss.stored == 5
        assert desk.run("lss scan --json").document["nodes"] == []


def test_nobody_says_so_soon() -> None:
    with bench(unconfigured(1, node_id=3)) as desk:
        ran = desk.run("lss scan")
        assert (ran.code, "no node without a node-ID answers" in ran.stdout) == (0, True)
        assert desk.session.bus.now_s() < 2


def test_what_is_selected_gets_the_node_id() -> None:
    nodes = [unconfigured(1), unconfigured(2)]
    with bench(*nodes) as desk:
        assert "no node is selected" in desk.run("lss node-id 9").stderr
        assert desk.run(f"lss select {address_of(nodes[1])}").code == 0
        assert desk.run("lss node-id 9").code == 0
        assert [one.node_id for one in nodes] == [UNCONFIGURED, 9]
        assert desk.run("lss identify --json").document["without_node_id"] == 1


def test_another_node_id_counts_after_a_reset_of_communication() -> None:
    one = unconfigured(7, node_id=3)
    with bench(one) as desk:
        given = desk.run(f"lss node-id 9 {address_of(one)} --json").document
        assert (given["nodes"][0]["before"], one.node_id) == (3, 9)
        again = desk.run(f"lss node-id 9 {address_of(one)} --json").document
        assert again["nodes"][0]["before"] == 9


@pytest.mark.parametrize("heartbeat_ms", [0, 100])
def test_a_node_id_in_use_is_refused(heartbeat_ms: int) -> None:
    one, other = unconfigured(1), unconfigured(2, node_id=5)
    other.set_value(0x1017, 0, heartbeat_ms.to_bytes(2, "little"))
    with bench(one, other) as desk:
        ran = desk.run(f"lss node-id 5 {address_of(one)}")
        assert (ran.code, one.lss.pending) == (6, UNCONFIGURED)
        assert "node-ID 5 is in use" in ran.stderr


def test_two_nodes_with_one_identity_are_refused() -> None:
    nodes = [unconfigured(1), unconfigured(1)]
    with bench(*nodes) as desk:
        ran = desk.run("lss scan --json")
        assert (ran.code, [row["confirmed"] for row in ran.document["nodes"]]) == (1, [False])
        ran = desk.run(f"lss node-id 5 {address_of(nodes[0])}")
        assert (ran.code, "more than one node answers" in ran.stderr) == (1, True)
        assert {one.lss.pending for one in nodes} == {UNCONFIGURED}


def test_nothing_is_sent_in_a_dry_run() -> None:
    with bench(unconfigured(1, node_id=5)) as desk:
        frames = sent(desk.session.bus)
        for line in ("scan", "identify", "node-id 6", "store 5", f"select {address_of(unconfigured(1))}"):
            ran = desk.run(f"lss {line} --dry-run")
            assert (ran.code, "Nothing was sent" in ran.stdout) == (0, True)
        assert frames == []


@pytest.mark.parametrize("line", ["node-id 5", "store 3"])
def test_nobody_to_ask_is_a_no(line: str) -> None:
    new, old = unconfigured(1), unconfigured(2, node_id=3)
    with bench(new, old, yes=False) as desk:
        desk.run(f"lss select {address_of(new)}")
        ran = desk.run(f"lss {line}")
        assert (ran.code, "--yes" in ran.stderr) == (6, True)
        assert (new.lss.pending, old.lss.stored) == (UNCONFIGURED, 3)
        assert not [frame for frame in sent(desk.session.bus) if frame.can_id == REQUEST_ID]


def test_a_store_that_fails_is_none() -> None:
    one = unconfigured(1, node_id=3)
    one.areas.fails = True
    with bench(one) as desk:
        ran = desk.run("lss store 3")
        assert (ran.code, "storage medium failed" in ran.stderr) == (1, True)


def network(folder: Path, *lines: str) -> str:
    file = folder / "line.yaml"
    file.write_text("nodes:\n" + "".join(f"  {line}\n" for line in lines), "utf-8")
    return str(file)


def test_the_nodes_of_a_file_get_their_node_ids(tmp_path: Path) -> None:
    nodes = [unconfigured(1), unconfigured(2), unconfigured(3, node_id=7)]
    file = network(
        tmp_path,
        "drive: {node_id: 5, identity: {serial: 2}}",
        "valve: {node_id: 6, identity: {serial: 1}}",
        "pump: {node_id: 7, identity: {serial: 3}}",
        "lamp: {node_id: 8}",
    )
    with bench(*nodes) as desk:
        assert desk.run(f"lss assign {file} --dry-run").code == 0
        assert desk.session.bus.now_s() < 0.1
        given = desk.run(f"lss assign {file} --store --json").document["nodes"]
        assert [(one["name"], one["node"], one["stored"]) for one in given] == [("drive", 5, True), ("valve", 6, True)]
        assert [(one.node_id, one.lss.stored) for one in nodes] == [(6, 6), (5, 5), (7, 7)]
        assert "every node has its node-ID" in desk.run(f"lss assign {file}").stdout


@pytest.mark.parametrize(
    ("lines", "code", "said"),
    [
        (["drive: {node_id: 5, identity: {product: 0x301}}"], 6, "2 nodes without a node-ID fit"),
        (["a: {node_id: 5, identity: {serial: 1}}", "b: {node_id: 6, identity: {serial: 1}}"], 6, "are one node"),
        (["drive: {node_id: 7, identity: {serial: 1}}"], 6, "in use, and not by drive"),
        (["drive: {node_id: 5, identity: {serial: 9}}"], 1, ""),
        (["drive: {node_id: 5}"], 2, "no node has an identity"),
    ],
)
def test_what_is_not_clear_is_not_assigned(tmp_path: Path, lines: list[str], code: int, said: str) -> None:
    nodes = [unconfigured(1), unconfigured(2), unconfigured(3, node_id=7)]
    with bench(*nodes) as desk:
        ran = desk.run(f"lss assign {network(tmp_path, *lines)}")
        assert (ran.code, said in ran.stderr) == (code, True), ran.stderr
        assert [one.lss.pending for one in nodes] == [UNCONFIGURED, UNCONFIGURED, 7]


class DeafTo(VirtualTimeBus):
    """Nothing of node 6 is heard here."""

    def _to_us(self, frame: Frame, delay_s: float = ANSWER_S) -> None:
        if frame.can_id not in (0x586, 0x706):
            super()._to_us(frame, delay_s)


def test_where_one_does_not_come_up_all_get_back_what_they_had(tmp_path: Path) -> None:
    nodes = [unconfigured(1), unconfigured(2)]
    file = network(tmp_path, "a: {node_id: 5, identity: {serial: 1}}", "b: {node_id: 6, identity: {serial: 2}}")
    with Bench((), {"yes": True}, DeafTo(nodes, simulated=False)) as desk:
        ran = desk.run(f"lss assign {file}")
        assert (ran.code, "did not come up as node 6" in ran.stderr, "nothing is stored" in ran.stderr) == (
            5,
            True,
            True,
        ), ran.stderr
        assert [(one.node_id, one.lss.pending) for one in nodes] == [(UNCONFIGURED, UNCONFIGURED)] * 2


def test_a_node_that_is_another_one_once_it_boots_is_left_and_said(tmp_path: Path) -> None:
    nodes = [unconfigured(1), unconfigured(2)]
    nodes[1].set_value(0x1018, 4, b"\x03\0\0\0")  # until it boots up
    file = network(tmp_path, "a: {node_id: 5, identity: {serial: 1}}", "b: {node_id: 6, identity: {serial: 3}}")
    with bench(*nodes) as desk:
        ran = desk.run(f"lss assign {file}")
        assert (ran.code, "cannot be given back" in ran.stderr) == (7, True)
        assert [one.node_id for one in nodes] == [UNCONFIGURED, 6]


WRONG = [
    ("lss assign", "takes one network file"),
    ("lss scan --store", "belongs to lss assign"),
    ("lss select vendor=1", "product, revision, serial missing"),
    ("lss select vendor=1 vendor=2", "given twice"),
    ("lss select vendor=1 model=2", "write vendor="),
    ("lss select vendor=x product=1 revision=1 serial=1", "vendor=x"),
    ("lss select vendor=-1 product=1 revision=1 serial=1", "32 bits"),
    ("lss node-id", "needs the node-ID"),
    ("lss node-id 128", "1…127"),
    ("lss scan 5", "nothing is expected"),
    ("lss store 5 6", "nothing is expected"),
    ("lss identify --wait 20", "belongs to lss scan"),
]


@pytest.mark.parametrize(("line", "said"), WRONG)
def test_wrong_words(line: str, said: str) -> None:
    with bench(unconfigured(1)) as desk:
        ran: Ran = desk.run(line)
        assert (ran.code, said in ran.stderr) == (2, True), ran.stderr
