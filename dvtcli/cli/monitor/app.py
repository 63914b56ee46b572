"""The monitor: what its screen shows, and what its keys do to it. What is drawn is `screen`'s.

Mappings are read, and a bus that is gone is waited for, in threads, so that the screen stays alive.
"""

from __future__ import annotations

import threading
from copy import deepcopy
from time import monotonic, time
from typing import TYPE_CHECKING

from dvtcli.cli.monitor.mapping_reader import MappingReader
from dvtcli.cli.monitor.screen import Lines, Moment, View, chosen_signals, picture
from dvtcli.errors import BusUnavailable, DvtcliError
from dvtcli.watch.seen import FrameStore

if TYPE_CHECKING:
    from dvtcli.operations.watch_bus import Watched

#: how long leaving may take where the bus is being opened (s)
_LEAVE_S = 0.2


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
        #: who waits for a bus that is gone, since when (s, monotonic), and what ended the waiting
        self._waiting: threading.Thread | None = None
        self._gone_s = 0.0
        self._failure: DvtcliError | None = None
        self._leaving = threading.Event()

    def _moment(self) -> Moment:
        gone_s = monotonic() - self._gone_s if self._waiting is not None else None
        running_s, dropped = monotonic() - self._began_s, self._watched.listener.dropped
        return Moment(self._name, running_s, dropped, time(), gone_s, self._reader.node)

    def gather(self) -> None:
        """Take what has arrived; BusUnavailable where the bus failed and is not waited for."""
        if self._waiting is not None:
            if self._waiting.is_alive():
                return
            self._is_back()
        news = self._reader.news()
        if news is not None:
            self.store.know(news)
        try:
            for frame in self._watched.listener.take():
                self.store.take(frame)
        except BusUnavailable as failed:
            self._wait(failed)

    def read_mappings(self) -> None:
        """Read the nodes' mappings anew, unless that is being done."""
        if self._waiting is None and not self._reader.is_reading:
            self._reader = MappingReader(self._watched)

    def _wait(self, failed: BusUnavailable) -> None:
        """Let a thread wait for the bus, which *failed*."""

        def wait() -> None:
            try:
                self._watched.listener.come_back(failed, self._leaving.is_set)
            except DvtcliError as ended:
                self._failure = ended

        self._gone_s = monotonic()
        self._waiting = threading.Thread(target=wait, name="waiting for the bus", daemon=True)
        self._waiting.start()

    def _is_back(self) -> None:
        """The bus is there again: nothing that was seen before counts, the mappings neither."""
        self._waiting = None
        if self._failure is not None:
            raise self._failure
        gone_s = monotonic() - self._gone_s
        self.store.gap(time(), f"the bus was gone for {gone_s:.0f} s: nothing was seen meanwhile")
        self._reader.stop()
        self._reader = MappingReader(self._watched)

    def leave(self) -> None:
        """Wait for the bus no longer, and read no more."""
        self._leaving.set()
        if self._waiting is not None:
            self._waiting.join(_LEAVE_S)
        self._reader.stop()

    def pause(self) -> None:
        """Let the screen stand still, or go on; frames are counted on."""
        self.view.paused = not self.view.paused
        self._still = (deepcopy(self.store), self._moment()) if self.view.paused else None

    def choose(self, step: int) -> None:
        """Choose another signal."""
        last = len(chosen_signals(self._shown()[0], self.view)) - 1
        self.view.chosen = max(0, min(last, self.view.chosen + step))

    def _shown(self) -> tuple[FrameStore, Moment]:
        return self._still or (self.store, self._moment())

    def lines(self, columns: int, rows: int) -> Lines:
        """The screen of *columns* x *rows*."""
        store, moment = self._shown()
        return picture(store, self.view, moment, columns, rows)
