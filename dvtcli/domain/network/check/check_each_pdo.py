"""Findings of the `map` rules about the PDOs of a network's nodes."""

from __future__ import annotations

import re
from functools import partial

from dvtcli.domain.lint.lint_rule import ERROR, WARNING, LintRule, RuleCheck
from dvtcli.domain.network.check.checked_network import CheckedNetwork, NetFound, NetSpot
from dvtcli.domain.profile import Severity
from dvtcli.domain.rules import (
    can_id,
    communication,
    entry_length,
    mapped_object,
    pdo_mapping,
)
from dvtcli.domain.rules.finding import Rule

_PLACE = re.compile(r"0x([0-9A-F]{4}):([0-9A-F]{2})")
_DECLARED: dict[str, Rule] = {
    rule.name: rule for file in (can_id, communication, entry_length, pdo_mapping, mapped_object) for rule in file.RULES
}


def _judged(name: str, severity: Severity, sense: str, of: str = "") -> RuleCheck[CheckedNetwork, NetSpot]:
    """A check that reports the `map` rule *of* (default: the same name), at the same severity."""
    rule = LintRule(name, severity, f"an enabled PDO {sense}", _DECLARED[of or name].source)
    return RuleCheck(rule, partial(_look, of or name, severity))


def _look(name: str, severity: Severity, network: CheckedNetwork) -> NetFound:
    for node_id, pdo, finding in network.judged:
        if finding.rule == name and finding.severity is severity:
            place = _PLACE.fullmatch(finding.place)
            index, sub_index = (int(place[1], 16), int(place[2], 16)) if place else (None, 0)
            yield NetSpot(node_id, pdo, index, sub_index), finding.text


#: The other rules judge a requested change, or have a network rule of their own.
CHECKS = (
    _judged("object-exists", ERROR, "maps an object that the device does not have"),
    _judged("direction", ERROR, "sends an unreadable object, or receives a read-only object"),
    _judged("mappable", ERROR, "maps an object with PDOMapping=0"),
    _judged("read-write-object", WARNING, "sends an object for RPDOs (rww)"),
    _judged("object-for-rpdos", ERROR, "sends an object for RPDOs (rww) on a device that refuses it",
            "read-write-object"),
    _judged("entry-length", ERROR, "maps a length other than the object's, 0 bits, or more than 64 bits"),
    _judged("granularity", ERROR, "maps a length that is not a multiple of Granularity"),
    _judged("dummy-direction", ERROR, "is a TPDO and skips bits"),
    _judged("dummy-supported", ERROR, "skips bits with a dummy that the device does not have"),
    _judged("dummy-length", ERROR, "maps a dummy with a length other than its type's"),
    _judged("double-target", ERROR, "is an RPDO and maps an object twice"),
    _judged("can-id-length", ERROR, "has a CAN-ID of more than 11 bits without bit 29 (frame)"),
    _judged("extended-id", ERROR, "has a CAN-ID of 29 bits on a device that takes 11"),
    _judged("rtr-bit", ERROR, "has the wrong bit 30 for its family"),
)  # fmt: skip
