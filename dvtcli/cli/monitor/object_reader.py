"""Reads objects again and again beside a screen that is drawn meanwhile. Knows no screen."""

from __future__ import annotations

import threading
from collections import deque
from time import monotonic, time
from typing import TYPE_CHECKING

from dvtcli.cli.monitor.mapping_reader import LEAVE_S
from dvtcli.errors import BusUnavailable, DvtcliError

if TYPE_CHECKING:
    from dvtcli.operations.objects.watch_objects import ObjectRound
    from dvtcli.operations.results import ValueRead


class ObjectReader:
    """Reads each of *objects* every *every_s* seconds, in a thread; what takes longer leaves moments out.

    A bus that is gone ends it: that is the listener's to say. Whatever else ends it is raised by `take`.
    """

    def __init__(self, objects: ObjectRound, every_s: float) -> None:
        self._objects = objects
        self._every_s = every_s
        self._found: deque[tuple[int, float, ValueRead | DvtcliError]] = deque(maxlen=10_000)
        self._failure: BaseException | None = None
        self._stopping = threading.Event()
        self._thread = threading.Thread(target=self._read, name="reading objects", daemon=True)
        self._thread.start()

    def _read(self) -> None:
        try:
            self._read_on()
        except BusUnavailable:
            pass
        except BaseException as failed:  # noqa: BLE001 - nobody sees what ends a thread: `take` raises it
            self._failure = failed

    def _read_on(self) -> None:
        next_s = monotonic()
        while not self._stopping.wait(max(0.0, next_s - monotonic())):
            for number in range(len(self._objects.objects)):
                if self._stopping.is_set():
                    return
                try:
                    found: ValueRead | DvtcliError = self._objects.read(number)
                except BusUnavailable:
                    raise
                except DvtcliError as failed:
                    found = failed
                self._found.append((number, time(), found))
            next_s = max(next_s + self._every_s, monotonic())

    def take(self) -> list[tuple[int, float, ValueRead | DvtcliError]]:
        """What was read since the last call: the object's number, the time (s since 1970), its value or why not.

        Raises what ended the reading once everything that was read before is taken.
        """
        if not self._found and self._failure is not None:
            raise self._failure
        return [self._found.popleft() for _ in range(len(self._found))]

    def stop(self) -> None:
        """Read no more."""
        self._stopping.set()
        self._thread.join(LEAVE_S)
