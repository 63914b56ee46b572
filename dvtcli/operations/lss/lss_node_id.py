"""Set a node's node-ID by LSS, verified at the new node-ID."""

from __future__ import annotations

from typing import TYPE_CHECKING

from dvtcli.device.lss_master import LssMaster
from dvtcli.domain.hint import Action, Hint
from dvtcli.domain.lss_services import LssAddress
from dvtcli.domain.nmt import UNCONFIGURED
from dvtcli.errors import DvtcliError, LeftChanged, NoAnswer, SafetyRefusal, UsageError
from dvtcli.operations.lss.lss_find import answers, is_on, lss_bus, require_on, selected
from dvtcli.operations.results.lss_nodes import LssChanged, LssGiven
from dvtcli.operations.session.consent import consent_to_reset, refuse_other_master

if TYPE_CHECKING:
    from collections.abc import Sequence

    from dvtcli.domain.ports import CanopenBus, Frame
    from dvtcli.operations.session.session_nodes import SessionNodes

#: How long a node may take to boot up with its new node-ID (s).
BOOT_UP_S = 3.0
_HEARTBEAT = 0x700


def lss_node_id(session: SessionNodes, node_id: int, address: LssAddress | None = None) -> LssChanged:
    """Set *node_id* (1..127) on the node with *address*, None: the selected node.

    Asks first. Succeeds once the node booted with it and is identified by SDO; otherwise its old node-ID is restored.
    Raises SafetyRefusal if *node_id* is in use, or another master is active; DeviceRefused, NoAnswer with state
    `rolled_back`; LeftChanged.
    """
    if session.dry_run:
        return LssChanged("node-id", wanted=node_id, dry_run=True)
    bus = lss_bus(session)
    with LssMaster(bus) as master:
        one, before = _meant(master, address)
        given = LssGiven(one, before, node_id)
        if before == node_id:
            require_on(bus, given.address, given.node_id)
            return LssChanged("node-id", (given,))
        refuse_used(session, node_id)
        consent_to_give(session, [given])
        with session.cancellation.deferred():
            give(session, master, given)
    return LssChanged("node-id", (given,))


def _meant(master: LssMaster, address: LssAddress | None) -> tuple[LssAddress, int]:
    """Select the node to configure; returns its address and node-ID."""
    if address is not None:
        return address, selected(master, address)
    said = master.inquire()
    if said is None:
        raise UsageError(
            "no node is selected for LSS",
            hint=Hint(Action.LSS_SELECT, why="{}, or name these after the node-ID") + Hint(Action.LSS_SCAN),
        )
    return said


def refuse_used(session: SessionNodes, node_id: int) -> None:
    """Raises SafetyRefusal if *node_id* is heard or answers, or another master is active."""
    received = node_id in received_ids(session)
    if received or answers(session.bus, node_id):
        raise SafetyRefusal(
            f"node-ID {node_id} is in use: a node {'is heard' if received else 'answers'} on it",
            node=node_id,
            hint=Hint(Action.SHOW_NODE, {"node": node_id}, "choose another node-ID; {} shows the node that has it"),
        )


def received_ids(session: SessionNodes) -> set[int]:
    """Return node-IDs of heartbeats and boot-ups; raises SafetyRefusal if another master is active meanwhile."""
    received: set[int] = set()

    def note(frame: Frame, sent: bool) -> None:
        if not sent and not frame.extended and 1 <= frame.can_id - _HEARTBEAT <= 127:
            received.add(frame.can_id - _HEARTBEAT)

    stop = session.bus.tap(note)
    try:
        refuse_other_master(session)
    finally:
        stop()
    return received


def consent_to_give(
    session: SessionNodes, given: Sequence[LssGiven], kept: Sequence[LssGiven] = (), *, store: bool = False,
    prove: bool = False,
) -> None:  # fmt: skip
    """Ask before nodes get node-IDs, those *kept* are stored, and a drive that may move is reset."""
    lines = [
        f"give node-ID {slave.node_id} to {slave.name or slave.address} (now {told_id(slave.before)})"
        for slave in given
    ]
    if given and store:
        lines[-1] += ", and store"
    lines += [f"store node-ID {slave.node_id} in {slave.name}, which has it" for slave in kept]
    session.consent(f"{'; '.join(lines)}{', and reset all' if prove else ''}?")
    reset = [*given, *kept] if prove else given
    consent_to_reset(session, [slave.before for slave in reset if slave.before != UNCONFIGURED])


def told_id(node_id: int) -> str:
    """A node-ID in words."""
    return "none" if node_id == UNCONFIGURED else str(node_id)


def give(session: SessionNodes, master: LssMaster, given: LssGiven) -> None:
    """Set the node-ID of a selected node, and verify that it comes up; else roll back."""
    bus = session.open_network().bus
    seen = bus.boot_ups(given.node_id)
    try:
        master.configure_node_id(given.node_id)
        activate(master, given.before)
        if (
            not master.comes_up(given.node_id, seen, BOOT_UP_S)
            and given.before == UNCONFIGURED
            and not answers(bus, given.node_id)
        ):
            master.reset_communication(UNCONFIGURED)  # some slaves take their first node-ID by a reset only
            master.comes_up(given.node_id, seen, BOOT_UP_S)
        require_on(bus, given.address, given.node_id)
    except DvtcliError as failed:
        raise _taken_back(bus, master, given, failed) from failed
    forget(session, given)


def activate(master: LssMaster, before: int) -> None:
    """Activate a node-ID: the first by waiting, a changed node-ID by a reset."""
    master.let_wait()
    if before != UNCONFIGURED:
        master.reset_communication(before)


def _taken_back(bus: CanopenBus, master: LssMaster, given: LssGiven, failed: DvtcliError) -> DvtcliError:
    """Return *failed* with the node's state after its old node-ID was restored; LeftChanged if it was not.

    Checked by LSS, and by SDO at the old and the new node-ID.
    """
    try:
        take_back(bus, master, given)
    except DvtcliError as stuck:
        left = LeftChanged(
            f"{failed.text}, and its old node-ID cannot be restored",
            node=given.node_id,
            why=f"{stuck.text}; {answering_now(bus, given)}",
            state="left_changed",
            hint=Hint(Action.LSS_SCAN, why="nothing is stored: switch the node off and on, then {}")
            + Hint(Action.LSS_IDENTIFY, why="shows its LSS address"),
        )
        left.details.append(("node", str(given.address)))
        return left
    failed.state = "rolled_back"
    failed.state_text = f"it has node-ID {told_id(given.before)} as before; nothing is stored"
    failed.hint = failed.hint or Hint(Action.LSS_SCAN) + Hint(
        Action.FIND_NODES, why=" and {} show the nodes on the bus"
    )
    return failed


def take_back(bus: CanopenBus, master: LssMaster, given: LssGiven) -> None:
    """Restore a node's old node-ID; verified by LSS and SDO, raises if it failed."""
    now = selected(master, given.address)
    if now == given.before and is_on(bus, given.address, given.node_id):
        now = given.node_id  # it tells the node-ID that it was given, and has the other one
    master.configure_node_id(given.before)
    if now != given.before:
        seen = bus.boot_ups(given.before)
        activate(master, now)
        if given.before != UNCONFIGURED:
            master.comes_up(given.before, seen, BOOT_UP_S)
        now = selected(master, given.address)
    master.let_wait()
    if now != given.before:
        raise NoAnswer(f"its node-ID by LSS is {told_id(now)}", state="unknown")
    if given.before != UNCONFIGURED:
        require_on(bus, given.address, given.before)
    if is_on(bus, given.address, given.node_id):
        raise NoAnswer(f"it answers as node {given.node_id}", state="unknown")


def answering_now(bus: CanopenBus, given: LssGiven) -> str:
    """Say which of the old and new node-ID of *given* answer SDO."""
    said = []
    for node_id in dict.fromkeys(
        candidate_id for candidate_id in (given.before, given.node_id) if candidate_id != UNCONFIGURED
    ):
        if is_on(bus, given.address, node_id):
            said.append(f"it answers as node {node_id}")
        else:
            said.append(f"{'another device' if answers(bus, node_id) else 'nobody'} answers as node {node_id}")
    return ", ".join(said)


def forget(session: SessionNodes, given: LssGiven) -> None:
    """Drop cached data of these node-IDs: they belong to another node now."""
    network = session.open_network()
    for node_id in (given.before, given.node_id):
        node = network.nodes.pop(node_id, None)
        if node is not None:
            node.release_lock()
        network.files.forget(node_id)
        # changes are remembered by device, whatever its node-ID
        network.order[:] = [known_id for known_id in network.order if known_id != node_id]
