"""`fpo`, `lg`, `store`: a node's NMT state, access level and non-volatile memory."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING, Any

from dvtcli.cli.dvt.notation import level
from dvtcli.cli.dvt.word import MAYBE_NODE, Argument, DvtWord, WordResult
from dvtcli.cli.effect import Effect, Final
from dvtcli.domain.nmt import NmtState

if TYPE_CHECKING:
    from dvtcli.cli.conversation import Conversation
    from dvtcli.operations.session.session_nodes import SessionNodes

_STATES = {"pre": NmtState.PRE_OPERATIONAL, "op": NmtState.OPERATIONAL}


def force(session: SessionNodes, node_id: int | None, state: str | None) -> WordResult:
    """Bring a node to PRE-OPERATIONAL (with `op` OPERATIONAL) in its family's way, and confirm the state."""
    node, wanted = session.node(node_id), state or "pre"
    node.commanded()
    node.access.request(_STATES[wanted])
    if not session.dry_run:
        session.record.add(node.node_id, [f"fpo {node.node_id} {wanted}"])
    return WordResult()


def log_in_at(session: Conversation, node_id: int | None, asked: int | None) -> WordResult:
    """Log in at the level *asked*, None for the level of PDO work; finds the passcode as `login` does."""
    from dvtcli.cli.passcode import passcode
    from dvtcli.device.access_level import log_in, policy_of

    node = session.node(node_id)
    wanted = policy_of(node.access).needed if asked is None else asked
    log_in(node.access, wanted, lambda: passcode(session, node.node_id, wanted))
    if not session.dry_run:
        session.record.add(node.node_id, [f"login {wanted}"])
    return WordResult()


def store(session: SessionNodes, node_id: int | None) -> WordResult:
    """0x1010 "save", as the command `store`."""
    from dvtcli.operations.changes.store_restore import store_settings

    store_settings(session, session.node(node_id), None)
    return WordResult()


def _final(values: Sequence[Any]) -> Final | None:
    return Final("fpo op") if "op" in values else None


def _state(text: str) -> str:
    if text not in _STATES:
        raise ValueError(f"{text}: the state is pre or op")
    return text


WORDS = (
    DvtWord(
        "fpo", (MAYBE_NODE, Argument("pre|op", _state, required=False)),
        "force pre-operational (pre) or operational (op)", "nmt preop", Effect.COMMANDS, force, _final,
    ),
    DvtWord(
        "lg", (MAYBE_NODE, Argument("LEVEL", level, required=False)),
        "log in at a level, 0 to log out", "login 4", Effect.COMMANDS, log_in_at,
    ),
    DvtWord("store", (MAYBE_NODE,), "keep what is set (in Tcl; elsewhere the command)", "store", Effect.KEEPS, store),
)  # fmt: skip
