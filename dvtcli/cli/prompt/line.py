"""Preprocess a typed line: expand aliases, and find the destination of results.

Quotes are as in `lexer.split`; after the word `tcl` they are Tcl's. Opens nothing.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

from dvtcli.cli.lexer import split
from dvtcli.errors import UsageError


@dataclass(frozen=True, slots=True)
class TypedLine:
    """The finished *words* before the cursor, and the current word: text and start in the line."""

    words: list[str]
    incomplete: str
    start: int


def typed(text: str) -> TypedLine | None:
    """Take apart the text before the cursor; None inside a comment."""
    words: list[str] = []
    word: list[str] = []
    start, quote, inside = 0, "", False
    for position, char in enumerate(text):
        if quote:
            if char == quote:
                quote = ""
            else:
                word.append(char)
        elif char.isspace():
            if inside:
                words.append("".join(word))
            word, inside = [], False
        elif char == "#" and not inside:
            return None
        else:
            if not inside:
                start, inside = position, True
            if char == '"' or (char == "'" and start == position):
                quote = char
            else:
                word.append(char)
    return TypedLine(words, "".join(word), start if inside else len(text))


def last_line(text: str) -> str:
    """Return the cursor's line: the last of pasted lines, joined with lines continued by backslashes.

    The result is as long as the corresponding end of *text*, so that positions from the end stay valid.
    """
    return text.replace("\\\n", "  ").rpartition("\n")[2]


def quoted(word: str) -> str:
    """Quote *word* so that it stays one word."""
    if word and not any(char.isspace() or char in "\"'#" for char in word):
        return word
    return f'"{word}"' if '"' not in word else f"'{word}'"


#: The prompt of a line continued by a backslash.
CONTINUED = "  ... "
#: Signs for the destination of results, at the start of a word.
_SIGNS = (">>", ">", "|")


@dataclass(frozen=True, slots=True)
class Destination:
    """The destination of results: *sign* is `|` (a program), `>` (a file) or `>>` (append to a file)."""

    sign: str
    target: str


def taken_apart(line: str, aliases: Mapping[str, str]) -> tuple[str, Destination | None]:
    """Split *line* into command and destination, as `cut`, then expand an alias at its start.

    Cutting first keeps an alias from changing the meaning of typed signs and quotes: if the alias has a sign, all typed
    text belongs to its destination.
    """
    command, destination = cut(line)
    name = _first_word(command)
    if name not in aliases:
        return command, destination
    meant, its_destination = cut(aliases[name])
    if its_destination is None:
        return meant + command.lstrip()[len(name) :], destination
    return meant, Destination(its_destination.sign, its_destination.target + line.lstrip()[len(name) :])


def _first_word(line: str) -> str:
    return (line.split(maxsplit=1) or [""])[0]


def expanded(line: str, aliases: Mapping[str, str]) -> str:
    """Expand an alias at the start of *line*."""
    name = _first_word(line)
    return line if name not in aliases else aliases[name] + line.lstrip()[len(name) :]


def tcl_line(line: str, aliases: Mapping[str, str]) -> str | None:
    """Return the Tcl after the word `tcl` as typed, with quotes and signs; None without `tcl`."""
    name, _, text = expanded(line, aliases).strip().partition(" ")
    return text.strip() or None if name.lower() == "tcl" else None


def cut(line: str) -> tuple[str, Destination | None]:
    """Split *line* into command and destination of results; None for the screen.

    Signs in quotes, words and comments belong to the command.
    """
    quote, before = "", " "
    for position, char in enumerate(line):
        starts, before = before.isspace(), char
        if quote:
            quote = "" if char == quote else quote
        elif char == '"' or (char == "'" and starts):
            quote = char
        elif starts and char == "#":
            break
        elif starts:
            sign = next((sign for sign in _SIGNS if line.startswith(sign, position)), None)
            if sign is not None:
                return line[:position], Destination(sign, line[position + len(sign) :].strip())
    return line, None


def checked(destination: Destination, *, programs: bool) -> Destination:
    """Return *destination* ready to open. Raises UsageError if empty, or a forbidden program."""
    if destination.sign == "|":
        if not programs:
            raise UsageError("`|` is off: dvtcli was started with --no-shell")
        if not destination.target:
            raise UsageError("`|` needs a program after it", hint="pdo --all | grep 0x181")
        return destination
    words = split(destination.target)
    if len(words) != 1:
        raise UsageError(
            f"`{destination.sign}` needs one file after it, not {len(words)}",
            hint='pdo > pdos.txt; write "…" around a name with blanks',
        )
    return Destination(destination.sign, words[0])
