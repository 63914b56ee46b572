"""Click types of plain words: texts, files, numbers and times, with parsing, completion and error text.

Types of PDOs are in `pdo_params`, types of objects in `object_params`, so that a command imports only its own.
"""

from __future__ import annotations

import re
from typing import TYPE_CHECKING, Any

import click
from click.shell_completion import CompletionItem

from dvtcli.cli.global_options import NEGATIVE_MARK
from dvtcli.domain.datatypes import parse_number
from dvtcli.errors import UsageError

if TYPE_CHECKING:
    ParamType = click.ParamType[Any]
else:
    ParamType = click.ParamType  # generic only in newer click


class CanopenType(ParamType):
    """A type whose values may begin with a minus sign, and whose ValueErrors become usage errors."""

    def convert(self, value: Any, param: click.Parameter | None, ctx: click.Context | None) -> Any:
        """Parse *value* once; click may pass parsed values again."""
        if not isinstance(value, str):
            return value
        try:
            return self.parse(value.removeprefix(NEGATIVE_MARK), ctx)
        except ValueError as wrong:
            self.fail(str(wrong), param, ctx)

    def parse(self, text: str, ctx: click.Context | None) -> Any:
        """Return the value of *text*. Raises ValueError with the reason."""
        raise ValueError(text)


class NumberType(CanopenType):
    """A whole number, decimal or `0x…`, within *low*..*high*."""

    name = "number"

    def __init__(self, low: int, high: int, what: str = "a number") -> None:
        self.low, self.high, self.what = low, high, what

    def parse(self, text: str, ctx: click.Context | None) -> int:
        """Return the number. Raises ValueError if out of range."""
        value = parse_number(text)
        if not self.low <= value <= self.high:
            raise ValueError(f"{text}: {self.what} is {self.low}…{self.high}")
        return value


class MillisecondsType(CanopenType):
    """A time in ms, kept as counts of *unit_us* µs; must be a whole number of counts up to *most*."""

    name = "ms"

    def __init__(self, unit_us: int, most: int = 0xFFFF) -> None:
        self.unit_us, self.most = unit_us, most

    def parse(self, text: str, ctx: click.Context | None) -> int:
        """Return the number of counts."""
        from dvtcli.domain.times import counts, milliseconds

        return counts(milliseconds(text), self.unit_us, self.most)


class TextType(CanopenType):
    """Any text, such as a value to write; only the mark of a leading minus sign is removed."""

    name = "text"

    def parse(self, text: str, ctx: click.Context | None) -> str:
        """The text itself."""
        return text


class FileType(TextType):
    """A file's path, completed by the shell."""

    name = "file"

    def shell_complete(self, ctx: click.Context, param: click.Parameter, incomplete: str) -> list[CompletionItem]:
        """Let the shell complete files."""
        return [CompletionItem(incomplete, type="file")]


#: a node before an object or a PDO: `3:6041`, `3:tpdo1`
_NODE = re.compile(r"\d{1,3}:")


class Listed(click.Argument):
    """Several words of one type, with blanks or commas between them: `tpdo1,tpdo2`."""

    def type_cast_value(self, ctx: click.Context, value: Any) -> Any:
        """Return the values. Raises BadParameter if a word has none."""
        words = [part for word in value or () for part in self._parts(ctx, word)]
        return super().type_cast_value(ctx, tuple(words) or value)

    def _parts(self, ctx: click.Context, word: Any) -> list[Any]:
        """Return *word* taken apart at its commas, unless it is one name with a comma."""
        if not isinstance(word, str) or "," not in word or self._is_value(ctx, word):
            return [word]
        parts = [part for part in word.split(",") if part]
        if not all(self._is_value(ctx, part) for part in parts):
            return [word]
        with_node = [part for part in parts if _NODE.match(part)]
        if with_node and len(with_node) < len(parts):
            raise click.BadParameter(f"{word!r}: write the node before each of them or before none of them", ctx, self)
        return parts

    def _is_value(self, ctx: click.Context, text: str) -> bool:
        try:
            self.type.convert(text, self, ctx)
        except (click.BadParameter, UsageError):
            return False
        return True


TEXT, FILE, NODE_ID = TextType(), FileType(), NumberType(1, 127, "a node-ID")
