"""Click types of plain words: texts, files, numbers and times; each parses, completes and explains itself.

Those of PDOs are in `pdo_params`, those of objects in `object_params`: a command imports what its words are.
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
        """Parse *value* once; click also hands over values that are parsed already."""
        if not isinstance(value, str):
            return value
        try:
            return self.parse(value.removeprefix(NEGATIVE_MARK), ctx)
        except ValueError as wrong:
            self.fail(str(wrong), param, ctx)

    def parse(self, text: str, ctx: click.Context | None) -> Any:
        """Turn *text* into the value; ValueError says what is wrong."""
        raise ValueError(text)


class NumberType(CanopenType):
    """A whole number, decimal or `0x…`, within *low*..*high*."""

    name = "number"

    def __init__(self, low: int, high: int, what: str = "a number") -> None:
        self.low, self.high, self.what = low, high, what

    def parse(self, text: str, ctx: click.Context | None) -> int:
        """The number; ValueError where it is outside the range."""
        value = parse_number(text)
        if not self.low <= value <= self.high:
            raise ValueError(f"{text}: {self.what} is {self.low}…{self.high}")
        return value


class MillisecondsType(CanopenType):
    """A time in milliseconds, kept as counts of *unit_us* µs; it must be a whole number of counts up to *most*."""

    name = "ms"

    def __init__(self, unit_us: int, most: int = 0xFFFF) -> None:
        self.unit_us, self.most = unit_us, most

    def parse(self, text: str, ctx: click.Context | None) -> int:
        """The number of counts."""
        from dvtcli.domain.milliseconds import counts, milliseconds

        return counts(milliseconds(text), self.unit_us, self.most)


class TextType(CanopenType):
    """Any text, such as a value to write; only the mark of a leading minus sign is taken off."""

    name = "text"

    def parse(self, text: str, ctx: click.Context | None) -> str:
        """The text itself."""
        return text


class FileType(TextType):
    """A file's path; a shell completes it."""

    name = "file"

    def shell_complete(self, ctx: click.Context, param: click.Parameter, incomplete: str) -> list[CompletionItem]:
        """Whatever files there are."""
        return [CompletionItem(incomplete, type="file")]


TEXT, FILE, NODE_ID = TextType(), FileType(), NumberType(1, 127, "a node-ID")
