"""The gateway's own PDOs (CiA 309-3): RPDOs keep the last frame, TPDOs are sent on request.

They belong to no node: no device's PDOs are changed.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

from dvtcli.domain.abort import Abort
from dvtcli.domain.cob_id import CobId, can_id_text
from dvtcli.domain.gateway_requests import PdoEntry, ReadPdo, SetPdo, WritePdo
from dvtcli.domain.gateway_words import (
    TYPES,
    Answer,
    Done,
    Failed,
    GatewayError,
    GatewayRequestError,
    data_of,
    value_text,
)
from dvtcli.domain.ports import Frame
from dvtcli.domain.rules.can_id import restricted_use

if TYPE_CHECKING:
    from collections.abc import Callable

    from dvtcli.operations.session.session import SessionNodes

_LONGEST = 8


class GatewayPdos:
    """The PDOs that all clients have set up on the bus."""

    def __init__(self, session: SessionNodes, *, allow_changes: bool) -> None:
        self._session = session
        self._allow_changes = allow_changes
        self._rpdos: dict[int, SetPdo] = {}
        self._tpdos: dict[int, SetPdo] = {}
        #: the last frame of each RPDO since it was set up
        self._received: dict[int, bytes] = {}
        self._stop: Callable[[], None] | None = None

    def close(self) -> None:
        """Listen no longer."""
        if self._stop is not None:
            self._stop()

    def answer(self, command: SetPdo | ReadPdo | WritePdo) -> Answer:
        """Do *command*."""
        match command:
            case SetPdo():
                return self._set(command)
            case ReadPdo(number):
                return self._read(number)
            case WritePdo(number, values):
                return self._write(number, values)

    def _set(self, pdo: SetPdo) -> Answer:
        """Set up *pdo*; bit 31 of its COB-ID deletes it."""
        cob_id = CobId.from_raw(pdo.cob_id)
        own = self._tpdos if pdo.is_tpdo else self._rpdos
        if pdo.is_tpdo and not self._allow_changes:
            return Failed(GatewayError.INTERNAL_STATE, "read-only: this gateway allows no changes")
        if not cob_id.valid:
            own.pop(pdo.number, None)
            if not pdo.is_tpdo:
                self._received.pop(pdo.number, None)
            return Done()
        refused = self._refusal(pdo, cob_id, own)
        if refused is not None:
            return refused
        if pdo.is_tpdo:
            self._session.consent(f"send frames with CAN-ID {cob_id}, which nodes may act on?")
        else:
            self._received.pop(pdo.number, None)
            self._stop = self._stop or self._session.open_network().bus.tap(self._note)
        own[pdo.number] = pdo
        return Done()

    def _refusal(self, pdo: SetPdo, cob_id: CobId, own: dict[int, SetPdo]) -> Failed | None:
        if not self._session.bus.carries_frames or pdo.transmission != "event":
            return Failed(GatewayError.NOT_SUPPORTED, "PDOs of the gateway are event-driven, on a bus of CAN frames")
        use = None if cob_id.extended else restricted_use(cob_id.can_id)
        if use is not None or not cob_id.fits_frame:
            return Failed(Abort.VALUE_RANGE, f"CAN-ID {cob_id} is not for PDOs{f': {use}' if use else ''}")
        if any(number != pdo.number and _frame_of(other_pdo) == _frame_of(pdo) for number, other_pdo in own.items()):
            return Failed(GatewayError.PDO_USED)
        lengths = [TYPES[entry.data_type].bits for entry in pdo.entries]
        if None in lengths or sum(length or 0 for length in lengths) > 8 * _LONGEST:
            return Failed(GatewayError.PDO_LENGTH)
        return None

    def _note(self, frame: Frame, sent: bool) -> None:
        """Keep the frame of an RPDO; called by the bus reader."""
        if sent or frame.remote:
            return
        for number, pdo in tuple(self._rpdos.items()):
            if _frame_of(pdo) == (frame.can_id, frame.extended):
                self._received[number] = frame.data

    def _read(self, number: int) -> Answer:
        pdo = self._rpdos.get(number)
        if pdo is None:
            return Failed(GatewayError.INTERNAL_STATE, f"RPDO {number} of the gateway is not set up")
        data = self._received.get(number)
        if data is None:
            return Failed(GatewayError.INTERNAL_STATE, "no frame of it was received yet")
        if 8 * len(data) < sum(map(_bits, pdo.entries)):
            return Failed(GatewayError.PDO_LENGTH, f"the last frame has {len(data)} bytes only")
        values = _unpacked(pdo, data)
        return Done(" ".join(["1 pdo", str(len(values)), *values]))

    def _write(self, number: int, values: tuple[str, ...]) -> Answer:
        pdo = self._tpdos.get(number)
        if not self._allow_changes or pdo is None:
            return Failed(GatewayError.INTERNAL_STATE, f"TPDO {number} of the gateway is not set up")
        if len(values) != sum(entry.index is not None for entry in pdo.entries):
            return Failed(GatewayError.SYNTAX, "the PDO has another number of values")
        try:
            data = _packed(pdo, values)
        except GatewayRequestError as wrong:
            return Failed(wrong.error, str(wrong))
        can_id, extended = _frame_of(pdo)
        self._session.bus.send(Frame(can_id, data, extended))
        self._session.reporter.note(f"frame {can_id_text(can_id, extended=extended)} sent")
        return Done()


def _frame_of(pdo: SetPdo) -> tuple[int, bool]:
    cob_id = CobId.from_raw(pdo.cob_id)
    return cob_id.can_id, cob_id.extended


def _bits(entry: PdoEntry) -> int:
    return TYPES[entry.data_type].bits or 0


def _packed(pdo: SetPdo, values: tuple[str, ...]) -> bytes:
    """Pack *values*, one per entry except gaps, into a frame's bytes."""
    word, at, left = 0, 0, list(values)
    for entry in pdo.entries:
        if entry.index is not None:
            data = data_of(entry.data_type, [left.pop(0)])
            word |= (int.from_bytes(data, "little") & ((1 << _bits(entry)) - 1)) << at
        at += _bits(entry)
    return word.to_bytes((at + 7) // 8, "little")


def _unpacked(pdo: SetPdo, data: bytes) -> list[str]:
    """Unpack a frame's *data* without gaps."""
    word, values = int.from_bytes(data, "little"), []
    for entry in pdo.entries:
        bits = _bits(entry)
        part = (word & ((1 << bits) - 1)).to_bytes((bits + 7) // 8, "little")
        word >>= bits
        if entry.index is not None:
            values.append(value_text(entry.data_type, part))
    return values
