"""A bus that is gone, waited for beside a screen that stays alive. Knows no screen."""

from __future__ import annotations

import threading
from time import monotonic
from typing import TYPE_CHECKING

from dvtcli.errors import DvtcliError

if TYPE_CHECKING:
    from dvtcli.errors import BusUnavailable
    from dvtcli.operations.session.steady_listener import SteadyListener

#: how long leaving may take where the bus is being opened (s)
_LEAVE_S = 0.2


class GoneBus:
    """Waits in a thread for the bus that *listener* listens to."""

    def __init__(self, listener: SteadyListener) -> None:
        self._listener = listener
        self._thread: threading.Thread | None = None
        self._since_s = 0.0
        self._failure: DvtcliError | None = None
        self._leaving = threading.Event()

    @property
    def gone_s(self) -> float | None:
        """How long it is gone (s), None while it is there."""
        return None if self._thread is None else monotonic() - self._since_s

    def wait(self, failed: BusUnavailable) -> None:
        """The bus *failed*: wait for it from now on."""

        def wait() -> None:
            try:
                self._listener.come_back(failed, self._leaving.is_set)
            except DvtcliError as ended:
                self._failure = ended

        self._since_s = monotonic()
        self._thread = threading.Thread(target=wait, name="waiting for the bus", daemon=True)
        self._thread.start()

    def is_waiting(self) -> bool:
        """Whether it is gone still."""
        return self._thread is not None and self._thread.is_alive()

    def back_after_s(self) -> float | None:
        """How long it was gone, once, when it is back; else None. DvtcliError where it is not waited for."""
        if self._thread is None or self._thread.is_alive():
            return None
        gone_s, self._thread = monotonic() - self._since_s, None
        if self._failure is not None:
            raise self._failure
        return gone_s

    def leave(self) -> None:
        """Wait for it no longer."""
        self._leaving.set()
        if self._thread is not None:
            self._thread.join(_LEAVE_S)
