"""Record the bus until its time is over, across its loss and return; decoded values as a row per frame."""

from __future__ import annotations

import platform
from collections.abc import Callable, Iterable, Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path
from time import monotonic, time
from typing import TYPE_CHECKING

from dvtcli.domain.hint import Action, Hint
from dvtcli.errors import BusUnavailable, DvtcliError, SafetyRefusal, UsageError, ended_with
from dvtcli.files.values.value_file import Rotation, ValueParts, checked_form, finish_parts, next_part, write_file
from dvtcli.operations.frames.decode_recording import DEFAULTS, ValuesOptions, is_parquet, parquet_form
from dvtcli.operations.frames.explain_frame import frame_seen
from dvtcli.operations.frames.layouts import live_decoder, open_wire
from dvtcli.operations.frames.watch_bus import ListeningTime
from dvtcli.operations.network.described_nodes import described_nodes
from dvtcli.operations.results.facts import Facts
from dvtcli.operations.session.save_script import ask_before_overwriting
from dvtcli.operations.session.steady_listener import SteadyListener
from dvtcli.watch.decoder import Misfits
from dvtcli.watch.frame_reader import FrameReader
from dvtcli.watch.table import SignalRows

if TYPE_CHECKING:
    from dvtcli.domain.ports import Frame
    from dvtcli.operations.results.documents import Document
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
        hint=Hint(Action.GIVE, {"node_ids": None}, "name nodes that answer: {}")
        + Hint(Action.GIVE, {"dbc": None}, ", or {}"),
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


def record_frames(
    session: Session,
    path: Path,
    filters: Filters = (),
    duration_s: float | None = None,
    *,
    append: bool = False,
    most_bytes: int = 0,
) -> Facts:
    """Record frames that pass one of *filters* (empty: all) to *path*, in the format of its suffix.

    Ends after *duration_s* seconds (None: never), or when the session is cancelled. *append* continues the file; a new
    file begins after *most_bytes* (0: never). Raises UsageError for an unknown suffix, BusUnavailable if the bus is
    lost and not waited for.
    """
    from dvtcli.files.recordings.formats import format_of
    from dvtcli.files.recordings.recording_file import Recorder, size_of

    if not append:
        ask_before_overwriting(session, path)
    format_of(path)
    open_wire(session)
    listening = SteadyListener(session)
    with Recorder(path, append=append, most_bytes=most_bytes) as recorder, listening as listener:

        def note_gap() -> None:
            recorder.note(f"{listener.gaps_s[-1]:.1f} s are missing: the bus was gone", time())

        recording = RunningRecording(session, listener, filters, recorder.write, recorder.flush, note_gap)
        seconds = recording.run(duration_s)
    if recorder.left_out:
        session.reporter.warning(
            f"{recorder.left_out} remote frames are missing: a {path.suffix} file cannot hold them"
        )
    files = f", in {recorder.files} files" if recorder.files > 1 else ""
    return recording.facts(path, recorder.frames, seconds, size_of(path), files)


#: CAN-IDs with their masks
Filters = tuple[tuple[int, int], ...]


@dataclass(slots=True)
class RunningRecording:
    """Frames from *listener* on the bus of *session* that pass one of *filters* (empty: all), for *write*.

    *flush* is called after each batch, *on_back* after the bus returned.
    """

    session: Session
    listener: SteadyListener
    filters: Filters
    write: Callable[[Frame], None]
    flush: Callable[[], None]
    on_back: Callable[[], None]

    def run(self, duration_s: float | None) -> float:
        """Write frames until Ctrl-C or *duration_s*; returns the seconds recorded. Frames are written whole.

        Frames received by then are written afterwards: on a busy bus this takes some time.
        """
        began_s = self.listener.began_s
        time = ListeningTime(duration_s, began_s=began_s)
        self.session.reporter.note("recording; Ctrl-C ends it")

        def is_over() -> bool:
            return self.session.cancellation.requested or time.is_over()

        with self.session.cancellation.deferred():
            while not is_over():
                failed = self._write_batch(time.batch_s)
                if failed is not None and self._is_back(failed, is_over):
                    self.on_back()
            self.listener.stop()
            seconds = monotonic() - began_s
            self._write_batch(0.0)
        return seconds

    def _write_batch(self, wait_s: float) -> BusUnavailable | None:
        """Write received frames, waiting *wait_s* for the first; returns the error if the bus failed."""
        failure: BusUnavailable | None = None
        taken: list[Frame] = []
        try:
            if not self.listener.is_gone:
                taken = self.listener.take(wait_s)
        except BusUnavailable as failed:
            failure = failed
        for frame in self._chosen(taken):
            self.write(frame)
        self.flush()
        return failure

    def _chosen(self, taken: Iterable[Frame]) -> Iterable[Frame]:
        if not self.filters:
            return taken
        return (frame for frame in taken if any(frame.can_id & mask == can_id & mask for can_id, mask in self.filters))

    def _is_back(self, failed: BusUnavailable, is_over: Callable[[], bool]) -> bool:
        """Wait for the bus, which *failed*, until *is_over*() or Ctrl-C; returns whether it is back.

        Flushes meanwhile: what was received is on the disk by then.
        """

        def flush_and_look() -> bool:
            self.flush()
            return is_over()

        try:
            with self.session.cancellation.released():
                return self.listener.come_back(failed, flush_and_look)
        except KeyboardInterrupt:
            self.session.cancellation.requested = True
            return False

    def facts(self, path: Path, frames: int, seconds: float, size: int, more: str) -> Facts:
        """Summarise: *frames* in *seconds*, *size* bytes in the file at *path*, and *more* in words."""
        session, listener = self.session, self.listener
        session.made.append(str(path))
        listener.tell_overflow()
        rows = (
            ("file", str(path)), ("frames", frames), ("seconds", round(seconds, 3)), ("dropped", listener.dropped),
            ("bytes", size), ("gaps", len(listener.gaps_s)), ("gone_s", round(sum(listener.gaps_s), 3)),
        )  # fmt: skip
        text = f"{path}: {frames} frames in {seconds:.2f} s, {listener.dropped} dropped, {size} bytes{more}"
        if listener.gaps_s:
            text += f"; the bus was gone {len(listener.gaps_s)}x, for {sum(listener.gaps_s):.1f} s in all"
        failure: DvtcliError | None = None
        if session.cancellation.requested:
            failure = ended_with(
                session.cancellation.exit_code, "the recording was ended by a signal; its file was closed"
            )
        elif listener.is_gone:
            failure = BusUnavailable("the bus was gone when the recording ended")
        return Facts("log", rows, (text,), failure)
