"""Split a script's text into lines, with continuations."""

from __future__ import annotations

import re
from dataclasses import dataclass

from dvtcli.cli.lexer import split
from dvtcli.errors import DvtcliError, InputFileError, UsageError

#: Maximum size of a script (bytes).
MOST_BYTES = 10_000_000
#: Maximum number of commands: all are parsed before the first runs.
MOST_COMMANDS = 10_000
#: What editors show as the end of a line; `str.splitlines` also splits at characters that nobody sees.
_LINE_END = re.compile("\r\n|\n|\r")


@dataclass(frozen=True, slots=True)
class ScriptLine:
    """A command of a script with its first line number, from 1."""

    number: int
    words: list[str]


def script_lines(data: bytes, source: str, first_line: int = 1) -> list[ScriptLine]:
    """Return the commands in *data*, numbered from *first_line*; a backslash at a line's end continues the line.

    Raises UsageError or InputFileError with FILE:LINE.
    """
    text = script_text(data, source)
    if source.lower().endswith(".309"):
        return _gateway_lines(text, source)
    found: list[ScriptLine] = []
    pending: list[str] = []
    began = 0
    raws = _LINE_END.split(text)
    for number, raw in enumerate(raws, first_line):
        if not raw and not pending:
            continue
        began = began or number
        if raw.endswith("\\") and number < first_line + len(raws) - 1:
            pending.append(raw[:-1])
            continue
        words = _words(" ".join([*pending, raw]), f"{source}:{began}")
        _take(found, ScriptLine(began, words), source)
        pending, began = [], 0
    return found


def _take(found: list[ScriptLine], line: ScriptLine, source: str) -> None:
    """Append *line* to *found* unless empty. Raises InputFileError if there are too many."""
    if not line.words:
        return
    found.append(line)
    if len(found) > MOST_COMMANDS:
        place = f"{source}:{line.number}"
        raise InputFileError(f"{place}: more than {MOST_COMMANDS} commands are no script", place=place)


def _gateway_lines(text: str, source: str) -> list[ScriptLine]:
    """Convert lines of a gateway's client to commands."""
    from dvtcli.cli.scripts.gateway_script import GatewayScript

    script, found = GatewayScript(), list[ScriptLine]()
    for number, line in enumerate(_LINE_END.split(text), 1):
        _take(found, ScriptLine(number, script.words(line, f"{source}:{number}")), source)
    return found


def script_text(data: bytes, source: str) -> str:
    """Decode a script. Raises InputFileError with FILE:LINE if it is no text."""
    if len(data) > MOST_BYTES:
        raise InputFileError(f"{source}: {len(data)} bytes are no script", place=source)
    try:
        return data.decode("utf-8-sig")
    except UnicodeDecodeError as wrong:
        number = data[: wrong.start].count(b"\n") + 1
        raise InputFileError(f"{source}:{number}: not UTF-8 text", place=f"{source}:{number}") from wrong


def _words(line: str, place: str) -> list[str]:
    try:
        return split(line)
    except UsageError as wrong:
        raise placed(wrong, place) from wrong


def placed(wrong: DvtcliError, place: str) -> DvtcliError:
    """Return *wrong* with *place* as its place."""
    from dvtcli.cli.view.typed_hints import error_text

    wrong.text, wrong.given, wrong.place = f"{place}: {error_text(wrong)}", {}, place
    return wrong
