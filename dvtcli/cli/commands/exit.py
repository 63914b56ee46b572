"""Leave the prompt, or end a script here."""

from __future__ import annotations

import click

from dvtcli.cli.boundary import LEAVE
from dvtcli.cli.command import DvtCommand, Effect


@click.command("exit", cls=DvtCommand, short_help=__doc__, effect=Effect.NONE, needs_settings=False)
def command() -> int:
    """Leave the prompt, or end a script here.

    \b
    exit
    """
    return LEAVE
