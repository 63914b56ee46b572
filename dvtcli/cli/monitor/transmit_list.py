"""The monitor's transmit list: frames to send once, with a period, or by a key; edited in place."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

from dvtcli.cli.monitor.sending import Sending
from dvtcli.cli.screen.choices import Cursor
from dvtcli.cli.screen.field import Dialog, FieldDialog
from dvtcli.cli.view.columns import clipped
from dvtcli.cli.view.lines import Cell
from dvtcli.domain.text import plural
from dvtcli.errors import UsageError
from dvtcli.operations.frames.transmit_rows import HOW, TransmitRow, transmit_row

#: rows of the list at most
_MOST = 10
_KEYS = (("a", "add"), ("Enter", "edit"), ("s", "send once"), ("c", "cyclic"), ("d", "delete"), ("Esc", "back"))


@dataclass(slots=True)
class TransmitEntry:
    """A row of the list, with its cyclic sending if it was started, and the frames sent once."""

    row: TransmitRow
    sending: Sending | None = None
    once: int = 0

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
        return (f"ended: {self.sending.ended}", "red") if self.sending is not None and self.sending.ended else ("", "")


class TransmitList:
    """The list on the screen; *send* sends a row once, *cyclic* starts or stops it, *changed* keeps the rows."""

    def __init__(
        self,
        rows: list[TransmitEntry],
        ask: Callable[[Dialog], None],
        send: Callable[[TransmitEntry], None],
        cyclic: Callable[[TransmitEntry], None],
        changed: Callable[[], None],
    ) -> None:
        self._rows, self._ask, self._changed = rows, ask, changed
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
            if was_going:
                self._cyclic(listed)
        return ""

    def lines(self, width: int, height: int) -> list[list[Cell]]:
        """Return the rows that fit, below a head, above the keys."""
        room = max(1, min(_MOST, height - 3))
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
        return [*lines, keys]
