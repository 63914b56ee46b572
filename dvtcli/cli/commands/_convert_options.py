"""The options of `eds convert`, as one value."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from functools import wraps
from typing import TYPE_CHECKING, Any

import click

from dvtcli.cli.commands._dbc_options import dbc_options
from dvtcli.cli.params import TEXT
from dvtcli.errors import UsageError

if TYPE_CHECKING:
    from dvtcli.operations.exchange.dbc_options import DbcOptions


@dataclass(frozen=True, slots=True)
class Conversion:
    """Which *node* of a network file, by name or node-ID, and how a DBC file is wanted."""

    node: str | None
    wishes: DbcOptions

    def refuse(self) -> None:
        """UsageError for any of them: another action was asked for."""
        if self.node is not None:
            raise UsageError("--for belongs to eds convert", hint="eds convert net.yaml node5.cdcf --for 5")
        if self.wishes:
            text = "--with, --split-bits and --all belong to eds convert"
            raise UsageError(text, hint="eds convert net.yaml net.dbc --all")


def convert_options(command: Callable[..., Any]) -> Callable[..., Any]:
    """`--for` and those of a DBC file, as one *conversion*."""

    @dbc_options
    @wraps(command)
    def with_conversion(*values: Any, node: str | None, wishes: DbcOptions, **others: Any) -> Any:
        return command(*values, conversion=Conversion(node, wishes), **others)

    help_ = "convert: the node of a network file, name or node-ID."
    return click.option("--for", "node", type=TEXT, metavar="NODE", help=help_)(with_conversion)
