"""The options that `decode`, `plot` and `log` share: what decodes a recording."""

from __future__ import annotations

from collections.abc import Callable
from typing import TypeVar

import click

from dvtcli.cli.commands._live_params import KindsType, NodesType
from dvtcli.cli.params import FILE, TEXT

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
