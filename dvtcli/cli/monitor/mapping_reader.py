"""Reads the nodes' mappings beside a screen that is drawn meanwhile. Knows no screen."""

from __future__ import annotations

import threading
from typing import TYPE_CHECKING

from dvtcli.errors import BusUnavailable

if TYPE_CHECKING:
    from dvtcli.operations.frames.watch_bus import Watched
    from dvtcli.watch.decoder import Decoder

#: how long leaving waits for the answer that is under way (s)
LEAVE_S = 2.0


class MappingReader:
    """Reads what *watched* is to know, once, in a thread; `news` is what it knows so far."""

    def __init__(self, watched: Watched) -> None:
        self._watched = watched
        #: the node that is being read, None where none is
        self.node: int | None = None
        #: what ended it, None where nothing did; a bus that is gone is the listener's to say
        self.failure: BaseException | None = None
        #: whether there is more to come
        self.is_reading = True
        self._news: Decoder | None = None
        self._stopping = False
        self._thread = threading.Thread(target=self._read, name="reading mappings", daemon=True)
        self._thread.start()

    def _read(self) -> None:
        try:
            for node, known in self._watched.decoders():
                self.node, self._news = node, known
                if self._stopping:
                    break
        except BusUnavailable:
            pass
        except BaseException as failed:  # noqa: BLE001 - nobody sees what ends a thread: `news` raises it
            self.failure = failed
        finally:  # in this order: who sees that no node is being read may ask for the next reading at once
            self.is_reading, self.node = False, None

    def news(self) -> Decoder | None:
        """What is known by now, None where that is no more than the last time; raises what the reading failed with."""
        news, self._news = self._news, None
        if self.failure is not None:
            raise self.failure
        return news

    def stop(self) -> None:
        """Read no other node."""
        self._stopping = True
        self._thread.join(LEAVE_S)
