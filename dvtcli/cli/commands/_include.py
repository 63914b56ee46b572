"""The option that names more of a file about one device as configuration."""

from __future__ import annotations

import click

from dvtcli.cli.params import TEXT

include = click.option(
    "--include",
    type=TEXT,
    multiple=True,
    metavar="OBJECT",
    help="With a DCF, an XDC or a backup: OBJECT of the maker (3001, or 3001:1 alone) is configuration, too; "
    "2000-2FFF for all from there on, of what an RPDO could take those only that are settings by their names.",
)
