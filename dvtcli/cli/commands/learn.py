"""Test what a device accepts, roll everything back, and write a profile and a simulated family."""

from __future__ import annotations

from typing import TYPE_CHECKING

import click

from dvtcli.cli.command import DvtCommand, Effect
from dvtcli.cli.params import TEXT

if TYPE_CHECKING:
    from dvtcli.operations.results import LearnForecast, LearntDevice
    from dvtcli.operations.session.session import Session


@click.command("learn", cls=DvtCommand, short_help=__doc__, effect=Effect.COMMANDS)
@click.option(
    "--save",
    type=TEXT,
    metavar="NAME",
    help="Write profile, simulated family and EDS to the folder ./NAME; add the profile to your own.",
)
@click.option(
    "--compare",
    type=TEXT,
    metavar="PROFILE",
    help="Show differences from this profile, or from the profile in the folder ./NAME; exit code 3 if any.",
)
@click.option("--isolated", is_flag=True, help="No other node is on the bus: also try restricted CAN-IDs.")
@click.option("--with-store", is_flag=True, help="Also test the store: at most two writes to 0x1010.")
@click.pass_obj
def command(
    session: Session, /, save: str | None, compare: str | None, isolated: bool, with_store: bool
) -> LearntDevice | LearnForecast:
    """Ask a device what its PDOs accept, and roll everything back. It asks before it writes; it starts no node.

    \b
    learn
    learn --dry-run            shows the tests, sends none
    learn --save pump          then --sim ./pump answers the same
    learn --compare gen4       after a firmware update
    learn --with-store         how it saves, too
    """
    from dvtcli.operations.devices.learn_device import learn

    return learn(session, save=save, compare=compare, isolated=isolated, with_store=with_store)
