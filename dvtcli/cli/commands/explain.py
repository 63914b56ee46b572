"""Explain a frame bit by bit: its sender, its content, its values."""

from __future__ import annotations

from typing import TYPE_CHECKING

import click

from dvtcli.cli.command import DvtCommand, Effect
from dvtcli.cli.commands._frame_options import decoding_options
from dvtcli.cli.params import TEXT

if TYPE_CHECKING:
    from dvtcli.operations.results import FrameExplained
    from dvtcli.operations.session.session import Session


@click.command("explain", cls=DvtCommand, short_help=__doc__, effect=Effect.NONE)
@click.argument("frame", type=TEXT, nargs=-1, required=True, metavar="FRAME")
@decoding_options
@click.pass_obj
def command(
    session: Session, /, frame: tuple[str, ...], dbc: str | None, nodes: tuple[int, ...] | None
) -> FrameExplained:
    """Name every bit of FRAME: 185#1027, a line of candump, or 0x185 10 27. It is not sent.

    A PDO is decoded by the mapping that nodes hold now (-n, --nodes, --sim), by --eds, or by a network or DBC file
    (-d). More than three hex digits before the # are a CAN-ID of 29 bits, written with eight.

    \b
    explain 185#1027000000
    explain 601#2B17100000000000
    explain 0x081 10 81 01 00 00 00 00 00
    explain 181#3706E803 --nodes 1
    """
    from dvtcli.domain.abort import abort_text, code_of
    from dvtcli.operations.frames.explain_frame import explain_frame

    text = " ".join(frame)
    explained = explain_frame(session, text, nodes, dbc)
    if (code := code_of(text)) is not None:
        session.reporter.note(f"0x{code:08X} is also an SDO abort code: {abort_text(code)}; `help {text}` explains it")
    return explained
