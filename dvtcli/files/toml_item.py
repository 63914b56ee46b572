"""TOML values with their places: strict readers whose complaints name line and key."""

from __future__ import annotations

import json
import re
import tomllib
from collections.abc import Callable, Iterable, Mapping
from enum import StrEnum
from typing import Any, NamedTuple, NoReturn, TypeVar

from dvtcli.domain.profile import Range
from dvtcli.errors import InputFileError

KeyPath = tuple[str, ...]


def parsed(text: str, source: str) -> tuple[dict[str, object], dict[KeyPath, int]]:
    """Return the values of *text*, and each key's line. Raises InputFileError with its place in *source*."""
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
    """Whether Python can print every whole number in *value*."""
    if isinstance(value, dict):
        return all(map(_numbers_fit, value.values()))
    if isinstance(value, list):
        return all(map(_numbers_fit, value))
    return not isinstance(value, int) or abs(value) < 1 << 64


def _syntax_error(error: ValueError, text: str, source: str) -> InputFileError:
    place = re.search(r"\(at line (\d+), column (\d+)\)", str(error))
    where = f"{place[1]}:{place[2]}" if place else str(text.count("\n") + 1)
    said = str(error).partition(" (at ")[0]
    return InputFileError(f"not valid TOML: {said}", place=f"{source}:{where}")


#: limits against slow patterns in untrusted files: matching must be linear in the line
_HEADER = re.compile(r"\[+([^\[\]]+)\]+\s*(?:#.*)?")
_KEY = re.compile(r"""("[^"]*"|'[^']*'|[A-Za-z0-9_.-]+)\s*=""")
_PART = re.compile(r""""[^"]*"|'[^']*'|[A-Za-z0-9_-]+""")


def _key_lines(text: str) -> dict[KeyPath, int]:
    """Return the line of every table and key by path."""
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


_Choice = TypeVar("_Choice", bound=StrEnum)
_T = TypeVar("_T")


#: The reader of each key in a table.
Schema = dict[str, Callable[["Item"], object]]


def read_toml(text: str, source: str) -> Item:
    """Read a whole TOML file; *source* is its name for messages. Raises InputFileError for bad TOML."""
    content, lines = parsed(text, source)
    return Item(content, (), source, lines)


class Item(NamedTuple):
    """A value with its place in the file: *path* of keys, *lines* of all keys."""

    value: object
    path: KeyPath
    source: str
    lines: Mapping[KeyPath, int]

    @property
    def key(self) -> str:
        """The last key of the path."""
        return self.path[-1]

    @property
    def shown(self) -> str:
        """The value as TOML writes it: `true`, not `True`."""
        return repr(self.value) if isinstance(self.value, str) else json.dumps(self.value, default=str)

    def fail(self, text: str, hint: str | None = None) -> NoReturn:
        """Raise InputFileError with the line of the nearest key on the way to this value."""
        path = self.path
        while path and path not in self.lines:
            path = path[:-1]
        name = f"{'.'.join(self.path)}: " if self.path else ""
        raise InputFileError(f"{name}{text}", place=f"{self.source}:{self.lines.get(path, 1)}", hint=hint)

    def items(self) -> list[Item]:
        """Return a table's members, each with its place."""
        if not isinstance(self.value, dict):
            self.fail(f"must be a table, not {self.shown}")
        return [self._replace(value=value, path=(*self.path, key)) for key, value in self.value.items()]

    def table(self, schema: Mapping[str, Callable[[Item], object]], required: Iterable[str] = ()) -> dict[str, Any]:
        """The values of a table by key, each read by *schema*'s function; unknown and missing keys are errors."""
        for member in self.items():
            if member.key not in schema:
                member.fail("unknown key", suggest(member.key, schema))
        present = {member.key: schema[member.key](member) for member in self.items()}
        for key in required:
            if key not in present:
                self.fail(f"the key {key!r} is missing")
        return present


def string(item: Item) -> str:
    """Read a text that is not blank."""
    if not isinstance(item.value, str) or not item.value.strip():
        item.fail(f"must be a text, not {item.shown}")
    return item.value


def boolean(item: Item) -> bool:
    """`true` or `false`."""
    if not isinstance(item.value, bool):
        item.fail(f"must be true or false, not {item.shown}")
    return item.value


def integer(low: int, high: int) -> Callable[[Item], int]:
    """Return a reader of whole numbers within *low*..*high*."""

    def read(item: Item) -> int:
        if not isinstance(item.value, int) or isinstance(item.value, bool):
            item.fail(f"must be a whole number, not {item.shown}")
        if not low <= item.value <= high:
            item.fail(f"{item.value} is not within {low}..{high}")
        return item.value

    return read


def seconds(item: Item) -> float:
    """A time-out in seconds, above 0 and up to 600."""
    if not isinstance(item.value, int | float) or isinstance(item.value, bool):
        item.fail(f"must be a number of seconds, not {item.shown}")
    if not 0 < item.value <= 600:
        item.fail(f"{item.value} s is not within 0..600")
    return float(item.value)


def members(item: Item) -> list[Item]:
    """A list's members, each at the list's place."""
    if not isinstance(item.value, list):
        item.fail(f"must be a list, not {item.shown}")
    return [item._replace(value=value) for value in item.value]


def integers(low: int, high: int) -> Callable[[Item], tuple[int, ...]]:
    """Return a reader of lists of whole numbers within *low*..*high*."""
    return lambda item: tuple(integer(low, high)(member) for member in members(item))


def pair(high: int) -> Callable[[Item], Range]:
    """Return a reader of two numbers within 0..*high*."""

    def read(item: Item) -> Range:
        numbers = integers(0, high)(item)
        if len(numbers) != 2:
            item.fail(f"must be a pair of numbers, not {item.shown}")
        return numbers[0], numbers[1]

    return read


def number_range(high: int) -> Callable[[Item], Range]:
    """Return a reader of minimum and maximum within 0..*high*."""

    def read(item: Item) -> Range:
        first, last = pair(high)(item)
        if first > last:
            item.fail(f"[{first}, {last}] is not a range: the first is above the last")
        return first, last

    return read


def number_ranges(high: int) -> Callable[[Item], tuple[Range, ...]]:
    """Return a reader of lists of ranges within 0..*high*."""
    return lambda item: tuple(number_range(high)(member) for member in members(item))


def one_of(choices: type[_Choice]) -> Callable[[Item], _Choice]:
    """Return a reader of a word of an enumeration."""

    def read(item: Item) -> _Choice:
        words = [choice.value for choice in choices]
        if item.value not in words:
            item.fail(f"must be {alternatives(words)}, not {item.shown}", suggest(str(item.value), words))
        return choices(item.value)

    return read


def each_of(choices: type[_Choice], read: Callable[[Item], _T]) -> Callable[[Item], dict[_Choice, _T]]:
    """Return a reader of tables with exactly the enumeration's words as keys, each value read by *read*."""

    def read_all(item: Item) -> dict[_Choice, _T]:
        names = [choice.value for choice in choices]
        given = item.table(dict.fromkeys(names, read), required=names)
        return {choice: given[choice.value] for choice in choices}

    return read_all


def object_address(item: Item) -> tuple[int, int]:
    """Read index and sub-index of an object, written `6C01:01`."""
    match = re.fullmatch(r"([0-9A-F]{4}):([0-9A-F]{2})", item.value) if isinstance(item.value, str) else None
    if not match:
        item.fail(f"must be an object such as '6C01:01', not {item.shown}")
    return int(match[1], 16), int(match[2], 16)


def key_range(item: Item, base: int, high: int) -> Range:
    """Return the range of a key like `254` or `1-240`, in number base *base* (10 or 16), within 0..*high*."""
    digit = "[0-9]" if base == 10 else "[0-9A-Fa-f]"
    match = re.fullmatch(rf"({digit}{{1,8}})(?:-({digit}{{1,8}}))?", item.key)
    if not match:
        item.fail("the key must be a number, or two with '-' between")
    first, last = int(match[1], base), int(match[2] or match[1], base)
    if not first <= last <= high:
        item.fail(f"the key must be within 0..{high}, the lower number first")
    return first, last


def by_number(high: int) -> Callable[[Item], dict[int, str]]:
    """Return a reader of tables number → text; a key may be a range, `1-240`."""

    def read(item: Item) -> dict[int, str]:
        texts: dict[int, str] = {}
        for member in item.items():
            first, last = key_range(member, 10, high)
            texts.update(dict.fromkeys(range(first, last + 1), string(member)))
        return texts

    return read


def suggest(word: str, known: Iterable[str]) -> str | None:
    """Return "did you mean …?" with the nearest of *known*, or None."""
    from difflib import get_close_matches

    near = get_close_matches(word, list(known), n=1)
    return f"did you mean {near[0]!r}?" if near else None


def alternatives(words: list[str]) -> str:
    """`a, b or c`."""
    return f"{', '.join(words[:-1])} or {words[-1]}"
