"""Lines of a recording that is text: counted, and those found that should be frames and that their reader passed by.

python-can's readers of .asc and .trc leave out what they do not know, a damaged frame, too. Knows what else is in such
files: headers, comments, and events of other kinds.
"""

from __future__ import annotations

import re
from io import TextIOWrapper

from dvtcli.domain.safe_text import safe

#: candump's CAN-IDs with the error flag (linux/can.h)
_ERROR_FRAME = re.compile(r" [2367][0-9A-F]{7}#", re.I)
_LONGEST = 60
#: lines of an .asc that have no time: comments, its header, triggers
_ASC_ASIDE = re.compile(r"//|;|date\b|base\b|(no )?\s*internal\s+events|begin\b|end\b|previous log", re.I)
_TIME, _ID = re.compile(r"\d+\.\d+", re.ASCII), re.compile(r"[0-9A-F]+x?", re.I | re.ASCII)
_DATA_FRAME = re.compile(r"\b[RT]x\s+[dr]\b", re.I)
#: what begins an event of an .asc that is no frame: `Statistic:`, `J1939TP`, `SV:`
_WORD = re.compile(r"[A-Za-z][\w:/]*", re.ASCII)
#: kinds of events of a .trc that are no frames; in its first version a CAN-ID that no frame has
_TRC_EVENTS = frozenset({"ST", "ER", "EC", "EV", "Warng", "Error", "FFFFFFFF"})
#: where a line says its kind: behind number and time, or behind the bus that follows them
_TRC_KIND = slice(2, 4)


class LostLineError(ValueError):
    """A line that should be a frame and is none: *line* is its number."""

    def __init__(self, line: int, text: str) -> None:
        super().__init__(no_frame(text))
        self.line = line


def no_frame(text: str) -> str:
    """That a line of a recording is no frame, with the line."""
    return f"this line is no frame: {safe(text.strip()[:_LONGEST])}"


class CountedLines(TextIOWrapper):
    """A text file that knows which line was read last."""

    line = 0
    text = ""

    def readline(self, size: int = -1, /) -> str:  # type: ignore[override]
        """The next line, which counts."""
        text = super().readline(size)
        self.line += 1
        self.text = text
        return text

    def __next__(self) -> str:  # type: ignore[override]
        text = self.readline()
        if not text:
            raise StopIteration
        return text


class CandumpLines(CountedLines):
    """candump's lines: python-can knows one kind of error frame, and takes the others for data; they become that."""

    def __next__(self) -> str:  # type: ignore[override]
        text = super().__next__()
        time, *_ = text.split() or ["()"]
        if time[0] != "(" or time[-1] != ")":  # python-can cuts off one character at each end, whichever it is
            raise LostLineError(self.line, text)
        return _ERROR_FRAME.sub(r" 20000080#", text)


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


class AscLines(LeftLines):
    """Those of Vector's ASCII. python-can's reader takes the first line behind the header for a part of it."""

    held = ""
    has_time = False

    def __next__(self) -> str:  # type: ignore[override]
        if self.held:
            text, self.held = self.held, ""
            return text
        text = super().__next__()
        if self.has_time or not _TIME.match(text.strip()):
            return text
        self.has_time, self.held = True, text
        return "\n"

    def is_lost(self, text: str) -> bool:
        """Whether it is neither header, comment nor an event of another kind."""
        words = text.split()
        if not words or _ASC_ASIDE.match(text.strip()):
            return False
        if not words[0][0].isdigit():
            return self.begun or self.has_time
        if not _TIME.fullmatch(words[0]) or len(words) == 1:
            return True
        kind = words[2] if words[1].isdigit() and len(words) > 2 else words[1]
        if _ID.fullmatch(kind) or not _WORD.fullmatch(kind):
            return True
        return _DATA_FRAME.search(text) is not None and not kind.upper().startswith("J1939")


class TrcLines(LeftLines):
    """Those of PEAK's trace."""

    def is_lost(self, text: str) -> bool:
        """Whether it is neither comment nor an event of another kind."""
        words = text.split()
        return bool(words) and not words[0].startswith(";") and _TRC_EVENTS.isdisjoint(words[_TRC_KIND])
