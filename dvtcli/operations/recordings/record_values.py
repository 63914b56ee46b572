"""Record decoded values from the bus to a file, a row per frame."""

from __future__ import annotations

import platform
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import TYPE_CHECKING

from dvtcli.domain.hint import Action, Hint
from dvtcli.errors import DvtcliError, SafetyRefusal, UsageError
from dvtcli.files.values.value_file import Rotation, ValueParts, finish_parts, next_part
from dvtcli.operations.frames.explain_frame import frame_seen
from dvtcli.operations.frames.layouts import live_decoder, open_wire
from dvtcli.operations.network.described_nodes import described_nodes
from dvtcli.operations.recordings.running_recording import Filters, RunningRecording
from dvtcli.operations.recordings.values_origin import DEFAULTS, ValuesOptions, is_parquet, parquet_form
from dvtcli.operations.session.save_script import ask_before_overwriting
from dvtcli.operations.session.steady_listener import SteadyListener
from dvtcli.watch.decoder import Misfits
from dvtcli.watch.frame_reader import FrameReader
from dvtcli.watch.table import SignalRows

if TYPE_CHECKING:
    from dvtcli.domain.ports import Frame
    from dvtcli.operations.results.documents import Document
    from dvtcli.operations.results.facts import Facts
    from dvtcli.operations.session.session import Session
    from dvtcli.operations.user.session_user import SessionUser
    from dvtcli.watch.decoder import Decoder


def record_values(
    session: Session,
    path: Path,
    filters: Filters = (),
    duration_s: float | None = None,
    nodes: tuple[int, ...] | None = None,
    dbc: str | None = None,
    text: str = "",
    options: ValuesOptions = DEFAULTS,
) -> Facts:
    """Record the values of known frames to *path*, a .csv, .parquet or .jsonl, decoded by *nodes* and *dbc*.

    Only signals with *text* (lower case) in their names. Ends after *duration_s* seconds (None: never), or when the
    session is cancelled. *options* has options of the file; the recorder defaults to this machine. Completes first what
    a killed recording left of a .parquet file; if that gets the name *path*, records into the next free name.

    Raises UsageError if no such signal is known or the suffix is another one, DvtcliError if the file cannot be
    written, BusUnavailable if the bus is lost and not waited for, SafetyRefusal if another process writes the file,
    *path* exists and may not be overwritten, or the bus returns with other mappings.
    """
    from dvtcli.files.values.value_file import checked_form, write_file

    checked_form(path)
    path = _first_file(session, path, append=options.append)
    open_wire(session)
    listening = SteadyListener(session)

    def known() -> Decoder:
        return live_decoder(session, nodes or (), dbc)

    decoder = known()
    rows = _rows(decoder, text, FrameReader(decoder, described_nodes(session, dbc)), options.only)
    misfits = Misfits(rows.layout, session.reporter.warning)
    asked = nodes or (tuple(range(1, 128)) if dbc is None else ())
    form = parquet_form(session, path, rows.decoder, options, platform.node(), asked=asked, dbc=dbc)

    def document(frame: Frame) -> Document:
        return frame_seen(frame, rows.decoder, rows.reading).chosen(text).document()

    with _refused_writes(path):
        parts = ValueParts(path, lambda part: write_file(part, rows, document, form), Rotation(*options.rotation))
    with _refused_writes(path, parts, rows), parts, listening as listener:
        bus = session.wire.name

        def write(frame: Frame) -> None:
            misfits.look(frame)
            parts.write(frame, bus)

        recording = RunningRecording(session, listener, filters, write, parts.flush, _the_same(path, rows, known))
        seconds = recording.run(duration_s)
    more = f", in {len(parts.files)} files" if len(parts.files) > 1 else ""
    more += f", {rows.other} others left out" if rows.other else ""
    session.made += [str(part) for part in parts.files[1:]]
    return recording.facts(path, rows.frames, seconds, parts.size, more)


def _first_file(session: SessionUser, path: Path, *, append: bool) -> Path:
    """Return the first file after completing killed recordings: *path*, or a file after it.

    After it with *append*, and if *path* is a recording that was completed just now.
    """
    with _refused_writes(path):
        for finished in finish_parts(path) if is_parquet(path) else ():
            if finished.rows:
                session.reporter.note(f"{finished.path}: {finished.rows} rows of a recording that was killed")
            if finished.aside is not None:
                session.reporter.warning(f"the recording is damaged after them; all of it is kept in {finished.aside}")
            append = append or finished.path == path
        if append:
            return next_part(path)
    ask_before_overwriting(session, path)
    return path


def _rows(decoder: Decoder, text: str, reader: FrameReader, only: frozenset[str]) -> SignalRows:
    """Return the rows of signals chosen by *text*; raises UsageError if there are none."""
    rows = SignalRows(decoder, text, reader, only)
    if rows.columns:
        return rows
    if text:
        raise UsageError(
            f"no signal has {text!r} in its name", hint=Hint(Action.SHOW_PDOS, why="shows what the nodes map")
        )
    raise UsageError(
        "no mappings: there is nothing to decode",
        hint=Hint(Action.GIVE, {"node_ids": None}, "name {} that answer") + Hint(Action.GIVE, {"dbc": None}, ", or {}"),
    )


def _the_same(path: Path, rows: SignalRows, known: Callable[[], Decoder]) -> Callable[[], None]:
    """Return a check that, after the bus returned, the nodes' mappings still fit the columns of *path*."""

    def require_the_same() -> None:
        if not rows.decode_by(known()):
            raise SafetyRefusal(
                f"{path} ends: the bus is back, but the nodes transmit other values than its columns",
                hint="log into another file",
            )

    return require_the_same


@contextmanager
def _refused_writes(path: Path, parts: ValueParts | None = None, rows: SignalRows | None = None) -> Iterator[None]:
    """Turn OSError into DvtcliError with *path*, or the last of *parts* and what is kept of *rows*."""
    try:
        yield
    except OSError as failed:
        at, after, kept = path, "", ""
        if parts is not None and rows is not None:
            at, after, kept = parts.files[-1], f" after {rows.frames} frames", parts.kept()
        raise DvtcliError(f"{at}: {failed.strerror or failed}{after}", place=str(at), hint=kept or None) from failed
