"""Trust a project's dvtcli.toml, with all its settings, until it changes."""

from __future__ import annotations

from typing import TYPE_CHECKING

import click

from dvtcli.cli.command import DvtCommand, Effect
from dvtcli.cli.params import FILE

if TYPE_CHECKING:
    from dvtcli.operations.results import Facts
    from dvtcli.operations.session.session import Session


@click.command("trust", cls=DvtCommand, short_help=__doc__, effect=Effect.NONE, needs_settings=False)
@click.argument("file", type=FILE, required=False)
@click.option("--remove", is_flag=True, help="Stop trusting the file, even if it no longer exists.")
@click.pass_obj
def command(session: Session, /, file: str | None, remove: bool) -> Facts:
    """Trust FILE, or the project's dvtcli.toml here or above, until a byte of it changes. Read it first.

    Of a file that is not trusted, only plain options count: no alias with | or >, with --yes or --force, or with the
    name of a common word; no journal folder; no channel that is a URL, no library of a driver; and no passcode is sent
    on a network that the file chose. A file with an alias that is a command is not trusted.

    \b
    trust
    trust --remove
    """
    from dvtcli.cli.catalogue import command_names
    from dvtcli.operations.user.change_settings import trust_settings

    return trust_settings(file, remove=remove, dry_run=session.dry_run, commands=command_names())
