"""The text of an INI file of which single lines change: every other byte stays as it is.

Knows encodings, line ends and `key=value`. Does not know what a key means; lines are counted as `files.eds.ini` does.
"""

from __future__ import annotations

import codecs
import re
from collections import Counter

from dvtcli.files.eds.ini import decode

_LINE_END = re.compile(r"(\r\n|\r|\n)")
#: UTF-16 is written with the byte order that the file has
_UTF_16 = ((codecs.BOM_UTF16_LE, "utf-16-le"), (codecs.BOM_UTF16_BE, "utf-16-be"))


class EditedText:
    """A file's *data*, and what becomes of its lines; the first one is line 1."""

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
        """The number of the last line that is not empty, 0 for none."""
        return next((number for number in range(len(self._lines), 0, -1) if self._lines[number - 1].strip()), 0)

    def can_hold(self, text: str) -> bool:
        """Whether the file's encoding has every character of *text*."""
        try:
            text.encode(self._codec)
        except UnicodeEncodeError:
            return False
        return True

    def line(self, number: int) -> str:
        """Line *number* as it was, without its end."""
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
        """Put *lines* behind line *number* (0: before the first), and behind what was put there before."""
        self._after.setdefault(number, []).extend(lines)

    def insert_key(self, number: int, key: str, value: str) -> None:
        """Put *key* behind line *number*, with blanks as that line has them if it has a key.

        Blanks on one side of its `=` are odd: as most lines have them then.
        """
        indent, equals, _ = _key_line(self._lines[number - 1])
        if equals.startswith("=") != equals.endswith("="):
            equals = self._usual_equals()
        self.insert(number, [f"{indent}{key}{equals}{value}"])

    def _usual_equals(self) -> str:
        """The `=` of most lines that have a key and a value, with its blanks."""
        found = Counter(equals for _, equals, value in map(_key_line, self._lines) if value)
        return next((equals for equals, _ in found.most_common(1)), "=")

    def to_bytes(self) -> bytes:
        """The file as it is now."""
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
    """The blanks before and behind what stands in *text*; all of them before where nothing does."""
    before = text[: len(text) - len(text.lstrip())]
    return before, text[max(len(text.rstrip()), len(before)) :]


def _key_line(line: str) -> tuple[str, str, str]:
    """The blanks before the key of a *line*, its `=` with the blanks around it, its value; no value where no key is."""
    left, sign, right = line.partition("=")
    if not sign:
        return "", "=", ""
    indent, before = _blanks_around(left)
    value = right.lstrip()
    return indent, f"{before}={right[: len(right) - len(value)]}", value
