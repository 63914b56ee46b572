"""Send frames, once or repeatedly, after an explanation of each frame."""

from __future__ import annotations

from typing import TYPE_CHECKING

import click

from dvtcli.cli.command import DvtCommand, Effect
from dvtcli.cli.commands._frame_options import decoding_options
from dvtcli.cli.params import TEXT, DurationType, NumberType

if TYPE_CHECKING:
    from dvtcli.operations.results import FramesSent
    from dvtcli.operations.session.session import Session


@click.command("send", cls=DvtCommand, short_help=__doc__, effect=Effect.COMMANDS)
@click.argument("frame", type=TEXT, nargs=-1, required=True, metavar="FRAME…")
@click.option("--every", type=DurationType(), metavar="TIME", help="Repeat at this interval (100ms, 5s), until Ctrl-C.")
@click.option("--for", "for_s", type=DurationType(), metavar="TIME", help="Repeat for TIME, every 100 ms or --every.")
@click.option("--count", type=NumberType(1, 1_000_000, "a count"), metavar="N", help="Send N times.")
@decoding_options
@click.pass_obj
def command(
    session: Session,
    /,
    frame: tuple[str, ...],
    every: float | None,
    for_s: float | None,
    count: int | None,
    dbc: str | None,
    nodes: tuple[int, ...] | None,
) -> FramesSent:
    """Send each FRAME: 185#1027 (185#R: a remote frame), 18FF0102#00 (29 bits), or 0x185 10 27.

    It asks before it sends frames that nodes act on: NMT, SYNC, TIME, SDO, LSS, an EMCY or a heartbeat, and the CAN-ID
    of a PDO of a node that is known, received, or in a network file (-d). A frame that the interface does not accept is
    not counted.

    \b
    send 7A0#1027
    send 185#1027 --yes
    send 000#8005 --yes
    send 7A0#01 7A1#02 --every 100ms --for 1s
    send 7A0#R --count 3
    """
    from dvtcli.operations.frames.send_frames import send_frames

    return send_frames(session, _texts(frame), every, for_s, count, nodes or (), dbc)


def _texts(words: tuple[str, ...]) -> list[str]:
    """Return a frame per word if any word has a `#` or was quoted; else all words are one frame."""
    return list(words) if any("#" in word or " " in word for word in words) else [" ".join(words)]
