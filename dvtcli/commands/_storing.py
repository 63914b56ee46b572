"""What `store`, `restore` and a `write` to 0x1010 or 0x1011 share."""

from __future__ import annotations

from typing import TYPE_CHECKING

from dvtcli.device.store import RESTORE, STORE, reset_and_wait, return_to, sign
from dvtcli.domain.nmt import NmtCommand
from dvtcli.domain.plan import plan_pdo
from dvtcli.params import CanopenType, NumberType
from dvtcli.results import Stored

if TYPE_CHECKING:
    import click

    from dvtcli.device.node import Node
    from dvtcli.domain.pdo import Pdo, PdoConfig
    from dvtcli.session import Session

_GROUPS = {"all": 1, "communication": 2, "application": 3}


class StoreGroup(CanopenType):
    """`all`, `communication`, `application`, or a sub-index 1…127."""

    name = "group"

    def parse(self, text: str, ctx: click.Context | None) -> int:
        """The sub-index of 0x1010 or 0x1011."""
        if text.lower() in _GROUPS:
            return _GROUPS[text.lower()]
        return int(NumberType(1, 127, "all, communication, application, or a sub-index").parse(text, ctx))


def store_settings(session: Session, node: Node, sub_index: int | None, *, prove: bool) -> Stored:
    """Store what the node holds; with *prove* reset it and compare the PDOs that it comes back with."""
    node.prepare_store(force=session.options.force)
    before = node.pdos() if prove else {}
    done = sign(node.access, node.profile.store, STORE, sub_index, node.cancellation)
    changed = node.pending.forget(done.sub_index)
    node.pending.stored_at = len(node.history)
    proof = _proof(node, before) if prove else None
    if not session.dry_run:
        session.record(node.node_id, ["store" if sub_index is None else f"store {sub_index}"])
    return Stored(
        node.node_id, f"{done.index:04X}:{done.sub_index:02X}", "store", done.seconds, node.profile.store.timeout_s,
        changed, session.dry_run, len(before) if prove else None, tuple(proof or ()),
    )  # fmt: skip


def _proof(node: Node, before: dict[Pdo, PdoConfig]) -> list[str]:
    """Reset the node and name every PDO that is not what it was."""
    state = node.access.state()
    reset_and_wait(node.access, NmtCommand.RESET_NODE)
    node.was_reset(communication=False)
    after = node.pdos()
    differences = []
    for pdo, config in before.items():
        if pdo not in after:
            differences.append(f"{pdo.label} is gone")
        elif after[pdo] != config:
            step = plan_pdo(pdo, after[pdo], config).steps[0]
            held = "unset" if step.before is None else step.before[::-1].hex()
            differences.append(f"{pdo.label}: 0x{step.object} is 0x{held.upper()} after the reset")
    return_to(node.access, state)
    return differences


def restore_defaults(session: Session, node: Node, sub_index: int | None, *, prove: bool) -> Stored:
    """Ask the node for its defaults; they come with the next reset, which *prove* does at once."""
    session.consent(f"node {node.node_id} will lose what is set and stored, and take its defaults; restore?")
    node.prepare_store(force=session.options.force)
    done = sign(node.access, node.profile.store, RESTORE, sub_index, node.cancellation)
    reset = None
    if prove:
        command = NmtCommand.RESET_COMMUNICATION if done.sub_index == 2 else NmtCommand.RESET_NODE
        state = node.access.state()
        reset_and_wait(node.access, command)
        node.was_reset(communication=command is NmtCommand.RESET_COMMUNICATION)
        node.pdos()
        return_to(node.access, state)
        reset = "reset-comm" if done.sub_index == 2 else "reset-node"
    node.wanted.clear()
    node.pending.forget(done.sub_index)
    if not session.dry_run:
        session.record(node.node_id, ["restore" if sub_index is None else f"restore {sub_index}"])
    return Stored(
        node.node_id, f"{done.index:04X}:{done.sub_index:02X}", "restore", done.seconds, node.profile.store.timeout_s,
        (), session.dry_run, reset=reset,
    )  # fmt: skip
