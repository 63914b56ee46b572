"""What the rules of `map` say of the PDOs that a file comes up with.

The decisions are those of `rules`; here stands which of them a file is held against, and how bad that is in a file.
"""

from __future__ import annotations

import re
from functools import partial

from dvtcli.domain.lint.described import HELD, Described, Found, Spot
from dvtcli.domain.lint.lint_rule import ERROR, NOTE, WARNING, Check, LintRule
from dvtcli.domain.rules import can_id, communication, entry_length, mappable, mapped_object
from dvtcli.domain.rules.rule import Rule

#: A rule of `map` -> how bad it is where a PDO of the file breaks it. The others are about what a change asks for.
_SEVERITIES = {
    "object-exists": ERROR,
    "direction": ERROR,
    "mappable": ERROR,
    "read-write-object": WARNING,
    "entry-length": ERROR,
    "granularity": WARNING,
    "pdo-length": ERROR,
    "dummy-direction": ERROR,
    "dummy-supported": ERROR,
    "dummy-length": ERROR,
    "double-target": NOTE,
    "transmission-type": ERROR,
    "can-id-length": ERROR,
    "can-id-restricted": ERROR,
    "can-id-in-use": WARNING,
    "can-id-clash": ERROR,
}
_PLACE = re.compile(r"0x([0-9A-F]{4}):([0-9A-F]{2})")
_DECLARED: dict[str, Rule] = {
    rule.name: rule for file in (can_id, communication, entry_length, mappable, mapped_object) for rule in file.RULES
}


def _look(name: str, device: Described) -> Found:
    for finding in device.judged:
        place = _PLACE.fullmatch(finding.place)
        if finding.rule == name and place is not None:
            yield Spot(int(place[1], 16), int(place[2], 16), HELD), finding.text


CHECKS = tuple(
    Check(LintRule(name, severity, f"a PDO of the file: {_DECLARED[name].sense}", _DECLARED[name].source),
          partial(_look, name))
    for name, severity in _SEVERITIES.items()
)  # fmt: skip
