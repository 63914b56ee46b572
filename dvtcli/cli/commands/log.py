"""Record what is on the bus: as .asc .blf .log .trc .mf4, or decoded as .csv."""

from __future__ import annotations

import os
from contextlib import closing
from pathlib import Path
from time import monotonic
from typing import TYPE_CHECKING, Any

import click

from dvtcli.cli.command import DvtCommand
from dvtcli.cli.commands._live_params import CanFilterType, NodesType, SecondsType
from dvtcli.cli.params import FILE, NumberType

if TYPE_CHECKING:
    from collections.abc import Callable

    from dvtcli.domain.ports import Frame
    from dvtcli.operations.results import Facts
    from dvtcli.operations.session import Session
    from dvtcli.watch.decoder import Decoder
    from dvtcli.watch.listener import Listener

#: how long frames are gathered before they are written (s)
_BATCH_S = 0.05
Filters = tuple[tuple[int, int], ...]


@click.command("log", cls=DvtCommand, short_help=__doc__)
@click.argument("file", type=FILE)
@click.option("-a", "--append", is_flag=True, help="Behind what is there (.blf .log).")
@click.option(
    "-s", "--file_size", "--file-size", "size", type=NumberType(1000, 1 << 40, "a size in bytes"), metavar="BYTES",
    help="A new file after so many bytes (.asc .blf .log).",
)  # fmt: skip
@click.option("--filter", "filters", type=CanFilterType(), multiple=True, metavar="ID:MASK", help="Hex; repeatable.")
@click.option("--duration", type=SecondsType(), metavar="S", help="End after S seconds.")
@click.option("--decode", is_flag=True, help="Into a .csv file: values, one column a signal.")
@click.option("--nodes", type=NodesType(), metavar="ID,…", help="For --decode: nodes whose mapping is read.")
@click.option("-d", "--dbc", type=FILE, metavar="FILE", help="For --decode: a DBC file.")
@click.pass_obj
def command(
    session: Session,
    /,
    file: str,
    append: bool,
    size: int | None,
    filters: Filters,
    duration: float | None,
    decode: bool,
    **sources: Any,
) -> Facts:
    """Record every frame into FILE until Ctrl-C; its suffix says the format.

    Sends nothing; with --decode SDO uploads, once, at the start.

    \b
    log run.asc
    log run.log --duration 10 --filter 180:780
    log run.blf --file_size 5000000
    log speed.csv --decode --nodes 5
    """
    from dvtcli.errors import UsageError

    path = Path(file)
    if decode and (path.suffix.lower() != ".csv" or append or size):
        raise UsageError("--decode writes a new .csv file", hint="log run.csv --decode; leave --append and -s out")
    _check_target(session, path, append=append)
    if decode:
        return _log_values(session, path, filters, duration, **sources)
    return _log_frames(session, path, filters, duration, append=append, most_bytes=size or 0)


def _check_target(session: Session, path: Path, *, append: bool) -> None:
    if not append and os.path.exists(path):  # noqa: PTH110 - Path.exists raises OSError for a name that is too long
        session.consent(f"{path} exists; overwrite it?")


def _log_frames(
    session: Session, path: Path, filters: Filters, duration_s: float | None, *, append: bool, most_bytes: int
) -> Facts:
    from dvtcli.files.recording import Recorder, checked_suffix, size_of
    from dvtcli.operations.layouts import open_wire
    from dvtcli.watch.listener import Listener

    checked_suffix(path)
    listening = Listener(open_wire(session), session.secrets.in_frame)
    with Recorder(path, append=append, most_bytes=most_bytes) as recorder, listening as listener:
        seconds = _record(session, listener, recorder.write, recorder.flush, filters, duration_s)
    if recorder.left_out:
        session.output.warning(f"{recorder.left_out} remote frames are missing: a {path.suffix} file cannot hold them")
    files = f", in {recorder.files} files" if recorder.files > 1 else ""
    return _facts(session, path, recorder.frames, seconds, listener.dropped, (size_of(path), files))


def _log_values(
    session: Session,
    path: Path,
    filters: Filters,
    duration_s: float | None,
    nodes: tuple[int, ...] | None,
    dbc: str | None,
) -> Facts:
    from dvtcli.errors import DvtcliError, UsageError
    from dvtcli.operations.layouts import live_decoder, open_wire
    from dvtcli.watch.listener import Listener
    from dvtcli.watch.table import SignalTable

    listening = Listener(open_wire(session), session.secrets.in_frame)
    decoder: Decoder = live_decoder(session, nodes or (), dbc)
    if not len(decoder):
        raise UsageError("no mapping is known: there is nothing to decode", hint="name --nodes that answer, or --dbc")
    try:
        with closing(path.open("w", encoding="utf-8", newline="")) as file, listening as listener:
            table = SignalTable(file, decoder)
            seconds = _record(session, listener, table.write, file.flush, filters, duration_s)
        size = path.stat().st_size
    except OSError as failed:
        raise DvtcliError(f"{path}: {failed.strerror or failed}", place=str(path)) from failed
    more = f", {table.other} others left out" if table.other else ""
    return _facts(session, path, table.frames, seconds, listener.dropped, (size, more))


def _record(
    session: Session,
    listener: Listener,
    write: Callable[[Frame], None],
    flush: Callable[[], None],
    filters: Filters,
    duration_s: float | None,
) -> float:
    """Write frames until Ctrl-C or the end of the time; the seconds it took. A frame is written whole."""
    session.output.note("recording; Ctrl-C ends it")
    began_s = monotonic()
    until_s = None if duration_s is None else began_s + duration_s
    with session.cancellation.guard():
        ended = False
        while not ended:
            ended = session.cancellation.requested or (until_s is not None and monotonic() >= until_s)
            for frame in listener.take(0.0 if ended else _BATCH_S):
                if not filters or any(frame.can_id & mask == can_id & mask for can_id, mask in filters):
                    write(frame)
            flush()
    return monotonic() - began_s


def _facts(session: Session, path: Path, frames: int, seconds: float, dropped: int, size: tuple[int, str]) -> Facts:
    from dvtcli.operations.results import Facts

    if dropped:
        session.output.warning(f"{dropped} frames were dropped: they came faster than they were written")
    rows = (
        ("file", str(path)), ("frames", frames), ("seconds", round(seconds, 3)), ("dropped", dropped),
        ("bytes", size[0]),
    )  # fmt: skip
    text = f"{path}: {frames} frames in {seconds:.2f} s, {dropped} dropped, {size[0]} bytes{size[1]}"
    code = session.cancellation.exit_code if session.cancellation.requested else 0
    return Facts("log", rows, (text,), exit_code=code)
