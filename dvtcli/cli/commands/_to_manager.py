"""The option by which a network file goes to a CANopen manager instead of to its nodes."""

from __future__ import annotations

import click

from dvtcli.cli.params import NODE_ID

to_manager = click.option(
    "--to-manager",
    "manager",
    type=NODE_ID,
    metavar="NODE",
    help="Not the nodes: NODE, a CANopen manager, downloads it to each of them that boots (0x1F22).",
)
