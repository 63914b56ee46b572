"""The text of a record with all its entries."""

from __future__ import annotations

from collections.abc import Iterator

from dvtcli.cli.view.answers.value_lines import value_line
from dvtcli.cli.view.lines import Cell, Line
from dvtcli.domain.hint import Action, Hint
from dvtcli.operations.results.records import EntryUnread, RecordRead


def record_lines(result: RecordRead, _width: int) -> Iterator[Line]:
    """Sub-index 0, and each entry, as each for itself."""
    yield value_line(result.head)
    for entry in result.entries:
        if isinstance(entry, EntryUnread):
            abort = "" if entry.abort is None else f"0x{entry.abort:08X} "
            name = f"  {entry.name}" if entry.name else ""
            line: list[Cell | Hint] = [Cell(f"0x{entry.object}"), Cell(name, "bold")]
            line.append(Cell(f"  not read: {abort}{entry.text}", "yellow"))
            if entry.abort is None:
                line += [Cell("; "), Hint(Action.READ, {"object": entry.object, "into": "FILE"}, "does")]
            yield line
        else:
            yield value_line(entry)
