"""Values of nodes from recorded SDO transfers (CiA 301, 7.2.4.3).

Only the default SDO of each node (0x600 and 0x580 + node-ID).
"""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import TYPE_CHECKING, NamedTuple

from dvtcli.device.described_node import ToldValues
from dvtcli.domain.abort import Abort
from dvtcli.errors import SdoAborted
from dvtcli.watch.sdo_transfers import SdoTransfers

if TYPE_CHECKING:
    from collections.abc import Collection, Mapping

    from dvtcli.domain.ports import Frame

Place = tuple[int, int]

_REQUESTS, _ANSWERS, _HEARTBEATS = 0x600, 0x580, 0x700
_SDO_BYTES = 8
#: heartbeat state of a boot-up message (CiA 301, 7.2.8.3.2.1)
_BOOT_UP = b"\x00"
_STORE, _RESTORE, _WITH_PDOS = 0x1010, 0x1011, (1, 2)


@dataclass(frozen=True, slots=True)
class ReceivedValues(ToldValues):
    """Received *values* of a node, with the same interface as the node."""

    node_id: int
    values: Mapping[Place, bytes]

    def told(self, index: int, sub_index: int) -> bytes:
        """The last received value. Raises SdoAborted if none was received."""
        if (index, sub_index) not in self.values:
            raise SdoAborted(index, sub_index, Abort.NO_SUB_INDEX, node=self.node_id)
        return self.values[index, sub_index]


class ReceivedValue(NamedTuple):
    """A node's object of which a transfer was complete: written, or read."""

    node_id: int
    place: Place
    is_written: bool


@dataclass(slots=True)
class _NodeValues:
    """The last values of a node, and those that it has stored."""

    last: dict[Place, bytes] = field(default_factory=dict)
    stored: dict[Place, bytes] = field(default_factory=dict)

    def hold(self, place: Place, data: bytes, *, is_written: bool) -> None:
        """Hold *data*; a written 0x1010 or 0x1011 says what is stored."""
        index, sub_index = place
        if not is_written or index not in (_STORE, _RESTORE):
            self.last[place] = data
        elif sub_index in _WITH_PDOS:
            self.stored = dict(self.last) if index == _STORE else {}


class ReceivedObjects:
    """Hold the last values of all nodes: of objects with indices in *only*, or of all."""

    def __init__(self, only: Collection[int] = ()) -> None:
        self._only = frozenset(only)
        self._nodes: dict[int, _NodeValues] = {}
        self._transfers = SdoTransfers()

    def take(self, frame: Frame) -> ReceivedValue | None:
        """Process *frame*; return the value that it completes. One with a missing segment is none."""
        if frame.extended or frame.remote or not frame.can_id & 0x7F:
            return None
        service, node_id = frame.can_id & 0x780, frame.can_id & 0x7F
        if is_boot_up(frame) and node_id in self._nodes:
            self._transfers.drop(node_id)
            self._nodes[node_id].last = dict(self._nodes[node_id].stored)
        if service not in (_REQUESTS, _ANSWERS) or len(frame.data) != _SDO_BYTES:
            return None
        node = self._nodes.setdefault(node_id, _NodeValues())
        step = self._transfers.take((node_id, "SDO"), frame.data, request=service == _REQUESTS)
        if not step.has_whole_value or step.place is None or (self._only and step.place[0] not in self._only):
            return None
        is_written = bool(step.is_write)
        node.hold(step.place, step.data, is_written=is_written)
        return ReceivedValue(node_id, step.place, is_written)

    def values(self, node_id: int) -> ReceivedValues:
        """Values of node *node_id* received so far."""
        return ReceivedValues(node_id, self._nodes[node_id].last if node_id in self._nodes else {})

    @property
    def node_ids(self) -> list[int]:
        """Nodes with requests or answers, in order."""
        return sorted(self._nodes)


def is_boot_up(frame: Frame) -> bool:
    """Whether *frame* is a boot-up message."""
    if frame.extended or frame.remote or not frame.can_id & 0x7F:
        return False
    return frame.can_id & 0x780 == _HEARTBEATS and frame.data == _BOOT_UP
