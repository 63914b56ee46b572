"""The INI text of EDS and DCF files: bytes -> sections -> keys with their lines, and edits of single lines."""

from __future__ import annotations

import codecs
import re
from collections import Counter
from collections.abc import Sequence
from itertools import accumulate
from typing import NamedTuple

from dvtcli.files.eds.findings import BAD_HEADER, BAD_LINE, DUPLICATE_KEY, Findings

_BOMS = ((codecs.BOM_UTF8, "utf-8-sig"), (codecs.BOM_UTF16_LE, "utf-16"), (codecs.BOM_UTF16_BE, "utf-16"))
_INDENTED_HEADER = re.compile(r"\n[ \t]+\[")
_SHOWN = 60


class IniValue(NamedTuple):
    """A `key=value` line: *key* as written, *value* without surrounding blanks, *line* from 1.

    *other* is an earlier line of the same key in the section with another text, if any.
    """

    key: str
    value: str
    line: int
    other: IniValue | None = None


class IniSection(NamedTuple):
    """A section: *name* as written in its header on *line*; *text* extends to the next header."""

    name: str
    line: int
    text: str


#: Values by key in lower case.
Values = dict[str, IniValue]


class IniText(NamedTuple):
    """A whole file: *sections* in order, *preamble* before the first section, and the encoding.

    *mixed_line_ends*: some lines do not end with *newline*.
    """

    preamble: IniSection
    sections: tuple[IniSection, ...]
    encoding: str
    newline: str
    mixed_line_ends: bool = False


def decode(data: bytes) -> tuple[str, str]:
    """Decode a file and name its encoding: by its BOM, else UTF-8, else Windows-1252.

    Bytes undefined in Windows-1252 make the file Latin-1, which defines all bytes.
    """
    encoding = next((name for bom, name in _BOMS if data.startswith(bom)), "utf-8")
    for name in (encoding, "cp1252", "latin-1"):
        try:
            return data.decode(name), name
        except UnicodeDecodeError:
            continue
    raise AssertionError("Latin-1 decodes every byte")


def split_sections(data: bytes) -> IniText:
    """Cut a file into its sections; lines end with CRLF, CR or LF, headers may be indented."""
    text, encoding = decode(data)
    newline = "\r\n" if "\r\n" in text else "\r" if "\r" in text and "\n" not in text else "\n"
    mixed = newline == "\r\n" and not text.count("\r\n") == text.count("\n") == text.count("\r")
    if "\r" in text:
        text = text.replace("\r\n", "\n").replace("\r", "\n")
    before, *chunks = _INDENTED_HEADER.sub("\n[", "\n" + text).split("\n[")
    names = [chunk.partition("]")[0] for chunk in chunks]
    # A header without its bracket ends with its line.
    names = [(name.partition("\n")[0] if "\n" in name else name).strip() for name in names]
    lines = accumulate((chunk.count("\n") + 1 for chunk in chunks), initial=before.count("\n") + 1)
    sections = tuple(map(IniSection._make, zip(names, lines, chunks, strict=False)))
    # The preamble starts with the line break put in front of the text, so that its first line counts as 1.
    return IniText(IniSection("", 0, before), sections, encoding, newline, mixed)


def section_values(sections: Sequence[IniSection], findings: Findings) -> Values:
    """Return the values of a section from all its parts; a key's last value wins.

    Reports lines that are neither comment (`;`, `#`) nor `key=value`, and keys repeated within a part.
    """
    values: Values = {}
    for section in sections:
        _check_header(section, findings)
        _read_lines(section, values, findings)
    return values


def _check_header(section: IniSection, findings: Findings) -> None:
    header, _, _ = section.text.partition("\n")
    name, bracket, rest = header.partition("]")
    if section.line and not bracket:
        findings.add(BAD_HEADER, section.line, f"[{name[:_SHOWN]} has no closing bracket")
    elif rest.strip() and rest.strip()[0] not in ";#":
        findings.add(BAD_HEADER, section.line, f"text after [{section.name}] is ignored: {rest.strip()[:_SHOWN]}")


def _begins_a_value(text: str) -> bool:
    """Whether the line *text*, without `=`, was probably meant as a ParameterValue: `ParameterValue: 5`."""
    key, _, said = text.strip().lower().partition("parametervalue")
    return not key and bool(said)


def _read_lines(section: IniSection, values: Values, findings: Findings) -> None:
    line = section.line
    own: dict[str, int] = {}
    for text in section.text.split("\n")[1:]:
        line += 1
        left, equals, value = text.partition("=")
        name = left.strip()
        if not equals or not name or name[0] in ";#":
            if text.strip() and text.strip()[0] not in ";#":
                said, is_value = text.strip(), _begins_a_value(text)
                findings.add(BAD_LINE, line, f"neither KEY=VALUE nor a ; comment: {said[:_SHOWN]}", value_lost=is_value)
            continue
        key = name.lower()
        if key in own:
            findings.add(DUPLICATE_KEY, line, f"{name} was given in line {own[key]} too; this value is used")
        own[key] = line
        given, before = IniValue(name, value.strip(), line), values.get(key)
        values[key] = given if before is None else _after(before, given)


def _after(before: IniValue, given: IniValue) -> IniValue:
    """Return *given* with a reference to the line *before* of the same key."""
    return given._replace(other=before.other if before.value == given.value else before)


#: A file is some 100 kB, with some thousand sections; an array in short form stands for up to 254 sub-indices.
MOST_BYTES = 16 << 20
_MOST_LINES = 500_000
_MOST_SECTIONS = 150_000
_MOST_COMPACT = 250_000
_COMPACT = re.compile(rb"compactsubobj\s*=\s*(?:0x([0-9a-f]{1,8})|([0-9]{1,8}))")
_PER_OBJECT = 254


def too_much(data: bytes) -> str | None:
    """Describe the limit that *data* exceeds; None if within all limits."""
    if len(data) > MOST_BYTES:
        return f"larger than {MOST_BYTES >> 20} MiB"
    if max(data.count(b"\n"), data.count(b"\r")) > _MOST_LINES:
        return f"longer than {_MOST_LINES} lines"
    if data.count(b"[") > _MOST_SECTIONS:
        return f"of more than {_MOST_SECTIONS} sections"
    if _compact_sub_indices(data) > _MOST_COMPACT:
        return f"of arrays with more than {_MOST_COMPACT} sub-indices in all (CompactSubObj)"
    return None


def _compact_sub_indices(data: bytes) -> int:
    """Return an upper bound for the sub-indices of all CompactSubObj; counts exactly only if the bound is too high."""
    text = data.replace(b"\0", b"").lower()  # UTF-16 has a zero beside each letter
    most = text.count(b"compactsubobj") * _PER_OBJECT
    if most <= _MOST_COMPACT:
        return most
    return sum(min(int(a, 16) if a else int(b), _PER_OBJECT) for a, b in _COMPACT.findall(text))


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
        """Let the key in line *number* have *value*; blanks stay, and a comment behind what is not text."""
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
