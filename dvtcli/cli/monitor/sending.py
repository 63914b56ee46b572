"""A frame of the monitor's transmit list that is sent again and again in a thread."""

from __future__ import annotations

import threading
from typing import TYPE_CHECKING

from dvtcli.cli.view.typed_hints import error_text
from dvtcli.device.cancellation import Cancellation
from dvtcli.domain.text import plural
from dvtcli.errors import DvtcliError
from dvtcli.operations.frames.put_on_bus import put_on_bus
from dvtcli.operations.frames.transmit_rows import TransmitRow, rounds
from dvtcli.operations.results.sent import NO_END

if TYPE_CHECKING:
    from dvtcli.domain.ports import Frame
    from dvtcli.operations.session.session import Session

#: maximum wait for the end of a sending (s)
_LEAVE_S = 2.0


class Sending:
    """Sends *frame* with the period of *row* until `stop`; the caller has asked for consent."""

    def __init__(self, session: Session, row: TransmitRow, frame: Frame) -> None:
        self.row, self.frame = row, frame
        #: frames sent so far
        self.sent = 0
        #: frames left out so far: they would have been late by a period or more
        self.left_out = 0
        #: why it ended by itself, empty while it goes on or after `stop`
        self.ended = ""
        #: an error that nobody expects, raised by the screen
        self.fault: BaseException | None = None
        self._session = session
        self._cancellation = Cancellation()
        self._thread = threading.Thread(target=self._run, name=f"sending {row.frame}", daemon=True)
        self._thread.start()

    @property
    def is_going(self) -> bool:
        """Whether frames are still sent."""
        return self._thread.is_alive()

    def _run(self) -> None:
        def count(sent: int, left_out: int) -> None:
            self.sent, self.left_out = sent, left_out

        try:
            bus = self._session.open_network().bus
            due = rounds(self.row, self.frame, bus.now_s, count)
            outcome = put_on_bus(self._session, due, NO_END, cancellation=self._cancellation)
            self.sent = outcome.handed
            if outcome.failure is not None:
                raise outcome.failure
        except DvtcliError as failed:
            self.ended = error_text(failed)
        except BaseException as fault:  # noqa: BLE001 - nobody sees what ends a thread: the screen raises it
            self.fault = fault

    @property
    def end(self) -> str:
        """What is to be said once it has ended, empty for nothing."""
        left = f"{plural(self.left_out, 'late frame')} left out" if self.left_out else ""
        if self.ended:
            return f"{self.row.frame} ended after {plural(self.sent, 'frame')}: {self.ended}{left and '; '}{left}"
        return f"{self.row.frame}: {left}" if left else ""

    def stop(self) -> None:
        """Send no other frame."""
        self._cancellation.requested = True
        self._thread.join(_LEAVE_S)
