"""Apply all lint rules to a file that describes a device, in any format."""

from __future__ import annotations

from bisect import bisect_right
from collections.abc import Collection
from typing import TYPE_CHECKING

from dvtcli.files.eds.findings import EdsFinding
from dvtcli.files.eds.ini import IniText
from dvtcli.files.eds.lint import lint_keys
from dvtcli.files.eds.lint.linter import RULES
from dvtcli.files.eds.read_rules import DUPLICATE_KEY
from dvtcli.files.eds.reader import EdsFile
from dvtcli.files.xdd.xdd_rules import XDD_RULES

if TYPE_CHECKING:
    from dvtcli.domain.profile import DeviceProfile
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
    from dvtcli.files.xdd.lint_xdd import lint_xdd

    return [(finding, (0, 0)) for finding in lint_xdd(file, name, wanted, profile)]
