"""Run a recording until its time is over, across loss and return of the bus."""

from __future__ import annotations

from collections.abc import Callable, Iterable
from dataclasses import dataclass
from pathlib import Path
from time import monotonic, time
from typing import TYPE_CHECKING

from dvtcli.errors import BusUnavailable, DvtcliError, ended_with
from dvtcli.operations.frames.layouts import open_wire
from dvtcli.operations.frames.watch_bus import ListeningTime
from dvtcli.operations.results.facts import Facts
from dvtcli.operations.session.save_script import ask_before_overwriting
from dvtcli.operations.session.steady_listener import SteadyListener

if TYPE_CHECKING:
    from dvtcli.domain.ports import Frame
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
    """Record frames that pass one of *filters* (empty: all) to *path*, in the format of its suffix.

    Ends after *duration_s* seconds (None: never), or when the session is cancelled. *append* continues the file; a new
    file begins after *most_bytes* (0: never). Raises UsageError for an unknown suffix, BusUnavailable if the bus is
    lost and not waited for.
    """
    from dvtcli.files.recordings.formats import format_of
    from dvtcli.files.recordings.recorder import Recorder, size_of

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

        with self.session.cancellation.guard():
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
