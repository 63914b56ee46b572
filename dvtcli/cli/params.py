"""Click types of plain words: texts, files, numbers and times, with parsing, completion and error text.

Types of PDOs are in `pdo_params`, types of objects in `object_params`, so that a command imports only its own.
"""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import click
from click.shell_completion import CompletionItem

from dvtcli.cli.global_options import NEGATIVE_MARK
from dvtcli.domain.datatypes import parse_number

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


TEXT, FILE, NODE_ID = TextType(), FileType(), NumberType(1, 127, "a node-ID")
