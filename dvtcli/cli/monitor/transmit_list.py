"""The monitor's transmit list: frames to send once, with a period, or by a key; edited in place."""

from __future__ import annotations

import threading
from collections.abc import Callable
from dataclasses import dataclass
from typing import TYPE_CHECKING

from dvtcli.cli.screen.widgets import Cursor, Dialog, FieldDialog
from dvtcli.cli.view.lines import Cell, broken, clipped
from dvtcli.cli.view.typed_hints import error_text
from dvtcli.device.cancellation import Cancellation
from dvtcli.domain.text import plural
from dvtcli.errors import DvtcliError, UsageError
from dvtcli.operations.frames.put_on_bus import put_on_bus
from dvtcli.operations.frames.transmit_rows import HOW, TransmitRow, rounds, transmit_row
from dvtcli.operations.results.frames import NO_END

if TYPE_CHECKING:
    from dvtcli.domain.ports import Frame
    from dvtcli.operations.session.session import Session

#: rows of the list at most
_MOST = 10
_KEYS = (("a", "add"), ("Enter", "edit"), ("s", "send once"), ("c", "cyclic"), ("d", "delete"), ("Esc", "back"))


@dataclass(slots=True)
class TransmitEntry:
    """A row of the list, with its cyclic sending if it was started, the frames sent once, and why it was refused."""

    row: TransmitRow
    sending: Sending | None = None
    once: int = 0
    refused: str = ""

    @property
    def is_going(self) -> bool:
        """Whether it is sent with its period now."""
        return self.sending is not None and self.sending.is_going

    def stop(self) -> None:
        """Send it no longer; the number of frames stays."""
        if self.sending is not None:
            self.sending.stop()

    @property
    def sent(self) -> int:
        """Frames sent so far."""
        return self.once + (0 if self.sending is None else self.sending.sent)

    @property
    def state(self) -> tuple[str, str]:
        """What it does, and a style."""
        if self.is_going:
            return "being sent", "green"
        return ("ended" if self._ended else "refused", "red") if self.reason else ("", "")

    @property
    def reason(self) -> str:
        """Why it ended by itself, or was refused; empty if neither happened."""
        return self._ended or self.refused

    @property
    def _ended(self) -> str:
        return "" if self.sending is None else self.sending.ended


class TransmitList:
    """The list on the screen; *send* sends a row once, *cyclic* starts or stops it, *changed* keeps the rows.

    *check* says what is wrong with a new or changed row: whether its values fit is known by the node only.
    """

    def __init__(
        self,
        rows: list[TransmitEntry],
        ask: Callable[[Dialog], None],
        send: Callable[[TransmitEntry], None],
        cyclic: Callable[[TransmitEntry], None],
        changed: Callable[[], None],
        check: Callable[[TransmitEntry], None],
    ) -> None:
        self._rows, self._ask, self._changed, self._check = rows, ask, changed, check
        self._send, self._cyclic = send, cyclic
        self._cursor = Cursor()

    def press(self, key: str, text: str) -> bool:
        """Take a key of the list; Esc and `x` close it."""
        if key in ("escape", "c-c") or text == "x":
            return False
        if text == "a":
            self._ask(FieldDialog("add", "", self._add, HOW))
        elif self._rows and not self._cursor.press(key, len(self._rows)):
            self._act(key, text, self._rows[self._cursor.chosen])
        return True

    def click(self, row: int) -> bool:
        """Move to the clicked row; True if it was chosen."""
        return self._cursor.click(row - 1, len(self._rows))

    def _act(self, key: str, text: str, listed: TransmitEntry) -> None:
        if key == "enter":
            self._ask(FieldDialog("edit", str(listed.row), lambda typed: self._edit(listed, typed), HOW))
        elif text == "s":
            self._send(listed)
        elif text == "c":
            self._cyclic(listed)
        elif text == "d" or key == "delete":
            self._rows[:] = [other for other in self._rows if other is not listed]
            listed.stop()  # now: what starts beside the screen looks whether its row is still there
            self._changed()

    def _add(self, text: str) -> str:
        try:
            row = transmit_row(text)
        except UsageError as wrong:
            return wrong.text
        self._rows.append(TransmitEntry(row))
        self._cursor.chosen = len(self._rows) - 1
        self._changed()
        self._check(self._rows[-1])
        return ""

    def _edit(self, listed: TransmitEntry, text: str) -> str:
        """Change the row; what is being sent is stopped, and started again with a question."""
        try:
            row = transmit_row(text)
        except UsageError as wrong:
            return wrong.text
        if row != listed.row:
            was_going = listed.is_going
            listed.row = row
            listed.stop()  # now: what starts beside the screen looks whether its row is still the same
            listed.once, listed.sending = listed.sent, None
            self._changed()
            (self._cyclic if was_going else self._check)(listed)
        return ""

    def lines(self, width: int, height: int) -> list[list[Cell]]:
        """Return the rows that fit, below a head, above the keys."""
        reasons = self._reasons(width)[: max(0, height - 3)]
        room = max(1, min(_MOST, height - 3 - len(reasons)))
        frame = max(12, width - 44)
        title = f"TRANSMIT ({plural(len(self._rows), 'row')})"
        head = f"  {'KEY':<4}{title:<{frame}} {'EVERY':>9} {'SENT':>7}  STATE"
        lines = [[Cell(head, "dim")]]
        if not self._rows:
            lines.append([Cell("  nothing yet: a adds a frame, as 185#1027 or rpdo1 6040=15", "dim")])
        for number in self._cursor.window(len(self._rows), room):
            listed = self._rows[number]
            chosen = number == self._cursor.chosen
            row, (state, style) = listed.row, listed.state
            period = "" if row.every_s is None else f"{1000 * row.every_s:g} ms"
            lines.append([
                Cell("> " if chosen else "  ", "cyan"), Cell(f"{row.key:<4}", "bold"),
                Cell(f"{clipped(row.frame, frame):<{frame}} {period:>9} {listed.sent:>7}  "), Cell(state, style),
            ])  # fmt: skip
        keys = [cell for key, what in _KEYS for cell in (Cell(f" {key}", "bold"), Cell(f" {what} "))]
        return [*lines, *reasons, keys]

    def _reasons(self, width: int) -> list[list[Cell]]:
        """Return why the chosen row was refused or ended, in as many lines as that takes."""
        reason = self._rows[self._cursor.chosen].reason if self._cursor.chosen < len(self._rows) else ""
        return [[Cell(f"  {line}", "red")] for line in broken(reason, max(8, width - 2))] if reason else []


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
