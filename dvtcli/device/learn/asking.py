"""Probe one PDO of a device: bring it to the initial state of a probe, write, and read it back.

Writes outside a plan, only to PDOs whose roll-back is in the journal.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping
from dataclasses import dataclass, field, replace
from itertools import takewhile
from typing import TYPE_CHECKING

from dvtcli.device.change.failed_change import TRY_AGAIN
from dvtcli.domain.cob_id import CobId
from dvtcli.domain.learning.probe import ACCEPTED, Probe, ProbeAnswer, ProbeCondition, ProbedPdo, ProbeWrite, Stand
from dvtcli.domain.plan import EVENT_TIMER, INHIBIT_TIME, SYNC_START, TRANSMISSION_TYPE
from dvtcli.errors import DeviceRefused, Interrupted, SafetyRefusal, SdoAborted

if TYPE_CHECKING:
    from dvtcli.device.node import Node

#: How often a refusal is asked for again where two answers differ.
_PAIRS = 2
#: Sub-indices of the communication parameter, in the order in which they are put back, besides the COB-ID.
_PARAMETERS = (TRANSMISSION_TYPE, INHIBIT_TIME, EVENT_TIMER, SYNC_START)


@dataclass(slots=True)
class Asking:
    """Probes *subject* of *node* with at most *limit* downloads; *on_write* is called for each.

    *fit* is the entry to map if a probe needs a mapping, None until an accepted entry is known. An object that refused
    its present value is not probed: it could not be rolled back.
    """

    node: Node
    subject: ProbedPdo
    limit: int
    on_write: Callable[[], None] = lambda: None
    fit: int | None = None
    writes: int = 0
    _now: dict[tuple[int, int], bytes] = field(default_factory=dict)
    _found: dict[tuple[int, int], bytes] = field(default_factory=dict)
    _stuck: set[tuple[int, int]] = field(default_factory=set)
    _boot_ups: int = 0

    def __post_init__(self) -> None:
        pdo, held = self.subject.pdo, self.subject
        self._now = {(pdo.communication_index, sub): data for sub, data in held.parameters.items()}
        self._now[pdo.communication_index, 1] = held.held.communication.cob_id.raw.to_bytes(4, "little")
        self._now[pdo.mapping_index, 0] = bytes([held.held.count])
        self._now |= {(pdo.mapping_index, n): word.to_bytes(4, "little") for n, word in enumerate(held.entries, 1)}
        self._found = dict(self._now)
        self._boot_ups = self.node.bus.boot_ups(self.node.node_id)

    def keep_to_what_goes_back(self) -> None:
        """Restrict the subject to restorable parameters and entries: those that accept their present value."""
        self._stand(Stand.EMPTY)
        pdo, subject = self.subject.pdo, self.subject
        parameters = {
            sub: data for sub, data in subject.parameters.items() if self._takes(pdo.communication_index, sub, data)
        }
        words = list(
            takewhile(
                lambda numbered: self._takes(pdo.mapping_index, numbered[0], numbered[1].to_bytes(4, "little")),
                enumerate(subject.entries, 1),
            )
        )
        entries = tuple(word for _, word in words)
        self._stuck |= {(pdo.mapping_index, number) for number in range(len(entries) + 1, len(subject.entries) + 1)}
        self.subject = replace(
            subject, parameters=parameters, entries=entries, more=len(entries) < len(subject.entries)
        )

    def _takes(self, index: int, sub_index: int, data: bytes) -> bool:
        """True if an object accepts its present value."""
        write = ProbeWrite(index, sub_index, data)
        taken = self._write(write) == ACCEPTED or self._write(write) == ACCEPTED
        self._note_way_back(write, taken=taken)
        return taken

    def _note_way_back(self, write: ProbeWrite, *, taken: bool) -> None:
        if taken:
            self._stuck.discard(write.place)
        else:
            self._stuck.add(write.place)

    def ask(self, probe: Probe) -> ProbeAnswer:
        """The device's answer to *probe*. A refusal counts if given twice."""
        if why := self._no_way_back(probe):
            return ProbeAnswer(probe, None, why=why)
        answer = self._answer(probe)
        if probe.where is ProbeCondition.OPERATIONAL and probe.asked.data == self._found.get(probe.asked.place):
            self._note_way_back(probe.asked, taken=answer.accepted)
        return answer

    def _answer(self, probe: Probe) -> ProbeAnswer:
        code = ACCEPTED
        for _ in range(_PAIRS):
            why = self._stand(probe.stand) or self._write_all(probe.writes[:-1])
            if why:
                return ProbeAnswer(probe, None, why=why)
            code = self._once(probe.asked)
            if code == ACCEPTED or self._once(probe.asked) == code:
                return ProbeAnswer(probe, code, self._now.get(probe.asked.place))
        return ProbeAnswer(probe, None, why=f"it was refused with 0x{code:08X}, and then not, or with another code")

    def _no_way_back(self, probe: Probe) -> str:
        """Why *probe* is forbidden (it alters an object that refuses its present value); empty if allowed."""
        for write in probe.writes:
            held = self._found.get(write.place)
            if held != write.data and write.place in self._stuck:
                return f"0x{write.label} refuses its own value (0x{(held or b'')[::-1].hex().upper()})"
        return ""

    def _once(self, write: ProbeWrite) -> int:
        code = self._write(write)
        if self.node.bus.boot_ups(self.node.node_id) != self._boot_ups:
            raise DeviceRefused(
                f"node {self.node.node_id} restarted when {write} was written",
                node=self.node.node_id,
                place=write.label,
                hint=TRY_AGAIN,
            )
        return code

    def _write_all(self, writes: Iterable[ProbeWrite]) -> str:
        """Make the prerequisite *writes* of a probe; the reason for a failure, else empty."""
        return next((why for write in writes if (why := self._must(write))), "")

    def _stand(self, stand: Stand) -> str:
        """Bring the PDO to *stand*; the reason for a failure, else empty."""
        if stand is Stand.FOUND:
            return ""
        if stand is not Stand.EMPTY and self.fit is None:
            return "its mappable objects are unknown"
        wanted = self._wanted(stand)
        if all(self._now.get(place) == data for place, data in wanted.items()):
            return ""
        pdo = self.subject.pdo
        places = [*((pdo.communication_index, sub) for sub in _PARAMETERS), (pdo.mapping_index, 1)]
        places += [(pdo.mapping_index, 0), (pdo.communication_index, 1)]
        return self._open() or next((why for place in places if (why := self._bring(place, wanted))), "")

    def _wanted(self, stand: Stand) -> dict[tuple[int, int], bytes]:
        pdo, subject = self.subject.pdo, self.subject
        wanted = {(pdo.communication_index, sub): data for sub, data in subject.parameters.items()}
        wanted[pdo.communication_index, 1] = subject.off.raw.to_bytes(4, "little")
        wanted[pdo.mapping_index, 0] = b"\0"
        if stand is not Stand.EMPTY and self.fit is not None:
            wanted[pdo.mapping_index, 0] = b"\1"
            wanted[pdo.mapping_index, 1] = self.fit.to_bytes(4, "little")
        if stand is Stand.ON:
            off = subject.off
            on = CobId(subject.spare[0], rtr_allowed=off.rtr_allowed)
            wanted[pdo.communication_index, 1] = on.raw.to_bytes(4, "little")
        return wanted

    def _open(self) -> str:
        """Disable the PDO with its former COB-ID and set count 0; the reason for a failure, else empty."""
        pdo = self.subject.pdo
        wanted = {
            (pdo.communication_index, 1): self.subject.off.raw.to_bytes(4, "little"),
            (pdo.mapping_index, 0): b"\0",
        }
        return next((why for place in wanted if (why := self._bring(place, wanted))), "")

    def _bring(self, place: tuple[int, int], wanted: Mapping[tuple[int, int], bytes]) -> str:
        if place not in wanted or self._now.get(place) == wanted[place]:
            return ""
        return self._must(ProbeWrite(*place, wanted[place]))

    def _must(self, write: ProbeWrite) -> str:
        """Write with a second try; the reason for a failure, else empty."""
        code = self._write(write)
        if code == ACCEPTED or self._write(write) == ACCEPTED:
            return ""
        return f"{write} before it was refused with 0x{code:08X}"

    def _write(self, write: ProbeWrite) -> int:
        """Send *write*, read the object back, and return the abort code, 0 if accepted."""
        if self.node.cancellation.requested:
            stopped = Interrupted(f"stopped after {self.writes} writes", node=self.node.node_id)
            stopped.exit_code = self.node.cancellation.exit_code
            raise stopped
        if self.writes >= self.limit:
            raise SafetyRefusal(
                f"node {self.node.node_id} was written {self.limit} times, the announced maximum",
                node=self.node.node_id,
            )
        self.writes += 1
        self.on_write()
        code = ACCEPTED
        try:
            self.node.sdo.download(write.index, write.sub_index, write.data)
        except SdoAborted as aborted:
            code = aborted.code
        try:
            self._now[write.place] = self.node.sdo.upload(write.index, write.sub_index)
        except SdoAborted:
            self._now.pop(write.place, None)
        return code
