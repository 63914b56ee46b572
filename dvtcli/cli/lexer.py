"""Split lines into words: quotes group, `#` begins a comment."""

from __future__ import annotations

from dvtcli.errors import UsageError

_BLANKS = " \t\r\n"
_SHOWN = 200
#: click takes words off the front of a list, in time that grows with the square of their number
_MOST_WORDS = 10_000


def split(line: str) -> list[str]:
    """Split a line into words: quotes group, `#` at the start of a word begins a comment.

    An apostrophe inside a word is a letter; directly after a closing quote it opens another, as in a shell. Raises
    UsageError for an unclosed quote, and for more words than any command takes.
    """
    if "\0" in line:
        raise UsageError("a command must not contain a NUL character")
    try:
        words = _split(line)
    except ValueError as wrong:
        shown = line.strip() if len(line) <= _SHOWN else line.strip()[:_SHOWN] + "…"
        raise UsageError(f"a quote is not closed: {shown}", hint='write "…" around a name with blanks') from wrong
    if len(words) > _MOST_WORDS:
        raise UsageError(f"{len(words)} words are too many for a command")
    return words


def _split(line: str) -> list[str]:
    """Split *line* in one pass (shlex takes 19 s for a word of 1 MB). Raises ValueError for an unclosed quote."""
    words: list[str] = []
    word: list[str] = []
    inside = closed = False
    quote, previous = "", " "
    for char in line:
        starts = previous.isspace()
        previous = char
        behind_quote = closed
        closed = False
        if quote:
            if char == quote:
                quote, closed = "", True
            else:
                word.append(char)
        elif char in _BLANKS:
            if inside:
                words.append("".join(word))
            word, inside = [], False
        elif char == "#" and starts:
            break
        else:
            inside = True
            if char == '"' or (char == "'" and (starts or behind_quote)):
                quote = char
            else:
                word.append(char)
    if quote:
        raise ValueError("a quote is not closed")
    return [*words, "".join(word)] if inside else words
