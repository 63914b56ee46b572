"""Whether a node is the device that it was before its bus was gone. Reads nothing.

Does not know why it was looked at before, nor what is to be done with it.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

from dvtcli.domain.hint import Action, Hint
from dvtcli.errors import SafetyRefusal

if TYPE_CHECKING:
    from dvtcli.device.change.plan_document import Identity


def unlike_before(before: Identity, now: Identity) -> str:
    """How the identity (0x1018) that was read *now* differs from that of *before*; empty where it does not."""
    return ", ".join(
        f"{name} {_shown(now.get(name))}, was {_shown(known)}"
        for name, known in before.items()
        if now.get(name) != known
    )


def another_device(node_id: int, unlike: str) -> SafetyRefusal:
    """The error of whoever would go on with another device, *unlike* the one before, as if it were the same."""
    return SafetyRefusal(
        f"node {node_id} is another device than before the bus was gone",
        node=node_id,
        place="1018",
        why=unlike,
        hint=Hint(
            Action.SHOW_NODE, {"node": node_id}, "is this the right one? {} takes it as it is, and begins anew with it"
        ),
    )


def _shown(value: int | None) -> str:
    return "none" if value is None else f"0x{value:08X}"
