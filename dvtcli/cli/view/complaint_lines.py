"""All that is wrong in a file, each with the line it stands in and a caret. Knows no file format."""

from __future__ import annotations

from collections.abc import Iterator, Sequence

from dvtcli.cli.view.columns import columns
from dvtcli.cli.view.lines import Cell, Line
from dvtcli.domain.file_complaint import FileComplaint
from dvtcli.domain.safe_text import safe
from dvtcli.domain.several import plural

#: a longer line is shown around its caret
_LONGEST = 90
_AHEAD = 40


def complaint_lines(complaints: Sequence[FileComplaint], most: int, outcome: str) -> Iterator[Line]:
    """Each complaint with its line and the one above, *most* of them; *outcome* says what was not done."""
    for complaint in complaints[:most]:
        yield [Cell(f"{complaint.place}: "), Cell("error: ", "red"), Cell(complaint.text, "bold")]
        yield from source_lines(complaint)
    more = f" ({most} shown)" if len(complaints) > most else ""
    yield f"{plural(len(complaints), 'error')}{more}. {outcome[:1].upper()}{outcome[1:]}."


def source_lines(complaint: FileComplaint) -> Iterator[Line]:
    """The line that *complaint* is about, and the one above, with a caret; none where the file's text is not known."""
    if not complaint.source.strip():
        return
    start = max(0, complaint.column - 1 - _AHEAD) if len(complaint.source) > _LONGEST else 0
    before = complaint.before[start : start + _LONGEST]
    if before.strip():
        yield _numbered(complaint.line - 1, before)
    yield _numbered(complaint.line, complaint.source[start : start + _LONGEST])
    ahead = columns(_shown(complaint.source[start : complaint.column - 1]))
    wide = columns(_shown(complaint.source[complaint.column - 1 :][: complaint.width][:_LONGEST]))
    yield [Cell(f"{'':5} | ", "dim"), Cell(" " * ahead), Cell("^" * max(1, wide), "red")]


def _numbered(line: int, text: str) -> Line:
    return [Cell(f"{line:5} | ", "dim"), Cell(_shown(text))]


def _shown(text: str) -> str:
    return safe(text.replace("\t", " "))
