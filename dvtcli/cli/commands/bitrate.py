"""Listen for the bit rate that a bus runs at."""

from __future__ import annotations

from typing import TYPE_CHECKING

import click

from dvtcli.cli.command import DvtCommand
from dvtcli.cli.commands._live_params import DurationType
from dvtcli.cli.effect import Effect

if TYPE_CHECKING:
    from dvtcli.operations.results.lss_nodes import BitRateFound
    from dvtcli.operations.session.session import Session


@click.command("bitrate", cls=DvtCommand, short_help=__doc__, effect=Effect.READS)
@click.option("--for", "listen_s", type=DurationType(), metavar="TIME", help="Listen so long at each [1.5s].")
@click.pass_obj
def command(session: Session, /, listen_s: float | None) -> BitRateFound:
    """Listen at the standard's bit rates until frames come without errors.

    Not a word is said: only with an interface that is known to listen without one, since who listens at a wrong bit
    rate destroys the frames of others. Of a CAN link of Linux the lines are printed that set it. `lss bitrate` lets a
    bus run at another one.

    \b
    bitrate
    bitrate --for 800ms
    """
    from dvtcli.operations.nodes.find_bit_rate import LISTEN_S, find_bit_rate

    return find_bit_rate(session, LISTEN_S if listen_s is None else listen_s)
