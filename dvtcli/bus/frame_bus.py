"""A `ReadBus` whose messages are CAN frames: SDO goes over them, and what nodes say by themselves is told apart.

Does not know what carries the frames, nor what a PDO or an object means.
"""

from __future__ import annotations

from abc import abstractmethod
from collections.abc import Callable
from time import monotonic
from typing import TypeVar

from dvtcli.bus.node_watch import EMERGENCY, HEARTBEAT
from dvtcli.bus.read_bus import ReadBus
from dvtcli.bus.sdo.channel import SdoChannel
from dvtcli.bus.sdo.channels import SdoChannels
from dvtcli.bus.sdo.sdo_link import ANSWER_ID, DEFAULT_RETRIES, DEFAULT_TIMEOUT_S, REQUEST_ID, DroppedAnswers
from dvtcli.bus.watched_bus import NMT_CAN_ID
from dvtcli.domain.cob_id import fits
from dvtcli.domain.nmt import NmtState
from dvtcli.domain.ports import Frame
from dvtcli.errors import UsageError

_SDO_IDS = (ANSWER_ID, REQUEST_ID)
#: LSS slaves' answers (CiA 305), here to spare every command the import of all of LSS
_LSS_ANSWER_ID = 0x7E4

#: how many nodes are asked at once where nothing runs: enough for the wire to be busy with servers that take 10 ms
MOST_AT_ONCE = 64
#: how long no PDO must have been heard for a bus to be one on which nothing runs (s)
QUIET_S = 10.0

M = TypeVar("M")


class FrameBus(ReadBus[M]):
    """A CanopenBus over CAN frames; the parameters are those of `ReadBus`."""

    def __init__(
        self,
        name: str,
        frame_of: Callable[[M], Frame],
        *,
        simulated: bool = False,
        timeout_s: float = DEFAULT_TIMEOUT_S,
        retries: int = DEFAULT_RETRIES,
        bitrate: int | None = None,
    ) -> None:
        super().__init__(name, frame_of, simulated=simulated, timeout_s=timeout_s, retries=retries, bitrate=bitrate)
        self._frame_of = frame_of
        self._channels = SdoChannels(self, self.settings)
        #: when a PDO was heard last
        self._pdo_s = float("-inf")

    @property
    def carries_frames(self) -> bool:
        """Frames are all that it carries."""
        return True

    @property
    def carries_remote_frames(self) -> bool:
        """Whether a remote frame can be sent."""
        return True

    def send(self, frame: Frame) -> None:
        """Send one frame (SYNC, a PDO); frames that answer it are kept for a `receive` within the next second.

        UsageError for a CAN-ID that does not fit: drivers cut it to its bits, and 0x800 would be an NMT command.
        """
        if not fits(frame.can_id, extended=frame.extended):
            raise UsageError(f"CAN-ID 0x{frame.can_id:X} has more than {29 if frame.extended else 11} bits: not sent")
        from dvtcli.bus.acts import act_of

        self.drain()
        self.note_act(act_of(frame))
        self._traffic.keep_answers()
        self._send(frame.can_id, frame.data, extended=frame.extended, remote=frame.remote, dlc=frame.dlc)

    def send_sdo(self, can_id: int, data: bytes) -> None:
        """Send one SDO frame (SdoLink)."""
        self._send(can_id, data)

    @abstractmethod
    def _send(self, can_id: int, data: bytes, *, extended: bool = False, remote: bool = False, dlc: int = 0) -> None:
        """Send one frame, of which *dlc* is a remote one's, and tell those who watch; raises BusUnavailable."""

    def _most_at_once(self) -> int:
        """One as long as a machine may be running, or the bit rate is not known.

        SDO at full speed would keep heartbeats off the bus; where the bit rate is known its pace is kept.
        """
        running = NmtState.OPERATIONAL in self._watch.states.values() or monotonic() - self._pdo_s < QUIET_S
        paced = self.bitrate is not None or self.simulated
        return MOST_AT_ONCE if paced and not running else 1

    def _channel(self, node_id: int) -> SdoChannel:
        return self._channels.channel(node_id)

    def _repeated(self, node_id: int) -> int:
        return self._channels.repeated(node_id)

    def _dropped(self) -> dict[int, DroppedAnswers]:
        return self._channels.dropped()

    def _understand(self, message: M, can_id: int, data: bytes | bytearray, *, extended: bool) -> None:
        """Hand a data frame to whom it answers: *message* with its CAN-ID and data."""
        function, node_id = can_id & ~0x7F, can_id & 0x7F
        if function in _SDO_IDS:
            if function == ANSWER_ID:
                self._traffic.answered(message)
                self._answered(node_id)
            elif not extended:
                self._watch.request_of_another(self._frame_of(message))
            self._channels.receive(node_id, can_id, bytes(data), extended=extended)
        elif can_id > EMERGENCY + 0x7F and function < ANSWER_ID:
            self._pdo_s = monotonic()
        elif not extended:
            self._told(message, can_id, data)

    def _told(self, message: M, can_id: int, data: bytes | bytearray) -> None:
        """Take what a node, or another master, says by itself."""
        function = can_id & ~0x7F
        if function == HEARTBEAT:
            self._heartbeat(self._frame_of(message))
            if data == b"\0":
                self._traffic.answered(message)
                self._channels.restarted(can_id & 0x7F)
        elif can_id == NMT_CAN_ID:
            self._heard_command(bytes(data))
        elif can_id == _LSS_ANSWER_ID:
            self._traffic.answered(message)
        elif function == EMERGENCY:
            self._traffic.answered(message)
            self._watch.emergency(self._frame_of(message))

    def _answered(self, node_id: int) -> None:
        """An SDO answer of *node_id* came, to whomever."""
        self._watch.answered(node_id)
