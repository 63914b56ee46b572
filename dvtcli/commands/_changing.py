"""What commands that change PDOs share: from a request to an answered change."""

from __future__ import annotations

import time
from collections.abc import Callable, Iterable
from typing import TYPE_CHECKING

from dvtcli.domain.plan import PdoChange
from dvtcli.domain.script_line import change_lines
from dvtcli.errors import UsageError
from dvtcli.results import Changed

if TYPE_CHECKING:
    from dvtcli.device.node import Applied, Node
    from dvtcli.domain.pdo import Pdo, PdoConfig
    from dvtcli.domain.rules import Proposal
    from dvtcli.session import Session


def configure(session: Session, node: Node, wants: dict[Pdo, PdoConfig]) -> Changed:
    """Carry *wants* out on *node* and answer what was done."""
    started = time.monotonic()
    applied = node.configure(wants, force=session.options.force)
    return changed(session, node, applied, time.monotonic() - started)


def changed(session: Session, node: Node, applied: Applied, seconds: float, *, undone: bool = False) -> Changed:
    """The answer to an applied plan; what changed something is remembered as script lines."""
    if len(applied.plan) and not session.dry_run:
        session.record(node.node_id, change_lines(applied.plan))
    return Changed(
        node.node_id,
        applied.plan,
        applied.findings,
        session.dry_run,
        seconds,
        undone,
        names(node, applied.plan.changes),
    )


def names(node: Node, changes: Iterable[object]) -> dict[str, str]:
    """Names of the objects that *changes* map, by their printed form."""
    found: dict[str, str] = {}
    for change in changes:
        if isinstance(change, PdoChange) and node.dictionary is not None:
            for entry in change.after.mapping:
                found[entry.object] = node.dictionary.display_name(entry.index, entry.sub_index)
    return found


def wanted(node: Node, pdo: Pdo, make: Callable[[Proposal], PdoConfig]) -> PdoConfig:
    """What *make* wants of *pdo*, given the PDO as it is; its ValueErrors become usage errors."""
    now = node.pdo(pdo)
    try:
        return make(node.proposal(pdo, now, now))
    except ValueError as wrong:
        raise UsageError(f"{pdo.label}: {wrong}", node=node.node_id) from wrong
