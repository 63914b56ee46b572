"""What is on the bus, recorded into a file: every frame as it is."""

from __future__ import annotations

from pathlib import Path
from time import time
from typing import TYPE_CHECKING

from dvtcli.operations.frames.layouts import open_wire
from dvtcli.operations.frames.running_recording import Filters, RunningRecording
from dvtcli.operations.session.save_script import ask_before_overwriting
from dvtcli.operations.session.steady_listener import SteadyListener

if TYPE_CHECKING:
    from dvtcli.operations.results.files import Facts
    from dvtcli.operations.session.session import Session


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
        session.tell.warning(f"{recorder.left_out} remote frames are missing: a {path.suffix} file cannot hold them")
    files = f", in {recorder.files} files" if recorder.files > 1 else ""
    return recording.facts(path, recorder.frames, seconds, size_of(path), files)
