"""Edit single lines of an INI file; every other byte stays unchanged.

Handles encodings, line ends and `key=value`. Lines are counted as in `files.eds.ini`.
"""

from __future__ import annotations

import codecs
import re
from collections import Counter

from dvtcli.files.eds.ini import decode

_LINE_END = re.compile(r"(\r\n|\r|\n)")
#: UTF-16 is written in the file's byte order
_UTF_16 = ((codecs.BOM_UTF16_LE, "utf-16-le"), (codecs.BOM_UTF16_BE, "utf-16-be"))


class EditedText:
    """A file's *data* with edits of lines; the first line is 1."""

    def __init__(self, data: bytes) -> None:
        text, self._encoding = decode(data)
        parts = _LINE_END.split(text)
        self._lines, self._ends = parts[0::2], [*parts[1::2], ""]
        self._usual_end = next((end for end, _ in Counter(self._ends[:-1]).most_common(1)), "\n")
        self._mark, self._codec = b"", self._encoding
        for mark, codec in _UTF_16:
            if self._encoding == "utf-16" and data.startswith(mark):
                self._mark, self._codec = mark, codec
        self._after: dict[int, list[str]] = {}
        self._gone: set[int] = set()

    @property
    def last_line(self) -> int:
        """The number of the last non-empty line, 0 for none."""
        return next((number for number in range(len(self._lines), 0, -1) if self._lines[number - 1].strip()), 0)

    def can_hold(self, text: str) -> bool:
        """Whether the file's encoding has every character of *text*."""
        try:
            text.encode(self._codec)
        except UnicodeEncodeError:
            return False
        return True

    def line(self, number: int) -> str:
        """Return the original line *number* without its line end."""
        return self._lines[number - 1]

    def set_value(self, number: int, value: str, *, is_text: bool = False) -> None:
        """Let the key in line *number* have *value*; blanks stay, and a comment behind what is no text."""
        left, _, rest = self._lines[number - 1].partition("=")
        at = -1 if is_text else rest.find(";")
        body, comment = (rest, "") if at < 0 else (rest[:at], rest[at:])
        before, after = _blanks_around(body)
        after += comment
        self._lines[number - 1] = f"{left}={before}{value}{after}"

    def remove(self, number: int) -> None:
        """Take line *number* out."""
        self._gone.add(number)

    def insert(self, number: int, lines: list[str]) -> None:
        """Insert *lines* after line *number* (0: before the first), after earlier insertions at this place."""
        self._after.setdefault(number, []).extend(lines)

    def insert_key(self, number: int, key: str, value: str) -> None:
        """Insert *key* after line *number*, with the blanks around `=` of the key on that line, if any.

        If that line has a blank on one side of `=` only, the file's usual blanks count.
        """
        indent, equals, _ = _key_line(self._lines[number - 1])
        if equals.startswith("=") != equals.endswith("="):
            equals = self._usual_equals()
        self.insert(number, [f"{indent}{key}{equals}{value}"])

    def _usual_equals(self) -> str:
        """The `=` with blanks as on most lines with a key and a value."""
        found = Counter(equals for _, equals, value in map(_key_line, self._lines) if value)
        return next((equals for equals, _ in found.most_common(1)), "=")

    def to_bytes(self) -> bytes:
        """Return the edited file."""
        text = "".join(self._pieces())
        return self._mark + text.encode(self._codec)

    def _pieces(self) -> list[str]:
        pieces: list[str] = [f"{line}{self._usual_end}" for line in self._after.get(0, ())]
        for number, (line, end) in enumerate(zip(self._lines, self._ends, strict=True), 1):
            if number not in self._gone:
                pieces.append(line + end)
            for added in self._after.get(number, ()):
                if not end:  # the last line has none: it gets one, and what follows it does without
                    pieces.append(self._usual_end)
                pieces.append(added + end)
        return pieces


def _blanks_around(text: str) -> tuple[str, str]:
    """Return the blanks before and after the content of *text*; for a blank text, all of them before."""
    before = text[: len(text) - len(text.lstrip())]
    return before, text[max(len(text.rstrip()), len(before)) :]


def _key_line(line: str) -> tuple[str, str, str]:
    """Split *line* into blanks before its key, `=` with blanks, and value; the value is empty without a key."""
    left, sign, right = line.partition("=")
    if not sign:
        return "", "=", ""
    indent, before = _blanks_around(left)
    value = right.lstrip()
    return indent, f"{before}={right[: len(right) - len(value)]}", value
