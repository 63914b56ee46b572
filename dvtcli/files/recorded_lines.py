"""Lines of a recording that is text: counted, and those found that should be frames and that their reader passed by.

python-can's readers of .asc and .trc leave out what they do not know, a damaged frame, too. Knows no format.
"""

from __future__ import annotations

from io import TextIOWrapper

from dvtcli.domain.safe_text import safe

_LONGEST = 60


class NoFrameError(ValueError):
    """What was read is no frame that there can be."""


class LostLineError(NoFrameError):
    """A line that should be a frame and is none: *line* is its number."""

    def __init__(self, line: int, text: str) -> None:
        super().__init__(no_frame(text))
        self.line = line


def no_frame(text: str) -> str:
    """That a line of a recording is no frame, with the line."""
    return f"this line is no frame: {safe(text.strip()[:_LONGEST])}"


#: no line of a recording is longer (characters): a file without line ends is not read whole
MOST_CHARACTERS = 1 << 20


class CountedLines(TextIOWrapper):
    """A text file that knows which line was read last."""

    line = 0
    text = ""

    def readline(self, size: int = -1, /) -> str:  # type: ignore[override]
        """The next line, which counts."""
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


class LeftLines(CountedLines):
    """Lines of a format whose reader passes by what it does not know: each is looked at as soon as the next is read."""

    #: whether the reader made something of the last line
    used = True
    begun = False

    def readline(self, size: int = -1, /) -> str:  # type: ignore[override]
        """The next line; LostLineError where nobody took the last one and it should be a frame."""
        if not self.used and self.is_lost(self.text):
            raise LostLineError(self.line, self.text)
        self.used = False
        return super().readline(size)

    def took(self) -> None:
        """The reader made a frame of the last line."""
        self.used = self.begun = True

    def is_lost(self, text: str) -> bool:
        """Whether *text*, of which the reader made nothing, should be a frame."""
        raise NotImplementedError
