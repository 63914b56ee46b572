"""What is on the bus, recorded into a file: frames as they are, or the values that are known of them."""

from __future__ import annotations

import os
from collections.abc import Callable
from contextlib import closing
from pathlib import Path
from time import monotonic, time
from typing import TYPE_CHECKING

from dvtcli.errors import BusUnavailable, DvtcliError, SafetyRefusal, UsageError
from dvtcli.operations.frames.frame_answer import frame_seen
from dvtcli.operations.frames.layouts import live_decoder, open_wire
from dvtcli.operations.results import Facts
from dvtcli.operations.session.steady_listener import SteadyListener
from dvtcli.watch.layout_fit import Misfits
from dvtcli.watch.table import SignalRows

if TYPE_CHECKING:
    from dvtcli.domain.ports import Frame
    from dvtcli.operations.session.session import Session
    from dvtcli.watch.decoder import Layout

#: how long frames are gathered before they are written (s)
_BATCH_S = 0.05
#: exit code of a recording that ended while its bus was gone
_GONE = BusUnavailable.exit_code
#: CAN-IDs with the bits of them that count
Filters = tuple[tuple[int, int], ...]


def record_frames(
    session: Session,
    path: Path,
    filters: Filters = (),
    duration_s: float | None = None,
    *,
    append: bool = False,
    most_bytes: int = 0,
) -> Facts:
    """Record every frame that passes one of *filters* (none: every frame) into *path*, whose suffix says the format.

    It ends after *duration_s* seconds, None for never, or when the session is cancelled. *append* writes behind what
    is there; a new file begins after *most_bytes*, 0 for never. UsageError for a suffix that is no format,
    BusUnavailable where the bus is gone and the session does not wait for it.
    """
    from dvtcli.files.recorder import Recorder, size_of
    from dvtcli.files.recording_formats import format_of

    _check_target(session, path, append=append)
    format_of(path)
    open_wire(session)
    listening = SteadyListener(session)
    with Recorder(path, append=append, most_bytes=most_bytes) as recorder, listening as listener:

        def note_gap() -> None:
            recorder.note(f"{listener.gaps_s[-1]:.1f} s are missing: the bus was gone", time())

        seconds = _record(session, listener, recorder.write, recorder.flush, filters, duration_s, note_gap)
    if recorder.left_out:
        session.tell.warning(f"{recorder.left_out} remote frames are missing: a {path.suffix} file cannot hold them")
    files = f", in {recorder.files} files" if recorder.files > 1 else ""
    return _facts(session, path, recorder.frames, seconds, listener, (size_of(path), files))


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
    _check_target(session, path, append=False)
    open_wire(session)
    listening = SteadyListener(session)
    rows = SignalRows(live_decoder(session, nodes or (), dbc), text)
    if not rows.columns:
        raise _nothing_known(text)
    try:
        written = write_file(path, rows, lambda one: frame_seen(one, rows.decoder).chosen(text).document())
        with closing(written) as file, listening as listener:

            def require_the_same() -> None:
                if not rows.decode_by(live_decoder(session, nodes or (), dbc)):
                    raise SafetyRefusal(
                        f"{path} ends: the bus is back, and the nodes send other values than its columns",
                        hint="log into another file",
                    )

            def layout_of(frame: Frame) -> Layout:
                return rows.decoder.layout(frame)  # another one after the bus was gone

            misfits = Misfits(layout_of, session.tell.warning)

            def write(frame: Frame) -> None:
                misfits.look(frame)
                file.write(frame)

            seconds = _record(session, listener, write, file.flush, filters, duration_s, require_the_same)
        size = path.stat().st_size
    except OSError as failed:
        raise DvtcliError(f"{path}: {failed.strerror or failed}", place=str(path)) from failed
    more = f", {rows.other} others left out" if rows.other else ""
    return _facts(session, path, rows.frames, seconds, listener, (size, more))


def _nothing_known(text: str) -> UsageError:
    if text:
        return UsageError(f"no signal has {text!r} in its name", hint="`pdo` shows what the nodes map")
    return UsageError("no mapping is known: there is nothing to decode", hint="name --nodes that answer, or --dbc")


def _record(
    session: Session,
    listener: SteadyListener,
    write: Callable[[Frame], None],
    flush: Callable[[], None],
    filters: Filters,
    duration_s: float | None,
    on_back: Callable[[], None] = lambda: None,
) -> float:
    """Write frames until Ctrl-C or the end of the time; the seconds that were listened. A frame is written whole.

    What came until then is written after it: on a busy bus that takes its time. *on_back* is called where the bus was
    gone, and is back.
    """
    began_s = listener.began_s
    session.tell.note("recording; Ctrl-C ends it")
    until_s = None if duration_s is None else began_s + duration_s

    def is_over() -> bool:
        return session.cancellation.requested or (until_s is not None and monotonic() >= until_s)

    with session.cancellation.guard():
        ended, seconds = False, 0.0
        while not ended:
            ended = is_over()
            if ended:
                seconds = monotonic() - began_s
                listener.stop()
            try:
                taken = [] if listener.is_gone else listener.take(0.0 if ended else _BATCH_S)
            except BusUnavailable as failed:
                flush()
                if not ended and _is_back(session, listener, failed, is_over):
                    on_back()
                continue
            for frame in taken:
                if not filters or any(frame.can_id & mask == can_id & mask for can_id, mask in filters):
                    write(frame)
            flush()
    return seconds


def _is_back(session: Session, listener: SteadyListener, failed: BusUnavailable, is_over: Callable[[], bool]) -> bool:
    """Wait for the bus, which *failed*, until *is_over*() or Ctrl-C, which ends the recording; whether it is back."""
    try:
        with session.cancellation.released():
            return listener.come_back(failed, is_over)
    except KeyboardInterrupt:
        session.cancellation.requested = True
        return False


def _facts(
    session: Session, path: Path, frames: int, seconds: float, listener: SteadyListener, size: tuple[int, str]
) -> Facts:
    session.made.append(str(path))
    dropped = listener.dropped
    if listener.overflowed:
        session.tell.warning(f"{listener.overflowed} frames were dropped: they came faster than they were written")
    rows = (
        ("file", str(path)), ("frames", frames), ("seconds", round(seconds, 3)), ("dropped", dropped),
        ("bytes", size[0]), ("gaps", len(listener.gaps_s)), ("gone_s", round(sum(listener.gaps_s), 3)),
    )  # fmt: skip
    text = f"{path}: {frames} frames in {seconds:.2f} s, {dropped} dropped, {size[0]} bytes{size[1]}"
    if listener.gaps_s:
        text += f"; the bus was gone {len(listener.gaps_s)}x, for {sum(listener.gaps_s):.1f} s in all"
    code = session.cancellation.exit_code if session.cancellation.requested else _GONE if listener.is_gone else 0
    return Facts("log", rows, (text,), exit_code=code)


def _check_target(session: Session, path: Path, *, append: bool) -> None:
    if not append and os.path.exists(path):  # noqa: PTH110 - Path.exists raises OSError for a name that is too long
        session.consent(f"{path} exists; overwrite it?")
