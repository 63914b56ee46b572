"""What went over the wire, by node: what we and others wrote, what was read, and who started over.

The law that every claim stands on: an upload of each claimed object behind the last download and the last boot-up.
Reads SDO frames itself; does not use dvtcli's own reading of them.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

from dvtcli.domain.ports import Frame
from tests.virtual_time import VirtualTimeBus

_STORE = 0x1010


@dataclass(frozen=True)
class Event:
    """One thing that happened: `download`, `upload` or `boot-up`; *data* is None where it came in segments."""

    kind: str
    node_id: int
    place: tuple[int, int] = (0, 0)
    data: bytes | None = None
    ours: bool = True


class WireRecord:
    """Listens on *bus* from now on."""

    def __init__(self, bus: VirtualTimeBus) -> None:
        self.events: list[Event] = []
        #: how many events there had been when we sent a frame last
        self.known = 0
        self._asked: dict[int, Event] = {}
        #: the last download that we began of each node, by its number in `events`, and those that were refused
        self._begun: dict[int, int] = {}
        self._refused: set[int] = set()
        self._downloads: dict[int, int] = {}
        self._reads: dict[int, int] = {}
        self._most_reads: dict[int, int] = {}
        self._requests = 0
        bus.tap(self._hear)

    def _hear(self, frame: Frame, sent: bool) -> None:
        function, node_id = frame.can_id & ~0x7F, frame.can_id & 0x7F
        if sent:
            self.known = len(self.events)
        if function == 0x600 and len(frame.data) == 8:
            self._request(node_id, frame.data, ours=sent)
        elif function == 0x580 and len(frame.data) == 8:
            self._answer(node_id, frame.data)
        elif function == 0x700 and frame.data == b"\0":
            self.events.append(Event("boot-up", node_id))

    def _request(self, node_id: int, data: bytes, *, ours: bool) -> None:
        place, specifier = (int.from_bytes(data[1:3], "little"), data[3]), data[0] >> 5
        self._requests += ours
        if specifier == 1 or (specifier == 6 and not data[0] & 1):
            written = data[4 : 8 - (data[0] >> 2 & 3)] if data[0] & 0x02 and specifier == 1 else None
            self.events.append(Event("download", node_id, place, written, ours))
            if ours:
                self._begun[node_id] = len(self.events) - 1
                self._downloads[node_id] = self._downloads.get(node_id, 0) + 1
                self._reads[node_id] = 0
        elif ours and (specifier == 2 or (specifier == 5 and data[0] & 3 == 0)):
            self._asked[node_id] = Event("upload", node_id, place)
            self._reads[node_id] = self._reads.get(node_id, 0) + 1
            self._most_reads[node_id] = max(self._most_reads.get(node_id, 0), self._reads[node_id])

    def _answer(self, node_id: int, data: bytes) -> None:
        asked, place = self._asked.get(node_id), (int.from_bytes(data[1:3], "little"), data[3])
        begun = self._begun.get(node_id)
        if data[0] >> 5 == 4 and begun is not None and self.events[begun].place == place:
            self._refused.add(begun)
        if asked is None or data[0] >> 5 not in (2, 6) or place != asked.place:
            return
        read = data[4 : 8 - (data[0] >> 2 & 3)] if data[0] & 0x02 and data[0] >> 5 == 2 else None
        self.events.append(Event("upload", node_id, place, read))
        del self._asked[node_id]

    def counts(self) -> tuple[dict[int, int], dict[int, int], int]:
        """Our downloads of each node, the most uploads between two of them, and all requests of ours."""
        return self._downloads, self._most_reads, self._requests

    def written(self) -> Sequence[int]:
        """The nodes that we wrote to."""
        return [event.node_id for event in self.events if event.kind == "download" and event.ours]

    def wrote(self, place: tuple[int, int, int]) -> bool:
        """Whether we wrote the object at *place* (node-ID, index, sub-index), and were not refused that each time."""
        return any(
            one.kind == "download" and one.ours and (one.node_id, *one.place) == place
            for number, one in enumerate(self.events)
            if number not in self._refused
        )

    def others_wrote(self, place: tuple[int, int, int]) -> bool:
        """Whether another master wrote the object at *place* (node-ID, index, sub-index)."""
        written = [one for one in self.events if one.kind == "download" and not one.ours]
        return any((one.node_id, *one.place) == place for one in written)

    def restarted(self, node_id: int) -> bool:
        """Whether a boot-up of *node_id* was heard."""
        return any(one.kind == "boot-up" and one.node_id == node_id for one in self.events)

    def replaced(self, place: tuple[int, int, int]) -> bytes | None:
        """What was read last at *place* before we wrote it; None where it was not, or came in segments."""
        read = None
        for one in self.events:
            if (one.node_id, *one.place) == place:
                if one.kind == "download" and one.ours:
                    break
                read = one.data if one.kind == "upload" else read
        return read

    def _last(self, node_id: int) -> int:
        """The place in `events` of the last thing that could have changed *node_id* and that we could have heard."""
        known = [
            number
            for number, one in enumerate(self.events)
            if one.node_id == node_id
            and one.place[0] != _STORE
            and ((one.kind == "download" and one.ours) or (one.kind == "boot-up" and number < self.known))
        ]
        return known[-1] if known else -1

    def last_change(self, node_id: int) -> str:
        """That thing in words."""
        last = self._last(node_id)
        return "the beginning" if last < 0 else f"{self.events[last].kind} of {self.events[last].place} #{last}"

    def looked(self, place: tuple[int, int, int], data: bytes | None) -> bool:
        """Whether *place* was read behind the last change of its node; and, unless None, *data* was answered then."""
        node_id, index, sub_index = place
        found = [
            one
            for one in self.events[self._last(node_id) + 1 :]
            if one.kind == "upload" and one.node_id == node_id and one.place == (index, sub_index)
        ]
        return bool(found) and (data is None or found[-1].data in (data, None))

    def dead(self, words: Sequence[str]) -> set[int]:
        """Nodes that cannot be reached any more, by the faults *words*."""
        if any("bus-error" in word for word in words):
            return set(range(1, 128))
        return {int(word.partition(":")[0]) for word in words if "silent" in word}
