"""Apply all lint rules to a file that describes a device, in any format."""

from __future__ import annotations

from bisect import bisect_right
from collections.abc import Collection
from functools import cached_property

from dvtcli.domain.lint import LintRule, RuleCheck, checks_of, lint_objects, lint_pdos, lint_standard
from dvtcli.domain.lint.described import DescribedDevice, Spot, object_text
from dvtcli.domain.profile import GENERIC, DeviceProfile
from dvtcli.files.eds import lint_keys, lint_sections
from dvtcli.files.eds.findings import DUPLICATE_KEY, READ_RULES, EdsFinding
from dvtcli.files.eds.ini import IniSection, IniText
from dvtcli.files.eds.linted_text import LintedText, named
from dvtcli.files.eds.modules import added_by_modules, connected_modules
from dvtcli.files.eds.reader import EdsFile
from dvtcli.files.eds.sections import Parts, object_place
from dvtcli.files.xdd.xdd_parameters import XDD_RULES
from dvtcli.files.xdd.xdd_reader import XddFile

_OF_KEYS = {
    rule.name
    for rule in (
        DUPLICATE_KEY, lint_keys.misspelt_key.rule, lint_keys.unknown_key.rule, lint_keys.key_without_effect.rule,
    )
}  # fmt: skip


class Columns:
    """The columns of findings in *text*; fast if asked in order of lines."""

    def __init__(self, text: IniText) -> None:
        self._sections = (text.preamble, *text.sections)
        self._starts = [section.line for section in self._sections]
        self._cut = -1
        self._lines: list[str] = []

    def of(self, finding: EdsFinding) -> tuple[int, int]:
        """Return first and last column (from 1) of a finding; 0, 0 if its line has none."""
        text = self._line(finding.line)
        key, equals, value = text.partition("=")
        if not equals or not value.strip() or text.lstrip().startswith(("[", ";", "#")):
            return _said(text, 0)
        return _said(key, 0) if finding.rule in _OF_KEYS else _said(value, len(key) + 1)

    def _line(self, line: int) -> str:
        at = max(0, bisect_right(self._starts, line) - 1)
        if at != self._cut:  # a section may have every line of a file, and each of them a finding
            self._cut, self._lines = at, ("[" * (at > 0) + self._sections[at].text).split("\n")
        place = line - self._starts[at]
        return self._lines[place] if place < len(self._lines) else ""


def _said(text: str, before: int) -> tuple[int, int]:
    said = text.strip()
    first = before + len(text) - len(text.lstrip()) + 1
    return (first, first + len(said) - 1) if said else (0, 0)


TEXT_CHECKS: list[RuleCheck[LintedText, int]] = checks_of(lint_sections, lint_keys)
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
#: All rules.
EVERY_RULE = (*RULES, *XDD_RULES)
#: A finding, and its first and last column, 0 and 0 for none.
Placed = tuple["EdsFinding", tuple[int, int]]


def lint_device_file(
    file: EdsFile | XddFile, name: str, wanted: Collection[str], profile: DeviceProfile
) -> list[Placed]:
    """Return findings of the rules *wanted* in *file*, named *name*, by line, for a device of *profile*."""
    if isinstance(file, EdsFile):
        columns = Columns(file.text)
        return [(finding, columns.of(finding)) for finding in lint(file, name, wanted, profile)]

    return [(finding, (0, 0)) for finding in lint_xdd(file, name, wanted, profile)]


def lint_xdd(
    file: XddFile, name: str, wanted: Collection[str], profile: DeviceProfile = GENERIC
) -> tuple[EdsFinding, ...]:
    """Return findings of the rules *wanted* in *file*, named *name*, by line.

    PDOs are checked as on a device of *profile*.
    """
    objects = _objects_by_line(file)
    found = [finding for finding in file.findings if finding.rule in wanted]
    any_node = file.node_id is None
    configured = name.lower().endswith(".xdc") or not any_node
    device = DescribedDevice(file.dictionary, file.node_id or 1, configured, any_node, profile)
    for check in DEVICE_CHECKS:
        if check.rule.name in wanted:
            found += (
                EdsFinding(_line(file, spot), check.rule.severity, check.rule.name, said, spot.object)
                for spot, said in check.look(device)
            )
    told = dict.fromkeys(
        named(finding, finding.object or objects.get(finding.line, ""), file.dictionary) for finding in found
    )
    return tuple(sorted(told, key=lambda finding: finding.line))


def _objects_by_line(file: XddFile) -> dict[int, str]:
    """Return the object of each line; the first, if a line has several."""
    found: dict[int, str] = {}
    for index in file.dictionary:
        held = file.dictionary[index]
        if held.line is not None:
            found.setdefault(held.line, object_text(index, None))
        for entry in held.entries.values():
            if entry.line is not None:
                found.setdefault(entry.line, object_text(index, entry.sub_index))
    return found


def _line(file: XddFile, spot: Spot) -> int:
    """Return the line of *spot*: of its sub-index, else its object, else 1."""
    held = None if spot.index is None else file.dictionary.get(spot.index)
    if held is None:
        return 1
    entry = None if spot.sub_index is None else held.entries.get(spot.sub_index)
    return (None if entry is None else entry.line) or held.line or 1


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
