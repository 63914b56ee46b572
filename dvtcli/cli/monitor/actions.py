"""The monitor's keys that act: NMT, SYNC, the transmit list, and a recording."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping
from datetime import datetime
from pathlib import Path
from typing import TYPE_CHECKING

from dvtcli.cli.monitor.transmit_list import Sending, TransmitEntry, TransmitList
from dvtcli.cli.screen.full_screen import BesideScreen, in_a_line
from dvtcli.cli.screen.widgets import Choices, Dialog, FieldDialog
from dvtcli.cli.view.typed_hints import error_text
from dvtcli.domain.cob_id import can_id_text
from dvtcli.domain.nmt import NmtCommand
from dvtcli.domain.text import join_some
from dvtcli.errors import DvtcliError, SafetyRefusal
from dvtcli.operations.frames.put_on_bus import put_on_bus
from dvtcli.operations.frames.send_frames import agree_to_send, frame_to_send
from dvtcli.operations.frames.transmit_rows import TransmitRow, frame_of, is_sdo_request, keep_rows, kept_rows
from dvtcli.operations.nodes.command_nmt import command_nmt
from dvtcli.operations.pdos.sync import DEFAULT, sync_frame
from dvtcli.operations.session.save_script import ask_before_overwriting
from dvtcli.watch.decoder import doubts

if TYPE_CHECKING:
    from dvtcli.cli.conversation import Conversation
    from dvtcli.domain.ports import Frame
    from dvtcli.files.recordings.recording_file import Recorder
    from dvtcli.operations.frames.watch_bus import Watched
    from dvtcli.watch.decoder import Address, Layout

#: letters of the NMT commands
_NMT = {
    "s": NmtCommand.START, "t": NmtCommand.STOP, "p": NmtCommand.ENTER_PRE_OPERATIONAL,
    "r": NmtCommand.RESET_NODE, "c": NmtCommand.RESET_COMMUNICATION,
}  # fmt: skip
#: range of the SYNC period (ms)
_SYNC_MS = 1.0, 3_600_000.0


class NmtDialog(Choices):
    """Asks for an NMT command; ←→ choose the node among all nodes of *names* by node-ID, or all of them."""

    def __init__(self, node_id: int | None, names: Mapping[int, str], done: Callable[[NmtCommand, int], None]) -> None:
        self._names = {**dict(sorted(names.items())), 0: "nodes"}
        if node_id is not None:
            self._names = {node_id: names.get(node_id, "")} | self._names
        self._whom = list(dict(sorted(self._names.items())))
        self._at = self._whom.index(node_id or 0)
        commands = list(_NMT.values())
        rows = [(letter, command.word) for letter, command in _NMT.items()]
        super().__init__(self._heading(), rows, lambda number: done(commands[number], self._whom[self._at]))

    def _heading(self) -> str:
        node_id = self._whom[self._at]
        whom = f"node {node_id} {self._names[node_id]}" if node_id else "all nodes"
        return f"NMT to {whom.rstrip()}" + ("   ←→ another" if len(self._whom) > 1 else "")

    def press(self, key: str, text: str) -> bool:
        """Take ← and → for another node; else as any list."""
        if key in ("left", "right"):
            self._at = (self._at + (1 if key == "right" else -1)) % len(self._whom)
            self._title = self._heading()
            return True
        return super().press(key, text)


class Actions:
    """What the monitor's keys send or record; *last* returns the last data of an address, None if none came.

    *layout* returns what is known of a frame.
    """

    def __init__(
        self,
        session: Conversation,
        watched: Watched,
        last: Callable[[Address], bytes | None],
        layout: Callable[[Frame], Layout],
    ) -> None:
        self.beside = BesideScreen(session)
        #: open dialogs, the innermost last
        self.dialogs: list[Dialog] = []
        self._session, self._watched, self._last, self._layout = session, watched, last, layout
        self._bus = session.wire.name
        self._rows = [TransmitEntry(row) for row in self._kept()]
        self._sync: Sending | None = None
        #: sendings that go on, or whose end was not told yet
        self._sendings: list[Sending] = []
        self._recorder: Recorder | None = None

    def _kept(self) -> list[TransmitRow]:
        try:
            return kept_rows(self._session, self._bus)
        except DvtcliError as wrong:
            self.beside.say(f"the saved transmit list of {self._bus}: {error_text(wrong)}", bad=True)
            return []

    def dialog(self) -> Dialog | None:
        """Return what takes the keys now: a question first, then the innermost dialog."""
        return self.beside.question or (self.dialogs[-1] if self.dialogs else None)

    def press(self, key: str, text: str) -> None:
        """Give a key to the present dialog, and close it if it is finished."""
        dialog = self.dialog()
        if dialog is not None and not dialog.press(key, text) and dialog in self.dialogs:
            self.dialogs.remove(dialog)

    def marks(self) -> list[str]:
        """Return what is going on, in words for the screen's head."""
        marks = [f"{self.beside.doing}..."] if self.beside.doing and self.beside.question is None else []
        if self._sync is not None and self._sync.is_going:
            marks.append(f"SYNC every {1000 * (self._sync.row.every_s or 0):g} ms")
        if going := sum(listed.is_going for listed in self._rows):
            marks.append(f"{going} cyclic")
        if self._recorder is not None:
            marks.append(f"REC {self._recorder.frames}")
        return marks

    def nmt(self, node_id: int | None, names: Mapping[int, str]) -> None:
        """Let the user choose an NMT command for *node_id* (None: all nodes), or another node of *names*."""
        self.dialogs.append(NmtDialog(node_id, names, self._command))

    def _command(self, command: NmtCommand, node_id: int) -> None:
        frame = frame_to_send(f"000#{command:02X}{node_id:02X}")

        def work() -> str:
            agree_to_send(self._session, [frame], "", self._watched.nodes, self._watched.dbc)
            result = command_nmt(self._session, command, node_id)
            if result.failure is not None:
                raise result.failure
            seen = ", ".join(
                f"node {seen_id} {state or 'has an unknown NMT state'}" for seen_id, state in result.states
            )
            dry = "dry run, nothing was sent: " if self._session.dry_run else ""
            lost = f"; the reset lost unstored values: {join_some(result.lost)}" if result.lost else ""
            return f"{dry}nmt {command.word}: {seen or 'no node is seen'}{lost}"

        self.beside.start(f"nmt {command.word}", work)

    def sync(self) -> None:
        """Stop SYNC if it is sent, else ask for its period and send it."""
        if self._sync is not None and self._sync.is_going:
            self._sync.stop()
            self.beside.say(f"SYNC is off, {self._sync.sent} were sent")
            return
        self.dialogs.append(FieldDialog("SYNC period in ms", "20", self._start_sync))

    def _start_sync(self, text: str) -> str:
        try:
            period_ms = float(text)
        except ValueError:
            period_ms = 0.0
        if not _SYNC_MS[0] <= period_ms <= _SYNC_MS[1]:
            return f"{text or 'nothing'}: a period is 1…3600000 ms"

        def work() -> str:
            selected = self._session.selected_id()
            frame = DEFAULT if selected is None else sync_frame(self._session.bus.sdo(selected))
            row = TransmitRow("SYNC", period_ms / 1000)
            self._agree_to_repeat(frame, row)
            self._sync = self._begin(row, frame)
            return ""

        self.beside.start("SYNC", work)
        return ""

    def _begin(self, row: TransmitRow, frame: Frame) -> Sending | None:
        """Send *frame* from now on; None under --dry-run."""
        if self._session.dry_run:
            return None
        sending = Sending(self._session, row, frame)
        self._sendings.append(sending)
        return sending

    def _agree_to_repeat(self, frame: Frame, row: TransmitRow) -> None:
        self._agree(frame, f" every {1000 * (row.every_s or 0):g} ms until it is stopped")

    def _agree(self, frame: Frame, often: str = "") -> None:
        shown = agree_to_send(self._session, [frame], often, self._watched.nodes, self._watched.dbc)
        if self._session.dry_run:
            self.beside.say(f"dry run, not sent: {shown[0].text}")

    def transmit_list(self) -> None:
        """Open the transmit list."""
        acts = self._send, self._cyclic, self._keep, self._check
        self.dialogs.append(TransmitList(self._rows, self.dialogs.append, *acts))

    def send_by_key(self, key: str) -> None:
        """Send the row of *key*: once, or if it has a period start or stop it."""
        for listed in self._rows:
            if listed.row.key == key:
                (self._send if listed.row.every_s is None else self._cyclic)(listed)

    def _demand_unchanged(self, listed: TransmitEntry, row: TransmitRow) -> None:
        """Raise SafetyRefusal if *listed* was deleted, or is no longer *row*."""
        if listed.row is not row or not any(present is listed for present in self._rows):
            raise SafetyRefusal(f"{row.frame} was not sent: the row was changed")

    def _check(self, listed: TransmitEntry) -> None:
        """Say what is doubtful about a row that was typed: its values, its length, its CAN-ID; sends nothing."""
        row = listed.row

        def work() -> str:
            frame = frame_of(self._session, row, self._last)
            layout = self._layout(frame)
            found = list(doubts(frame, layout))
            for doubt in found:
                self.beside.say(f"{row.frame}: {doubt}", bad=True)
            listed.refused = "; ".join(found)
            if layout.service.kind == "other":
                can_id = can_id_text(frame.can_id, extended=frame.extended)
                return f"{row.frame}: no node that was read transmits CAN-ID {can_id}"
            return ""

        if not self.beside.doing:  # else it is judged when it is sent
            self.beside.start(f"check {row.frame}", self._with_reason(listed, work), is_check=True)

    def _with_reason(self, listed: TransmitEntry, work: Callable[[], str]) -> Callable[[], str]:
        """Return *work*, which keeps the reason in *listed* if it is refused."""

        def run() -> str:
            listed.refused = ""
            try:
                return work()
            except DvtcliError as failed:
                listed.refused = in_a_line(self._session, failed)
                raise

        return run

    def _send(self, listed: TransmitEntry) -> None:
        row = listed.row

        def work() -> str:
            frame = frame_of(self._session, row, self._last)
            self._agree(frame)
            self._demand_unchanged(listed, row)
            if not self._session.dry_run:
                outcome = put_on_bus(self._session, [(None, frame)], 1)
                listed.once += outcome.handed
                if outcome.failure is not None:
                    raise outcome.failure
            return ""

        self.beside.start(f"send {row.frame}", self._with_reason(listed, work))

    def _cyclic(self, listed: TransmitEntry) -> None:
        if listed.is_going:
            listed.stop()
            return
        row = listed.row
        if row.every_s is None:
            self.beside.say(f"{row.frame} has no period: Enter edits it, every 100ms adds one", bad=True)
            return

        def work() -> str:
            frame = frame_of(self._session, row, self._last)
            self._agree_to_repeat(frame, row)
            self._demand_unchanged(listed, row)
            sending = self._begin(row, frame)
            if sending is not None:
                listed.once, listed.sending = listed.sent, sending
                try:
                    self._demand_unchanged(listed, row)  # changed while it was started: nobody else would stop it
                except SafetyRefusal:
                    sending.stop()
                    raise
            return ""

        self.beside.start(f"send {row.frame}", self._with_reason(listed, work))

    def _keep(self) -> None:
        try:
            keep_rows(self._session, self._bus, [listed.row for listed in self._rows])
            if any(is_sdo_request(listed.row) for listed in self._rows):
                self.beside.say("rows with SDO requests are not saved: they may contain a passcode")
        except DvtcliError as failed:
            self.beside.say(error_text(failed), bad=True)

    def record(self) -> None:
        """Start a recording of all frames from now on, or end it."""
        if self._recorder is not None:
            self._end_recording()
            return
        name = f"monitor-{datetime.now().astimezone():%Y%m%d-%H%M%S}.log"
        self.dialogs.append(FieldDialog("record to", name, self._start_recording, ".asc .blf .log .trc .mf4 .pcapng"))

    def _start_recording(self, text: str) -> str:
        from dvtcli.files.recordings.formats import format_of
        from dvtcli.files.recordings.recording_file import Recorder

        path = Path(text)
        try:
            format_of(path)
        except DvtcliError as wrong:
            return error_text(wrong)

        def work() -> str:
            ask_before_overwriting(self._session, path)
            self._recorder = Recorder(path)
            return f"recording to {path}; l ends it"

        self.beside.start("record", work)
        return ""

    def take(self, frames: Iterable[Frame]) -> None:
        """Record *frames*, if a recording is running; a full disk ends it."""
        recorder = self._recorder
        if recorder is None:
            return
        try:
            for frame in frames:
                recorder.write(frame)
            recorder.flush()
        except DvtcliError as failed:
            self.beside.say(error_text(failed), bad=True)
            self._recorder = None

    def gap(self, gone_s: float, at_s: float) -> None:
        """Note a loss of the bus in a running recording."""
        if self._recorder is not None:
            self._recorder.note(f"{gone_s:.1f} s are missing: the bus was gone", at_s)

    def _end_recording(self) -> None:
        recorder, self._recorder = self._recorder, None
        if recorder is None:
            return
        try:
            recorder.close()
        except DvtcliError as failed:
            self.beside.say(error_text(failed), bad=True)
            return
        self._session.made.append(str(recorder.path))
        left = (
            f"; {recorder.left_out} remote frames are missing, which the format cannot store"
            if recorder.left_out
            else ""
        )
        self.beside.say(f"{recorder.path}: {recorder.frames} frames{left}")

    def check(self) -> None:
        """Say once why a sending ended by itself, and what it left out; raises an error that nobody expects of it."""
        for sending in [sending for sending in self._sendings if not sending.is_going]:
            self._sendings.remove(sending)
            if sending.fault is not None:
                raise sending.fault
            if sending.end:
                self.beside.say(sending.end, bad=True)

    def leave(self) -> None:
        """Send and record no longer."""
        self.beside.leave()
        for sending in self._sendings:
            sending.stop()
        self._end_recording()
        self.check()
