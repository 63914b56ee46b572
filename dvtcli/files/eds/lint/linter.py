"""Apply all rules to an EDS or DCF: findings of the reader, rules about the text and about the device.

Findings get their line; their text names the object and its data type.
"""

from __future__ import annotations

from bisect import bisect_right
from collections.abc import Collection
from functools import cached_property

from dvtcli.domain.lint import lint_objects, lint_pdos, lint_standard
from dvtcli.domain.lint.described import DescribedDevice, Spot, object_text
from dvtcli.domain.lint.lint_rule import LintRule, RuleCheck, checks_of
from dvtcli.domain.profile import GENERIC, DeviceProfile
from dvtcli.files.eds.findings import READ_RULES, EdsFinding
from dvtcli.files.eds.ini import IniSection
from dvtcli.files.eds.layout import Parts, object_place
from dvtcli.files.eds.lint import (
    lint_keys,
    lint_lines,
    lint_sections,
)
from dvtcli.files.eds.lint.linted_text import LintedText, named
from dvtcli.files.eds.modules import added_by_modules, connected_modules
from dvtcli.files.eds.reader import EdsFile

TEXT_CHECKS: list[RuleCheck[LintedText, int]] = checks_of(lint_lines, lint_keys, lint_sections)
DEVICE_CHECKS: list[RuleCheck[DescribedDevice, Spot]] = [
    *lint_pdos.CHECKS,
    *checks_of(lint_pdos, lint_standard, lint_objects),
]
#: All rules.
RULES: tuple[LintRule, ...] = (
    *READ_RULES,
    *(check.rule for check in TEXT_CHECKS),
    *(check.rule for check in DEVICE_CHECKS),
)


def lint(file: EdsFile, name: str, wanted: Collection[str], profile: DeviceProfile = GENERIC) -> tuple[EdsFinding, ...]:
    """Return findings of the rules *wanted* in *file*, named *name*, by line.

    PDOs are checked as on a device of *profile*.
    """
    places = _Places(file)
    found = [finding for finding in file.findings if finding.rule in wanted]
    text = LintedText(file, name)
    for asked in TEXT_CHECKS:
        if asked.rule.name in wanted:
            found += (_finding(asked.rule, line, said) for line, said in asked.look(text))
    configured, any_node = text.is_dcf or file.node_id is not None, file.node_id is None
    device = DescribedDevice(file.dictionary, file.node_id or 1, configured, any_node, profile, _added(file))
    for check in DEVICE_CHECKS:
        if check.rule.name in wanted:
            found += (_finding(check.rule, places.line(spot), said, spot.object) for spot, said in check.look(device))
    named = dict.fromkeys(places.named(finding) for finding in found)
    return tuple(sorted(named, key=lambda finding: finding.line))


def _added(file: EdsFile) -> frozenset[int]:
    """The indices that modules may add to an EDS; a DCF says which are connected."""
    return frozenset() if connected_modules(file.layout) else added_by_modules(file.layout)


def _finding(rule: LintRule, line: int, text: str, about: str = "") -> EdsFinding:
    return EdsFinding(line, rule.severity, rule.name, text, about)


class _Places:
    """Convert lines of a file to objects, and spots to lines."""

    def __init__(self, file: EdsFile) -> None:
        self._file = file

    @cached_property
    def _starts(self) -> list[int]:
        return [section.line for section in self._file.text.sections]

    def named(self, finding: EdsFinding) -> EdsFinding:
        """Add the object, by the finding or its line, and its data type to the text."""
        return named(finding, finding.object or self._at(finding.line), self._file.dictionary)

    def _at(self, line: int) -> str:
        """Return the object whose section contains *line*, empty if none."""
        at = bisect_right(self._starts, line) - 1
        place = object_place(self._file.text.sections[at].name) if at >= 0 else None
        return "" if place is None else object_text(*place)

    def line(self, spot: Spot) -> int:
        """Return the line of *spot*: of its key, else its section, else its object, else 1."""
        parts = self._parts(spot)
        for key in spot.key.split("|") if spot.key else ():
            for part in reversed(parts):
                if (found := _line_of(part, key)) is not None:
                    return found
        return parts[0].line if parts else 1

    def _parts(self, spot: Spot) -> Parts:
        """Return all parts of the section of *spot*, or of the nearest section if *spot* has none."""
        layout = self._file.layout
        if spot.index is None:
            return layout.device.get(spot.section, [])
        if spot.index not in layout.objects:
            return []
        sections = layout.object_sections(spot.index)
        own = [] if spot.sub_index is None else sections.sub_indices.get(spot.sub_index, [])
        return own or sections.own or next(iter(sections.sub_indices.values()), [])


def _line_of(section: IniSection, key: str) -> int | None:
    for number, text in enumerate(section.text.split("\n")[1:], section.line + 1):
        name, equals, _ = text.partition("=")
        if equals and name.strip().lower() == key:
            return number
    return None
