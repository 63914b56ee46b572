"""Store or restore the parameters of a node (0x1010, 0x1011), with a proof if requested."""

from __future__ import annotations

from contextlib import contextmanager
from dataclasses import replace
from functools import partial
from typing import TYPE_CHECKING

from dvtcli.device.resets import await_power_cycle, reset_and_wait, return_to
from dvtcli.device.stamped import NO_STAMP, held_stamp, stamp_changes
from dvtcli.device.store.pending import COMMUNICATION, EVERYTHING, GROUPS
from dvtcli.device.store.prove_restore import prove_restore, restart_and_read
from dvtcli.device.store.prove_store import (
    Restart,
    Snapshot,
    prepare_proof,
    prove_store,
    refuse_deaf_to_reset,
    refuse_unprovable,
)
from dvtcli.device.store.store_parameters import chosen, write_signature
from dvtcli.device.store.unstored import mark_stored, prepare_store, require_storable
from dvtcli.domain.hint import Action, Hint
from dvtcli.domain.nmt import NmtCommand
from dvtcli.domain.objects import RESTORE_PARAMETERS, STORE_PARAMETERS
from dvtcli.domain.plan import Plan
from dvtcli.domain.store import POWER, RESET_COMM, RESET_NODE, ProveBy
from dvtcli.errors import DeviceRefused, SdoAborted
from dvtcli.operations.results import Stored
from dvtcli.operations.session.consent import consent_to_reset

if TYPE_CHECKING:
    from collections.abc import Iterator, Sequence

    from dvtcli.device.node import Node
    from dvtcli.device.node_parts import NodeDescription, ReadableNode
    from dvtcli.device.store.store_parameters import StoreAnswer
    from dvtcli.device.target_config import ValueFormatter
    from dvtcli.operations.session.session import SessionNodes
    from dvtcli.operations.user.session_user import SessionUser

#: How long a power cycle is waited for, in seconds.
POWER_CYCLE_S = 60.0
_UNPROVED = Hint(Action.RESTORE, why="without a proof, then switch the node off and on")


def store_settings(
    session: SessionNodes,
    node: Node,
    sub_index: int | None,
    *,
    prove: ProveBy | None = None,
    if_changed: bool = False,
    wait_s: float = POWER_CYCLE_S,
    is_part_of_group: bool = False,
) -> Stored:
    """Store the node's parameters, and verify this session's changes: a restart may go unnoticed.

    *is_part_of_group*: stores of other nodes follow, after which all are verified. *prove* restarts the node (`reset`,
    or `power`, waiting *wait_s* seconds) and compares its PDOs. *if_changed* skips the store if the PDOs equal those
    of a received boot-up.
    """
    because = why_to_store(node, sub_index) if if_changed else ""
    if if_changed and not because:
        return _skipped(session, node, sub_index)
    restart = _agree_on_restart(session, node, prove, wait_s) if prove else None
    boot_ups = node.bus.boot_ups(node.node_id)
    before = place = None
    with _resetting(node, restart):
        prepare_store(node, force=session.options.force)
        if restart is not None:
            before = Snapshot.now(node)
            place = prepare_proof(node, before, sub_index, restart)
    stored_at = node.pending.stored_at
    done = write_signature(
        node.access,
        node.profile.store,
        STORE_PARAMETERS,
        sub_index,
        node.cancellation,
        node.dictionary,
        node.require_not_restarted,
    )
    node.gate.done.append(f"0x{done.place} acknowledged the store")
    refuse_after_restart(node, boot_ups, done)
    if restart is None and not (is_part_of_group or session.options.force):
        _refuse_lost(node, done)
    changed = node.pending.was_stored(done.sub_index, len(node.history))
    proof = (
        None
        if restart is None or before is None
        else prove_store(node, before, done, restart, place, _value_formatter(node))
    )
    if proof is not None and proof.differences and set(changed) <= set(proof.differing):
        node.pending.was_not_kept(stored_at)
    mark_stored(node, set(changed) - set(() if proof is None else proof.differing))
    if not session.dry_run:
        session.record.add(node.node_id, ["store" if sub_index is None else f"store {sub_index}"])
    return Stored(
        node.node_id, done.place, "store", done.seconds, node.profile.store.timeout_s, changed, session.dry_run, proof,
        because=because, prove_asked=prove is not None, all_known=node.guard is None and done.sub_index in GROUPS,
    )  # fmt: skip


@contextmanager
def _resetting(node: Node, restart: Restart | None) -> Iterator[None]:
    """A block in which the question before *node* leaves OPERATIONAL names the reset of *restart*."""
    node.gate.resets = restart is not None and restart.by != POWER  # a power cycle has a question of its own
    try:
        yield
    finally:
        node.gate.resets = False


def look_before_stores(
    session: SessionNodes, node_ids: Sequence[int], sub_index: int | None, *, prove: ProveBy | None = None
) -> None:
    """Check all nodes before the first store: raises if a node must not store, cannot, or could not prove it.

    Reads the PDOs of all nodes, since a store cannot be rolled back if a later node refuses.
    """
    for node_id in node_ids:
        node = session.node(node_id)
        require_storable(node, force=session.options.force)
        if prove and not session.dry_run:
            refuse_unprovable(node, sub_index, certain=prove == POWER)
        else:
            chosen(node.access, node.profile.store, STORE_PARAMETERS, sub_index, node.dictionary)


def look_before_restores(
    session: SessionNodes, node_ids: Sequence[int], sub_index: int | None, *, prove: bool = False
) -> None:
    """Check all nodes before the first restore: raises if a node must not restore, cannot, or could not prove it."""
    for node_id in node_ids:
        node = session.node(node_id)
        if prove and not session.dry_run:
            refuse_deaf_to_reset(node, _UNPROVED)
        require_storable(node, force=session.options.force, confirm=False)
        chosen(node.access, node.profile.store, RESTORE_PARAMETERS, sub_index, node.dictionary)


def refuse_after_restart(node: ReadableNode, boot_ups: int, answer: StoreAnswer) -> None:
    """Raises DeviceRefused if *node* restarted between its last read and the acknowledged store in *answer*."""
    if node.bus.boot_ups(node.node_id) != boot_ups:
        raise DeviceRefused(
            f"node {node.node_id} restarted just before or during the store: its stored values were not read",
            node=node.node_id,
            why=f"0x{answer.place} acknowledged the store",
            hint=Hint(Action.VERIFY, why="{}, set the differences again, then store again"),
            state="unknown",
        )


def _refuse_lost(node: Node, answer: StoreAnswer) -> None:
    """Raises DeviceRefused if changed values of *node* differ after the acknowledged store in *answer*."""
    lost = node.expected.lost(node, node.pending.covered(answer.sub_index))
    if lost:
        raise DeviceRefused(
            f"node {node.node_id} does not have the values to be stored: {lost[0]}",
            node=node.node_id,
            why="; ".join(
                [
                    f"0x{answer.place} acknowledged the store; it restarted silently, or alters the value",
                    *lost[1:],
                ]
            ),
            hint=Hint(Action.VERIFY, why="{}, set the differences again, then store again"),
            state="unknown",
        )


def why_to_store(node: Node, sub_index: int | None) -> str:
    """Say why the node's values may differ from its stored ones; empty if unwritten since boot-up."""
    if sub_index not in (None, EVERYTHING, COMMUNICATION):
        return f"the objects of group {sub_index} are unknown"
    node.begin_change()  # from here on no other dvtcli writes to it
    if node.bus.downloads_of_others(node.node_id):
        return "another SDO client wrote to it since its last boot-up"
    known = replace(node.boot_snapshot, pdos=dict(node.boot_snapshot.pdos))  # reading again would count as what came up
    boot_ups, now = node.bus.boot_ups(node.node_id), node.pdos()
    return known.why_not(node.bus.boot_ups(node.node_id), now) or (
        "it restarted during the check" if node.bus.boot_ups(node.node_id) != boot_ups else ""
    )


def _skipped(session: SessionUser, node: NodeDescription, sub_index: int | None) -> Stored:
    place = f"{STORE_PARAMETERS:04X}:{sub_index or 1:02X}"
    skipped = "nothing was written since the node's boot-up, and its PDOs are the same as at boot-up"
    return Stored(node.node_id, place, "store", 0.0, node.profile.store.timeout_s, (), session.dry_run, skipped=skipped)


def _agree_on_restart(session: SessionNodes, node: ReadableNode, way: ProveBy, wait_s: float) -> Restart | None:
    """Ask for consent and choose the restart; None on a twin, where a restart proves nothing."""
    if session.dry_run:
        return None
    if way == "power":
        session.consent(
            f"node {node.node_id} must be switched off and on after the store; will you do that?", node.node_id
        )
        return Restart(POWER, lambda: _power_cycle(session, node, wait_s))
    consent_to_reset(session, [node.node_id])
    return Restart(RESET_NODE, lambda: reset_and_wait(node.access, NmtCommand.RESET_NODE))


def _power_cycle(session: SessionUser, node: ReadableNode, wait_s: float) -> None:
    text = f"switch node {node.node_id} off and on now; waiting {wait_s:g} s at most for its boot-up"

    def stop() -> None:
        if node.cancellation.requested:
            raise KeyboardInterrupt

    with node.cancellation.deferred():  # a Ctrl-C is obeyed between two moments of waiting
        await_power_cycle(node.access, wait_s, lambda: session.reporter.instruct(text), stop)


def restore_defaults(session: SessionNodes, node: Node, sub_index: int | None, *, prove: bool) -> Stored:
    """Restore the node's defaults (0x1011), active after its next reset; *prove* resets and reads it."""
    asked, prove = prove, prove and not session.dry_run  # a twin has no defaults but those of its file
    resets = ", and is reset now" if prove else ""
    session.consent(
        f"node {node.node_id} will lose its settings and stored values and return to its defaults{resets}; restore?",
        node.node_id,
    )
    if prove:
        refuse_deaf_to_reset(node, _UNPROVED)
        consent_to_reset(session, [node.node_id])
    prepare_store(node, force=session.options.force, confirm=False)
    communication = sub_index == COMMUNICATION
    command = NmtCommand.RESET_COMMUNICATION if communication else NmtCommand.RESET_NODE
    restart = Restart(
        RESET_COMM if communication else RESET_NODE,
        lambda: reset_and_wait(node.access, command),
        communication=communication,
    )
    state = node.access.state() if prove else None
    before, lost = _before_restore(node, restart) if prove else (None, ())
    node.require_not_restarted()
    _end_stamp_before(session, node, sub_index)
    done = write_signature(
        node.access,
        node.profile.store,
        RESTORE_PARAMETERS,
        sub_index,
        node.cancellation,
        node.dictionary,
        node.require_not_restarted,
    )
    node.gate.done.append(f"0x{done.place} acknowledged the restore")
    proof = prove_restore(node, done, restart, before, lost, _value_formatter(node)) if prove else None
    return_to(node.access, state)
    node.wanted.clear()
    if proof is None or not proof.differences:  # what is not restored is looked at again the next time
        node.wanted_values.clear()
        node.unreadable_values.clear()
    node.expected.clear()
    node.pending.forget(done.sub_index)
    if proof is not None:
        node.pending.was_restored(len(node.history))
    else:
        node.await_restart()
    if not session.dry_run:
        session.record.add(node.node_id, ["restore" if sub_index is None else f"restore {sub_index}"])
    return Stored(
        node.node_id, done.place, "restore", done.seconds, node.profile.store.timeout_s, (), session.dry_run, proof,
        prove_asked=asked,
    )  # fmt: skip


def _end_stamp_before(session: SessionUser, node: Node, sub_index: int | None) -> None:
    """End our stamp on *node* before its defaults are restored: its values are no longer stored."""
    held = held_stamp(node)
    if held is not None and held.is_own:  # a device that has no defaults keeps its stamp
        chosen(node.access, node.profile.store, RESTORE_PARAMETERS, sub_index, node.dictionary)
        end_stamp(session, node, "a node that is no longer stored loses its stamp")


def end_stamp(session: SessionUser, node: Node, why: str) -> bool:
    """Write 0 to 0x1020 of *node* if it holds our stamp, and report *why*; returns whether it did."""
    held = held_stamp(node)
    if held is not None and held.is_own:
        session.reporter.note(f"0x1020 of node {node.node_id} <- 0: {why}")
        ending = stamp_changes(held, NO_STAMP, why)
        node.apply(Plan(node.node_id, ending), force=session.options.force, remembered=False)
        return True
    return False


def _before_restore(node: Node, restart: Restart) -> tuple[Snapshot | None, tuple[str, ...]]:
    """Read *node* before a restore; also lists read losses: boot-up values are unknown without its EDS."""
    if node.dictionary is None or node.unlike_file:
        return restart_and_read(node, restart)
    try:
        return Snapshot.now(node), ()
    except SdoAborted:  # a node that refuses to be read is not kept from its defaults
        return None, ()


def _value_formatter(node: NodeDescription) -> ValueFormatter:
    """Return the printing of values of *node*, as used on all screens."""
    from dvtcli.operations.values.object_values import planned_words

    return partial(planned_words, node)
