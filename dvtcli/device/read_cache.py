"""What was read of a node since the last thing that could have changed it, so that nothing is read twice.

It is read like the node's SDO channel: an object that was read is answered from memory, also where it was refused. It
empties itself where the node restarted, an answer was lost, or another SDO client wrote; whoever writes, or
lets others write, has to empty it. Never for reading back, which is done on the channel itself.
"""

from __future__ import annotations

from collections.abc import Callable, Collection, Iterable, Sequence
from dataclasses import dataclass, field
from typing import Protocol

from dvtcli.device.read_pdos import IDENTITY
from dvtcli.domain.ports import CanopenBus, SdoReader
from dvtcli.errors import SdoAborted


class OnBus(Protocol):
    """Something, such as a node, that is reached over a bus."""

    @property
    def bus(self) -> CanopenBus:
        """The bus."""


def read_side_by_side(nodes: Iterable[OnBus], jobs: Sequence[Callable[[], None]]) -> None:
    """Do *jobs*, each of which reads one of *nodes*, which are on one bus; raises a Ctrl-C, or that the bus is gone."""
    for node in list(nodes)[:1]:
        for fault in node.bus.side_by_side(jobs):
            raise fault


@dataclass(slots=True)
class ReadCache:
    """The objects of *node_id* on *bus* that were read, by index and sub-index; *channel* reads those that were not."""

    bus: CanopenBus
    node_id: int
    channel: Callable[[], SdoReader]
    #: told of each object (index, sub-index) before it is asked for
    on_read: Callable[[int, int], None] = lambda _index, _sub_index: None
    _read: dict[tuple[int, int], bytes | SdoAborted] = field(default_factory=dict)
    #: what had happened to the node when the first of them was read
    _seen: tuple[int, int] = (0, 0)

    def upload(
        self, index: int, sub_index: int, *, timeout_s: float | None = None, retries: int | None = None
    ) -> bytes:
        """What the object held when it was read, now at the latest; raises as the channel does."""
        self.bus.drain()
        return self.upload_known(index, sub_index, timeout_s=timeout_s, retries=retries)

    def upload_known(
        self, index: int, sub_index: int, *, timeout_s: float | None = None, retries: int | None = None
    ) -> bytes:
        """The same, as far as what was read of the bus by now tells whether that may be old."""
        self._drop_what_may_be_old()
        if (index, sub_index) not in self._read:
            self._read[index, sub_index] = self._asked(index, sub_index, timeout_s, retries)
        held = self._read[index, sub_index]
        if isinstance(held, SdoAborted):
            raise SdoAborted(index, sub_index, held.code, node=self.node_id)
        return held

    def look(self) -> CacheLook:
        """The same for objects that are read one after the other, and nothing else meanwhile.

        What has arrived on the bus by now counts, and what an exchange meets: it is not read for each object.
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
        """Everything may be old, but who the node is: that changes with a restart at most."""
        self._read = {place: held for place, held in self._read.items() if place[0] == IDENTITY}

    def forget_one(self, index: int, sub_index: int) -> None:
        """The object is to be read again."""
        self._read.pop((index, sub_index), None)

    def forget_objects(self, indices: Collection[int]) -> None:
        """The objects at *indices* are to be read again."""
        self._read = {place: held for place, held in self._read.items() if place[0] not in indices}

    def learn(self, other: ReadCache) -> None:
        """Know what *other* knows of the same node."""
        self._read, self._seen = dict(other._read), other._seen

    def clear(self) -> None:
        """Everything may be old: nobody listened, or another device may have taken the node's place."""
        self._read.clear()

    def is_of_now(self) -> bool:
        """Whether something was read since the last thing that could have changed it."""
        return bool(self._read) and self._seen[0] == self.bus.upsets(self.node_id)

    def _drop_what_may_be_old(self) -> None:
        happened = self.bus.happened(self.node_id)
        if happened != self._seen:
            self._seen = happened
            self.clear()


@dataclass(frozen=True, slots=True)
class CacheLook:
    """One look at *cache* (`ReadCache.look`)."""

    cache: ReadCache

    def upload(
        self, index: int, sub_index: int, *, timeout_s: float | None = None, retries: int | None = None
    ) -> bytes:
        """What the object held when it was read, now at the latest; raises as the channel does."""
        return self.cache.upload_known(index, sub_index, timeout_s=timeout_s, retries=retries)
