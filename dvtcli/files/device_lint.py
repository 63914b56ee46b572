"""Apply all lint rules to a file that describes a device, in any format."""

from __future__ import annotations

from bisect import bisect_right
from collections.abc import Collection

from dvtcli.domain.lint.described import DescribedDevice, Spot, object_text
from dvtcli.domain.profile import GENERIC, DeviceProfile
from dvtcli.files.eds.findings import DUPLICATE_KEY, EdsFinding
from dvtcli.files.eds.ini import IniText
from dvtcli.files.eds.lint import lint_keys
from dvtcli.files.eds.lint.linted_text import named
from dvtcli.files.eds.lint.linter import DEVICE_CHECKS, RULES
from dvtcli.files.eds.reader import EdsFile
from dvtcli.files.xdd.xdd_reader import XddFile
from dvtcli.files.xdd.xdd_rules import XDD_RULES

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


#: All rules.
EVERY_RULE = (*RULES, *XDD_RULES)
#: A finding, and its first and last column, 0 and 0 for none.
Placed = tuple["EdsFinding", tuple[int, int]]


def lint_device_file(
    file: EdsFile | XddFile, name: str, wanted: Collection[str], profile: DeviceProfile
) -> list[Placed]:
    """Return findings of the rules *wanted* in *file*, named *name*, by line, for a device of *profile*."""
    if isinstance(file, EdsFile):
        from dvtcli.files.eds.lint.linter import lint

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
