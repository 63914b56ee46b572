"""`lss`: nodes without a node-ID are found, get one that is seen, and keep it; nothing is sent in a dry run."""

from __future__ import annotations

from contextlib import suppress
from pathlib import Path
from typing import Any

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from dvtcli.domain.lss_services import REQUEST_ID
from dvtcli.domain.nmt import UNCONFIGURED, NmtState
from dvtcli.domain.ports import Frame
from dvtcli.operations.lss.lss_assign import in_order
from dvtcli.operations.lss.lss_node_id import lss_node_id
from dvtcli.operations.results.lss_nodes import LssGiven
from dvtcli.operations.session.session import Session
from dvtcli.operations.user.options import Options
from dvtcli.simulator.device.strict_device import StrictDevice
from tests.cli.commands.bench import Bench, Ran
from tests.lss_nodes import address_of, unconfigured
from tests.virtual_time import ANSWER_S, VirtualTimeBus

pytestmark = pytest.mark.drawn(14, "lss")


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
        told = desk.run(f"lss node-id 5 {address_of(one)} --json").document
        assert (told["nodes"][0]["before"], told["nodes"][0]["node"]) == (None, 5)
        assert (one.node_id, one.lss.stored, one.state) == (5, UNCONFIGURED, NmtState.PRE_OPERATIONAL)
        assert desk.run("lss store 5 --json").document["nodes"][0]["stored"]
        assert one.lss.stored == 5
        assert desk.run("lss scan --json").document["nodes"] == []


def answers_in_any_state(one: StrictDevice) -> None:
    """As durand's LSS slave does, which is found by a fast scan again though it is being configured."""
    handle = one.lss.handle

    def answer(request: bytes) -> bytes | None:
        if request[0] == 0x51:
            one.lss._configuring = False
        return handle(request)

    one.lss.handle = answer  # type: ignore[method-assign]


def test_slaves_that_are_found_again_and_again_are_told_apart_by_every_branch() -> None:
    nodes = [unconfigured(1), unconfigured(2)]
    for one in nodes:
        answers_in_any_state(one)
    with bench(*nodes) as desk:
        ran = desk.run("lss scan --json")
        assert (ran.code, [row["serial"] for row in ran.document["nodes"]]) == (0, [1, 2]), ran.stderr


@settings(deadline=None, max_examples=max(3, settings().max_examples // 6))
@given(
    st.lists(
        st.tuples(st.integers(2, 0xFFFF_FFFF), st.sampled_from(["generic", "lss-echo"])),
        max_size=4,
        unique_by=lambda one: one[0],
    )
)
def test_who_answers_every_question_while_it_is_configured_counts_once(serials: list[tuple[int, str]]) -> None:
    nodes = [unconfigured(serial, family) for serial, family in serials]
    with bench(*nodes, unconfigured(1, node_id=3)) as desk:
        ran = desk.run("lss scan --json")
        assert ran.code == 0, ran.stderr
        found = [row["serial"] for row in ran.document["nodes"]]
        assert sorted(found) == sorted(serial for serial, _ in serials)
        assert all(row["confirmed"] for row in ran.document["nodes"])
        assert ran.document["without_node_id"] == len(serials)
        assert all(one.lss.pending == UNCONFIGURED for one in nodes)


@pytest.mark.parametrize("family", ["generic", "lss-echo", "lss-reset", "no-boot-up"])
@pytest.mark.parametrize("others", [0, 1])
def test_every_family_gets_its_first_node_id_and_another_one(family: str, others: int) -> None:
    """Also who comes up by a reset only, or without saying so; nobody else without a node-ID gets one."""
    one = unconfigured(0xC0FFEE, family)
    rest = [unconfigured(2 + number, family) for number in range(others)]
    with bench(one, *rest) as desk:
        for node_id, before in ((5, None), (9, 5)):
            ran = desk.run(f"lss node-id {node_id} {address_of(one)} --json")
            assert ran.code == 0, ran.stderr
            (row,) = ran.document["nodes"]
            assert (row["before"], row["node"], one.node_id) == (before, node_id, node_id)
        assert all((other.node_id, other.lss.pending) == (UNCONFIGURED, UNCONFIGURED) for other in rest)


def test_the_scan_names_a_node_id_that_is_free() -> None:
    one = unconfigured(7)
    others = [unconfigured(number, node_id=number) for number in (1, 2, 4)]
    with bench(one, *others) as desk:
        scanned = desk.run("lss scan")
        assert desk.run("lss scan --json").document["free_node_id"] == 3
        line = next(line.strip() for line in scanned.stdout.splitlines() if line.strip().startswith("lss node-id"))
        assert line.startswith("lss node-id 3 ")
        assert desk.run(line).code == 0
        assert one.node_id == 3
        assert desk.run("lss scan --json").document["free_node_id"] is None


def test_where_every_node_id_is_taken_none_is_proposed() -> None:
    with bench(unconfigured(200), *(unconfigured(number, node_id=number) for number in range(1, 128))) as desk:
        ran = desk.run("lss scan")
        assert (ran.code, "node-id" in ran.stdout, "no node-ID is free" in ran.stdout) == (0, False, True), ran.stdout


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
        told = desk.run(f"lss node-id 9 {address_of(one)} --json").document
        assert (told["nodes"][0]["before"], one.node_id) == (3, 9)
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
        told = desk.run(f"lss assign {file} --store --json").document["nodes"]
        told_all = [(one["name"], one["before"], one["node"], one["stored"]) for one in told]
        assert told_all == [("drive", None, 5, True), ("valve", None, 6, True), ("pump", 7, 7, True)]
        assert [(one.node_id, one.lss.stored) for one in nodes] == [(6, 6), (5, 5), (7, 7)]
        assert "every node has its node-ID" in desk.run(f"lss assign {file}").stdout


@pytest.mark.parametrize(
    ("lines", "code", "said"),
    [
        (["drive: {node_id: 5, identity: {product: 0x301}}"], 6, "3 nodes fit the identity of drive"),
        (
            ["a: {node_id: 5, identity: {serial: 1}}", "b: {node_id: 6, identity: {serial: 1}}"],
            6,
            "have the same identity",
        ),
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
        if "in use" in said:  # the command that the hint prints frees it
            command = ran.stderr.partition("shows the node that has it; `dvtcli ")[2].partition("`")[0]
            assert (desk.run(command).code, nodes[2].node_id) == (0, 1)


def test_nodes_that_have_a_wrong_node_id_get_theirs_and_two_swap(tmp_path: Path) -> None:
    nodes = [unconfigured(1, node_id=5), unconfigured(2, node_id=6), unconfigured(3, node_id=9), unconfigured(4)]
    file = network(
        tmp_path,
        "a: {node_id: 6, identity: {serial: 1}}",
        "b: {node_id: 5, identity: {serial: 2}}",
        "c: {node_id: 7, identity: {serial: 3}}",
        "d: {node_id: 9, identity: {serial: 4}}",
    )
    with bench(*nodes) as desk:
        ran = desk.run(f"lss assign {file} --store --prove --json")
        assert ran.code == 0, ran.stderr
        assert [(one["name"], one["before"], one["node"], one["proved"]) for one in ran.document["nodes"]] == [
            ("b", 6, 5, True),
            ("a", 5, 6, True),
            ("c", 9, 7, True),
            ("d", None, 9, True),
        ]
        assert ran.stderr.splitlines() == [
            "note: plan 1: c gets node-ID 7 (now 9)",
            "note: plan 2: d gets node-ID 9 (now none)",
            "note: plan 3: b gets node-ID 126 (now 6)",
            "note: plan 4: a gets node-ID 6 (now 5)",
            "note: plan 5: b gets node-ID 5 (now 126)",
        ]
        assert [(one.node_id, one.lss.stored) for one in nodes] == [(6, 6), (5, 5), (7, 7), (9, 9)]


def power_cycle(*nodes: StrictDevice) -> list[int]:
    """The node-IDs that are left of it."""
    for one in nodes:
        one.restart()
        one.boot_up()
    return [one.node_id for one in nodes]


@pytest.mark.parametrize("option", ["--store", "--store --prove"])
def test_node_ids_that_are_in_ram_only_are_stored_by_the_same_words(tmp_path: Path, option: str) -> None:
    nodes = [unconfigured(1, node_id=5), unconfigured(2, node_id=6), unconfigured(3, node_id=9)]
    file = network(
        tmp_path,
        "a: {node_id: 6, identity: {serial: 1}}",
        "b: {node_id: 5, identity: {serial: 2}}",
        "c: {node_id: 9, identity: {serial: 3}}",
    )
    with bench(*nodes) as desk:
        assert desk.run(f"lss assign {file}").code == 0
        assert "every node has its node-ID" in desk.run(f"lss assign {file}").stdout
        assert [one.lss.stored for one in nodes] == [5, 6, 9]
        ran = desk.run(f"lss assign {file} {option} --json")
        assert (ran.code, [one["stored"] for one in ran.document["nodes"]]) == (0, [True] * 3), ran.stderr
        assert [one["proved"] for one in ran.document["nodes"]] == ["prove" in option] * 3
        assert "plan 2: a stores node-ID 6, which it has" in desk.run(f"lss assign {file} --store").stderr
    assert power_cycle(*nodes) == [6, 5, 9]


def test_nobody_is_told_to_store_unasked(tmp_path: Path) -> None:
    one, other = unconfigured(1, node_id=3), unconfigured(2, node_id=4)
    file = network(tmp_path, "a: {node_id: 5, identity: {serial: 1}}", "b: {node_id: 6, identity: {serial: 2}}")
    with bench(one, other) as desk:
        desk.run(f"lss assign {file}")
    with bench(one, other, yes=False) as desk:
        ran = desk.run(f"lss assign {file} --store")
        assert (ran.code, "store node-ID 5 in a, which has it" in ran.stderr) == (6, True), ran.stderr
    assert [one.lss.stored, other.lss.stored] == [3, 4]


def test_who_waits_for_another_node_id_stores_the_one_it_has() -> None:
    """A dvtcli that was killed on the way left a node-ID that the next reset would bring."""
    one = unconfigured(1, node_id=3)
    one.lss.pending = 9
    with bench(one) as desk:
        assert desk.run("lss store 3").code == 0
    assert power_cycle(one) == [3]


def test_who_takes_no_part_in_lss_is_named_and_the_others_store(tmp_path: Path) -> None:
    nodes = [unconfigured(1, node_id=5), unconfigured(2, node_id=6)]
    nodes[1].lss.handle = lambda _request: None  # type: ignore[method-assign]
    file = network(tmp_path, "a: {node_id: 5, identity: {serial: 1}}", "b: {node_id: 6, identity: {serial: 2}}")
    with bench(*nodes) as desk:
        ran = desk.run(f"lss assign {file} --store --json")
    assert (ran.code, [one["name"] for one in ran.document["nodes"]]) == (0, ["a"])
    assert "not stored, since LSS cannot reach them: b (6)" in ran.stderr


@pytest.mark.parametrize(("faulty", "code", "after"), [("b", 1, [5, 6]), ("a", 7, [5, 5])])
def test_where_one_does_not_store_what_it_has_it_is_said_who_has(
    tmp_path: Path, faulty: str, code: int, after: list[int]
) -> None:
    """What they had stored is not known: no way leads back to it."""
    nodes = [unconfigured(1, node_id=5), unconfigured(2, node_id=6), unconfigured(3)]
    swap = ["a: {node_id: 6, identity: {serial: 1}}", "b: {node_id: 5, identity: {serial: 2}}"]
    with bench(*nodes) as desk:
        assert desk.run(f"lss assign {network(tmp_path, *swap)}").code == 0
        nodes["ab".index(faulty)].areas.fails = True
        file = network(tmp_path, *swap, "c: {node_id: 7, identity: {serial: 3}}")
        ran = desk.run(f"lss assign {file} --store")
        assert (ran.code, f"refused {faulty} (node-ID" in ran.stderr) == (code, True), ran.stderr
        assert ("unknown a may have another node-ID after the next power-on" in ran.stderr) == (code == 7)
        assert ("repeat the command, or `dvtcli lss store 6`\n" in ran.stderr) == (code == 7)
        assert [one.node_id for one in nodes] == [6, 5, UNCONFIGURED]
    assert power_cycle(*nodes) == [*after, UNCONFIGURED]


def test_where_a_new_one_does_not_store_those_that_had_theirs_have_stored_it(tmp_path: Path) -> None:
    nodes = [unconfigured(1, node_id=5), unconfigured(3)]
    nodes[1].areas.fails = True
    file = network(tmp_path, "a: {node_id: 5, identity: {serial: 1}}", "c: {node_id: 7, identity: {serial: 3}}")
    with bench(*nodes) as desk:
        ran = desk.run(f"lss assign {file} --store")
        assert (ran.code, "a stored its old node-ID; none has stored a new node-ID" in ran.stderr) == (
            1,
            True,
        ), ran.stderr
    assert power_cycle(*nodes) == [5, UNCONFIGURED]


def test_where_going_back_fails_half_way_it_is_said_which_node_id_each_has(tmp_path: Path) -> None:
    """The third does not come up, the second is gone by then, the first has what it had."""
    nodes = [unconfigured(1, node_id=11), unconfigured(2, node_id=12), unconfigured(3, node_id=13)]
    file = network(
        tmp_path, *(f"{name}: {{node_id: {5 + at}, identity: {{serial: {1 + at}}}}}" for at, name in enumerate("abc"))
    )
    bus = VirtualTimeBus(nodes, simulated=False)
    resets: list[Frame] = []

    def spoil(frame: Frame, ours: bool) -> None:
        """At the third reset the second node loses its power for good, and the third forgets its new node-ID."""
        if ours and frame.can_id == 0 and frame.data[0] == 0x82:
            resets.append(frame)
            if len(resets) == 3:
                nodes[2].lss.pending = nodes[2].node_id
                nodes[1].lss.handle = lambda _request: None  # type: ignore[method-assign]

    bus.tap(spoil)
    with Bench((), {"yes": True}, bus) as desk:
        ran = desk.run(f"lss assign {file}")
    assert (ran.code, [one.node_id for one in nodes]) == (7, [11, 6, 13]), ran.stderr
    said = " ".join(ran.stderr.split())
    assert "now c has node-ID 13, before 13; it answers as node 13, nobody answers as node 7" in said
    assert "now b has a node-ID that is not known (no node answers" in said
    assert "now a has node-ID 11, before 11; it answers as node 11, nobody answers as node 5" in said


def test_going_back_counts_once_nobody_answers_with_the_new_node_id(tmp_path: Path) -> None:
    """LSS tells the node-ID that a node was given, not the one that it has: who answers on the bus is looked at."""
    nodes = [unconfigured(1, node_id=11), unconfigured(2, node_id=12)]
    nodes[0].lss._family = nodes[0].family._replace(lss_tells_pending=True)
    file = network(tmp_path, "a: {node_id: 5, identity: {serial: 1}}", "b: {node_id: 6, identity: {serial: 2}}")
    bus = VirtualTimeBus(nodes, simulated=False)

    def spoil(frame: Frame, ours: bool) -> None:
        """At the second reset the second node forgets its new node-ID; the first one obeys no other reset."""
        if ours and frame.can_id == 0 and frame.data == bytes((0x82, 12)):
            nodes[1].lss.pending = 12
            nodes[0].nmt = lambda _command: None  # type: ignore[method-assign]

    bus.tap(spoil)
    with Bench((), {"yes": True}, bus) as desk:
        ran = desk.run(f"lss assign {file}")
    assert [one.node_id for one in nodes] == [5, 12]
    said = " ".join(ran.stderr.split())
    assert ran.code == 7, said
    assert "now a has node-ID 11, before 11; nobody answers as node 11, it answers as node 5" in said
    assert "now b has node-ID 12, before 12; it answers as node 12, nobody answers as node 6" in said


def test_a_wrong_node_id_is_not_taken_from_a_node_of_the_file(tmp_path: Path) -> None:
    """Node 6 may be `lamp`, of which the file says no identity, however well it fits another one."""
    nodes = [unconfigured(1, node_id=6)]
    file = network(tmp_path, "drive: {node_id: 5, identity: {serial: 1}}", "lamp: {node_id: 6}")
    with bench(*nodes) as desk:
        ran = desk.run(f"lss assign {file}")
        assert (ran.code, "drive: not found" in ran.stdout, nodes[0].node_id) == (1, True, 6)


def test_where_a_swap_fails_both_have_what_they_had(tmp_path: Path) -> None:
    nodes = [unconfigured(1, node_id=5), unconfigured(2, node_id=6)]
    file = network(tmp_path, "a: {node_id: 6, identity: {serial: 1}}", "b: {node_id: 5, identity: {serial: 2}}")
    bus = VirtualTimeBus(nodes, simulated=False)
    changed: list[Frame] = []

    def spoil(frame: Frame, ours: bool) -> None:
        """At the third reset of communication node 126 has forgotten what it should become."""
        if ours and frame.can_id == 0 and frame.data[0] == 0x82:
            changed.append(frame)
            if len(changed) == 3:
                nodes[1].lss.pending = nodes[1].node_id

    bus.tap(spoil)
    with Bench((), {"yes": True}, bus) as desk:
        ran = desk.run(f"lss assign {file}")
        assert (ran.code, "did not start as node 5" in ran.stderr) == (5, True), ran.stderr
        assert "plan 1: b gets node-ID 126 (now 6)" in ran.stderr
        assert [one.node_id for one in nodes] == [5, 6]


def test_who_is_selected_by_its_node_id_gets_another_one() -> None:
    one = unconfigured(7, node_id=3)
    with bench(one, unconfigured(8)) as desk:
        found = desk.run("lss select 3 --json").document["nodes"]
        assert [(row["serial"], row["node"]) for row in found] == [(7, 3)]
        assert (desk.run("lss node-id 9").code, one.node_id) == (0, 9)
        ran = desk.run("lss select 44")
        assert (ran.code, "node 44 does not answer" in ran.stderr) == (5, True)


def test_a_store_is_proved_by_a_reset() -> None:
    one, liar = unconfigured(1, node_id=3), unconfigured(2, node_id=4)
    liar.areas.stores_nothing = True
    liar.lss.stored = UNCONFIGURED
    with bench(one, liar) as desk:
        assert desk.run("lss store 3 --prove --json").document["nodes"][0]["proved"]
        assert "proved by a reset" in desk.run("lss store 3 --prove").stdout
        ran = desk.run("lss store 4 --prove")
        assert (ran.code, "its node-ID is none now" in ran.stderr) == (7, True), ran.stderr


@pytest.mark.parametrize("which", [0, 1, 2])
def test_where_one_cannot_store_all_have_what_they_had_stored_too(tmp_path: Path, which: int) -> None:
    """Else the next power-on would bring two nodes with one node-ID."""
    nodes = [unconfigured(1, node_id=5), unconfigured(2, node_id=6), unconfigured(3)]
    nodes[which].areas.fails = True
    file = network(
        tmp_path,
        "a: {node_id: 6, identity: {serial: 1}}",
        "b: {node_id: 5, identity: {serial: 2}}",
        "c: {node_id: 7, identity: {serial: 3}}",
    )
    with bench(*nodes) as desk:
        ran = desk.run(f"lss assign {file} --store")
        assert (ran.code, f"refused {'abc'[which]} (node-ID {(6, 5, 7)[which]}" in ran.stderr) == (1, True), ran.stderr
        assert "none has stored a new node-ID" in ran.stderr
        assert "the same command without --store gives the new node-IDs" in ran.stderr
        assert ("stored  b (node-ID 5" in ran.stderr) == (which != 1)  # the first one, by its node-ID
        assert [(one.node_id, one.lss.stored) for one in nodes] == [(5, 5), (6, 6), (UNCONFIGURED, UNCONFIGURED)]


def test_where_what_was_stored_cannot_be_taken_back_it_is_said(tmp_path: Path) -> None:
    nodes = [unconfigured(1), unconfigured(2)]
    nodes[1].areas.fails = True
    file = network(tmp_path, "a: {node_id: 5, identity: {serial: 1}}", "b: {node_id: 6, identity: {serial: 2}}")
    bus = VirtualTimeBus(nodes, simulated=False)
    stores: list[Frame] = []

    def spoil(frame: Frame, ours: bool) -> None:
        """From the second store on the first node cannot store either."""
        if ours and frame.can_id == REQUEST_ID and frame.data[0] == 0x17:
            stores.append(frame)
            nodes[0].areas.fails = len(stores) > 1

    bus.tap(spoil)
    with Bench((), {"yes": True}, bus) as desk:
        ran = desk.run(f"lss assign {file} --store")
        assert (ran.code, "a (node-ID 5, before none) may have node-ID 5 stored" in ran.stderr) == (7, True), ran.stderr
        assert "refused b (node-ID 6" in ran.stderr
        assert "`dvtcli scan` show the node-IDs, then let these have a node-ID anew" in ran.stderr
        assert [one.lss.stored for one in nodes] == [5, UNCONFIGURED]


def test_a_proof_that_fails_says_who_is_not_proved(tmp_path: Path) -> None:
    nodes = [unconfigured(1), unconfigured(2)]
    nodes[0].areas.stores_nothing = True
    file = network(tmp_path, "a: {node_id: 5, identity: {serial: 1}}", "b: {node_id: 6, identity: {serial: 2}}")
    with bench(*nodes) as desk:
        ran = desk.run(f"lss assign {file} --store --prove")
        assert (ran.code, "b (node-ID 6, before none), not proved" in ran.stderr) == (7, True), ran.stderr


class Cut(Exception):
    """The power of the computer fails."""


@pytest.mark.parametrize("before", [3, UNCONFIGURED])
def test_what_is_killed_on_the_way_stores_nothing_and_is_finished_by_the_same_words(before: int) -> None:
    line = f"lss node-id 5 {address_of(unconfigured(1))}"
    for killed_after in range(1, 30):
        one = unconfigured(1, node_id=before)
        bus = VirtualTimeBus([one], simulated=False)
        frames = sent(bus)

        def cut(_frame: Frame, ours: bool, frames: list[Frame] = frames, after: int = killed_after) -> None:
            if ours and len(frames) == after:
                raise Cut

        stop = bus.tap(cut)
        with suppress(Cut), Session(Options(yes=True), open_bus=lambda _options, bus=bus: bus) as session:
            lss_node_id(session, 5, address_of(one))
            return  # it was done before
        stop()
        assert one.lss.stored == before
        with Bench((), {"yes": True}, VirtualTimeBus([one], simulated=False)) as desk:
            ran = desk.run(line)
            assert (ran.code, one.node_id, one.lss.stored) == (0, 5, before), (killed_after, ran.stderr)


@given(st.permutations(range(1, 7)), st.lists(st.sampled_from([UNCONFIGURED, *range(1, 9)]), min_size=6, max_size=6))
def test_no_two_nodes_ever_have_one_node_id(wanted: list[int], before: list[int]) -> None:
    given_ids = [
        LssGiven(address_of(unconfigured(serial)), now, want)
        for serial, (now, want) in enumerate(zip(before, wanted, strict=True))
        if now != want and (now == UNCONFIGURED or now not in before[:serial])
    ]
    now = {one.address: one.before for one in given_ids}
    others = set(range(100, 110))
    for step in in_order(given_ids, set(now.values()) | others, {7, 8}):
        assert now[step.address] == step.before
        assert step.node_id not in now.values()
        assert step.node_id not in others
        now[step.address] = step.node_id
    assert now == {one.address: one.node_id for one in given_ids}


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
        assert (ran.code, "did not start as node 6" in ran.stderr, "nothing is stored" in ran.stderr) == (
            5,
            True,
            True,
        ), ran.stderr
        assert [(one.node_id, one.lss.pending) for one in nodes] == [(UNCONFIGURED, UNCONFIGURED)] * 2


def failing(one: StrictDevice, how: str, wanted: int, before: int) -> None:
    """Let *one* not take *wanted*: refuse it, say nothing to it, acknowledge it only, or forget it at its reset."""
    handle, reset = one.lss.handle, one.lss.reset
    answers = {"refuses": b"\x11\1\0\0\0\0\0\0", "only acknowledges": b"\x11\0\0\0\0\0\0\0", "is silent": None}

    def handled(request: bytes) -> bytes | None:
        answer = handle(request)
        if request[:2] == bytes((0x11, wanted)) and answer is not None and how in answers:
            one.lss.pending = before
            return answers[how]
        return answer

    def forgetting(*, communication_only: bool = True) -> None:
        if one.lss.pending == wanted:
            one.lss.pending = before
        reset(communication_only=communication_only)

    one.lss.handle = handled  # type: ignore[method-assign]
    if how == "forgets":
        one.lss.reset = forgetting  # type: ignore[method-assign]


@settings(max_examples=8)
@given(
    st.lists(st.sampled_from(["generic", "lss-echo", "lss-reset", "no-boot-up"]), min_size=3, max_size=3),
    st.tuples(*(st.sampled_from([UNCONFIGURED, 11 + at, (5, 6, 7)[at - 2]]) for at in range(3))),
    st.integers(0, 2), st.sampled_from(["refuses", "only acknowledges", "is silent", "forgets"]), st.booleans(),
)  # fmt: skip
def test_where_one_does_not_take_its_node_id_the_others_have_theirs_or_are_named(
    families: list[str], before: tuple[int, ...], which: int, how: str, tells_pending: bool
) -> None:
    nodes = [unconfigured(1 + at, families[at], before[at]) for at in range(3)]
    for one in nodes:
        one.lss._family = one.family._replace(lss_tells_pending=tells_pending)
    failing(nodes[which], how, 5 + which, before[which])
    lines = (f"{name}: {{node_id: {5 + at}, identity: {{serial: {1 + at}}}}}" for at, name in enumerate("abc"))
    file = network(Path.cwd(), *lines)
    with bench(*nodes) as desk:
        ran = desk.run(f"lss assign {file} --json")
    now = [one.node_id for one in nodes]
    if ran.code == 0:
        assert now == [5, 6, 7]
    elif ran.code != 7:
        assert (now, [one.lss.pending for one in nodes]) == ([*before], [*before]), ran.stdout


def test_a_node_that_is_another_one_once_it_boots_is_left_and_said(tmp_path: Path) -> None:
    nodes = [unconfigured(1), unconfigured(2)]
    nodes[1].set_value(0x1018, 4, b"\x03\0\0\0")  # until it boots up
    file = network(tmp_path, "a: {node_id: 5, identity: {serial: 1}}", "b: {node_id: 6, identity: {serial: 3}}")
    with bench(*nodes) as desk:
        ran = desk.run(f"lss assign {file}")
        assert (ran.code, "cannot be restored" in ran.stderr) == (7, True)
        assert [one.node_id for one in nodes] == [UNCONFIGURED, 6]


@given(st.lists(st.integers(0, 0xFFFFFFFF), min_size=2, max_size=2), st.sampled_from([1, 0x800, 0xFFFFFFFF]))
@settings(max_examples=max(4, settings().max_examples // 5))
def test_who_is_within_ranges_says_so(ends: list[int], serial: int) -> None:
    low, high = sorted(ends)
    one = unconfigured(serial, node_id=5)
    vendor, product, revision, _serial = address_of(one).parts
    with bench(one) as desk:
        words = f"lss identify vendor={vendor} product={product} revision={revision} serial={low}-{high} --json"
        assert desk.run(words).document["within"] == (low <= serial <= high)
        assert desk.run(f"lss identify vendor={vendor} product={product} --json").document["within"]
        assert not desk.run(f"lss identify vendor={vendor} product={product + 1} --json").document["within"]
        assert one.state is NmtState.PRE_OPERATIONAL


WRONG = [
    ("lss identify serial=1-2", "vendor, product missing"),
    ("lss identify vendor=1 product=2 serial=5-4", "the lower number first"),
    ("lss identify vendor=1-2 product=2", "vendor=1-2"),
    ("lss identify vendor=1 product=2 revision=1-x", "revision=1-x"),
    ("lss assign", "takes one network file"),
    ("lss scan --store", "belongs to lss assign"),
    ("lss bitrate 500k --prove", "lss bitrate with --store"),
    ("lss bitrate", "takes a bit rate"),
    ("lss bitrate 500kHz", "is not a bit rate"),
    ("lss bitrate 100k", "has no bit rate 100000"),
    ("lss select vendor=1", "product, revision, serial missing"),
    ("lss select vendor=1 vendor=2", "given twice"),
    ("lss select vendor=1 model=2", "write vendor="),
    ("lss select vendor=x product=1 revision=1 serial=1", "vendor=x"),
    ("lss select vendor=-1 product=1 revision=1 serial=1", "32 bits"),
    ("lss node-id", "needs the node-ID"),
    ("lss node-id 128", "1…127"),
    ("lss scan 5", "unexpected"),
    ("lss store 5 6", "unexpected"),
    ("lss identify --wait 20", "belongs to lss scan"),
    ("lss assign line.yaml --prove", "belongs to lss store"),
    ("lss node-id 5 --prove", "belongs to lss store"),
    ("lss select 128", "1…127"),
]


@pytest.mark.parametrize(("line", "said"), WRONG)
def test_wrong_words(line: str, said: str) -> None:
    with bench(unconfigured(1)) as desk:
        ran: Ran = desk.run(line)
        assert (ran.code, said in ran.stderr) == (2, True), ran.stderr
