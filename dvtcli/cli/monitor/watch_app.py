"""`watch`: what its screen shows, and what its keys do to it. What is drawn is `watch_screen`'s.

Objects and mappings are read, and a bus that is gone is waited for, in threads, so that the screen stays alive.
"""

from __future__ import annotations

from collections.abc import Sequence
from copy import deepcopy
from time import monotonic, time
from typing import TYPE_CHECKING

from dvtcli.cli.monitor.gone_bus import GoneBus
from dvtcli.cli.monitor.mapping_reader import MappingReader
from dvtcli.cli.monitor.monitor_state import Moment, View
from dvtcli.cli.monitor.object_reader import ObjectReader
from dvtcli.cli.monitor.signal_lines import Lines
from dvtcli.cli.monitor.watch_screen import Board, WatchedPdo, shown_values, watch_picture
from dvtcli.domain.abort import abort_text
from dvtcli.errors import BusUnavailable, DvtcliError
from dvtcli.watch.decoder import Signal
from dvtcli.watch.seen import FrameStore
from dvtcli.watch.watched_object import WatchedObject

if TYPE_CHECKING:
    from dvtcli.operations.frames.watch_bus import Watched
    from dvtcli.operations.objects.watch_objects import ObjectRound
    from dvtcli.operations.results import ValueRead


class WatchScreen:
    """What is on the screen: the board that everything goes to, and, while paused, a copy of it that stands still."""

    def __init__(
        self, watched: Watched, objects: ObjectRound, pdos: Sequence[WatchedPdo], every_s: float, view: View
    ) -> None:
        self._watched, self._objects = watched, objects
        rows = [
            WatchedObject(node_id, Signal(f"{index:04X}:{sub:02X}", "", f"{index:04X}:{sub:02X}"))
            for node_id, index, sub in objects.objects
        ]
        self.board = Board(rows, pdos, FrameStore(watched.decoder), every_s)
        self.view = view
        self._name = watched.session.wire.name
        self._began_s = monotonic()
        self._still: tuple[Board, Moment] | None = None
        self._gone = GoneBus(watched.listener)
        self._begin()

    def _begin(self) -> None:
        self._mappings = MappingReader(self._watched) if self.board.pdos else None
        self._reader = ObjectReader(self._objects, self.board.every_s) if self.board.objects else None

    def _end(self) -> None:
        for reader in (self._mappings, self._reader):
            if reader is not None:
                reader.stop()

    def _moment(self) -> Moment:
        reading = None if self._mappings is None else self._mappings.node
        return Moment(self._name, monotonic() - self._began_s, 0, time(), self._gone.gone_s, reading)

    def gather(self) -> None:
        """Take what has arrived; BusUnavailable where the bus failed and is not waited for."""
        back_after_s = self._gone.back_after_s()
        if self._gone.is_waiting():
            return
        if back_after_s is not None:
            self.board.store.gap(time(), "")
            self._end()
            self._begin()
        news = None if self._mappings is None else self._mappings.news()
        if news is not None:
            self.board.store.know(news)
        for number, at_s, found in () if self._reader is None else self._reader.take():
            _note(self.board.objects[number], at_s, found)
        try:
            for frame in self._watched.listener.take():
                self.board.store.take(frame)
        except BusUnavailable as failed:
            self._gone.wait(failed)

    def read_mappings(self) -> None:
        """Read the mappings anew, unless that is being done."""
        if self._mappings is not None and not self._mappings.is_reading and not self._gone.is_waiting():
            self._mappings = MappingReader(self._watched)

    def pause(self) -> None:
        """Let the screen stand still, or go on; values are taken on."""
        self.view.paused = not self.view.paused
        self._still = (deepcopy(self.board), self._moment()) if self.view.paused else None

    def choose(self, step: int) -> None:
        """Choose another value."""
        last = len(shown_values(self._shown()[0])) - 1
        self.view.chosen = max(0, min(last, self.view.chosen + step))

    def leave(self) -> None:
        """Wait for the bus no longer, and read no more."""
        self._gone.leave()
        self._end()

    def _shown(self) -> tuple[Board, Moment]:
        return self._still or (self.board, self._moment())

    def lines(self, columns: int, rows: int) -> Lines:
        """The screen of *columns* x *rows*."""
        board, moment = self._shown()
        return watch_picture(board, self.view, moment, columns, rows)


def _note(watched: WatchedObject, at_s: float, found: ValueRead | DvtcliError) -> None:
    if isinstance(found, DvtcliError):
        watched.fail(found.text if found.abort is None else f"refused: {abort_text(found.abort)}")
    else:
        watched.take(
            Signal(found.object, found.name, found.object, found.meaning, 8 * len(found.raw)), found.value, at_s
        )
