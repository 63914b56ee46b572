"""`fpo`, `lg`, `store`: a node's NMT state, its access level, and what it keeps."""

from __future__ import annotations

from typing import TYPE_CHECKING

from dvtcli.cli.dvt.done import Done
from dvtcli.domain.nmt import NmtState

if TYPE_CHECKING:
    from dvtcli.cli.conversation import Conversation

_STATES = {"pre": NmtState.PRE_OPERATIONAL, "op": NmtState.OPERATIONAL}


def force(session: Conversation, node_id: int | None, state: str | None) -> Done:
    """Bring a node to PRE-OPERATIONAL (or with `op` to OPERATIONAL), in the way its family wants, and confirm it."""
    node, wanted = session.node(node_id), state or "pre"
    node.commanded()
    node.access.request(_STATES[wanted])
    if not session.dry_run:
        session.record.add(node.node_id, [f"fpo {node.node_id} {wanted}"])
    return Done()


def log_in_at(session: Conversation, node_id: int | None, level: int | None) -> Done:
    """Log in at *level*, None for the one that PDO work needs; the passcode is found as `login` finds it."""
    from dvtcli.cli.passcode import passcode
    from dvtcli.device.access_level import log_in, policy_of

    node = session.node(node_id)
    wanted = policy_of(node.access).needed if level is None else level
    log_in(node.access, wanted, lambda: passcode(session, node.node_id, wanted))
    if not session.dry_run:
        session.record.add(node.node_id, [f"login {wanted}"])
    return Done()


def store(session: Conversation, node_id: int | None) -> Done:
    """0x1010 "save", as the command `store`."""
    from dvtcli.operations.store_restore import store_settings

    store_settings(session, session.node(node_id), None)
    return Done()
