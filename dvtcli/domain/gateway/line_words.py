"""Split a gateway's line into words: spaces separate words, quotes group, `#` begins a comment.

The length is limited, since a line comes from people and programs.
"""

from __future__ import annotations

import re

from dvtcli.domain.datatypes import parse_number
from dvtcli.domain.gateway.gateway_answers import GatewayError, GatewayRequestError

#: maximum length of a line (characters): an object of 48 kB as base64
LONGEST_LINE = 65_536
#: maximum number of words: 64 entries of a PDO, each an object with its type
MOST_WORDS = 256
_WORD = re.compile(r'[ \t]*(?:"((?:[^"]|"")*)"(?=[ \t]|$)|(#.*)|([^ \t"#][^ \t"]*))')
#: start of a quoted word: a text, never a number or a command
QUOTED = '"'


def words_of(line: str) -> list[str]:
    """Words of *line*; a quoted word begins with a quote. Raises GatewayRequestError if not text, or too long."""
    if len(line) > LONGEST_LINE:
        raise wrong(f"the line has more than {LONGEST_LINE} characters")
    if not (line.isascii() and line.replace("\t", " ").isprintable()):
        raise wrong("the line has characters that are no ASCII text")
    found: list[str] = []
    line = line.rstrip(" \t")
    end = 0
    while end < len(line):
        match = _WORD.match(line, end)
        if match is None:
            raise wrong("a quote is not closed, or stands in a word")
        end = match.end()
        if match[2] is not None:
            break
        found.append(match[3] if match[1] is None else QUOTED + match[1].replace('""', '"'))
        if len(found) > MOST_WORDS:
            raise wrong(f"the line has more than {MOST_WORDS} words")
    return found


def quoted(text: str) -> str:
    """*text* as a word in quotes."""
    return '"' + text.replace('"', '""') + '"'


def number_of(word: str, least: int, most: int, what: str) -> int:
    """The number in *word*, decimal or `0x…`, *least* to *most*. Raises GatewayRequestError otherwise."""
    if re.fullmatch(r"-?0[0-9]+", word):  # C reads it as octal, people do not
        raise wrong(f"{what} {word[:20]}: a number has no leading zero")
    try:
        number = parse_number(word)
    except ValueError:
        raise wrong(f"{what} {word[:20]!r} is no number") from None
    if not least <= number <= most:
        raise wrong(f"{what} {number} is not {least} to {most}")
    return number


def wrong(why: str) -> GatewayRequestError:
    """A syntax error, and *why*."""
    return GatewayRequestError(GatewayError.SYNTAX, why)
