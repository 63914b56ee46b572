"""Draw signals of a recording: on the terminal, or as a picture."""

from __future__ import annotations

import os
import shutil
from pathlib import Path
from typing import TYPE_CHECKING

import click

from dvtcli.cli.command import DvtCommand, Effect
from dvtcli.cli.commands._frame_options import decoding_options
from dvtcli.cli.params import FILE, TEXT

if TYPE_CHECKING:
    from dvtcli.cli.conversation import Conversation
    from dvtcli.operations.results import Plotted, PlottedSignal
    from dvtcli.operations.user.session_user import SessionUser
    from dvtcli.watch.table import Track

#: a graph's maximum columns, minimum and maximum lines
_WIDTH, _LEAST, _MOST = 200, 8, 24


@click.command("plot", cls=DvtCommand, short_help=__doc__, effect=Effect.NONE)
@click.argument("file", type=FILE)
@click.argument("signals", nargs=-1, required=True, type=TEXT, metavar="SIGNAL…")
@decoding_options
@click.option("-o", "--output", type=FILE, metavar="FILE", help="Picture file: .png .svg .pdf (needs matplotlib).")
@click.pass_obj
def command(
    session: Conversation,
    /,
    file: str,
    signals: tuple[str, ...],
    dbc: str | None,
    nodes: tuple[int, ...] | None,
    output: str | None,
) -> Plotted:
    """Draw each SIGNAL (a name or an object) of FILE over time, decoded as by `decode`.

    \b
    plot run.log velocity_actual_value 6041
    plot run.asc Speed --dbc drive.dbc -o speed.png
    """
    from dvtcli.operations.frames.decode_recording import recorded_tracks
    from dvtcli.operations.results import Plotted

    if output is not None:
        from dvtcli.cli.monitor.graph import check_chart

        check_chart(Path(output))
    found, span_s = recorded_tracks(session, Path(file), signals, nodes, dbc)
    if output is not None:
        _draw(session, Path(output), found, span_s)
    shown = tuple(_drawn(session, track, span_s, len(found), picture=output is not None) for track in found)
    return Plotted(file, shown, span_s[1] - span_s[0], output)


def _draw(session: SessionUser, path: Path, found: list[Track], span_s: tuple[float, float]) -> None:
    from dvtcli.cli.monitor.graph import draw_chart

    if os.path.exists(path):  # noqa: PTH110 - Path.exists raises OSError for a name that is too long
        session.consent(f"{path} exists; overwrite it?")
    draw_chart(path, found, span_s[0])


def _drawn(
    session: Conversation, track: Track, span_s: tuple[float, float], count: int, *, picture: bool
) -> PlottedSignal:
    """Return the signal with its graph, sized so that *count* graphs fit the terminal."""
    from dvtcli.cli.monitor.graph import graph, slots
    from dvtcli.operations.results import PlottedSignal

    signal = track.signal
    size = shutil.get_terminal_size((80, 24))
    height = max(_LEAST, min(_MOST, (size.lines - 2) // count - 1))
    wide = min(_WIDTH, size.columns)
    ends = "0 s", f"{span_s[1] - span_s[0]:.2f} s"
    plain = session.output.plain
    points = () if picture else track.ranges(span_s, slots(wide, plain=plain))
    drawing = () if picture else tuple(graph(points, wide, height, span_s, ends=ends, plain=plain))
    low, high = min(track.values), max(track.values)
    return PlottedSignal(track.name, signal.object, signal.meaning, len(track.values), low, high, drawing)
