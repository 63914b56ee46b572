"""Store a node's node-ID and bit rate by LSS, and prove the store by a reset."""

from __future__ import annotations

from contextlib import suppress
from dataclasses import replace
from typing import TYPE_CHECKING

from dvtcli.device.lss_master import LssMaster
from dvtcli.domain.hint import Action, Hint
from dvtcli.errors import DeviceRefused, DvtcliError, LeftChanged, NoAnswer, SafetyRefusal
from dvtcli.operations.consent.other_master import refuse_other_master
from dvtcli.operations.consent.reset_consent import consent_to_reset
from dvtcli.operations.lss.lss_find import lss_bus, selected
from dvtcli.operations.lss.lss_identity import address_of, require_on
from dvtcli.operations.lss.lss_node_id import BOOT_UP_S, forget, told_id
from dvtcli.operations.results.lss_nodes import LssChanged, LssGiven

if TYPE_CHECKING:
    from dvtcli.operations.session.session_nodes import SessionNodes


def lss_store(session: SessionNodes, node_id: int | None = None, *, prove: bool = False) -> LssChanged:
    """Store the node-ID of the node *node_id*, None: the selected node; *prove* also resets it.

    Asks first. Identifies the node by SDO, so that a node that did not come up is not stored. Proved: it returns with
    its node-ID after the reset. Raises DeviceRefused with its reason, LeftChanged if it returns differently; NoAnswer,
    SafetyRefusal.
    """
    node_id = session.node_id() if node_id is None else node_id
    if session.dry_run:
        return LssChanged("store", wanted=node_id, dry_run=True)
    bus = lss_bus(session)
    address = address_of(bus, node_id)
    refuse_other_master(session)
    what = f"store node-ID {node_id} in the node with {address}{', and reset it' if prove else ''}?"
    session.consent(what, node_id)
    if prove:
        consent_to_reset(session, [node_id])
    with LssMaster(bus) as master, session.cancellation.guard():
        stored = store(master, LssGiven(address, node_id, node_id))
        return LssChanged("store", (prove_by_reset(session, master, stored) if prove else stored,))


def store(master: LssMaster, given: LssGiven) -> LssGiven:
    """Store a node's node-ID; raises SafetyRefusal if it has another by LSS."""
    now = selected(master, given.address)
    if now != given.node_id:
        raise SafetyRefusal(
            f"the node with {given.address} has node-ID {told_id(now)}, not {given.node_id}",
            node=given.node_id,
            hint=Hint(Action.FIND_NODES, why="nothing was stored; {} shows who is there"),
        )
    with suppress(DeviceRefused):  # who cannot be told its own node-ID was told no other one either
        master.configure_node_id(now)  # else it keeps one that it was told and that waits for a reset
    with suppress(DeviceRefused, NoAnswer):
        master.configure_own_bit_rate()  # else it keeps one that it was told and that nobody activated
    master.store()
    return replace(given, stored=True)


def prove_by_reset(session: SessionNodes, master: LssMaster, given: LssGiven) -> LssGiven:
    """Reset a node after its store, and verify its node-ID; raises LeftChanged if it differs.

    Raises DeviceRefused if no boot-up message was received: nothing is proved.
    """
    bus, node_id = session.open_network().bus, given.node_id
    master.let_wait()
    seen = bus.boot_ups(node_id)
    master.reset_node(node_id)
    booted = bus.wait_boot_up(node_id, seen, BOOT_UP_S)
    forget(session, given)
    try:
        require_on(bus, given.address, node_id)
    except DvtcliError as failed:
        raise _not_kept(master, given, failed) from failed
    if not booted:
        raise DeviceRefused(
            f"node {node_id} sent no boot-up message after its reset: nothing is proved",
            node=node_id,
            why="it answers with its node-ID all the same",
            hint=Hint(Action.FIND_NODES, why="switch it off and on, then {}"),
            state="unknown",
        )
    return replace(given, proved=True)


def _not_kept(master: LssMaster, given: LssGiven, failed: DvtcliError) -> LeftChanged:
    """Make the error for a node that did not return after its store, with its node-ID by LSS."""
    try:
        now = f"by LSS its node-ID is {told_id(selected(master, given.address))} now"
    except DvtcliError as silent:
        now = silent.text
    return LeftChanged(
        f"node {given.node_id} says that it stored its node-ID, and did not come back with it after a reset",
        node=given.node_id, why=f"{failed.text}; {now}", state="left_changed",
        hint="lss scan and scan show who is there",
    )  # fmt: skip
