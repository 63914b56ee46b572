"""The values that are known of what is on the bus, recorded into a file: a row for each frame."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from contextlib import closing, contextmanager
from pathlib import Path
from typing import TYPE_CHECKING

from dvtcli.domain.hint import Action, Hint
from dvtcli.errors import DvtcliError, SafetyRefusal, UsageError
from dvtcli.operations.frames.frame_answer import frame_seen
from dvtcli.operations.frames.layouts import live_decoder, open_wire
from dvtcli.operations.frames.running_recording import Filters, RunningRecording
from dvtcli.operations.session.save_script import ask_before_overwriting
from dvtcli.operations.session.steady_listener import SteadyListener
from dvtcli.watch.layout_fit import Misfits
from dvtcli.watch.table import SignalRows

if TYPE_CHECKING:
    from dvtcli.domain.ports import Frame
    from dvtcli.operations.results.files import Facts
    from dvtcli.operations.session.session import Session
    from dvtcli.watch.decoder import Decoder


def record_values(
    session: Session,
    path: Path,
    filters: Filters = (),
    duration_s: float | None = None,
    nodes: tuple[int, ...] | None = None,
    dbc: str | None = None,
    text: str = "",
) -> Facts:
    """Record the values of known frames into *path*, a .csv, .parquet or .jsonl; *nodes* and *dbc* say what is known.

    Only signals with *text* (small letters) in their names. It ends after *duration_s* seconds, None for never, or
    when the session is cancelled. UsageError where no such signal is known, DvtcliError where the file cannot be
    written; SafetyRefusal where the bus is back and carries other values.
    """
    from dvtcli.files.values.value_file import checked_form, write_file

    checked_form(path)
    ask_before_overwriting(session, path)
    open_wire(session)
    listening = SteadyListener(session)

    def known() -> Decoder:
        return live_decoder(session, nodes or (), dbc)

    rows = _rows(known(), text)
    misfits = Misfits(rows.layout, session.tell.warning)
    with _refused_writes(path):
        written = write_file(
            path, rows, lambda recorded_frame: frame_seen(recorded_frame, rows.decoder).chosen(text).document()
        )
        with closing(written) as file, listening as listener:

            def write(frame: Frame) -> None:
                misfits.look(frame)
                file.write(frame)

            recording = RunningRecording(session, listener, filters, write, file.flush, _the_same(path, rows, known))
            seconds = recording.run(duration_s)
        size = path.stat().st_size
    more = f", {rows.other} others left out" if rows.other else ""
    return recording.facts(path, rows.frames, seconds, size, more)


def _rows(decoder: Decoder, text: str) -> SignalRows:
    """The rows of signals that *decoder* knows and *text* chooses; UsageError where there is none."""
    rows = SignalRows(decoder, text)
    if rows.columns:
        return rows
    if text:
        raise UsageError(
            f"no signal has {text!r} in its name", hint=Hint(Action.SHOW_PDOS, why="shows what the nodes map")
        )
    raise UsageError(
        "no mapping is known: there is nothing to decode",
        hint=Hint(Action.GIVE, {"node_ids": None}, "name {} that answer") + Hint(Action.GIVE, {"dbc": None}, ", or {}"),
    )


def _the_same(path: Path, rows: SignalRows, known: Callable[[], Decoder]) -> Callable[[], None]:
    """What makes sure, where the bus is back, that the nodes still send what the columns of *path* are for."""

    def require_the_same() -> None:
        if not rows.decode_by(known()):
            raise SafetyRefusal(
                f"{path} ends: the bus is back, and the nodes send other values than its columns",
                hint="log into another file",
            )

    return require_the_same


@contextmanager
def _refused_writes(path: Path) -> Iterator[None]:
    """An error of the system as one of dvtcli that names *path*."""
    try:
        yield
    except OSError as failed:
        raise DvtcliError(f"{path}: {failed.strerror or failed}", place=str(path)) from failed
