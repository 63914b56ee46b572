"""Set a node's node-ID by LSS, verified at the new node-ID, and store it."""

from __future__ import annotations

from collections.abc import Sequence
from contextlib import suppress
from dataclasses import replace
from typing import TYPE_CHECKING

from dvtcli.device.lss_master import LssMaster
from dvtcli.domain.can_ids import HEARTBEAT_BASE
from dvtcli.domain.hint import Action, Hint, as_hint
from dvtcli.domain.lss_services import LssAddress
from dvtcli.domain.nmt import UNCONFIGURED
from dvtcli.domain.text import join_some
from dvtcli.errors import DeviceRefused, DvtcliError, LeftChanged, NoAnswer, SafetyRefusal, UsageError
from dvtcli.operations.lss.lss_find import address_of, answers, is_on, lss_bus, require_on, selected
from dvtcli.operations.results.lss_nodes import LssChanged, LssGiven
from dvtcli.operations.session.consent import consent_to_reset, refuse_other_master

if TYPE_CHECKING:
    from dvtcli.domain.ports import CanopenBus, Frame
    from dvtcli.operations.session.session import SessionNodes

#: How long a node may take to boot up with its new node-ID (s).
BOOT_UP_S = 3.0


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
    received = node_id in received_node_ids(session)
    if received or answers(session.bus, node_id):
        raise SafetyRefusal(
            f"node-ID {node_id} is in use: a node {'sends frames' if received else 'answers'} with it",
            node=node_id,
            hint=Hint(Action.SHOW_NODE, {"node": node_id}, "choose another node-ID; {} shows the node that has it"),
        )


def received_node_ids(session: SessionNodes) -> set[int]:
    """Return node-IDs of heartbeats and boot-ups; raises SafetyRefusal if another master is active meanwhile."""
    received: set[int] = set()

    def note(frame: Frame, sent: bool) -> None:
        if not sent and not frame.extended and 1 <= frame.can_id - HEARTBEAT_BASE <= 127:
            received.add(frame.can_id - HEARTBEAT_BASE)

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
        raise _rolled_back(bus, master, given, failed) from failed
    forget(session, given)


def activate(master: LssMaster, before: int) -> None:
    """Activate a node-ID: the first by waiting, a changed node-ID by a reset."""
    master.let_wait()
    if before != UNCONFIGURED:
        master.reset_communication(before)


def _rolled_back(bus: CanopenBus, master: LssMaster, given: LssGiven, failed: DvtcliError) -> DvtcliError:
    """Return *failed* with the node's state after its old node-ID was restored; LeftChanged if it was not.

    Checked by LSS, and by SDO at the old and the new node-ID.
    """
    try:
        roll_back_node_id(bus, master, given)
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


def roll_back_node_id(bus: CanopenBus, master: LssMaster, given: LssGiven) -> None:
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
        network.change_order[:] = [change for change in network.change_order if change.node_id != node_id]


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
    with LssMaster(bus) as master, session.cancellation.deferred():
        stored = store(master, LssGiven(address, node_id, node_id))
        return LssChanged("store", (prove_by_reset(session, master, stored) if prove else stored,))


def store(master: LssMaster, given: LssGiven) -> LssGiven:
    """Store a node's node-ID; raises SafetyRefusal if it has another by LSS."""
    now = selected(master, given.address)
    if now != given.node_id:
        raise SafetyRefusal(
            f"the node with {given.address} has node-ID {told_id(now)}, not {given.node_id}",
            node=given.node_id,
            hint=Hint(Action.FIND_NODES, why="nothing was stored; {} lists the nodes on the bus"),
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
            f"node {node_id} sent no boot-up message after its reset: the store is not proved",
            node=node_id,
            why="but it answers with its node-ID",
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
        f"node {given.node_id} confirmed the store of its node-ID, but did not start with it after a reset",
        node=given.node_id, why=f"{failed.text}; {now}", state="left_changed",
        hint="lss scan and scan show the nodes on the bus",
    )  # fmt: skip


def store_all(
    bus: CanopenBus, master: LssMaster, kept: Sequence[LssGiven], given: Sequence[LssGiven], steps: Sequence[LssGiven]
) -> list[LssGiven]:
    """Store the node-ID of each of *given*; raises after all have, and have stored, their state before *steps*.

    The unchanged nodes *kept* come first: their earlier stored node-ID is unknown, and cannot be restored. LeftChanged
    says who has stored, and which node-ID each node has.
    """
    stored: list[LssGiven] = []
    for slave in (everybody := [*kept, *given]):
        try:
            stored.append(store(master, slave))
        except DvtcliError as failed:
            failed.node = slave.node_id
            refused = isinstance(failed, DeviceRefused)
            failed.details.append(("refused" if refused else "silent", _who(slave)))
            if stored:
                failed.details.append(("stored", join_some([_who(other) for other in stored])))
            if slave in kept:
                raise _partly_stored(bus, master, stored, everybody, steps, failed) from failed
            doubtful = [] if refused else [slave]
            raise _unstored(bus, master, kept, [*stored[len(kept) :], *doubtful], steps, failed) from failed
    return stored


def prove_all(session: SessionNodes, master: LssMaster, stored: Sequence[LssGiven]) -> list[LssGiven]:
    """Reset each of *stored*, and verify its node-ID; an error names the nodes not checked."""
    proved: list[LssGiven] = []
    for number, slave in enumerate(stored, 1):
        try:
            proved.append(prove_by_reset(session, master, slave))
        except DvtcliError as failed:
            if proved:
                failed.details.append(("proved", join_some([_who(other) for other in proved])))
            if stored[number:]:
                failed.details.append(
                    ("stored", f"{join_some([_who(other) for other in stored[number:]])}, not proved")
                )
            raise
    return proved


def all_back(
    bus: CanopenBus, master: LssMaster, done: Sequence[LssGiven], failed: DvtcliError, *, at: LssGiven | None = None
) -> DvtcliError:
    """Return *failed* after those *done* have their old state; LeftChanged with each node's state if not.

    *at* is the node that failed, None: after all.
    """
    stuck: list[str] = []
    for slave in reversed(done):
        try:
            roll_back_node_id(bus, master, slave)
        except DvtcliError as silent:
            stuck.append(f"{slave.name}: {silent.text}")
    if not stuck and not isinstance(failed, LeftChanged):
        if done and failed.state == "rolled_back":
            failed.state_text = "all nodes have their old node-IDs; nothing is stored"
        return failed
    why = "; ".join([*([failed.why] if failed.why else []), *stuck])
    error = LeftChanged(failed.text, node=failed.node, why=why, state="left_changed")
    error.details += [*failed.details, *_who_has_what(bus, master, [*done, *([at] if at else [])])]
    error.hint = Hint(Action.LSS_SCAN, why="nothing is stored: switch those with a new node-ID off and on, then {}")
    return error


def _who_has_what(bus: CanopenBus, master: LssMaster, done: Sequence[LssGiven]) -> list[tuple[str, str]]:
    """List each node's current node-ID by LSS and SDO, as lines of an error."""
    lines: list[tuple[str, str]] = []
    for address, before in {slave.address: slave.before for slave in reversed(done)}.items():
        name, last = next((slave.name, slave) for slave in reversed(done) if slave.address == address)
        try:
            now = f"has node-ID {told_id(selected(master, address))}"
        except DvtcliError as silent:
            now = f"has a node-ID that is not known ({silent.text})"
        master.let_wait()
        seen = answering_now(bus, replace(last, before=before))
        lines.append(("now", f"{name} {now}, before {told_id(before)}; {seen}"))
    return lines


def _partly_stored(
    bus: CanopenBus, master: LssMaster, stored: Sequence[LssGiven], kept: Sequence[LssGiven], steps: Sequence[LssGiven],
    failed: DvtcliError,
) -> DvtcliError:  # fmt: skip
    """Return *failed* if an unchanged node did not store, after the others were rolled back."""
    error = all_back(bus, master, steps, failed)
    if error is failed and not stored and isinstance(failed, DeviceRefused):
        failed.state = "unchanged"
        failed.state_text = "all nodes have their old node-IDs; nothing new is stored"
        return failed
    done = {slave.address for slave in stored}
    others = [slave for slave in kept if slave.address not in done and slave.before == slave.node_id]
    if error is failed:
        error = LeftChanged(failed.text, node=failed.node, why=failed.why, state="left_changed")
        error.details += failed.details
        error.hint = store_again(
            [other.node_id for other in others], "before the next power-off repeat the command, or"
        )
    error.details.append(
        ("unknown", f"{join_some(other.name for other in others)} may have another node-ID after the next power-on")
    )
    return error


def _unstored(
    bus: CanopenBus, master: LssMaster, kept: Sequence[LssGiven], stored: Sequence[LssGiven], steps: Sequence[LssGiven],
    failed: DvtcliError,
) -> DvtcliError:  # fmt: skip
    """Return *failed* after all have their state before *steps*, stored if they may have *stored* another."""
    error = all_back(bus, master, steps, failed)
    left: list[str] = []
    for slave in stored:
        try:
            store(master, replace(slave, node_id=slave.before))
        except DvtcliError as stuck:
            left.append(f"{_who(slave)} may have node-ID {slave.node_id} stored: {stuck.text}")
    if error is failed and not left:
        failed.state = "rolled_back"
        again = f"; {join_some([stored_slave.name for stored_slave in stored])} stored that again" if stored else ""
        again += f"; {join_some([kept_slave.name for kept_slave in kept])} stored its old node-ID" if kept else ""
        failed.state_text = f"all nodes have their old node-IDs{again}; none has stored a new node-ID"
        failed.hint = Hint(
            Action.GIVE, {"store": True}, "the same command without {} gives the new node-IDs until the next power-off"
        )
        return failed
    why = "; ".join([*([error.why] if error is not failed and error.why else []), *left])
    changed = LeftChanged(failed.text, node=failed.node, why=why, state="left_changed")
    changed.details += error.details
    who = Hint(Action.LSS_SCAN, why="before the next power-off: {}")
    who += Hint(Action.FIND_NODES, why=" and {} show the node-IDs, then")
    changed.hint = store_again([stored_slave.before for stored_slave in stored], who)
    return changed


def store_again(node_ids: Sequence[int], first: Hint | str) -> Hint:
    """Suggest *first*, then or else a store on *node_ids*, as a single command if many."""
    known = [node_id for node_id in node_ids if node_id != UNCONFIGURED]
    one_by_one: list[int | None] = [*known] if len(known) <= _SINGLY else [None]
    hint = as_hint(first)
    if node_ids and not known:
        return hint + " let these have a node-ID anew, and store it"
    for number, node_id in enumerate(one_by_one):
        arguments = {} if node_id is None else {"of": node_id}
        hint += Hint(Action.LSS_STORE, arguments, ", {}" if number else " {}")
    return hint


#: up to this number of nodes, a hint has a store command for each
_SINGLY = 3


def _who(one: LssGiven) -> str:
    return f"{one.name} (node-ID {told_id(one.node_id)}, before {told_id(one.before)})"
