"""Refused transfers, time-outs, and PDO mappings that were begun and not completed (CiA 301, 7.2.4.3 and 7.5.2)."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import dataclass, field

from dvtcli.domain.abort import Abort, abort_text
from dvtcli.domain.lint import ERROR, NOTE, WARNING, LintRule
from dvtcli.domain.pdo import Pdo
from dvtcli.domain.text import join_some
from dvtcli.watch.recording_checks.node_problems import Cause, NodeAtRequest, NodeProblems
from dvtcli.watch.recording_checks.problems import Moment, Moments, Problem, TimesOf
from dvtcli.watch.sdo_transfers import SdoStep

REFUSED_WRITE = LintRule("refused-write", ERROR, "a node refused a write", "CiA 301, table 22: SDO abort codes")
REFUSED_READ = LintRule("refused-read", WARNING, "a node refused a read", "CiA 301, table 22: SDO abort codes")
ABSENT = LintRule("absent-object", NOTE, "a client read objects that a node does not have", "CiA 301, table 22")
GIVEN_UP = LintRule(
    "sdo-given-up", ERROR, "a client ended a transfer: no answer in time, or a wrong answer", "CiA 301, 7.2.4.3.17"
)
HALF_DONE = LintRule(
    "mapping-half-done", ERROR, "a PDO was disabled for a change, but not enabled again", "CiA 301, 7.5.2.36"
)
LEFT_OFF = LintRule(
    "pdo-left-disabled", NOTE, "a PDO was configured or emptied, but not enabled again", "CiA 301, 7.5.2.36"
)
EMPTY = LintRule("mapping-empty", WARNING, "a PDO was left without mapped objects", "CiA 301, 7.5.2.36")
INCOMPLETE = LintRule(
    "sdo-segments", WARNING, "segments of a transfer are missing or repeated", "CiA 301, 7.2.4.3: toggle bit"
)
SDO_RULES = (REFUSED_WRITE, REFUSED_READ, GIVEN_UP, INCOMPLETE, ABSENT, HALF_DONE, EMPTY, LEFT_OFF)

#: node-ID and name of an SDO server
Channel = tuple[int, str]
_DISABLED = 1 << 31
#: a client that asks the next within this time (s) was not ended before
_AT_ONCE_S = 1.0


@dataclass(slots=True)
class _PdoWrites:
    """What was written to a PDO since its node started: whether it is disabled, the number of entries, and when."""

    disabled: Moment | None = None
    count: int | None = None
    #: writes to entries since the count was 0, refused writes, and the last of all
    entries: int = 0
    refused: int = 0
    last: Moment | None = None
    #: whether the client went on with another transfer right after it emptied the disabled PDO
    went_on: bool = False


@dataclass(frozen=True)
class _AbortedTransfer:
    """An aborted transfer of a node's object, with the abort code."""

    node_id: int
    index: int
    sub_index: int
    is_write: bool
    code: int

    @property
    def place(self) -> str:
        return f"{self.index:04X}:{self.sub_index:02X}"

    @property
    def is_of_absent(self) -> bool:
        """Whether it read what the node does not have, as tools do that try."""
        return not self.is_write and self.code in _ABSENT


@dataclass(slots=True)
class SdoProblems:
    """Watches the SDO transfers of each node; *name_of* gives the name of a node's object, empty if unknown.

    *nodes* knows which nodes are STOPPED or silent.
    """

    name_of: Callable[[int, int, int], str]
    nodes: NodeProblems
    _refused: TimesOf[_AbortedTransfer] = field(default_factory=TimesOf)
    _given_up: TimesOf[tuple[_AbortedTransfer, Cause]] = field(default_factory=TimesOf)
    #: object and direction of the transfer in progress
    _asked: dict[Channel, tuple[bytes, bool]] = field(default_factory=dict)
    #: the state of the node at the last request, until its answer
    _waiting: dict[Channel, NodeAtRequest] = field(default_factory=dict)
    _incomplete: TimesOf[tuple[int, str, bool]] = field(default_factory=TimesOf)
    _pdos: dict[tuple[int, Pdo], _PdoWrites] = field(default_factory=dict)
    #: by node-ID, the disabled PDO whose count was written with 0 last, until the next transfer
    _emptied: dict[int, _PdoWrites] = field(default_factory=dict)

    def start(self, node_id: int) -> None:
        """Node *node_id* starts: forget what was written to it."""
        for key in [key for key in self._pdos if key[0] == node_id]:
            del self._pdos[key]
        self._emptied.pop(node_id, None)

    def take(self, moment: Moment, channel: Channel, data: bytes, step: SdoStep, *, request: bool) -> None:
        """Look at *data*, an SDO of *channel*, which is this *step* of a transfer."""
        node_id = channel[0]
        if step.has_whole_value and (emptied := self._emptied.pop(node_id, None)) is not None:
            emptied.went_on = emptied.last is not None and moment.time_s - emptied.last.time_s <= _AT_ONCE_S
        if step.is_write and step.place is not None and step.has_whole_value:
            self._written(moment, node_id, step.place, int.from_bytes(step.data, "little"))
        if step.step == "abort":
            self._aborted(moment, channel, data, by_client=request)
        elif step.step == "start":
            self._asked[channel] = data[1:4], bool(step.is_write)
        elif step.step == "incomplete" and step.place is not None:
            self._incomplete.note(moment, (node_id, step.object, bool(step.is_write)))
        if not request or step.step == "abort":
            self._waiting.pop(channel, None)
        else:
            self._waiting[channel] = self.nodes.asked(node_id, moment)

    def _aborted(self, moment: Moment, channel: Channel, data: bytes, *, by_client: bool) -> None:
        node_id = channel[0]
        asked, is_write = self._asked.pop(channel, (data[1:4], False))
        if asked != data[1:4] and any(data[1:4]):
            asked, is_write = data[1:4], False
        index, sub_index, code = int.from_bytes(asked[:2], "little"), asked[2], int.from_bytes(data[4:], "little")
        transfer = _AbortedTransfer(node_id, index, sub_index, is_write, code)
        if by_client:
            waiting = self._waiting.get(channel)
            self._given_up.note(moment, (transfer, Cause() if waiting is None else self.nodes.cause(waiting)))
        else:
            self._refused.note(moment, transfer)
        if is_write and not by_client and (pdo := Pdo.at(index)) is not None:
            writes = self._pdos.setdefault((node_id, pdo), _PdoWrites())
            writes.refused += 1
            writes.last = moment

    def _written(self, moment: Moment, node_id: int, place: tuple[int, int], value: int) -> None:
        index, sub_index = place
        pdo = Pdo.at(index)
        if pdo is None:
            return
        writes = self._pdos.setdefault((node_id, pdo), _PdoWrites())
        if index == pdo.communication_index:
            if sub_index == 1:
                if not value & _DISABLED:
                    writes.disabled, writes.entries, writes.refused = None, 0, 0
                elif writes.disabled is None:
                    writes.disabled, writes.entries, writes.refused, writes.count = moment, 0, 0, None
        elif sub_index:
            writes.entries += 1
        else:
            writes.count = value
            writes.entries, writes.went_on = (writes.entries, False) if value else (0, False)
            if not value and writes.disabled is not None:
                self._emptied[node_id] = writes
        writes.last = moment

    def problems(self, end: Moment) -> Iterator[Problem]:
        """Return refused and abandoned transfers, and PDOs that were left disabled or empty, in frames until *end*."""
        yield from self._absent()
        for transfer, moments in self._refused.items():
            if not transfer.is_of_absent:
                yield self._aborted_transfer(
                    REFUSED_WRITE if transfer.is_write else REFUSED_READ, "refused", transfer, moments
                )
        for (transfer, silence), moments in self._given_up.by(lambda key: (key[0], key[1].text(end))).items():
            yield self._aborted_transfer(GIVEN_UP, "given up", transfer, moments, silence)
        for (node_id, place, is_write), moments in self._incomplete.items():
            text = f"{'write to' if is_write else 'read of'} {place}: segments are missing or repeated"
            look = "the toggle bits of its segments, and whether frames are missing in the recording"
            yield Problem(INCOMPLETE, text, f"SDO client and node {node_id}", look, moments, node_id, place)
        for (node_id, pdo), writes in self._pdos.items():
            yield from _left(node_id, pdo, writes)

    def _absent(self) -> Iterator[Problem]:
        """Return a problem for each node of which objects were read that it does not have: tools try so."""
        missing: dict[int, list[tuple[str, Moments]]] = {}
        for transfer, moments in self._refused.items():
            if transfer.is_of_absent:
                missing.setdefault(transfer.node_id, []).append((transfer.place, moments))
        for node_id, reads in missing.items():
            places = join_some(place for place, _ in reads)
            yield Problem(
                ABSENT, f"node {node_id} does not have the objects that were read: {places}",
                f"SDO client and node {node_id}", "nothing, if a tool was searching for objects",
                Moments.at(*sorted(each.first for _, each in reads)), node_id,
            )  # fmt: skip

    def _aborted_transfer(
        self, rule: LintRule, how: str, transfer: _AbortedTransfer, moments: Moments, silence: str = ""
    ) -> Problem:
        node_id, place = transfer.node_id, transfer.place
        named = " ".join(filter(None, (place, self.name_of(node_id, transfer.index, transfer.sub_index))))
        text = f"{'write to' if transfer.is_write else 'read of'} {named} {how}: "
        text += f"abort 0x{transfer.code:08X}, {abort_text(transfer.code)}"
        look = silence or _LOOK.get(transfer.code, "whether the object and its value are what the node's EDS describes")
        return Problem(rule, text, f"SDO client and node {node_id}", look, moments, node_id, place)


_ABSENT = (Abort.NO_OBJECT, Abort.NO_SUB_INDEX)
#: what to look at first, by abort code
_LOOK = {
    int(Abort.TIME_OUT): "whether the node is on, and how busy it and the bus are",
    int(Abort.TOGGLE_BIT): "whether two clients use the node's SDO at once",
    int(Abort.NOT_MAPPABLE): "whether the EDS lets the object be mapped to this PDO",
    int(Abort.UNSUPPORTED_ACCESS): "whether the PDO was disabled, and its count 0, before the write",
    int(Abort.DEVICE_STATE): "the NMT state of the node: many accept such a write in PRE-OPERATIONAL only",
    int(Abort.NO_OBJECT): "whether the EDS is that of this device and firmware",
    int(Abort.NO_SUB_INDEX): "whether the EDS is that of this device and firmware",
}


def _left(node_id: int, pdo: Pdo, writes: _PdoWrites) -> Iterator[Problem]:
    """Say how the writes to *pdo* left it, if that is not as they were to end."""
    if writes.last is None:
        return
    is_begun = bool(writes.entries or writes.refused or writes.count)
    look = "the client's actions after the last of these frames: was a write refused, or was it ended?"
    if writes.disabled is not None and writes.count and writes.count == writes.entries and not writes.refused:
        rule, begin, how = LEFT_OFF, writes.disabled, "was configured, but not enabled again"
        look = "nothing, if the PDO should be off"
    elif writes.disabled is not None and is_begun:
        rule, begin = HALF_DONE, writes.disabled
        how = "was disabled, written to and not enabled again"
    elif writes.disabled is not None and writes.count == 0 and writes.went_on:
        rule, begin, how = LEFT_OFF, writes.disabled, "was emptied, but not enabled again"
        look = "nothing, if the PDO should be off"
    elif writes.count == 0:
        rule, begin = (HALF_DONE if is_begun else EMPTY), writes.disabled or writes.last
        how = "has count 0 although its entries were written" if is_begun else "has count 0"
    else:
        return
    yield Problem(
        rule,
        f"{pdo.label} of node {node_id} {how}",
        f"SDO client and node {node_id}",
        look,
        Moments(writes.last, writes.last, 1, sorted({begin.number, writes.last.number})),
        node_id,
        f"{pdo.communication_index:04X}:01" if writes.disabled is not None else f"{pdo.mapping_index:04X}:00",
    )
