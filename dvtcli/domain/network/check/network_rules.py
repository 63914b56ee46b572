"""All rules of `check`, and their evaluation."""

from __future__ import annotations

from collections.abc import Collection, Iterator

from dvtcli.domain.lint import LintRule, RuleCheck, checks_of
from dvtcli.domain.network.check import (
    check_bus,
    check_can_ids,
    check_heartbeats,
    check_layouts,
    check_nodes,
    check_received,
    check_sync,
)
from dvtcli.domain.network.check.checked_network import CheckedNetwork, NetSpot

CHECKS: list[RuleCheck[CheckedNetwork, NetSpot]] = [
    *checks_of(
        check_can_ids, check_layouts, check_sync, check_heartbeats, check_bus, check_nodes, check_received,
    ),
    *check_layouts.OF_EACH_PDO,
]  # fmt: skip
#: Rules that compare a file's network with the nodes on a bus.
AGAINST_FILE: tuple[LintRule, ...] = tuple(
    check.rule for check in checks_of(check_nodes) if check.rule.name != "nobody-starts"
)
#: Network rules covered by a more detailed rule of a change: reported once per PDO.
SAME_RULES: dict[str, tuple[str, ...]] = {
    "one-producer": ("can-id-clash",),
    **dict.fromkeys(
        ("can-id-of-nmt", "can-id-of-sdo", "can-id-of-heartbeat", "can-id-of-lss", "can-id-reserved"),
        ("can-id-restricted",),
    ),
    **dict.fromkeys(("can-id-of-sync", "can-id-of-emcy", "can-id-of-time"), ("can-id-in-use",)),
    "rpdo-without-producer": ("rpdo-producer",),
    "too-long": ("pdo-length",),
    "heartbeat-and-guarding": ("link-guarded",),
    "reserved-type": ("transmission-type",),
    "hears-no-command": ("link-command",),
    "hears-no-target": ("link-target",),
    "part-of-object": ("link-part",),
    "data-type": ("link-type",),
    "unwatched-link": ("link-unwatched",),
}
#: Network rules that are more detailed, or stronger, than a change's rule about the same PDO.
SUPERSEDED: dict[str, tuple[str, ...]] = dict.fromkeys(("frame-too-short", "frame-too-long"), ("consumer-length",))
#: Rules about a device's limits: if it holds a PDO that breaks them, its maker allows more than the standard.
OF_ONE_DEVICE = frozenset(
    {"can-id-reserved", "too-long", "reserved-type", *(check.rule.name for check in check_layouts.OF_EACH_PDO)}
)
#: Rules that need only a node's COB-IDs.
OF_COB_IDS = frozenset(
    {
        "one-producer", "can-id-of-sdo", "can-id-of-sync", "can-id-of-emcy", "can-id-of-time", "emcy-twice",
        "two-times", "two-syncs",
    }
)  # fmt: skip
#: All rules.
NETWORK_RULES: tuple[LintRule, ...] = tuple(check.rule for check in CHECKS)


def network_findings(network: CheckedNetwork, wanted: Collection[str]) -> Iterator[tuple[LintRule, NetSpot, str]]:
    """All findings of the rules named in *wanted* about *network*."""
    for check in CHECKS:
        if check.rule.name in wanted:
            yield from ((check.rule, spot, text) for spot, text in check.look(network))
