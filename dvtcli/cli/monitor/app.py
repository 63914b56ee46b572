"""The monitor: what its screen shows, and what its keys do to it. What is drawn is `screen`'s.

Mappings are read, and a bus that is gone is waited for, in threads, so that the screen stays alive.
"""

from __future__ import annotations

from copy import deepcopy
from time import monotonic, time
from typing import TYPE_CHECKING

from dvtcli.cli.monitor.gone_bus import GoneBus
from dvtcli.cli.monitor.mapping_reader import MappingReader
from dvtcli.cli.monitor.monitor_state import Moment, View
from dvtcli.cli.monitor.screen import chosen_signals, picture
from dvtcli.cli.monitor.signal_lines import Lines
from dvtcli.errors import BusUnavailable
from dvtcli.watch.seen import FrameStore

if TYPE_CHECKING:
    from dvtcli.operations.frames.watch_bus import Watched


class Monitor:
    """What is on the screen: the store that all frames go to, and, while paused, a copy of it that stands still."""

    def __init__(self, name: str, watched: Watched, view: View) -> None:
        self._name = name
        self._watched = watched
        self.store = FrameStore(watched.decoder, watched.bitrate)
        self.view = view
        self._began_s = monotonic()
        self._still: tuple[FrameStore, Moment] | None = None
        self._reader = MappingReader(watched)
        self._gone = GoneBus(watched.listener)

    def _moment(self) -> Moment:
        running_s, dropped = monotonic() - self._began_s, self._watched.listener.dropped
        return Moment(self._name, running_s, dropped, time(), self._gone.gone_s, self._reader.node)

    def gather(self) -> None:
        """Take what has arrived; BusUnavailable where the bus failed and is not waited for."""
        gone_s = self._gone.back_after_s()
        if self._gone.is_waiting():
            return
        if gone_s is not None:
            self._is_back(gone_s)
        news = self._reader.news()
        if news is not None:
            self.store.know(news)
        try:
            for frame in self._watched.listener.take():
                self.store.take(frame)
        except BusUnavailable as failed:
            self._gone.wait(failed)

    def read_mappings(self) -> None:
        """Read the nodes' mappings anew, unless that is being done."""
        if not self._gone.is_waiting() and not self._reader.is_reading:
            self._reader = MappingReader(self._watched)

    def _is_back(self, gone_s: float) -> None:
        """The bus is there again: nothing that was seen before counts, the mappings neither."""
        self.store.gap(time(), f"the bus was gone for {gone_s:.0f} s: nothing was seen meanwhile")
        self._reader.stop()
        self._reader = MappingReader(self._watched)

    def leave(self) -> None:
        """Wait for the bus no longer, and read no more."""
        self._gone.leave()
        self._reader.stop()

    def pause(self) -> None:
        """Let the screen stand still, or go on; frames are counted on."""
        self.view.paused = not self.view.paused
        self._still = (deepcopy(self.store), self._moment()) if self.view.paused else None

    def choose(self, step: int) -> None:
        """Choose another signal; behind the last one, scroll to the frames that stand there."""
        self.view.choose(step, len(chosen_signals(self._shown()[0], self.view)))

    def _shown(self) -> tuple[FrameStore, Moment]:
        return self._still or (self.store, self._moment())

    def lines(self, columns: int, rows: int) -> Lines:
        """The screen of *columns* x *rows*."""
        store, moment = self._shown()
        return picture(store, self.view, moment, columns, rows)
