"""Whether any known node sends an RPDO's CAN-ID. Pure."""

from __future__ import annotations

from collections.abc import Collection, Iterable, Iterator

from dvtcli.domain.cob_id import CobId
from dvtcli.domain.hint import Action, Hint
from dvtcli.domain.pdo import PdoConfig
from dvtcli.domain.plan import PdoChange
from dvtcli.domain.rules.finding import WARNING, Finding, Rule, warning

RULES = (
    Rule("rpdo-producer", WARNING,
         "no known node transmits the frames of an RPDO, and the family then reports a fault", "the family"),
)  # fmt: skip


def sent_by(pdos: Iterable[PdoConfig]) -> Iterator[tuple[int, bool]]:
    """CAN-ID, and whether it has 29 bits, of every enabled TPDO in *pdos*."""
    return (_identifier(config.communication.cob_id) for config in pdos if config.enabled)


def producer_findings(
    changes: Iterable[PdoChange], sent: Collection[tuple[int, bool]], consequence: str
) -> Iterator[Finding]:
    """A warning for each RPDO that *changes* enable or move to a CAN-ID that is not *sent* by a known node.

    *consequence* is the device's reaction to missing frames.
    """
    for change in changes:
        before, after = change.before.communication.cob_id, change.after.communication.cob_id
        if change.pdo.is_tpdo or not after.valid or before == after or _identifier(after) in sent:
            continue
        text = f"{change.label} waits for {after}, which no node that was read transmits: {consequence}"
        hint = Hint(Action.DISABLE, {"pdo": change.pdo}, "map it into a TPDO of another node, or {}")
        yield warning("rpdo-producer", f"0x{change.pdo.communication_index:04X}:01", text, hint)


def _identifier(cob_id: CobId) -> tuple[int, bool]:
    return cob_id.can_id, cob_id.extended
