"""The options of commands that write a DBC file."""

from __future__ import annotations

from collections.abc import Callable
from functools import wraps
from typing import Any

import click

from dvtcli.cli.params import TEXT


def dbc_options(command: Callable[..., Any]) -> Callable[..., Any]:
    """Add `--with`, `--split-bits` and `--all`, as one *options*. Raises UsageError for an unknown service."""

    @wraps(command)
    def with_options(*values: Any, services: str | None, split_bits: bool, everything: bool, **others: Any) -> Any:
        from dvtcli.operations.exchange.dbc_options import DbcOptions
        from dvtcli.operations.exchange.export_dbc import services_of

        return command(*values, options=DbcOptions(services_of(services), split_bits, everything), **others)

    for option in (
        click.option("--all", "everything", is_flag=True, help="DBC: also PDOs that are off."),
        click.option("--split-bits", is_flag=True, help="DBC: a signal for each bit that has a name."),
        click.option("--with", "services", type=TEXT, metavar="LIST", help="DBC: also nmt,sync,emcy,heartbeat,sdo."),
    ):
        with_options = option(with_options)
    return with_options
