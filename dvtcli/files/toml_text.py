"""The text of a TOML file: its values, and the line of every key, which tomllib reads but does not tell.

Does not know what a key means, nor of which type its value has to be.
"""

from __future__ import annotations

import re
import tomllib

from dvtcli.errors import InputFileError

KeyPath = tuple[str, ...]


def parsed(text: str, source: str) -> tuple[dict[str, object], dict[KeyPath, int]]:
    """The values of *text*, and the line of each key; InputFileError, its place in *source*, where it is not TOML."""
    try:
        content = tomllib.loads(text)
    except ValueError as error:  # TOMLDecodeError, and what int() says to a number of 5000 digits
        raise _syntax_error(error, text, source) from None
    except RecursionError:
        raise InputFileError("values are nested too deeply", place=f"{source}:1") from None
    if not _numbers_fit(content):
        raise InputFileError("a number has more than the 64 bits of TOML", place=f"{source}:1")
    return content, _key_lines(text)


def _numbers_fit(value: object) -> bool:
    """Whether no whole number in *value* is so long that Python refuses to write it out."""
    if isinstance(value, dict):
        return all(map(_numbers_fit, value.values()))
    if isinstance(value, list):
        return all(map(_numbers_fit, value))
    return not isinstance(value, int) or abs(value) < 1 << 64


def _syntax_error(error: ValueError, text: str, source: str) -> InputFileError:
    place = re.search(r"\(at line (\d+), column (\d+)\)", str(error))
    where = f"{place[1]}:{place[2]}" if place else str(text.count("\n") + 1)
    said = str(error).partition(" (at ")[0]
    return InputFileError(f"no valid TOML: {said}", place=f"{source}:{where}")


#: none of these may grow worse than a line does: a family's file may come from anybody
_HEADER = re.compile(r"\[+([^\[\]]+)\]+\s*(?:#.*)?")
_KEY = re.compile(r"""("[^"]*"|'[^']*'|[A-Za-z0-9_.-]+)\s*=""")
_PART = re.compile(r""""[^"]*"|'[^']*'|[A-Za-z0-9_-]+""")


def _key_lines(text: str) -> dict[KeyPath, int]:
    """Path of every table and key -> its line."""
    lines: dict[KeyPath, int] = {}
    table: KeyPath = ()
    for number, full_line in enumerate(text.split("\n"), 1):
        line = full_line.strip()
        if header := _HEADER.fullmatch(line):
            table = _parts(header[1])
            lines.setdefault(table, number)
        elif key := _KEY.match(line):
            lines.setdefault((*table, *_parts(key[1])), number)
    return lines


def _parts(dotted: str) -> KeyPath:
    return tuple(part.strip("\"'") for part in _PART.findall(dotted))
