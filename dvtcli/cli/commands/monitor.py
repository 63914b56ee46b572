"""Show what is on the bus, decoded, with rate, jitter, least and most; in a pipe one document a frame."""

from __future__ import annotations

import os
import sys
from time import monotonic
from typing import TYPE_CHECKING

import click

from dvtcli.cli.command import DvtCommand
from dvtcli.cli.commands._live_params import NodesType, SecondsType
from dvtcli.cli.params import FILE, TEXT

if TYPE_CHECKING:
    from dvtcli.operations.session import Session
    from dvtcli.watch.decoder import Decoder
    from dvtcli.watch.listener import Listener

#: how long frames are gathered before they are written (s)
_BATCH_S = 0.05


@click.command("monitor", cls=DvtCommand, short_help=__doc__)
@click.option("--nodes", type=NodesType(), metavar="ID,…", help="Nodes whose mapping is read [those that are heard].")
@click.option("-d", "--decode", type=FILE, metavar="FILE.dbc", help="Decode by a DBC file (after --nodes, if given).")
@click.option("--filter", "wanted", type=TEXT, metavar="TEXT", help="Only frames and signals with TEXT in their names.")
@click.option("--duration", type=SecondsType(), metavar="S", help="End after S seconds.")
@click.option("--changes", is_flag=True, help="Only frames that say something new.")
@click.pass_obj
def command(
    session: Session,
    /,
    nodes: tuple[int, ...] | None,
    decode: str | None,
    wanted: str | None,
    duration: float | None,
    changes: bool,
) -> None:
    """Watch the bus: PDOs decoded with the mapping that the nodes hold, EMCY and NMT, until q or Ctrl-C.

    At a terminal a full screen, its keys are at the bottom; else one dvtcli.frame/1 document a line. Only reads: the
    mappings by SDO upload, once, at the start. A node that does not answer shows its frames as bytes.

    \b
    monitor
    monitor --nodes 1,5 --filter velocity
    monitor --decode drive.dbc --changes
    monitor --duration 10 --json
    """
    from dvtcli.operations.layouts import live_decoder, open_wire
    from dvtcli.watch.listener import Listener

    bus = open_wire(session)
    decoder = live_decoder(session, nodes or (), decode)
    with Listener(bus, session.secrets.in_frame) as listener:
        if _full_screen(session):
            from dvtcli.cli.monitor.app import watch

            watch(session, listener, decoder, wanted or "", duration, changes=changes)
        else:
            _stream(session, listener, decoder, (wanted or "").lower(), duration, changes=changes)


def _full_screen(session: Session) -> bool:
    terminal = sys.stdin.isatty() and sys.stdout.isatty() and os.environ.get("TERM", "").lower() not in _PLAIN
    return terminal and not session.output.json and not session.in_script


_PLAIN = ("", "dumb", "unknown")


def _stream(
    session: Session, listener: Listener, decoder: Decoder, wanted: str, duration_s: float | None, *, changes: bool
) -> None:
    """Write each frame as a document; the drops are said at the end, however it comes."""
    from dvtcli.operations.frame_answer import frame_seen
    from dvtcli.watch.seen import FrameStore

    store = FrameStore(decoder)
    until_s = None if duration_s is None else monotonic() + duration_s
    try:
        while until_s is None or monotonic() < until_s:
            left_s = _BATCH_S if until_s is None else min(_BATCH_S, max(0.0, until_s - monotonic()))
            fresh = [frame for frame in listener.take(left_s) if store.take(frame) or not changes]
            seen = [frame_seen(frame, decoder) for frame in fresh]
            session.output.documents(one.document() for one in seen if one.matches(wanted))
    finally:
        if listener.dropped:
            session.output.warning(f"{listener.dropped} frames were dropped: they came faster than they were written")
