"""Log in to a device that asks for an access level; the passcode is never shown or kept."""

from __future__ import annotations

from typing import TYPE_CHECKING

import click

from dvtcli.cli.command import DvtCommand, Effect
from dvtcli.cli.params import NumberType
from dvtcli.operations.user.refused_options import refuse_options

if TYPE_CHECKING:
    from dvtcli.cli.conversation import Conversation
    from dvtcli.operations.results import LoggedIn


@click.command("login", cls=DvtCommand, short_help=__doc__, effect=Effect.COMMANDS)
@click.argument("level", type=NumberType(0, 255, "an access level"), required=False)
@click.option("--user", type=NumberType(1, 0xFFFF, "a user ID"), metavar="N", help="User ID 1…65535 [the family's].")
@click.pass_obj
def command(session: Conversation, /, level: int | None, user: int | None) -> LoggedIn:
    """Log in at LEVEL, or at the one that PDO work needs; 0 logs out.

    The passcode comes from DVTCLI_PASSCODE, from `passcode` in the user's config.toml, or is asked for without echo.

    \b
    login
    login 4
    login 2 --user 7
    login 0                    log out
    """
    if level == 0:
        refuse_options({"user": user}, "not for LEVEL 0, which logs out")
    from dvtcli.cli.passcode import passcode
    from dvtcli.operations.nodes.log_in import log_in

    return log_in(session, lambda node_id, wanted: passcode(session, node_id, wanted), level, user)
