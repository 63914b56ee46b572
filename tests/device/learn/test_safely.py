"""Asking a node and putting everything back: what the way back is about, what is asked in which state, and the end."""

from __future__ import annotations

from dataclasses import dataclass, field, replace

import pytest

from dvtcli.device.learn.probing import Asked, Terms, ask_safely, roll_back_writes
from dvtcli.device.learn.subjects import subjects
from dvtcli.device.node import Node
from dvtcli.device.store.pending import CHANGE
from dvtcli.domain.learning.probe import IN_OPERATIONAL
from dvtcli.domain.nmt import NmtCommand, NmtState
from dvtcli.domain.pdo import Pdo
from dvtcli.errors import LeftChanged, SafetyRefusal, SdoAborted
from tests.laws.bench import NODE, DirectBus, DirectSdo, booted, dictionary

TPDO1, TPDO2, TPDO3, TPDO4 = (Pdo.parse(f"tpdo{number}") for number in (1, 2, 3, 4))
TIMER, OTHERS_TIMER = (0x1803, 5), (0x1800, 5)


@dataclass
class Odd(DirectSdo):
    """A device that refuses to write to *fixed*, and with each download sets *altered* to what is told."""

    fixed: tuple[tuple[int, int], ...] = ()
    altered: dict[tuple[int, int], bytes] = field(default_factory=dict)

    def download(self, index: int, sub_index: int, data: bytes, *, timeout_s: float | None = None) -> None:
        if (index, sub_index) in self.fixed:
            self.writes.append((index, sub_index, bytes(data)))
            raise SdoAborted(index, sub_index, 0x0800_0021, node=NODE)
        super().download(index, sub_index, data, timeout_s=timeout_s)
        for place, value in self.altered.items():
            self.device.set_value(*place, value)


def odd(**oddities: object) -> tuple[Node, Odd]:
    device = booted()
    channel = Odd(device, **oddities)  # type: ignore[arg-type]
    return Node(DirectBus(device, channel), NODE, dictionary("generic")), channel


def ask(node: Node, *, isolated: bool = False, limit: int = 100_000) -> Asked:
    """Ask one TPDO of *node* everything."""
    found = node.begin_change()
    pdos = node.pdos()
    return ask_safely(node, subjects(node, pdos, frozenset())[:1], pdos, found, Terms(limit, isolated))


def test_the_way_back_is_about_every_pdo_that_is_whole() -> None:
    node, _ = odd()
    pdos = node.pdos()
    subject = replace(subjects(node, pdos, frozenset())[0], entries=(1, 2, 3))
    assert subject.pdo == TPDO4
    multiplexed = replace(pdos[TPDO2], mpdo=0xFE, mapping=())
    lacking = replace(pdos[TPDO3], unread=((0x1802, 1),))
    plan = roll_back_writes(NODE, [subject], {**pdos, TPDO2: multiplexed, TPDO3: lacking})
    labels = [change.label for change in plan.changes]
    assert labels == ["TPDO1", "RPDO1", "RPDO2", "RPDO3", "RPDO4", "TPDO4", "1A03:03"]


def test_all_is_as_it_was_and_what_was_read_is_read_anew() -> None:
    node, channel = odd()
    before = node.pdos()
    asked = ask(node)
    assert asked.writes > 100
    assert all(answer.why != "its mappable objects are unknown" for answer in asked.known[0].answers.values())
    assert node.cancellation.active, "a Ctrl-C comes too late by now"
    assert node.pdos() == before
    ask(node)
    channel.device.set_value(*OTHERS_TIMER, b"\7\0")
    assert node.known_pdo(TPDO1).communication.event_timer == 7


@pytest.mark.parametrize("isolated", [True, False])
@pytest.mark.parametrize("state", [NmtState.OPERATIONAL, NmtState.PRE_OPERATIONAL])
def test_what_operational_refuses_is_asked_there_where_nothing_else_is_on_the_bus(
    isolated: bool, state: NmtState
) -> None:
    node, channel = odd()
    if state is NmtState.OPERATIONAL:
        channel.device.nmt(NmtCommand.START)
    answers = ask(node, isolated=isolated).known[0].answers
    asked = [name for name, answer in answers.items() if name.endswith(IN_OPERATIONAL) and answer.code is not None]
    assert bool(asked) == (isolated and state is NmtState.OPERATIONAL)


def test_what_does_not_go_back_is_not_asked() -> None:
    node, channel = odd(fixed=(TIMER,))
    asked = ask(node)
    assert 5 not in asked.known[0].subject.parameters
    assert len([one for one in channel.writes if one[:2] == TIMER]) == 2, "it was tried with what it held"


def test_a_device_that_maps_nothing_is_asked_what_needs_no_mapping() -> None:
    node, _ = odd(fixed=((0x1A03, 1),))
    before = node.pdos()
    asked = ask(node)
    assert asked.known[0].fits == ()
    assert (asked.writes > 10, node.pdos()) == (True, before)


def test_what_ends_it_is_told_once_all_is_put_back() -> None:
    node, _ = odd()
    before = node.pdos()
    with pytest.raises(SafetyRefusal, match="written 20 times") as caught:
        ask(node, limit=20)
    assert (caught.value.state, node.pdos(), node.pending.suspicions) == ("rolled_back", before, {})


@pytest.mark.parametrize("limit", [100_000, 20])
def test_what_the_device_goes_on_altering_is_left_changed_with_both_reasons(limit: int) -> None:
    node, channel = odd()
    node.pdos()
    channel.altered = {OTHERS_TIMER: b"\x55\0"}
    with pytest.raises(LeftChanged) as caught:
        ask(node, limit=limit)
    why = str(caught.value.why)
    assert why.startswith("node 1 was written 20 times, the announced maximum; then, while") == (limit == 20)
    assert "None" not in why
    assert node.pending.suspicions.keys() == {CHANGE}, "nothing is stored over it"


def test_a_pdo_that_is_not_whole_and_was_altered_is_named() -> None:
    """It cannot be put back, and so stands in no plan; it is looked at all the same."""
    node, channel = odd()
    channel.device.set_value(0x1A00, 0, b"\xfe")
    before = node.pdos()
    ask(node)
    assert node.pdos() == before
    channel.altered = {OTHERS_TIMER: b"\x55\0"}
    with pytest.raises(LeftChanged, match="TPDO1 of node 1 could not be rolled back") as caught:
        ask(node)
    assert caught.value.why == "the device altered TPDO1 beside what it was asked"
