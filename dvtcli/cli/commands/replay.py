"""Send a recording again: at its own speed, faster or slower, whole or in part."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Any

import click

from dvtcli.cli.command import DvtCommand, Effect
from dvtcli.cli.commands._frame_options import decoding_options
from dvtcli.cli.params import FILE, TEXT, FrameFilterType, NumberType, RateType, SinceType

if TYPE_CHECKING:
    from dvtcli.operations.results import Replayed
    from dvtcli.operations.session.session import Session


@click.command("replay", cls=DvtCommand, short_help=__doc__, effect=Effect.COMMANDS)
@click.argument("file", type=FILE)
@click.option(
    "--rate",
    type=RateType(),
    default=1.0,
    metavar="N",
    help="N times as fast; 0: as fast as the load limit allows [1].",
)
@click.option("--from", "from_s", type=SinceType(), metavar="S", help="Start S seconds after the first frame.")
@click.option("--to", "to_s", type=SinceType(), metavar="S", help="End S seconds after the first frame.")
@click.option(
    "--filter", "only", type=FrameFilterType(), multiple=True, metavar="FRAMES",
    help="Only these, repeatable: 181, 180-1FF, 180:780, node=5, 5:tpdo1, sdo.",
)  # fmt: skip
@click.option(
    "--without",
    type=FrameFilterType(),
    multiple=True,
    metavar="FRAMES",
    help="Leave these out; written as for --filter.",
)
@click.option(
    "--from-channel", "channel", type=TEXT, metavar="NAME", help="Only frames recorded on that channel, or all."
)
@click.option("--loop", "loops", type=NumberType(1, 1_000_000, "a count"), default=1, metavar="N", help="N times [1].")
@decoding_options
@click.pass_obj
def command(
    session: Session,
    /,
    file: str,
    rate: float,
    from_s: float | None,
    to_s: float | None,
    dbc: str | None,
    nodes: tuple[int, ...] | None,
    **part: Any,
) -> Replayed:
    """Send the frames of FILE (.asc .blf .log .trc .mf4 .pcapng .pcap) at the times at which they were recorded.

    It asks once, with a list, before it sends frames that nodes act on, as send does; --without nmt --without sdo
    leaves out the most dangerous. --dry-run shows the list, sends nothing, and needs no bus. CAN FD and error frames
    are left out. While a node is OPERATIONAL, with --rate 0 always, the bus load stays within --bus-share (50 %) if
    the bit rate is known.

    \b
    replay run.log --dry-run
    replay run.log --yes
    replay run.asc --filter 281 --rate 10 --yes
    replay run.blf --from 1 --to 2 --without sdo --loop 2 --rate 0 --yes
    """
    from dvtcli.operations.frames.replay_recording import Choice, replay_recording

    within_s = float("-inf") if from_s is None else from_s, float("inf") if to_s is None else to_s
    choice = Choice(rate, *within_s, **part)
    return replay_recording(session, Path(file), choice, nodes or (), dbc)
