"""A read cache for a node, valid until an event could have changed a value.

Used like the node's SDO channel, for values and refusals. Expires after a restart, a lost answer, or a write by another
SDO client; own writes, and releasing the node to others, must call `forget`. Never use the cache for a read-back: read
the channel itself.
"""

from __future__ import annotations

from collections.abc import Callable, Collection, Iterable, Sequence
from dataclasses import dataclass, field
from typing import NamedTuple, Protocol

from dvtcli.device.read_pdos import IDENTITY
from dvtcli.domain.ports import CanopenBus, SdoReader
from dvtcli.errors import SdoAborted


class OnBus(Protocol):
    """An object, such as a node, reached over a bus."""

    @property
    def bus(self) -> CanopenBus:
        """The bus."""


def read_side_by_side(nodes: Iterable[OnBus], jobs: Sequence[Callable[[], None]]) -> None:
    """Run *jobs*, each of which reads one of *nodes*, all on one bus; raises Ctrl-C, and the loss of the bus."""
    bus = next((node.bus for node in nodes), None)
    if bus is not None and (faults := bus.side_by_side(jobs)):
        raise faults[0]


@dataclass(slots=True, eq=False, repr=False)
class ReadCache:
    """The objects read from *node_id* on *bus*, by index and sub-index; *channel* reads the others."""

    bus: CanopenBus
    node_id: int
    channel: Callable[[], SdoReader]
    #: called with each object (index, sub-index) before its upload
    on_read: Callable[[int, int], None] = lambda _index, _sub_index: None
    _read: dict[tuple[int, int], bytes | SdoAborted] = field(default_factory=dict)
    _expired: int = 0
    #: the node's events at the first read
    _seen: tuple[int, int] = (0, 0)

    def upload(
        self, index: int, sub_index: int, *, timeout_s: float | None = None, retries: int | None = None
    ) -> bytes:
        """The cached value, or read now. Raises the errors of the channel."""
        self.bus.drain()
        return self.upload_known(index, sub_index, timeout_s=timeout_s, retries=retries)

    def upload_known(
        self, index: int, sub_index: int, *, timeout_s: float | None = None, retries: int | None = None
    ) -> bytes:
        """As `upload`, judging expiry by frames received so far, without receiving more."""
        self._drop_what_may_be_old()
        if (index, sub_index) not in self._read:
            self._read[index, sub_index] = self._asked(index, sub_index, timeout_s, retries)
        held = self._read[index, sub_index]
        if isinstance(held, SdoAborted):
            raise SdoAborted(index, sub_index, held.code, node=self.node_id)
        return held

    def expired(self) -> int:
        """A counter that grows whenever a value expires; unchanged, results computed from the values are still valid.

        Judges expiry as `upload_known`.
        """
        self._drop_what_may_be_old()
        return self._expired

    def look(self) -> CacheLook:
        """A faster view for consecutive reads without other work between.

        Checks the frames that have arrived once and during exchanges, not for each object.
        """
        self.bus.drain()
        return CacheLook(self)

    def _asked(self, index: int, sub_index: int, timeout_s: float | None, retries: int | None) -> bytes | SdoAborted:
        self.on_read(index, sub_index)
        try:
            return self.channel().upload(index, sub_index, timeout_s=timeout_s, retries=retries)
        except SdoAborted as aborted:
            return aborted

    def forget(self) -> None:
        """Expire all values except the identity, which only a restart can change."""
        self._expired += 1
        self._read = {place: held for place, held in self._read.items() if place[0] == IDENTITY}

    def forget_one(self, index: int, sub_index: int) -> None:
        """Expire one object."""
        self._expired += 1
        self._read.pop((index, sub_index), None)

    def forget_objects(self, indices: Collection[int]) -> None:
        """Expire the objects at *indices*."""
        self._expired += 1
        self._read = {place: held for place, held in self._read.items() if place[0] not in indices}

    def learn(self, other: ReadCache) -> None:
        """Copy the values of *other*, a cache of the same node."""
        self._expired += 1
        self._read, self._seen = dict(other._read), other._seen

    def clear(self) -> None:
        """Expire everything, after a gap in monitoring or a possible replacement of the device."""
        self._expired += 1
        self._read.clear()

    def is_of_now(self) -> bool:
        """True if the cache has a value read since the last possible change."""
        return bool(self._read) and self._seen[0] == self.bus.disturbance_count(self.node_id)

    def _drop_what_may_be_old(self) -> None:
        happened = self.bus.happened(self.node_id)
        if happened != self._seen:
            self._seen = happened
            self.clear()


class CacheLook(NamedTuple):
    """A view of *cache* (`ReadCache.look`)."""

    cache: ReadCache

    def upload(
        self, index: int, sub_index: int, *, timeout_s: float | None = None, retries: int | None = None
    ) -> bytes:
        """The cached value, or read now. Raises the errors of the channel."""
        return self.cache.upload_known(index, sub_index, timeout_s=timeout_s, retries=retries)
