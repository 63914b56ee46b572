"""Findings of the `map` rules about the PDOs at power-on, with their severity for a file."""

from __future__ import annotations

import re
from functools import partial

from dvtcli.domain.lint.described import HELD, DescribedDevice, Found, Spot
from dvtcli.domain.lint.lint_rule import ERROR, NOTE, WARNING, LintRule, RuleCheck
from dvtcli.domain.profile import Severity
from dvtcli.domain.rules import can_id, communication, entry_length, mappable, mapped_object
from dvtcli.domain.rules.finding import Rule

_PLACE = re.compile(r"0x([0-9A-F]{4}):([0-9A-F]{2})")
_DECLARED: dict[str, Rule] = {
    rule.name: rule for file in (can_id, communication, entry_length, mappable, mapped_object) for rule in file.RULES
}


def _judged(
    name: str, severity: Severity, sense: str, of: str = "", meant: Severity = ERROR
) -> RuleCheck[DescribedDevice, Spot]:
    """A check that reports the `map` rule *of* (default: the same name), from severity *meant* on."""
    rule = LintRule(name, severity, f"a PDO of the file {sense}", _DECLARED[of or name].source)
    return RuleCheck(rule, partial(_look, of or name, meant))


def _look(name: str, meant: Severity, device: DescribedDevice) -> Found:
    for finding in device.judged:
        place = _PLACE.fullmatch(finding.place)
        if finding.rule == name and finding.severity is meant and place is not None:
            index, sub_index = int(place[1], 16), int(place[2], 16)
            if name == "object-exists" and (device.number(index, sub_index) or 0) >> 16 in device.added:
                continue  # which modules are connected, and so how many sub-indices there are, is not known
            yield Spot(index, sub_index, HELD), finding.text


#: The other rules of `map` judge a requested change.
CHECKS = (
    _judged("object-exists", ERROR, "maps an object that is not in it"),
    _judged("direction", ERROR, "sends what cannot be read, or receives what cannot be written"),
    _judged("mappable", ERROR, "maps what has PDOMapping=0"),
    _judged("read-write-object", WARNING, "sends what is for RPDOs (rww)"),
    _judged("entry-length", ERROR, "maps another length than the object's, or none, or more than 64 bits"),
    _judged("granularity", ERROR, "maps a length that is no multiple of Granularity"),
    _judged("pdo-length", ERROR, "maps more than 64 bits"),
    _judged("dummy-direction", ERROR, "is a TPDO and skips bits"),
    _judged("dummy-supported", ERROR, "skips bits by a dummy that DummyUsage does not allow"),
    _judged("dummy-length", ERROR, "maps a dummy of another length than its type"),
    _judged("double-target", ERROR, "is an RPDO and maps an object twice"),
    _judged("several-writers", NOTE, "receives an object that another enabled RPDO receives, too", "double-target",
            WARNING),
    _judged("transmission-type", ERROR, "has a reserved transmission type, or one on RTR that its COB-ID forbids"),
    _judged("can-id-length", ERROR, "has a CAN-ID of more than 11 bits without bit 29 (frame)"),
    _judged("can-id-restricted", ERROR, "is enabled on a CAN-ID that CiA 301 restricts"),
    _judged("can-id-in-use", ERROR, "is enabled on the CAN-ID of SYNC or of the node's EMCY"),
    _judged("can-id-elsewhere", WARNING, "is enabled on the CAN-ID of TIME or of another node's EMCY", "can-id-in-use",
            WARNING),
    _judged("can-id-clash", ERROR, "is enabled on the CAN-ID of another enabled one"),
)  # fmt: skip
