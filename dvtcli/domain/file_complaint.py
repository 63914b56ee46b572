"""An error in a text file, with the line to show."""

from __future__ import annotations

from dataclasses import dataclass


@dataclass(frozen=True, slots=True, order=True)
class FileComplaint:
    """An error in *line* at *column* (1 and up) of *file*, *width* characters long.

    *source* is the text of the line, *before* the text of the line above, empty for none.
    """

    file: str
    line: int
    column: int
    text: str
    width: int = 1
    source: str = ""
    before: str = ""

    @property
    def place(self) -> str:
        """`FILE:LINE:COLUMN`."""
        return f"{self.file}:{self.line}:{self.column}"
