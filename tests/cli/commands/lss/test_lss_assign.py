"""`lss assign`: the nodes of a file get their node-IDs, all or none, and store them."""

from __future__ import annotations

from pathlib import Path

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from dvtcli.domain.can_ids import LSS_REQUEST_ID
from dvtcli.domain.nmt import UNCONFIGURED
from dvtcli.domain.ports import Frame
from dvtcli.operations.lss.lss_assign import in_order
from dvtcli.operations.results.lss_nodes import LssGiven
from dvtcli.simulator.device.strict_device import StrictDevice
from tests.cli.commands.bench import Bench
from tests.cli.commands.lss.lss_bench import at_frame, bench, is_communication_reset, network, power_cycle
from tests.lss_nodes import address_of, unconfigured
from tests.virtual_time import ANSWER_S, VirtualTimeBus

pytestmark = pytest.mark.drawn(14, "lss")


def test_the_nodes_of_a_file_get_their_node_ids(tmp_path: Path) -> None:
    nodes = [unconfigured(1), unconfigured(2), unconfigured(3, node_id=7)]
    file = network(
        tmp_path,
        "drive: {node_id: 5, identity: {serial: 2}}",
        "valve: {node_id: 6, identity: {serial: 1}}",
        "pump: {node_id: 7, identity: {serial: 3}}",
        "lamp: {node_id: 8}",
    )
    with bench(*nodes) as session:
        assert session.run(f"lss assign {file} --dry-run").code == 0
        assert session.session.bus.now_s() < 0.1
        told = session.run(f"lss assign {file} --store --json").document["nodes"]
        told_all = [(row["name"], row["before"], row["node"], row["stored"]) for row in told]
        assert told_all == [("drive", None, 5, True), ("valve", None, 6, True), ("pump", 7, 7, True)]
        assert [(device.node_id, device.lss.stored) for device in nodes] == [(6, 6), (5, 5), (7, 7)]
        assert "every node has its node-ID" in session.run(f"lss assign {file}").stdout


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
    with bench(*nodes) as session:
        ran = session.run(f"lss assign {network(tmp_path, *lines)}")
        ran.failed(code, said)
        assert [device.lss.pending for device in nodes] == [UNCONFIGURED, UNCONFIGURED, 7]
        if "in use" in said:  # the command that the hint prints frees it
            command = ran.stderr.partition("shows the node that has it; `dvtcli ")[2].partition("`")[0]
            assert (session.run(command).code, nodes[2].node_id) == (0, 1)


def test_nodes_that_have_a_wrong_node_id_get_theirs_and_two_swap(tmp_path: Path) -> None:
    nodes = [unconfigured(1, node_id=5), unconfigured(2, node_id=6), unconfigured(3, node_id=9), unconfigured(4)]
    file = network(
        tmp_path,
        "a: {node_id: 6, identity: {serial: 1}}",
        "b: {node_id: 5, identity: {serial: 2}}",
        "c: {node_id: 7, identity: {serial: 3}}",
        "d: {node_id: 9, identity: {serial: 4}}",
    )
    with bench(*nodes) as session:
        ran = session.run(f"lss assign {file} --store --prove --json")
        assert ran.code == 0, ran.stderr
        assert [(row["name"], row["before"], row["node"], row["proved"]) for row in ran.document["nodes"]] == [
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
        assert [(device.node_id, device.lss.stored) for device in nodes] == [(6, 6), (5, 5), (7, 7), (9, 9)]


@pytest.mark.parametrize("option", ["--store", "--store --prove"])
def test_node_ids_that_are_in_ram_only_are_stored_by_the_same_words(tmp_path: Path, option: str) -> None:
    nodes = [unconfigured(1, node_id=5), unconfigured(2, node_id=6), unconfigured(3, node_id=9)]
    file = network(
        tmp_path,
        "a: {node_id: 6, identity: {serial: 1}}",
        "b: {node_id: 5, identity: {serial: 2}}",
        "c: {node_id: 9, identity: {serial: 3}}",
    )
    with bench(*nodes) as session:
        assert session.run(f"lss assign {file}").code == 0
        assert "every node has its node-ID" in session.run(f"lss assign {file}").stdout
        assert [device.lss.stored for device in nodes] == [5, 6, 9]
        ran = session.run(f"lss assign {file} {option} --json")
        assert (ran.code, [row["stored"] for row in ran.document["nodes"]]) == (0, [True] * 3), ran.stderr
        assert [row["proved"] for row in ran.document["nodes"]] == ["prove" in option] * 3
        assert "plan 2: a stores node-ID 6, which it has" in session.run(f"lss assign {file} --store").stderr
    assert power_cycle(*nodes) == [6, 5, 9]


def test_nobody_is_told_to_store_unasked(tmp_path: Path) -> None:
    device, other = unconfigured(1, node_id=3), unconfigured(2, node_id=4)
    file = network(tmp_path, "a: {node_id: 5, identity: {serial: 1}}", "b: {node_id: 6, identity: {serial: 2}}")
    with bench(device, other) as session:
        session.run(f"lss assign {file}")
    with bench(device, other, yes=False) as session:
        ran = session.run(f"lss assign {file} --store")
        ran.failed(6, "store node-ID 5 in a, which has it")
    assert [device.lss.stored, other.lss.stored] == [3, 4]


def test_who_takes_no_part_in_lss_is_named_and_the_others_store(tmp_path: Path) -> None:
    nodes = [unconfigured(1, node_id=5), unconfigured(2, node_id=6)]
    nodes[1].lss.handle = lambda _request: None  # type: ignore[method-assign]
    file = network(tmp_path, "a: {node_id: 5, identity: {serial: 1}}", "b: {node_id: 6, identity: {serial: 2}}")
    with bench(*nodes) as session:
        ran = session.run(f"lss assign {file} --store --json")
    assert (ran.code, [row["name"] for row in ran.document["nodes"]]) == (0, ["a"])
    assert "not stored, since LSS cannot reach them: b (6)" in ran.stderr


@pytest.mark.parametrize(("faulty", "code", "after"), [("b", 1, [5, 6]), ("a", 7, [5, 5])])
def test_where_one_does_not_store_what_it_has_it_is_said_who_has(
    tmp_path: Path, faulty: str, code: int, after: list[int]
) -> None:
    """What they had stored is not known: no way leads back to it."""
    nodes = [unconfigured(1, node_id=5), unconfigured(2, node_id=6), unconfigured(3)]
    swap = ["a: {node_id: 6, identity: {serial: 1}}", "b: {node_id: 5, identity: {serial: 2}}"]
    with bench(*nodes) as session:
        assert session.run(f"lss assign {network(tmp_path, *swap)}").code == 0
        nodes["ab".index(faulty)].areas.fails = True
        file = network(tmp_path, *swap, "c: {node_id: 7, identity: {serial: 3}}")
        ran = session.run(f"lss assign {file} --store")
        ran.failed(code, f"refused {faulty} (node-ID")
        assert ("unknown a may have another node-ID after the next power-on" in ran.stderr) == (code == 7)
        assert ("repeat the command, or `dvtcli lss store 6`\n" in ran.stderr) == (code == 7)
        assert [device.node_id for device in nodes] == [6, 5, UNCONFIGURED]
    assert power_cycle(*nodes) == [*after, UNCONFIGURED]


def test_where_a_new_one_does_not_store_those_that_had_theirs_have_stored_it(tmp_path: Path) -> None:
    nodes = [unconfigured(1, node_id=5), unconfigured(3)]
    nodes[1].areas.fails = True
    file = network(tmp_path, "a: {node_id: 5, identity: {serial: 1}}", "c: {node_id: 7, identity: {serial: 3}}")
    with bench(*nodes) as session:
        ran = session.run(f"lss assign {file} --store")
        ran.failed(1, "a stored its old node-ID; none has stored a new node-ID")
    assert power_cycle(*nodes) == [5, UNCONFIGURED]


def test_where_going_back_fails_half_way_it_is_said_which_node_id_each_has(tmp_path: Path) -> None:
    """The third does not come up, the second is gone by then, the first has what it had."""
    nodes = [unconfigured(1, node_id=11), unconfigured(2, node_id=12), unconfigured(3, node_id=13)]
    file = network(
        tmp_path, *(f"{name}: {{node_id: {5 + at}, identity: {{serial: {1 + at}}}}}" for at, name in enumerate("abc"))
    )
    bus = VirtualTimeBus(nodes, simulated=False)

    def spoil() -> None:
        """The second node loses its power for good, and the third forgets its new node-ID."""
        nodes[2].lss.pending = nodes[2].node_id
        nodes[1].lss.handle = lambda _request: None  # type: ignore[method-assign]

    at_frame(bus, is_communication_reset, 3, spoil)
    with Bench((), {"yes": True}, bus) as session:
        ran = session.run(f"lss assign {file}")
    assert (ran.code, [device.node_id for device in nodes]) == (7, [11, 6, 13]), ran.stderr
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

    def spoil() -> None:
        """At its reset the second node forgets its new node-ID; the first one obeys no other reset."""
        nodes[1].lss.pending = 12
        nodes[0].nmt = lambda _command: None  # type: ignore[method-assign]

    at_frame(bus, lambda frame: is_communication_reset(frame) and frame.data[1] == 12, 1, spoil)
    with Bench((), {"yes": True}, bus) as session:
        ran = session.run(f"lss assign {file}")
    assert [device.node_id for device in nodes] == [5, 12]
    said = " ".join(ran.stderr.split())
    assert ran.code == 7, said
    assert "now a has node-ID 11, before 11; nobody answers as node 11, it answers as node 5" in said
    assert "now b has node-ID 12, before 12; it answers as node 12, nobody answers as node 6" in said


def test_a_wrong_node_id_is_not_taken_from_a_node_of_the_file(tmp_path: Path) -> None:
    """Node 6 may be `lamp`, of which the file says no identity, however well it fits another one."""
    nodes = [unconfigured(1, node_id=6)]
    file = network(tmp_path, "drive: {node_id: 5, identity: {serial: 1}}", "lamp: {node_id: 6}")
    with bench(*nodes) as session:
        ran = session.run(f"lss assign {file}")
        assert (ran.code, "drive: not found" in ran.stdout, nodes[0].node_id) == (1, True, 6)


def test_where_a_swap_fails_both_have_what_they_had(tmp_path: Path) -> None:
    nodes = [unconfigured(1, node_id=5), unconfigured(2, node_id=6)]
    file = network(tmp_path, "a: {node_id: 6, identity: {serial: 1}}", "b: {node_id: 5, identity: {serial: 2}}")
    bus = VirtualTimeBus(nodes, simulated=False)

    def forget() -> None:
        """Node 126 forgets what it should become."""
        nodes[1].lss.pending = nodes[1].node_id

    at_frame(bus, is_communication_reset, 3, forget)
    with Bench((), {"yes": True}, bus) as session:
        ran = session.run(f"lss assign {file}")
        ran.failed(5, "did not start as node 5")
        assert "plan 1: b gets node-ID 126 (now 6)" in ran.stderr
        assert [device.node_id for device in nodes] == [5, 6]


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
    with bench(*nodes) as session:
        ran = session.run(f"lss assign {file} --store")
        ran.failed(1, f"refused {'abc'[which]} (node-ID {(6, 5, 7)[which]}")
        assert "none has stored a new node-ID" in ran.stderr
        assert "the same command without --store gives the new node-IDs" in ran.stderr
        assert ("stored  b (node-ID 5" in ran.stderr) == (which != 1)  # the first one, by its node-ID
        assert [(device.node_id, device.lss.stored) for device in nodes] == [
            (5, 5),
            (6, 6),
            (UNCONFIGURED, UNCONFIGURED),
        ]


def test_where_what_was_stored_cannot_be_taken_back_it_is_said(tmp_path: Path) -> None:
    nodes = [unconfigured(1), unconfigured(2)]
    nodes[1].areas.fails = True
    file = network(tmp_path, "a: {node_id: 5, identity: {serial: 1}}", "b: {node_id: 6, identity: {serial: 2}}")
    bus = VirtualTimeBus(nodes, simulated=False)

    def spoil() -> None:
        """From now on the first node cannot store either."""
        nodes[0].areas.fails = True

    at_frame(bus, lambda frame: frame.can_id == LSS_REQUEST_ID and frame.data[0] == 0x17, 2, spoil)
    with Bench((), {"yes": True}, bus) as session:
        ran = session.run(f"lss assign {file} --store")
        ran.failed(7, "a (node-ID 5, before none) may have node-ID 5 stored")
        assert "refused b (node-ID 6" in ran.stderr
        assert "`dvtcli scan` show the node-IDs, then let these have a node-ID anew" in ran.stderr
        assert [device.lss.stored for device in nodes] == [5, UNCONFIGURED]


def test_a_proof_that_fails_says_who_is_not_proved(tmp_path: Path) -> None:
    nodes = [unconfigured(1), unconfigured(2)]
    nodes[0].areas.stores_nothing = True
    file = network(tmp_path, "a: {node_id: 5, identity: {serial: 1}}", "b: {node_id: 6, identity: {serial: 2}}")
    with bench(*nodes) as session:
        ran = session.run(f"lss assign {file} --store --prove")
        ran.failed(7, "b (node-ID 6, before none), not proved")


@given(st.permutations(range(1, 7)), st.lists(st.sampled_from([UNCONFIGURED, *range(1, 9)]), min_size=6, max_size=6))
def test_no_two_nodes_ever_have_one_node_id(wanted: list[int], before: list[int]) -> None:
    given_ids = [
        LssGiven(address_of(unconfigured(serial)), now, want)
        for serial, (now, want) in enumerate(zip(before, wanted, strict=True))
        if now != want and (now == UNCONFIGURED or now not in before[:serial])
    ]
    now = {device.address: device.before for device in given_ids}
    others = set(range(100, 110))
    for step in in_order(given_ids, set(now.values()) | others, {7, 8}):
        assert now[step.address] == step.before
        assert step.node_id not in now.values()
        assert step.node_id not in others
        now[step.address] = step.node_id
    assert now == {device.address: device.node_id for device in given_ids}


class DeafTo(VirtualTimeBus):
    """Nothing of node 6 is heard here."""

    def _to_us(self, frame: Frame, delay_s: float = ANSWER_S) -> None:
        if frame.can_id not in (0x586, 0x706):
            super()._to_us(frame, delay_s)


def test_where_one_does_not_come_up_all_get_back_what_they_had(tmp_path: Path) -> None:
    nodes = [unconfigured(1), unconfigured(2)]
    file = network(tmp_path, "a: {node_id: 5, identity: {serial: 1}}", "b: {node_id: 6, identity: {serial: 2}}")
    with Bench((), {"yes": True}, DeafTo(nodes, simulated=False)) as session:
        ran = session.run(f"lss assign {file}")
        ran.failed(5, "did not start as node 6")
        assert "nothing is stored" in ran.stderr
        assert [(device.node_id, device.lss.pending) for device in nodes] == [(UNCONFIGURED, UNCONFIGURED)] * 2


def failing(device: StrictDevice, how: str, wanted: int, before: int) -> None:
    """Let *one* not take *wanted*: refuse it, say nothing to it, acknowledge it only, or forget it at its reset."""
    handle, reset = device.lss.handle, device.lss.reset
    answers = {"refuses": b"\x11\1\0\0\0\0\0\0", "only acknowledges": b"\x11\0\0\0\0\0\0\0", "is silent": None}

    def handled(request: bytes) -> bytes | None:
        answer = handle(request)
        if request[:2] == bytes((0x11, wanted)) and answer is not None and how in answers:
            device.lss.pending = before
            return answers[how]
        return answer

    def forgetting(*, communication_only: bool = True) -> None:
        if device.lss.pending == wanted:
            device.lss.pending = before
        reset(communication_only=communication_only)

    device.lss.handle = handled  # type: ignore[method-assign]
    if how == "forgets":
        device.lss.reset = forgetting  # type: ignore[method-assign]


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
    for device in nodes:
        device.lss._family = device.family._replace(lss_tells_pending=tells_pending)
    failing(nodes[which], how, 5 + which, before[which])
    lines = (f"{name}: {{node_id: {5 + at}, identity: {{serial: {1 + at}}}}}" for at, name in enumerate("abc"))
    file = network(Path.cwd(), *lines)
    with bench(*nodes) as session:
        ran = session.run(f"lss assign {file} --json")
    now = [device.node_id for device in nodes]
    if ran.code == 0:
        assert now == [5, 6, 7]
    elif ran.code != 7:
        assert (now, [device.lss.pending for device in nodes]) == ([*before], [*before]), ran.stdout


def test_a_node_that_is_another_one_once_it_boots_is_left_and_said(tmp_path: Path) -> None:
    nodes = [unconfigured(1), unconfigured(2)]
    nodes[1].set_value(0x1018, 4, b"\x03\0\0\0")  # until it boots up
    file = network(tmp_path, "a: {node_id: 5, identity: {serial: 1}}", "b: {node_id: 6, identity: {serial: 3}}")
    with bench(*nodes) as session:
        ran = session.run(f"lss assign {file}")
        ran.failed(7, "cannot be restored")
        assert [device.node_id for device in nodes] == [UNCONFIGURED, 6]
