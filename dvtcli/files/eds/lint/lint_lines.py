"""Rules about the bytes and lines of a file: encoding, line ends, lengths, how headers are written."""

from __future__ import annotations

from dvtcli.domain.lint.lint_rule import NOTE, WARNING, check
from dvtcli.files.eds.ini import IniSection
from dvtcli.files.eds.lint.linted_text import Found, LintedText

_LONGEST = 255
_FORMAT = "CiA 306, 4.2"


@check("byte-order-mark", WARNING, "the file begins with a byte-order mark: many readers miss its first section",
       _FORMAT)  # fmt: skip
def byte_order_mark(text: LintedText) -> Found:
    """The standard has plain characters of a byte each."""
    if text.file.text.encoding in ("utf-8-sig", "utf-16"):
        yield 1, f"the file begins with a byte-order mark ({text.file.text.encoding.upper()})"


@check("non-ascii", NOTE, "a character beyond ASCII: readers differ in which one it is", _FORMAT)
def non_ascii(text: LintedText) -> Found:
    """Reports the first line only."""
    for section in _parts(text):
        if not section.text.isascii():
            line, words = next((n, part) for n, part in enumerate(section.text.split("\n")) if not part.isascii())
            sign = next(sign for sign in words if not sign.isascii())
            encoding = text.file.text.encoding.upper()
            yield section.line + line, f"{sign!r} is beyond ASCII, the first here; the file was read as {encoding}"
            return


@check("line-ends", NOTE, "lines do not all end with CR LF", _FORMAT)
def line_ends(text: LintedText) -> Found:
    """Said once."""
    if text.file.text.mixed_line_ends:
        yield 1, "some lines end with CR LF and others do not"
    elif text.file.text.newline != "\r\n":
        yield 1, f"lines end with {'LF' if text.file.text.newline == chr(10) else 'CR'}, not CR LF"


@check("long-line", NOTE, "a line has more than 255 characters", _FORMAT)
def long_line(text: LintedText) -> Found:
    """Some readers cut long lines."""
    for section in _parts(text):
        if len(section.text) > _LONGEST:
            for number, words in enumerate(section.text.split("\n"), section.line):
                if len(words) > _LONGEST:
                    yield number, f"the line has {len(words)} characters; {_LONGEST} are allowed"


@check("header-case", NOTE, "a sub-index is called SUB in capitals: some libraries drop it", "CiA 306, 4.6.3")
def header_case(text: LintedText) -> Found:
    """The standard writes `[1018sub0]`."""
    for entry in text.objects:
        section = entry.section
        if entry.sub_index is not None and section.name[4:7] not in ("sub", "Sub"):
            yield section.line, f"[{section.name}] is written [{section.name[:4]}sub{section.name[7:]}]"


def _parts(text: LintedText) -> tuple[IniSection, ...]:
    return text.file.text.preamble, *text.file.text.sections
