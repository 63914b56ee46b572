"""Tell whether a node is still the same device after its bus was lost. Reads nothing."""

from __future__ import annotations

from typing import TYPE_CHECKING

from dvtcli.domain.hint import Action, Hint
from dvtcli.errors import SafetyRefusal

if TYPE_CHECKING:
    from dvtcli.device.change.plan_document import Identity


def unlike_before(before: Identity, now: Identity) -> str:
    """The difference between the identities (0x1018) *before* and *now*; empty if equal."""
    return ", ".join(
        f"{name} {_shown(now.get(name))}, was {_shown(known)}"
        for name, known in before.items()
        if now.get(name) != known
    )


def another_device(node_id: int, unlike: str) -> SafetyRefusal:
    """The error for continuing on another device, with the difference *unlike*."""
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
