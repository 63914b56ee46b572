"""Finishing an interrupted change on the device it was made on: what is put back, what is held, and what is said."""

from __future__ import annotations

from pathlib import Path

import pytest

from dvtcli.cli.view.typed_hints import typed
from dvtcli.device.change.journal import Journal
from dvtcli.device.change.plan_document import Identity
from dvtcli.device.change.recovery import accepted_states, refuse_other_device
from dvtcli.device.node import Node
from dvtcli.device.store.pending import CHANGE, VERIFY
from dvtcli.domain.pdo import Pdo, PdoConfig
from dvtcli.domain.plan import Change, Plan, Step, ValueChange, plan_pdo
from dvtcli.errors import LeftChanged, NoAnswer, SafetyRefusal
from tests.faults.recovering import recover
from tests.laws.bench import NODE, DirectBus, DirectSdo, booted, dictionary, silence

TPDO1 = Pdo.parse("tpdo1")
TYPE, TIMER, HEARTBEAT = (0x1800, 2), (0x1800, 5), (0x1017, 0)


@pytest.fixture
def channel() -> DirectSdo:
    return DirectSdo(booted())


@pytest.fixture
def node(channel: DirectSdo) -> Node:
    return Node(DirectBus(channel.device, channel), NODE, dictionary("generic"))


def journal(node: Node, *changes: Change, identity: Identity | None = None) -> Journal:
    made_on = node.identity() if identity is None else identity
    return Journal(Path("state/direct-1.json"), "direct", made_on, Plan(NODE, changes))


def with_(config: PdoConfig, **parameters: int) -> PdoConfig:
    return config.with_parameters(**parameters)  # type: ignore[arg-type]


def heartbeat(before: bytes | None, after: bytes = b"\xe8\3") -> ValueChange:
    return ValueChange(Step(*HEARTBEAT, before, after, "write"))


@pytest.mark.parametrize(
    ("before", "held", "was", "differences"),
    [
        (b"\x64\0", "write 1017:00 0x01F4 --as u16", "write 1017:00 0x0064 --as u16", ["is 0x01F4, was 0x0064"]),
        (b"\xf4\1", "write 1017:00 0x01F4 --as u16", "write 1017:00 0x01F4 --as u16", []),
        (None, "# 1017:00 is write-only", "# 1017:00 was not known", []),
    ],
)
def test_what_is_held_of_a_single_object_is_told_beside_what_was(
    node: Node, before: bytes | None, held: str, was: str, differences: list[str]
) -> None:
    (state,) = accepted_states(node, journal(node, heartbeat(before)))
    words = {"held": held, "before": was, "differs_from_before": differences, "known": before is not None}
    assert state.document() == {"object": "1017:00", **words}


def test_what_was_changed_is_put_back_as_the_device_is_found_now(node: Node, channel: DirectSdo) -> None:
    before = node.pdo(TPDO1)
    half_done = journal(node, plan_pdo(TPDO1, before, with_(before, event_timer=50)), heartbeat(b"\xf4\1"))
    channel.device.set_value(*TIMER, b"\x4d\0")  # since it was read
    channel.device.set_value(*HEARTBEAT, b"\x64\0")
    node.pending.suspicions.update({CHANGE: "it was interrupted", VERIFY: "it is not as wanted"})
    plan, findings = recover(node, half_done)
    assert [change.steps[-1].after for change in plan.changes if isinstance(change, ValueChange)] == [b"\xf4\1"]
    assert plan.changes[0] == plan_pdo(TPDO1, with_(before, event_timer=77), before)
    assert (node.pdo(TPDO1), node.upload(*HEARTBEAT), findings) == (before, b"\xf4\1", ())
    assert node.pending.suspicions.keys() == {VERIFY}


def test_what_a_device_does_not_take_back_becomes_what_it_takes_and_that_is_the_plan(
    node: Node, channel: DirectSdo
) -> None:
    channel.device.set_value(*TYPE, b"\xf5")  # a reserved transmission type, which it came with and refuses
    before = node.pdo(TPDO1)
    after, back = with_(before, transmission_type=255), with_(before, transmission_type=254)
    change = plan_pdo(TPDO1, before, after)._replace(substitute=back)
    channel.device.set_value(*TYPE, b"\xff")
    plan, findings = recover(node, journal(node, change))
    assert node.pdo(TPDO1) == back
    assert plan.changes == (plan_pdo(TPDO1, after, back),)
    assert len(findings) == 1


def test_what_could_be_put_back_is_planned_though_a_refusal_was_foreseen(node: Node) -> None:
    before = node.pdo(TPDO1)
    half_done = with_(before, event_timer=50)
    node.bus.sdo(NODE).download(*TIMER, b"\x32\0")
    change = plan_pdo(TPDO1, before, half_done)._replace(substitute=with_(before, event_timer=60))
    plan, findings = recover(node, journal(node, change))
    assert (plan.changes, findings, node.pdo(TPDO1)) == ((plan_pdo(TPDO1, half_done, before),), (), before)


class Silent(DirectSdo):
    """A node that reads and does not answer a write."""

    def download(self, index: int, sub_index: int, data: bytes, *, timeout_s: float | None = None) -> None:
        raise silence(index, sub_index)


def test_where_the_node_is_silent_the_next_try_is_named() -> None:
    device = booted()
    node = Node(DirectBus(device, Silent(device)), NODE, dictionary("generic"))
    with pytest.raises(LeftChanged) as caught:
        recover(node, journal(node, heartbeat(b"\x64\0")))
    assert isinstance(caught.value.__cause__, NoAnswer)
    assert typed(caught.value.hint) == "`recover` tries again, with the journal state/direct-1.json"


@pytest.mark.parametrize(
    ("identity", "named"),
    [
        ({"vendor": 0x1E, "product": None, "revision": 7, "serial": None}, "it names vendor 0x1E revision 0x7; this"),
        ({}, "it names no identity; this one is vendor 0x"),
    ],
)
def test_a_journal_of_another_device_names_both(node: Node, identity: Identity, named: str) -> None:
    with pytest.raises(SafetyRefusal) as caught:
        refuse_other_device(node, journal(node, identity=identity))
    assert named in str(caught.value.why)
    assert "None" not in str(caught.value.why)
