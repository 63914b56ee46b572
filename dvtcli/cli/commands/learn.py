"""Find out what a device takes, put everything back, and write a profile and a simulated family."""

from __future__ import annotations

from typing import TYPE_CHECKING

import click

from dvtcli.cli.command import DvtCommand
from dvtcli.cli.effect import Effect
from dvtcli.cli.params import TEXT

if TYPE_CHECKING:
    from dvtcli.operations.results import LearnForecast, LearntDevice
    from dvtcli.operations.session.session import Session


@click.command("learn", cls=DvtCommand, short_help=__doc__, effect=Effect.COMMANDS)
@click.option(
    "--save",
    type=TEXT,
    metavar="NAME",
    help="Write profile, simulated family and EDS into the folder ./NAME, and the profile among your own, too.",
)
@click.option(
    "--compare",
    type=TEXT,
    metavar="PROFILE",
    help="Say what differs from this profile, or that in the folder ./NAME; exit code 3 then.",
)
@click.option("--isolated", is_flag=True, help="Nothing else is on the bus: ask for restricted CAN-IDs, too.")
@click.option("--with-store", is_flag=True, help="Let the device save, too: two writes to 0x1010 at most.")
@click.pass_obj
def command(
    session: Session, /, save: str | None, compare: str | None, isolated: bool, with_store: bool
) -> LearntDevice | LearnForecast:
    """Ask a device, safely and reversibly, what its PDOs take. It asks before it writes; it starts no node.

    \b
    learn
    learn --dry-run            what it would ask
    learn --save pump          then --sim ./pump answers the same
    learn --compare gen4       after a firmware update
    learn --with-store         how it saves, too
    """
    from dvtcli.operations.known_devices.learn_device import learn

    return learn(session, save=save, compare=compare, isolated=isolated, with_store=with_store)
