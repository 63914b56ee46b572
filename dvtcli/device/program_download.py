"""Load firmware into a device: stop, clear, transfer, check, start, and wait until it runs (CiA 302-3).

Nothing can be rolled back after the old program is cleared: every failure reports the state of the device.
"""

from __future__ import annotations

from collections.abc import Callable
from contextlib import suppress
from dataclasses import dataclass, field

from dvtcli.device.cancellation import Cancellation
from dvtcli.device.programs import CLEAR, START, STOP, FlashStatus, Stage
from dvtcli.device.read_pdos import ABSENT
from dvtcli.domain.abort import Abort
from dvtcli.domain.objects import DEVICE_TYPE, FLASH_STATUS, PROGRAM_CONTROL, PROGRAM_DATA, PROGRAM_IDENTIFICATION
from dvtcli.domain.ports import CanopenBus
from dvtcli.errors import DeviceRefused, DvtcliError, LeftChanged, NoAnswer, SdoAborted, SdoProtocolError

#: how long clearing, and the answer after the last byte, may take (s)
SLOW_S = 30.0
#: how long a flash memory may be at work after that (s), and how often it is asked
FLASH_S, _ASK_S = 120.0, 0.1
#: how long a node may take from the command that starts its program to its boot-up message (s)
BOOT_S = 20.0
#: how long a node that starts its program without a restart is listened to for one (s)
_NO_RESTART_S = 3.0
#: what became of the program, where it was loaded
_OUTCOMES = {Stage.CHECKING: "was not started", Stage.STARTING: "was started, and is not known to run"}
_UNREADABLE = (*ABSENT, Abort.WRITE_ONLY)
#: how boot loaders refuse their objects while the flash memory is at work
_BUSY = (Abort.DEVICE_STATE, Abort.LOCAL_CONTROL, Abort.HARDWARE)


@dataclass(slots=True)
class ProgramDownload:
    """A download to program *number* (1..254) of *node_id*.

    *on_stage* is called before each stage; *cancellation* is checked as long as the old program exists.
    """

    bus: CanopenBus
    node_id: int
    number: int
    on_stage: Callable[[Stage], None]
    cancellation: Cancellation
    stage: Stage = field(default=Stage.STOPPING, init=False)
    #: whether a boot-up message was heard once the program was started
    restarted: bool = field(default=False, init=False)

    def identification(self) -> int | None:
        """The program software identification; None if the device has no such object."""
        return self._read(PROGRAM_IDENTIFICATION)

    def run(self, data: bytes, expected: int | None) -> None:
        """Load *data*, compare its identification with *expected* (None: any), start the program and see it run.

        On failure raises the cause with state `rolled_back` if the old program is running again; otherwise LeftChanged
        with the state of the device.
        """
        with self.cancellation.deferred():
            try:
                self._stop()
            except BaseException as failed:
                raise self._old_again(failed) from failed
            try:
                self._replace(data, expected)
            except BaseException as failed:
                raise self._left(failed) from failed

    def _enter(self, stage: Stage) -> None:
        self.on_stage(stage)
        self.stage = stage

    def _stop(self) -> None:
        self._enter(Stage.STOPPING)
        try:
            self._control(STOP)
        except (NoAnswer, SdoProtocolError):
            self._await_answer()  # possibly restarted into the boot loader
        except SdoAborted:
            if self._when_asked(PROGRAM_CONTROL) not in (STOP, CLEAR):  # some loaders refuse to stop what is stopped
                raise
        if self._read(PROGRAM_CONTROL) == START:
            raise DeviceRefused(f"node {self.node_id} did not stop its firmware", node=self.node_id)
        if self.cancellation.requested:
            raise self.cancellation.interrupted("stopped before the old program was cleared", node=self.node_id)

    def _replace(self, data: bytes, expected: int | None) -> None:
        self._enter(Stage.CLEARING)
        self._clear()
        self._await_flash("clear its program")
        self._enter(Stage.LOADING)
        with self.cancellation.released():  # an incomplete program is none
            self.bus.sdo(self.node_id).download(PROGRAM_DATA, self.number, data, timeout_s=SLOW_S)
        self._await_flash("write its program")
        self._enter(Stage.CHECKING)
        self._check(expected)
        self._enter(Stage.STARTING)
        self._start()
        self._check(expected)

    def _clear(self) -> None:
        """Have the program cleared; a device that did not answer, and may be at it, is told again."""
        try:
            self._control(CLEAR, SLOW_S)
            return
        except NoAnswer:
            pass
        deadline_s = self.bus.now_s() + FLASH_S
        while True:
            try:
                self._control(CLEAR, SLOW_S)
                return
            except SdoAborted as aborted:
                is_busy = aborted.code in _BUSY
                if is_busy:
                    self._await_flash("clear its program")
                if self._when_asked(PROGRAM_CONTROL) == CLEAR:  # some loaders refuse to clear what is cleared
                    return
                if not is_busy or self.bus.now_s() >= deadline_s:
                    raise
            self.bus.sleep(_ASK_S)

    def _check(self, expected: int | None) -> None:
        found = self.identification()
        if expected is not None and found != expected:
            raise DeviceRefused(
                f"node {self.node_id} has other firmware than was sent", node=self.node_id,
                place=f"{PROGRAM_IDENTIFICATION:04X}:{self.number:02X}",
                why=f"0x1F56 says {'nothing' if found is None else f'0x{found:08X}'}, expected is 0x{expected:08X}",
            )  # fmt: skip

    def _start(self) -> None:
        seen = self.bus.boot_ups(self.node_id)
        try:
            self._control(START)
        except NoAnswer:
            pass  # the device may restart before it answers; checked below
        except SdoAborted:
            self.stage = Stage.CHECKING if self.stage is Stage.STARTING else self.stage
            raise
        deadline_s, patient_s = self.bus.now_s() + BOOT_S, self.bus.now_s() + _NO_RESTART_S
        while not self.bus.wait_boot_up(self.node_id, seen, 0.5):
            if self.bus.now_s() >= patient_s and self._runs():
                return
            if self.bus.now_s() >= deadline_s:
                raise NoAnswer(f"node {self.node_id} sent no boot-up message within {BOOT_S:g} s", node=self.node_id)
        self.restarted = True
        self._await_answer()
        if self._read(PROGRAM_CONTROL) in (STOP, CLEAR):
            raise DeviceRefused(f"node {self.node_id} restarted, but does not run its firmware", node=self.node_id)

    def _runs(self) -> bool:
        """True if the device reports a running program; false without a report."""
        with suppress(NoAnswer, SdoProtocolError):
            return self._read(PROGRAM_CONTROL) == START
        return False

    def _control(self, command: int, timeout_s: float | None = None) -> None:
        sdo = self.bus.sdo(self.node_id)
        sdo.download(PROGRAM_CONTROL, self.number, bytes([command]), timeout_s=timeout_s)

    def _read(self, index: int) -> int | None:
        """The value of the program's object at *index*; None if missing or unreadable."""
        try:
            return int.from_bytes(self.bus.sdo(self.node_id).upload(index, self.number), "little")
        except SdoAborted as aborted:
            if aborted.code in _UNREADABLE:
                return None
            raise

    def _when_asked(self, index: int) -> int | None:
        """The value of the program's object at *index*; None if unreadable, also while the device is busy."""
        try:
            return self._read(index)
        except SdoAborted as aborted:
            if aborted.code in _BUSY:
                return None
            raise

    def _await_answer(self) -> None:
        """Wait until a restarting node answers. Raises NoAnswer if it does not."""
        deadline_s = self.bus.now_s() + BOOT_S
        while True:
            try:
                self.bus.sdo(self.node_id).upload(DEVICE_TYPE, 0)
            except (NoAnswer, SdoProtocolError):
                if self.bus.now_s() >= deadline_s:
                    raise
            else:
                return

    def _await_flash(self, what: str) -> None:
        """Wait until the flash operation ends. Raises DeviceRefused with the reported error."""
        deadline_s = self.bus.now_s() + FLASH_S
        while True:
            try:
                status = FlashStatus(self._read(FLASH_STATUS) or 0)
            except NoAnswer:
                if self.bus.now_s() >= deadline_s:
                    raise
                continue  # a processor writing flash memory may not answer meanwhile
            except SdoAborted as aborted:
                if aborted.code not in _BUSY or self.bus.now_s() >= deadline_s:
                    raise
                self.bus.sleep(_ASK_S)
                continue
            if not status.is_at_work:
                break
            if self.bus.now_s() >= deadline_s:
                raise NoAnswer(f"node {self.node_id} did not {what} within {FLASH_S:g} s", node=self.node_id)
            self.bus.sleep(_ASK_S)
        if status.error:
            place = f"{FLASH_STATUS:04X}:{self.number:02X}"
            text = f"node {self.node_id} did not {what}: {status.error}"
            raise DeviceRefused(text, node=self.node_id, place=place)

    def _old_again(self, failed: BaseException) -> BaseException:
        """*failed*, from before the clearing, once the old program runs again; LeftChanged if it does not."""
        try:
            if self._read(PROGRAM_CONTROL) != START:
                self._start()
        except DvtcliError:
            return self._left(failed)
        if isinstance(failed, DvtcliError):
            failed.state, failed.state_text = "rolled_back", "its old firmware runs, as it reports"
        return failed

    def _left(self, failed: BaseException) -> BaseException:
        """The error with the present state of the device."""
        if not isinstance(failed, (DvtcliError, KeyboardInterrupt)):
            return failed
        text = failed.text if isinstance(failed, DvtcliError) else "stopped in the middle of the transfer"
        outcome = _OUTCOMES.get(self.stage, "was not loaded")
        left = LeftChanged(
            f"{text}; the program of node {self.node_id} {outcome}", node=self.node_id, state="left_changed",
            place=failed.place if isinstance(failed, DvtcliError) else None,
            abort=failed.abort if isinstance(failed, DvtcliError) else None,
            why=failed.why if isinstance(failed, DvtcliError) else None,
            hint="download the file again: its boot loader accepts it; if the node is silent, switch it off and on",
        )  # fmt: skip
        left.state_text = f"the device holds {self.stage.value}"
        return left
