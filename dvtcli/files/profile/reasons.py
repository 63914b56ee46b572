"""A profile's values with the comments behind them: where each comes from. Does not judge them (`toml`)."""

from __future__ import annotations

import re
from collections.abc import Iterator
from dataclasses import dataclass

_HEADER = re.compile(r"\s*\[+(?!\[)([^\]]+)\]+\s*(?:#.*)?")


@dataclass(frozen=True, slots=True)
class Reason:
    """A key (with its tables, `store.timeout_s`), its value as it is written, and why; *line* is 1 and up.

    *reason* is the comment behind the value, else the one above the table; empty where there is none.
    """

    key: str
    value: str
    reason: str
    line: int


def reasons(text: str) -> Iterator[Reason]:
    """Every value of a profile's *text* that stands on a line of its own, in order."""
    table = above = previous = ""
    for number, line in enumerate(text.splitlines(), 1):
        content, comment = split_comment(line)
        if header := _HEADER.fullmatch(line):
            table, above = f"{header[1].strip()}.", comment or split_comment(previous)[1]
        elif "=" in content:
            key, _, value = content.partition("=")
            yield Reason(table + key.strip(), value.strip(), comment or (above if table else ""), number)
        previous = line


def split_comment(line: str) -> tuple[str, str]:
    """What stands before a line's comment, and the comment; a `#` inside a TOML string begins none."""
    quote = ""
    for place, char in enumerate(line):
        if quote:
            quote = "" if char == quote else quote
        elif char in "\"'":
            quote = char
        elif char == "#":
            return line[:place], line[place + 1 :].strip()
    return line, ""
