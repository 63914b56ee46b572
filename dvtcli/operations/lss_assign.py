"""Node-IDs for the nodes of a network file, by what it says of their identity. Does not know how one is given."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import astuple
from typing import TYPE_CHECKING

from dvtcli.device.lss_master import LssMaster
from dvtcli.domain.nmt import UNCONFIGURED
from dvtcli.domain.several import several
from dvtcli.errors import DvtcliError, LeftChanged, SafetyRefusal, UsageError
from dvtcli.operations.lss_find import lss_bus, scanned, selected, two_alike
from dvtcli.operations.lss_node_id import answers, consent_to_give, give, heard_ids, identity_on, store, take_back
from dvtcli.operations.network_wish import read_wish
from dvtcli.operations.results.lss_nodes import LssChanged, LssGiven, LssNode

if TYPE_CHECKING:
    from dvtcli.domain.network.wanted_state import NodeWish, WantedIdentity
    from dvtcli.operations.session import Session


def lss_assign(session: Session, file: str, *, stores: bool = False) -> LssChanged:
    """Give each node of the network *file* that has no node-ID yet the one of the file, found by its identity there.

    Asks first. Nodes that have theirs are left alone, those that are not found are `missing`. Where one does not come
    up with its node-ID all get back what they had. With *stores* all store it, once all came up. SafetyRefusal where a
    node-ID is another device's, an identity fits several nodes, or another master is active.
    """
    wishes = _with_identity(session, file)
    if session.dry_run:
        return LssChanged("assign", dry_run=True)
    lss_bus(session)
    waiting = _without_node_id(session, wishes)
    if not waiting:
        return LssChanged("assign")
    with LssMaster(lss_bus(session)) as master:
        given, missing = _matched(waiting, scanned(session, master))
        if given:
            consent_to_give(session, given, store=stores)
            with session.cancellation.guard():
                _give_all(session, master, given)
                given = [store(master, one) for one in given] if stores else given
    return LssChanged("assign", tuple(given), missing=missing)


def _with_identity(session: Session, file: str) -> list[NodeWish]:
    """The nodes of *file* that LSS can find; UsageError where there is none, and those that it cannot are named."""
    nodes = read_wish(file).nodes
    wishes = [wish for wish in nodes if any(part is not None for part in astuple(wish.identity))]
    if not wishes:
        hint = "identity: {vendor: 0x1E, serial: 0x12345} under a node says who it is"
        raise UsageError(f"{file}: no node has an identity, by which LSS could find it", hint=hint)
    others = [f"{wish.name} ({wish.node_id})" for wish in nodes if wish not in wishes]
    if others:
        session.tell.note(f"no identity in {file}, left alone: {several(others)}")
    return wishes


def _without_node_id(session: Session, wishes: Sequence[NodeWish]) -> list[NodeWish]:
    """Those whose node-ID nobody has; SafetyRefusal where another device than the wanted one has it."""
    heard, bus, waiting = heard_ids(session), session.bus, []
    for wish in wishes:
        if not answers(bus, wish.node_id) and wish.node_id not in heard:
            waiting.append(wish)
            continue
        identity = identity_on(bus, wish.node_id)
        if identity is None or not _fits(identity, wish.identity):
            raise SafetyRefusal(
                f"node-ID {wish.node_id} is in use, and not by {wish.name}",
                node=wish.node_id,
                why="0x1018 says " + " ".join("-" if part is None else f"0x{part:X}" for part in identity)
                if identity
                else "it is heard, and does not say who it is",
                hint=f"node {wish.node_id} shows who has it; lss node-id gives it another one",
            )
    return waiting


def _fits(identity: Sequence[int | None], wanted: WantedIdentity) -> bool:
    return all(want in (None, part) for part, want in zip(identity, astuple(wanted), strict=True))


def _matched(wishes: Sequence[NodeWish], found: Sequence[LssNode]) -> tuple[list[LssGiven], tuple[str, ...]]:
    """Who gets which node-ID, and the names of those that were not found; SafetyRefusal where that is not clear."""
    given: list[LssGiven] = []
    missing: list[str] = []
    for wish in wishes:
        fitting = [node for node in found if _fits(node.address.parts, wish.identity)]
        if len(fitting) > 1:
            raise SafetyRefusal(
                f"{len(fitting)} nodes without a node-ID fit the identity of {wish.name}",
                node=wish.node_id, hint="serial: in its identity tells them apart; lss scan lists them",
            )  # fmt: skip
        if not fitting:
            missing.append(wish.name)
            continue
        (node,) = fitting
        if not node.confirmed:
            raise two_alike(node.address)
        twice = next((one.name for one in given if one.address == node.address), None)
        if twice is not None:
            raise SafetyRefusal(f"{twice} and {wish.name} are one node by their identity", hint=str(node.address))
        given.append(LssGiven(node.address, UNCONFIGURED, wish.node_id, name=wish.name))
    return given, tuple(missing)


def _give_all(session: Session, master: LssMaster, given: Sequence[LssGiven]) -> None:
    """Give all of *given* their node-IDs; where one does not come up all get back what they had."""
    done: list[LssGiven] = []
    for number, one in enumerate(given):
        session.tell.progress(f"LSS: node-ID {one.node_id} to {one.name}", number, len(given))
        try:
            selected(master, one.address)
            give(session, master, one)
        except DvtcliError as failed:
            raise _all_back(master, done, failed) from failed
        done.append(one)


def _all_back(master: LssMaster, done: Sequence[LssGiven], failed: DvtcliError) -> DvtcliError:
    """*failed*, once those that were *done* have what they had; LeftChanged where one has not."""
    left: list[str] = []
    for one in reversed(done):
        try:
            take_back(master, one)
        except DvtcliError as stuck:
            left.append(f"{one.name} keeps node-ID {one.node_id}: {stuck.text}")
    if not left:
        return failed
    error = LeftChanged(failed.text, node=failed.node, why="; ".join(left), state="left_changed")
    error.hint = "nothing is stored: switch these off and on, then lss scan"
    return error
