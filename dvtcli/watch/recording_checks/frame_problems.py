"""PDOs of a wrong length or without a sender, and CAN-IDs and node-IDs with two senders (CiA 301, 7.2.2 and 7.3.5)."""

from __future__ import annotations

from collections import Counter, defaultdict
from collections.abc import Callable, Collection, Iterator, Mapping
from dataclasses import dataclass, field
from typing import NamedTuple

from dvtcli.domain.cob_id import CobId, can_id_text
from dvtcli.domain.frame import byte_length
from dvtcli.domain.lint import ERROR, NOTE, WARNING, LintRule
from dvtcli.domain.nmt import NmtCommand
from dvtcli.domain.pdo import Pdo, is_mpdo
from dvtcli.domain.ports import Frame
from dvtcli.domain.text import plural
from dvtcli.watch.decoder import Address, Layout, misfit
from dvtcli.watch.recording_checks.node_problems import Cause, NodeAtRequest, NodeProblems
from dvtcli.watch.recording_checks.problems import Moment, Moments, Problem, TimesOf
from dvtcli.watch.recording_checks.sdo_problems import Channel
from dvtcli.watch.sdo_transfers import SdoStep

LENGTH = LintRule("pdo-other-length", ERROR, "a PDO has another length than is mapped", "CiA 301, 7.4.7")
DEFAULT_LENGTH = LintRule(
    "pdo-other-than-default", NOTE, "a PDO has another length than its default mapping, and the file maps nothing",
    "CiA 301, 7.4.7",
)  # fmt: skip
TWO_SENDERS = LintRule(
    "two-senders", ERROR, "two nodes seem to send the same CAN-ID", "CiA 301, 7.3.5: a CAN-ID has one producer"
)
TWO_NODES = LintRule("two-nodes-answer", ERROR, "an SDO request got two answers", "CiA 301, 7.3.4: node-IDs are unique")
NO_ANSWER = LintRule(
    "sdo-no-answer", ERROR, "a node that answers SDO requests did not answer a request", "CiA 301, 7.2.4.3"
)
UNASKED = LintRule("sdo-unasked", WARNING, "an SDO response without a request", "CiA 301, 7.2.4.3")
FRAME_RULES = (LENGTH, DEFAULT_LENGTH, TWO_SENDERS, TWO_NODES, NO_ANSWER, UNASKED)
#: changes between two lengths from which two senders are likely: one change is a new mapping
_ENOUGH = 4
#: command specifiers of answers that begin a transfer, one for each request: upload, download
_FIRST_ANSWERS = (2, 3)
#: how long an answer takes at most (s)
_PATIENCE_S = 1.0


class _Misfit(NamedTuple):
    """A mismatch in words: frames of *length* bytes, a layout of *mapped* bytes for *node* (0: unknown).

    *is_guess*: the layout is that of a default mapping, which the node need not have.
    """

    text: str
    node: int
    label: str
    length: int
    mapped: int
    is_consumers: bool
    is_guess: bool

    @classmethod
    def of(cls, frame: Frame, layout: Layout) -> _Misfit | None:
        """Compare *frame* with *layout*; None if it fits."""
        text, mapped = misfit(frame, layout), layout.byte_length
        if not text or mapped is None:
            return None
        service = layout.service
        return cls(
            text, service.node or 0, service.label, len(frame.data), mapped, layout.is_consumers, bool(layout.guess)
        )

    def fits(self, mapped: int) -> bool:
        """Tell whether the frame fits a mapping of *mapped* bytes."""
        return self.length == mapped or (self.is_consumers and self.length > mapped)


@dataclass(slots=True)
class _Lengths:
    """The lengths of a CAN-ID's frames: the last, the one before it, and changes back to that.

    *misfit* says what is wrong with the last, None if nothing is. *is_pdo*: the CAN-ID is that of a known PDO, or of
    one in the pre-defined connection set.
    """

    last: int = -1
    before: int = -1
    changes: list[Moment] = field(default_factory=list)
    misfit: _Misfit | None = None
    is_pdo: bool = False


@dataclass(slots=True)
class LengthProblems:
    """Watches the lengths of frames; *layout_of* a frame is what its sender maps, *mappings* those in the recording."""

    layout_of: Callable[[Frame], Layout]
    mappings: RecordedMappings
    _lengths: dict[Address, _Lengths] = field(default_factory=lambda: defaultdict(_Lengths))
    _misfits: TimesOf[_Misfit] = field(default_factory=TimesOf)

    def take(self, moment: Moment, frame: Frame) -> None:
        """Look at *frame*."""
        if frame.remote:
            return
        seen, length = self._lengths[frame.can_id, frame.extended], len(frame.data)
        if seen.last != length:
            if seen.before == length:
                seen.changes.append(moment)
            seen.before, seen.last = seen.last, length
            layout = self.layout_of(frame)
            seen.misfit = _Misfit.of(frame, layout)
            seen.is_pdo = not frame.extended and layout.service.kind == "pdo"
        if (found := seen.misfit) is not None and not (
            found.is_guess and self.mappings.explains(found.node, found.label, found.fits)
        ):
            self._misfits.note(moment, found)

    @property
    def sent(self) -> Collection[Address]:
        """The CAN-IDs of all frames so far, remote ones aside."""
        return self._lengths.keys()

    def problems(self) -> Iterator[Problem]:
        """Return PDOs of a wrong length, with the cause if known, and those whose length changes to and fro."""
        two = {address for address, seen in self._lengths.items() if seen.is_pdo and len(seen.changes) >= _ENOUGH}
        for address in sorted(two):
            seen, can_id = self._lengths[address], can_id_text(address[0], extended=address[1])
            text = f"{can_id} alternates between {seen.before} and {plural(seen.last, 'byte')}"
            look = f"which nodes have {can_id} in a TPDO"
            yield Problem(TWO_SENDERS, text, f"senders of {can_id}", look, Moments.at(*seen.changes))
        for found, moments in self._misfits.items():
            node_id = found.node
            if found.is_guess and self.mappings.was_read_later(node_id, found.label, moments.last, found.fits):
                continue
            cause = self.mappings.cause(node_id, found.label, moments.first, found.mapped, found.fits)
            expected = "what the node maps, which the file does not say" if found.is_guess else (
                "whether the node's mapping is that of the file"
            )  # fmt: skip
            look = cause or f"{expected}, and whether another node sends it"
            parties = f"node {node_id}" if node_id else "the sender"
            rule = DEFAULT_LENGTH if found.is_guess else LENGTH
            yield Problem(rule, found.text, parties, look, moments, node_id or None)


@dataclass(slots=True)
class AnswerProblems:
    """Watches for SDO requests that get two answers, or none; *nodes* knows which nodes are STOPPED or silent."""

    nodes: NodeProblems
    #: requests that are not answered yet, by node and object
    _asked: dict[Channel, Counter[bytes]] = field(default_factory=lambda: defaultdict(Counter))
    #: the answer to each node's last request, and the state of the node at a request without one
    _answered: dict[Channel, bytes | None] = field(default_factory=dict)
    _waiting: dict[Channel, NodeAtRequest] = field(default_factory=dict)
    _twice: TimesOf[Channel] = field(default_factory=TimesOf)
    _never: TimesOf[tuple[Channel, Cause]] = field(default_factory=TimesOf)
    _unasked: TimesOf[Channel] = field(default_factory=TimesOf)
    #: nodes that answer at all: tools ask every node-ID
    _present: set[Channel] = field(default_factory=set)

    def start(self, node_id: int) -> None:
        """Node *node_id* starts: it answers no earlier request."""
        for channel in [channel for channel in self._asked if channel[0] == node_id]:
            del self._asked[channel]

    def take(
        self, moment: Moment, channel: Channel, data: bytes, step: SdoStep, *, request: bool, is_other: bool
    ) -> None:
        """Look at *data*, an SDO of *channel*, which is this *step* of a transfer.

        *is_other*: it begins one within that of another client.
        """
        if request:
            self._request(moment, channel, data, step, is_other=is_other)
        elif data:
            self._present.add(channel)
            self._waiting.pop(channel, None)
            if step.step != "segment":
                self._answer(moment, channel, data, step)

    def _request(self, moment: Moment, channel: Channel, data: bytes, step: SdoStep, *, is_other: bool) -> None:
        self._answered[channel] = None
        if step.step == "abort":
            self._waiting.pop(channel, None)
        elif step.step == "start":
            if channel in self._waiting and not is_other:
                self._not_answered(channel)
            self._waiting[channel] = self.nodes.asked(channel[0], moment)
            self._asked[channel][data[1:4]] += 1

    def _not_answered(self, channel: Channel) -> None:
        asked = self._waiting[channel]
        self._never.note(asked.moment, (channel, self.nodes.cause(asked)))

    def _answer(self, moment: Moment, channel: Channel, data: bytes, step: SdoStep) -> None:
        """Look at an answer: of two to one request, the second is a finding."""
        is_first = data[0] >> 5 in _FIRST_ANSWERS
        is_asked = self._asked[channel][data[1:4]] > 0
        if is_asked and (is_first or step.step in ("accepted", "abort")):
            self._asked[channel][data[1:4]] -= 1
        if is_first and channel in self._answered:
            before = self._answered[channel]
            if before is not None and before[:4] == data[:4] and not is_asked:
                self._twice.note(moment, channel)
            elif not is_asked and before != data:
                self._unasked.note(moment, channel)
            self._answered[channel] = data

    def problems(self, end: Moment) -> Iterator[Problem]:
        """Return nodes that answer twice, or not always, in the frames until *end*."""
        for (node_id, _), moments in self._twice.items():
            yield Problem(TWO_NODES, f"node {node_id}: requests are answered twice", f"nodes with node-ID {node_id}",
                          "the serial numbers (0x1018:04) of both, one of them unplugged",
                          moments, node_id)  # fmt: skip
        for (node_id, _), moments in self._unasked.items():
            text = f"node {node_id}: {plural(moments.times, 'answer')} without a request"
            yield Problem(UNASKED, text, f"SDO client and node {node_id}",
                          "whether two nodes have this node-ID, and whether frames are missing in the recording",
                          moments, node_id)  # fmt: skip
        for channel, asked in self._waiting.items():
            if end.time_s - asked.moment.time_s > _PATIENCE_S:
                self._not_answered(channel)
        self._waiting = {}
        for (channel, silence), moments in self._never.by(lambda key: (key[0], key[1].text(end))).items():
            if channel in self._present:
                node_id = channel[0]
                text = f"node {node_id}: {plural(moments.times, 'request')} without an answer"
                look = silence or "whether the node restarted or was busy at that time"
                yield Problem(NO_ANSWER, text, f"SDO client and node {node_id}", look, moments, node_id)


NOT_SENT = LintRule(
    "rpdo-not-sent", WARNING, "a node in OPERATIONAL waits for an RPDO that no node transmits", "CiA 301, 7.2.2"
)
RPDO_RULES = (NOT_SENT,)
#: how long a node is in OPERATIONAL before an RPDO is missed (s)
_MISSED_S = 2.0
#: a node's PDO: node-ID and PDO
NodePdo = tuple[int, Pdo]


@dataclass(slots=True)
class RpdoProblems:
    """Knows which RPDOs are meant to be sent: the *described* ones, and those that are written in the recording."""

    described: Mapping[NodePdo, Address]
    _written: dict[NodePdo, tuple[Address, Moment] | None] = field(default_factory=dict)

    def take(self, moment: Moment, node_id: int, step: SdoStep) -> None:
        """Look at a *step* of an SDO transfer of *node_id*: it may have written a COB-ID."""
        if step.step != "done" or not step.is_write or step.place is None or step.place[1] != 1:
            return
        pdo = Pdo.at(step.place[0])
        if pdo is None or pdo.is_tpdo or step.place[0] != pdo.communication_index or len(step.data) != 4:
            return
        cob_id = CobId.from_raw(int.from_bytes(step.data, "little"))
        is_on = cob_id.valid and bool(cob_id.can_id)
        self._written[node_id, pdo] = ((cob_id.can_id, cob_id.extended), moment) if is_on else None

    def problems(self, sent: Collection[Address], nodes: NodeProblems) -> Iterator[Problem]:
        """Return RPDOs whose CAN-ID is not among those that were *sent*, of *nodes* that were in OPERATIONAL."""
        first = Moment(1, float("-inf"))
        known: dict[NodePdo, tuple[Address, Moment] | None] = {
            **{key: (address, first) for key, address in self.described.items()},
            **self._written,
        }
        for (node_id, pdo), found in sorted(known.items()):
            operational = nodes.operational(node_id)
            if found is None or operational is None or found[0] in sent:
                continue
            (can_id, extended), since = found
            begin, end = max(operational[0], since, key=lambda moment: moment.time_s), operational[1]
            if end.time_s - begin.time_s >= _MISSED_S:
                named = f"0x{can_id:0{8 if extended else 3}X}"
                text = f"{pdo.label} of node {node_id} is {named}, which no node transmits"
                look = (
                    f"which node should transmit {named}, and whether its TPDO is enabled and the node in OPERATIONAL"
                )
                yield Problem(NOT_SENT, text, f"node {node_id} and the sender of {named}", look, Moments.at(begin),
                              node_id, f"{pdo.communication_index:04X}:01")  # fmt: skip


#: a node's PDO: node-ID and label
_NodePdo = tuple[int, str]


class _RecordedMapping(NamedTuple):
    """A mapping that was complete at *moment*, by a write or a read; *length* (bytes) is None if unknown."""

    moment: Moment
    length: int | None
    is_write: bool


@dataclass(slots=True)
class RecordedMappings:
    """Knows when SDO transfers wrote or read the whole mapping of a PDO, and the frame length (bytes) that it gives."""

    #: the number of entries, and the bits of each entry, by PDO
    _counts: dict[_NodePdo, int] = field(default_factory=dict)
    _entries: dict[_NodePdo, dict[int, int]] = field(default_factory=lambda: defaultdict(dict))
    #: the complete mappings of each PDO in order
    _mappings: dict[_NodePdo, list[_RecordedMapping]] = field(default_factory=lambda: defaultdict(list))

    def start(self, moment: Moment, node_id: int) -> None:
        """Node *node_id* starts: its mappings are those that it stored."""
        for key in [key for key in self._mappings if key[0] == node_id]:
            self._mappings[key].append(_RecordedMapping(moment, None, is_write=True))
        for known in (self._counts, self._entries):
            for key in [key for key in known if key[0] == node_id]:
                del known[key]

    def take(self, moment: Moment, node_id: int, step: SdoStep) -> None:
        """Look at a *step* of an SDO transfer of *node_id*: it may have written or read a mapping."""
        if not step.has_whole_value or step.place is None:
            return
        index, sub_index = step.place
        pdo = Pdo.at(index)
        if pdo is None or index != pdo.mapping_index:
            return
        key, value = (node_id, pdo.label), int.from_bytes(step.data, "little")
        if sub_index:
            self._entries[key][sub_index] = value & 0xFF
        else:
            self._counts[key] = value
        if step.is_write:
            if not sub_index and value:
                self._mappings[key].append(_RecordedMapping(moment, self._length(key), is_write=True))
        elif (length := self._length(key)) is not None:
            self._mappings[key].append(_RecordedMapping(moment, length, is_write=False))

    def _length(self, key: _NodePdo) -> int | None:
        """The length of the PDO's frames by all entries of its mapping; None if one is unknown, or without entries."""
        count = self._counts.get(key, 0)
        bits = [self._entries[key].get(number) for number in range(1, count + 1)]
        known = [entry_bits for entry_bits in bits if entry_bits is not None]
        return byte_length(sum(known)) if known and len(known) == len(bits) and not is_mpdo(count) else None

    def explains(self, node_id: int, label: str, fits: Callable[[int], bool]) -> bool:
        """Whether the last mapping so far has a length that *fits*."""
        found = self._mappings.get((node_id, label), [])
        length = found[-1].length if found else None
        return length is not None and fits(length)

    def was_read_later(self, node_id: int, label: str, last: Moment, fits: Callable[[int], bool]) -> bool:
        """Whether the first mapping in the recording was read after *last* and has a length that *fits*."""
        first = next(iter(self._mappings.get((node_id, label), ())), None)
        is_read = first is not None and not first.is_write and first.moment > last
        return first is not None and is_read and first.length is not None and fits(first.length)

    def cause(self, node_id: int, label: str, moment: Moment, mapped: int, fits: Callable[[int], bool]) -> str:
        """Say when SDO writes changed the mapping, if that is why a frame at *moment* has not *mapped* bytes.

        *fits* tells whether the frame fits a mapping of a length (bytes). Empty if the writes do not explain it.
        """
        written = [found for found in self._mappings.get((node_id, label), ()) if found.is_write]
        before = [found for found in written if found.moment < moment]
        if before and (length := before[-1].length) is not None and length != mapped and fits(length):
            return _words(label, length, "in", before[-1].moment)
        later = next((found for found in written[len(before) :] if found.length == mapped), None)
        return "" if later is None else _words(label, mapped, "only in", later.moment)


def _words(label: str, length: int, when: str, written: Moment) -> str:
    return f"the mapping of {label}: SDO writes changed it to {plural(length, 'byte')} {when} frame {written.number}"


TWO_MASTERS = LintRule(
    "two-masters", WARNING, "there seem to be two masters on the bus: SDO clients, or senders of NMT commands",
    "CiA 301, 7.2.4.3.1 and 7.2.8.3.1",
)  # fmt: skip
MASTER_RULES = (TWO_MASTERS,)
#: no client gives up a transfer so fast (s)
_SAME_CLIENT_S = 0.01
#: how often NMT commands undo each other until two masters are likely, and within what time (s)
_REVERSALS, _REVERSED_S = 3, 1.0
_COMMANDS = frozenset(NmtCommand)
_ENDS = ("done", "incomplete", "abort")


@dataclass(slots=True)
class _Commanded:
    """The last two NMT commands to a node (0: all), the time of the last (s), and reversals in a row."""

    last: int = -1
    before: int = -1
    at_s: float = 0.0
    reversals: list[Moment] = field(default_factory=list)


@dataclass(slots=True)
class MasterProblems:
    """Watches for SDO requests within another transfer, and for NMT commands by turns."""

    #: time of the last frame of a running transfer, by server; nodes that answer
    _running: dict[Channel, float] = field(default_factory=dict)
    _present: set[int] = field(default_factory=set)
    _clients: TimesOf[int] = field(default_factory=TimesOf)
    _commanded: dict[int, _Commanded] = field(default_factory=dict)
    _fights: dict[int, Moments] = field(default_factory=dict)

    def start(self, node_id: int) -> None:
        """Node *node_id* starts: its transfers are over."""
        for channel in [channel for channel in self._running if channel[0] == node_id]:
            del self._running[channel]

    def take_sdo(self, moment: Moment, channel: Channel, step: SdoStep, *, request: bool) -> bool:
        """Look at a *step* of a transfer of *channel*; return whether it begins one while another client's runs."""
        node_id = channel[0]
        self._commanded.pop(node_id, None)  # whoever changes a node sets its state before and after that
        self._commanded.pop(0, None)
        if not request:
            self._present.add(node_id)
        is_other = step.step == "start" and moment.time_s - self._running.get(channel, -1e9) < _SAME_CLIENT_S
        if is_other:
            self._clients.note(moment, node_id)
        if step.step in _ENDS:
            self._running.pop(channel, None)
        elif step.step != "unknown":
            self._running[channel] = moment.time_s
        return is_other

    def take_command(self, moment: Moment, data: bytes) -> None:
        """Look at an NMT command."""
        if len(data) != 2 or data[0] not in _COMMANDS:
            return
        commanded = self._commanded.setdefault(data[1], _Commanded())
        if data[0] == commanded.last:
            return
        if data[0] == commanded.before and moment.time_s - commanded.at_s < _REVERSED_S:
            commanded.reversals.append(moment)
            if len(commanded.reversals) >= _REVERSALS:
                self._fights[data[1]] = Moments.at(*commanded.reversals)
        else:
            commanded.reversals = []
        commanded.before, commanded.last, commanded.at_s = commanded.last, data[0], moment.time_s

    def problems(self) -> Iterator[Problem]:
        """Return nodes with two SDO clients, and those with two NMT masters."""
        for node_id, moments in self._clients.items():
            if node_id in self._present:
                text = f"node {node_id}: {plural(moments.times, 'request')} within another transfer"
                yield Problem(TWO_MASTERS, text, f"two SDO clients and node {node_id}",
                              "which programs use the node's SDO at once: each takes the other's answers", moments,
                              node_id)  # fmt: skip
        for node_id, moments in self._fights.items():
            whom = f"node {node_id}" if node_id else "all nodes"
            text = f"{whom}: NMT commands undo each other {plural(moments.times, 'time')} in a row"
            yield Problem(TWO_MASTERS, text, f"NMT masters and {whom}", "which masters are on the bus", moments,
                          node_id or None)  # fmt: skip
