"""Where in its line a finding is: at the value, at the key, or at all that the line says.

Does not know what a rule looks at, only which ones judge a key and not its value.
"""

from __future__ import annotations

from bisect import bisect_right

from dvtcli.files.eds.findings import EdsFinding
from dvtcli.files.eds.ini import IniText
from dvtcli.files.eds.lint import lint_keys
from dvtcli.files.eds.read_rules import DUPLICATE_KEY

_OF_KEYS = {
    rule.name
    for rule in (
        DUPLICATE_KEY, lint_keys.misspelt_key.rule, lint_keys.unknown_key.rule, lint_keys.key_without_effect.rule,
    )
}  # fmt: skip


class Columns:
    """The columns of findings in *text*; quick where they are asked for by line."""

    def __init__(self, text: IniText) -> None:
        self._sections = (text.preamble, *text.sections)
        self._starts = [section.line for section in self._sections]
        self._cut = -1
        self._lines: list[str] = []

    def of(self, finding: EdsFinding) -> tuple[int, int]:
        """First and last column (1 and up) of what is odd; 0 and 0 where its line says nothing."""
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
