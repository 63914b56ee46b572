"""Count the lines of a text recording, and detect damaged frames that the reader skips.

python-can's readers of .asc and .trc skip unknown lines, including damaged frames.
"""

from __future__ import annotations

from collections.abc import Iterator
from io import TextIOWrapper

from dvtcli.domain.text import safe

_LONGEST = 60


class NoFrameError(ValueError):
    """The data is no possible frame."""


class LostLineError(NoFrameError):
    """The line with number *line* should be a frame but is not."""

    def __init__(self, line: int, text: str) -> None:
        super().__init__(no_frame(text))
        self.line = line


def no_frame(text: str) -> str:
    """Return the message that a line of a recording is no frame, with the line."""
    shown = text.strip()[:_LONGEST]
    unprintable = sum(not character.isprintable() or character == "\N{REPLACEMENT CHARACTER}" for character in shown)
    if unprintable * 4 > len(shown):
        return "this line is no frame, nor text"
    return f"this line is no frame: {safe(shown)}"


#: maximum length of a line (characters), against files without line ends
MOST_CHARACTERS = 1 << 20


class CountedLines(TextIOWrapper):
    """A text file that knows the last line read."""

    line = 0
    text = ""

    def readline(self, size: int = -1, /) -> str:  # type: ignore[override]
        """Return the next line, and count it."""
        text = super().readline(MOST_CHARACTERS if size < 0 else size)
        self.line += 1
        if len(text) == MOST_CHARACTERS and size < 0:
            raise LostLineError(self.line, text[:80])
        self.text = text
        return text

    def __next__(self) -> str:  # type: ignore[override]
        text = self.readline()
        if not text:
            raise StopIteration
        return text

    def lines(self) -> Iterator[tuple[int, str]]:
        """Iterate over the lines with their numbers, as `readline` returns them; faster than that."""
        readline = super().readline
        while text := readline(MOST_CHARACTERS):
            self.line += 1
            if len(text) == MOST_CHARACTERS:
                raise LostLineError(self.line, text[:80])
            self.text = text
            yield self.line, text


class LeftLines(CountedLines):
    """Lines for a reader that skips unknown lines: a skipped line is checked on reading the next."""

    #: whether the reader used the last line
    used = True
    begun = False

    def readline(self, size: int = -1, /) -> str:  # type: ignore[override]
        """Return the next line. Raises LostLineError if the reader skipped a damaged frame."""
        if not self.used and self.is_lost(self.text):
            raise LostLineError(self.line, self.text)
        self.used = False
        return super().readline(size)

    def took(self) -> None:
        """Record that the reader made a frame of the last line."""
        self.used = self.begun = True

    def is_lost(self, text: str) -> bool:
        """Whether *text*, skipped by the reader, should be a frame."""
        raise NotImplementedError
