"""Values in a file without effect: misspelt keys, sections of no object, rows of no sub-index.

Users of a file's values are warned, because otherwise only `eds check` reports them.
"""

from __future__ import annotations

import re
from collections.abc import Iterator
from typing import TYPE_CHECKING

from dvtcli.files.eds.reader import EdsFile

if TYPE_CHECKING:
    from dvtcli.files.xdd.xdd_reader import XddFile

#: maximum number of lines to report one by one
_MOST = 4
_VALUE, _NODE_ID = "parametervalue", "nodeid"
#: names similar to an object's: `[0x1017]`, `[1017 sub 1]`, `[2100Values]`
_NEARLY_OBJECT = re.compile(r"(0x)?[0-9a-f]{3,5}h?([^a-z].*|s(ub)?[^a-z]*|val.*)?", re.IGNORECASE)
_HAS_VALUE = re.compile(r"^[ \t]*(parametervalue|nodeid)[ \t]*=[ \t]*[^\s;]", re.IGNORECASE | re.MULTILINE)


def unread_values(read: EdsFile | XddFile, file: str) -> tuple[str, ...]:
    """Return warnings for users of values from *read*, the file at the path *file*; empty if all are read."""
    found = [(finding.line, finding.text) for finding in read.findings if finding.value_unread]
    if isinstance(read, EdsFile):
        found += _passed_by(read, file)
    told = [f"{file}:{line}: {text}" for line, text in sorted(found)]
    if len(told) <= _MOST:
        return tuple(told)
    more = len(told) - _MOST + 1
    return *told[: _MOST - 1], f"{file}: {more} more lines like these; a check of the file names them"


def _passed_by(read: EdsFile, file: str) -> Iterator[tuple[int, str]]:
    """Iterate over unknown keys and sections that look like values, and misplaced values."""
    from dvtcli.files.eds.keys import quoted
    from dvtcli.files.eds.lint.lint_keys import unknown_keys
    from dvtcli.files.eds.lint.linted_text import LintedText, given, is_head

    text = LintedText(read, file)
    for value, near in unknown_keys(text):
        if near.lower() in (_VALUE, _NODE_ID) and value.value:
            yield value.line, f"{quoted(value)} is not read; is {near} meant?"
    for entry in text.objects:
        if is_head(text, entry) and (own := given(entry.values, _VALUE)) is not None:
            yield own.line, f"{quoted(own)} is not read: the sub-indices of {entry.index:04X} have their own"
    for section in read.layout.stray:
        if _HAS_VALUE.search(section.text) or ("=" in section.text and _NEARLY_OBJECT.fullmatch(section.name)):
            yield section.line, f"[{section.name[:60]}] is not read: it belongs to no object in this file"
