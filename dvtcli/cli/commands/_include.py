"""The option that names more of a file about one device as configuration."""

from __future__ import annotations

import click

from dvtcli.cli.params import NODE_ID, TEXT

trust_stamp = click.option(
    "--trust-stamp",
    is_flag=True,
    help="Skip nodes whose 0x1020 has the stamp of this file (stamp: true), and name them.",
)


to_manager = click.option(
    "--to-manager",
    "manager",
    type=NODE_ID,
    metavar="NODE",
    help="Write NODE, a CANopen manager, which downloads it to each node that boots (0x1F22).",
)


include = click.option(
    "--include",
    type=TEXT,
    multiple=True,
    metavar="OBJECT",
    help="With a DCF, an XDC or a backup: OBJECT of the maker (3001, or 3001:1 alone) is configuration, too; "
    "2000-2FFF for all from there on, of what an RPDO could take those only that are settings by their names.",
)
