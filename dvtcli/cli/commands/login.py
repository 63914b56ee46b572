"""Log in to a device that asks for an access level; the passcode is never shown or kept."""

from __future__ import annotations

from typing import TYPE_CHECKING

import click

from dvtcli.cli.command import DvtCommand
from dvtcli.cli.params import NumberType

if TYPE_CHECKING:
    from dvtcli.domain.profile import LoginPolicy
    from dvtcli.operations.results import LoggedIn
    from dvtcli.operations.session import Session


@click.command("login", cls=DvtCommand, short_help=__doc__)
@click.argument("level", type=NumberType(0, 255, "an access level"), required=False)
@click.option("--user", type=NumberType(1, 0xFFFF, "a user ID"), metavar="N", help="User ID 1…65535 [the family's].")
@click.pass_obj
def command(session: Session, /, level: int | None, user: int | None) -> LoggedIn:
    """Log in at LEVEL, or at the one that PDO work needs; 0 logs out.

    The passcode comes from DVTCLI_PASSCODE, from `passcode` in the user's config.toml, or is asked for without echo.

    \b
    login
    login 4
    login 2 --user 7
    login 0                    log out
    """
    from dvtcli.cli.commands._passcode import passcode
    from dvtcli.device.access_level import access_level, log_in, policy_of
    from dvtcli.operations.results import LoggedIn

    node = session.node()
    policy = policy_of(node.access)
    wanted = policy.needed if level is None else level
    before = access_level(node.access)
    held = log_in(node.access, wanted, lambda: passcode(session, node.node_id, wanted), user)
    if held != before and not session.dry_run:
        session.record(node.node_id, [f"login {wanted}" if user is None else f"login {wanted} --user {user}"])
    return LoggedIn(node.node_id, held, wanted, session.dry_run, _allows(policy, held))


def _allows(policy: LoginPolicy, level: int) -> str:
    if level >= policy.needed:
        return "PDOs can be written and stored"
    return f"PDOs can be read; writing and storing them needs level {policy.needed}"
