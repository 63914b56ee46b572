"""The twin of one node: a simulated device that reads from the node and keeps all writes to itself.

Nothing but SDO uploads reaches the node.
"""

from __future__ import annotations

import threading
from collections.abc import Callable
from contextlib import suppress
from typing import TYPE_CHECKING

from dvtcli.domain.hint import Action, Hint
from dvtcli.domain.nmt import NmtCommand, NmtState
from dvtcli.domain.ports import CanopenBus, Frame
from dvtcli.errors import NoAnswer, SdoAborted
from dvtcli.simulator.device.refusal import Refusal

if TYPE_CHECKING:
    from dvtcli.simulator.device.strict_device import StrictDevice

Backing = Callable[[int, int], bytes]
DeviceFor = Callable[[int, Backing], "StrictDevice"]

_HEARTBEAT = 0x700
_BOOT_UP = b"\0"


class Twin:
    """One node's twin as an SdoTransport, created on first use, reading the node on demand.

    *commands* are NMT commands to all nodes from before the creation.
    """

    def __init__(
        self, wrapped: CanopenBus, node_id: int, device_for: DeviceFor, commands: tuple[NmtCommand, ...] = ()
    ) -> None:
        self._wrapped = wrapped
        self._node_id = node_id
        self._device_for = device_for
        self._commands = commands
        self._made: StrictDevice | None = None
        self._lock = threading.RLock()
        #: time-out and retries of the present upload, None for the bus's
        self._limits: tuple[float | None, int | None] = None, None
        #: whether the state is the twin's own, no longer the node's
        self.commanded = bool(commands)
        self.boot_ups = 0

    @property
    def state(self) -> NmtState:
        """The twin's NMT state."""
        with self._lock:
            return self._device().state

    def exists(self) -> bool:
        """True if the real node exists."""
        with self._lock:
            try:
                self._device()
            except NoAnswer:
                return False
            return True

    def upload(
        self,
        index: int,
        sub_index: int,
        *,
        timeout_s: float | None = None,
        retries: int | None = None,
    ) -> bytes:
        """Read an object as written to the twin, else from the node. Raises as the node would.

        *timeout_s* and *retries* apply to reads of the node, including the check for existence.
        """
        with self._lock:
            self._limits = timeout_s, retries
            try:
                if self._made is None:
                    self._reach(index, sub_index)
                device = self._answering(index, sub_index)
                if (index, sub_index) == device.family.state_object:
                    self._follow_node(device)
                return device.upload(index, sub_index)
            except Refusal as refusal:
                raise SdoAborted(index, sub_index, refusal.code, node=self._node_id) from refusal
            finally:
                self._limits = None, None

    def _reach(self, index: int, sub_index: int) -> None:
        """Raise NoAnswer for a missing node early: creating its twin would need more uploads and a longer wait."""
        with suppress(Refusal):
            self._backing(index, sub_index)

    def download(self, index: int, sub_index: int, data: bytes, *, timeout_s: float | None = None) -> None:  # noqa: ARG002
        """Write an object of the twin only. Raises SdoAborted if the device would refuse."""
        with self._lock:
            device = self._answering(index, sub_index)
            self._follow_node(device)
            before = device.state
            try:
                device.download(index, sub_index, data)
            except Refusal as refusal:
                raise SdoAborted(index, sub_index, refusal.code, node=self._node_id) from refusal
            if device.state is not before:
                self.commanded = True

    def command(self, command: NmtCommand) -> list[Frame]:
        """Obey an NMT command; returns the twin's frames (a boot-up)."""
        with self._lock:
            device = self._device()
            self.commanded = True
            device.nmt(command)
            return self._sent(device.take_outbox())

    def hear(self, frame: Frame) -> list[Frame]:
        """Receive a frame of the bus; returns the twin's answers."""
        with self._lock:
            device = self._device()
            self._follow_node(device)
            if device.services.hears_sync(frame):
                answers = device.services.sync(frame.data[0] if frame.data else None)
            else:
                answers = device.services.receive(frame)
            return self._sent(answers + device.take_outbox())

    def _sent(self, frames: list[Frame]) -> list[Frame]:
        self.boot_ups += frames.count(Frame(_HEARTBEAT + self._node_id, _BOOT_UP))
        return frames

    def _answering(self, index: int, sub_index: int) -> StrictDevice:
        """The device, unless silent (CiA 301, 7.3.2.2.4: no SDO while STOPPED)."""
        device = self._device()
        if self.commanded and device.state is NmtState.STOPPED:
            place = f"{index:04X}:{sub_index:02X}"
            text = f"node {self._node_id} does not answer for 0x{place}: its twin is STOPPED"
            raise NoAnswer(
                text, node=self._node_id, place=place, hint=Hint(Action.ENTER_PRE_OPERATIONAL, {"node": self._node_id})
            )
        return device

    def _device(self) -> StrictDevice:
        """The simulated device, created here in the node's state."""
        made = self._made
        if made is None:
            made = self._device_for(self._node_id, self._backing)
            made.state = self._state_of_node(made) or NmtState.PRE_OPERATIONAL
            self._made = made
            for command in self._commands:
                made.nmt(command)
            self._sent(made.take_outbox())
        return made

    def _follow_node(self, device: StrictDevice) -> None:
        """Copy the node's state until the twin is commanded."""
        if not self.commanded:
            device.state = self._state_of_node(device) or device.state

    def _state_of_node(self, device: StrictDevice) -> NmtState | None:
        """The node's state, preferably from its state object: a received state may be old."""
        if device.family.state_object is None:
            return self._wrapped.nmt_state(self._node_id)
        try:
            return NmtState(int.from_bytes(self._backing(*device.family.state_object), "little"))
        except (Refusal, ValueError):
            return None

    def _backing(self, index: int, sub_index: int) -> bytes:
        try:
            timeout_s, retries = self._limits
            return self._wrapped.sdo(self._node_id).upload(index, sub_index, timeout_s=timeout_s, retries=retries)
        except SdoAborted as aborted:
            raise Refusal(aborted.code) from aborted
