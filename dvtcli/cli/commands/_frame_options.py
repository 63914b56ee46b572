"""Options of commands that decode frames, write values as Parquet, or write a DBC file."""

from __future__ import annotations

from collections.abc import Callable
from functools import wraps
from typing import Any, TypeVar

import click

from dvtcli.cli.params import FILE, TEXT, KindsType, NodesType


def dbc_options(command: Callable[..., Any]) -> Callable[..., Any]:
    """Add `--with`, `--split-bits` and `--all`, as one *options*. Raises UsageError for an unknown service."""

    @wraps(command)
    def with_options(*values: Any, services: str | None, split_bits: bool, everything: bool, **others: Any) -> Any:
        from dvtcli.operations.exchange.export_dbc import DbcOptions, services_of

        return command(*values, options=DbcOptions(services_of(services), split_bits, everything), **others)

    for option in (
        click.option("--all", "everything", is_flag=True, help="DBC: also PDOs that are off."),
        click.option("--split-bits", is_flag=True, help="DBC: a signal for each bit that has a name."),
        click.option("--with", "services", type=TEXT, metavar="LIST", help="DBC: also nmt,sync,emcy,heartbeat,sdo."),
    ):
        with_options = option(with_options)
    return with_options


F = TypeVar("F", bound=Callable[..., object])


def decoding_options(command: F) -> F:
    """Add the options that select how a recording is decoded."""
    nodes = click.option(
        "--nodes", type=NodesType(), metavar="ID,…", help="Nodes whose mappings decode it [the selected node]."
    )
    return nodes(
        click.option("-d", "--dbc", type=FILE, metavar="FILE", help="Decode by a DBC or network file.")(command)
    )


def only_option(command: F) -> F:
    """Add the option that selects kinds of frames."""
    return click.option(
        "--only",
        type=KindsType(),
        metavar="KIND,…",
        help="Only these kinds of frames: pdo, emcy, nmt, sdo, sdo-abort, heartbeat, …",
    )(command)


def parquet_options(command: F) -> F:
    """Add the options of .parquet files."""
    layout = click.option(
        "--layout", type=click.Choice(["long", "wide"]), metavar="long|wide",
        help="For .parquet: a row for each value, or a column for each signal [long].",
    )  # fmt: skip
    return layout(
        click.option(
            "--source",
            type=TEXT,
            metavar="TEXT",
            help="For .parquet: name of the recorder [log: this computer; decode: FILE].",
        )(command)
    )
