"""Find the bit rate of a bus by listening."""

from __future__ import annotations

from typing import TYPE_CHECKING

import click

from dvtcli.cli.command import DvtCommand, Effect
from dvtcli.cli.params import DurationType

if TYPE_CHECKING:
    from dvtcli.operations.results.lss_nodes import BitRateFound
    from dvtcli.operations.session.session import Session


@click.command("bitrate", cls=DvtCommand, short_help=__doc__, effect=Effect.NONE)
@click.option("--for", "listen_s", type=DurationType(), metavar="TIME", help="Time to listen at each bit rate [1.5s].")
@click.pass_obj
def command(session: Session, /, listen_s: float | None) -> BitRateFound:
    """Listen at the standard bit rates until frames come without errors.

    It sends nothing, and uses only interfaces with a listen-only mode, since a controller at a wrong bit rate destroys
    the frames of others. For a CAN link of Linux it prints the commands that set it. `lss bitrate` changes the bit
    rate.

    \b
    bitrate
    bitrate --for 800ms
    """
    from dvtcli.operations.nodes.find_nodes import LISTEN_S, find_bit_rate

    return find_bit_rate(session, LISTEN_S if listen_s is None else listen_s)
