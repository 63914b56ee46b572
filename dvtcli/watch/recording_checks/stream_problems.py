"""CAN-IDs that come too often or by turns, and a bus that is full (CiA 301, 7.2.2 and 7.3.5)."""

from __future__ import annotations

from collections import defaultdict
from collections.abc import Collection, Iterator, Mapping
from dataclasses import dataclass, field

from dvtcli.domain.cob_id import CobId
from dvtcli.domain.frame_bits import least_frame_bits
from dvtcli.domain.lint import WARNING, LintRule
from dvtcli.domain.pdo import Pdo, PdoCommunicationParameter
from dvtcli.domain.ports import Frame
from dvtcli.domain.text import plural
from dvtcli.watch.decoder import Address
from dvtcli.watch.recording_checks.frame_problems import TWO_SENDERS, NodePdo
from dvtcli.watch.recording_checks.problems import AlternatingFrames, Moment, Moments, Problem, TimesOf
from dvtcli.watch.sdo_transfers import SdoStep

FLOOD = LintRule(
    "pdo-floods", WARNING, "a PDO is transmitted far more often than usual", "CiA 301, 7.5.2.37: inhibit time"
)
LOAD = LintRule("bus-load", WARNING, "the bus was nearly full", "ISO 11898-1; CiA 301, 7.2.2: low priorities wait")
STREAM_RULES = (FLOOD, LOAD)

#: windows in a second, in which frames and bits are counted
_WINDOWS = 10
#: PDOs of one CAN-ID in a window from which they may be a flood: one each 2 ms; and how many come with each SYNC
_FLOOD, _EACH_SYNC = 50, 2
#: a CAN-ID that comes so evenly (share of the most in a window) in nearly all windows is cyclic
_EVEN, _NEARLY_ALL, _ENOUGH_WINDOWS = 0.8, 0.9, 5
#: the share of the bit rate from which a window is full; stuff bits come on top
_FULL = 0.8
#: bytes that two senders' data has otherwise, at least
_OTHER_BYTES = 2


@dataclass(slots=True)
class _Pdo:
    """The frames of a PDO's CAN-ID in the present window since *begin*, and the full windows so far."""

    window: int
    begin: Moment
    syncs: int
    count: int = 0
    windows: int = 0
    most: int = 0
    fewest: int = 1 << 30
    floods: list[Moment] = field(default_factory=list)
    data: bytes = b""
    before: bytes = b""
    turns: AlternatingFrames = field(default_factory=AlternatingFrames)

    def next_window(self, window: int, moment: Moment, syncs: int) -> None:
        """Begin *window* at *moment*, after so many *syncs*."""
        self.judge(syncs)
        if self.windows > 1:  # the first one is not whole
            self.fewest = min(self.fewest, self.count)
        self.window, self.begin, self.syncs, self.count = window, moment, syncs, 1

    def judge(self, syncs: int) -> None:
        """Judge the present window, at the end of which there were so many *syncs*."""
        if self.count >= _FLOOD and self.count > _EACH_SYNC * (syncs - self.syncs + 1):
            self.floods.append(self.begin)
        self.most = max(self.most, self.count)
        self.windows += 1

    def compare(self, moment: Moment, data: bytes) -> None:
        """Look whether *data* comes by turns with other data of that length.

        A switch that changes one byte by turns has one sender.
        """
        if data != self.data:
            is_back = data == self.before and len(data) == len(self.data)
            if is_back and sum(new != old for new, old in zip(data, self.data, strict=False)) >= _OTHER_BYTES:
                self.turns.take(moment)
            self.before, self.data = self.data, data
        else:
            self.before = data

    @property
    def is_cyclic(self) -> bool:
        """Whether the frames come evenly in nearly all windows."""
        is_long = self.windows >= _ENOUGH_WINDOWS
        return is_long and len(self.floods) > _NEARLY_ALL * self.windows - 1 and self.fewest >= _EVEN * self.most


#: sub-indices of a TPDO's communication parameter, and the bytes of the longest value
_COB_ID, _TYPE, _EVENT_TIMER, _LONGEST = 1, 2, 5, 4
#: the type of TPDOs that only events transmit; what transmits those of type 254, such as a timer, is the manufacturer's
_BY_EVENTS = 255


class KnownTpdos:
    """The COB-ID, type and event timer of TPDOs: as *described*, and as written or read by SDO in the recording."""

    def __init__(self, described: Mapping[NodePdo, PdoCommunicationParameter]) -> None:
        #: all values by TPDO and sub-index
        self._values: dict[NodePdo, dict[int, set[int]]] = defaultdict(lambda: defaultdict(set))
        for key, parameter in described.items():
            values = self._values[key]
            values[_COB_ID].add(parameter.cob_id.raw)
            values[_EVENT_TIMER].add(parameter.event_timer or 0)
            if parameter.transmission_type is not None:
                values[_TYPE].add(parameter.transmission_type)

    def take(self, node_id: int, step: SdoStep) -> None:
        """Look at a *step* of an SDO transfer of *node_id*: it may have a TPDO's parameter."""
        if step.step != "done" or step.place is None or not 0 < len(step.data) <= _LONGEST:
            return
        index, sub_index = step.place
        pdo = Pdo.at(index)
        if pdo is not None and pdo.is_tpdo and index == pdo.communication_index:
            self._values[node_id, pdo][sub_index].add(int.from_bytes(step.data, "little"))

    def event_driven(self) -> Collection[Address]:
        """Return the CAN-IDs of TPDOs that only events transmit: their type was never another, their timer always 0.

        The CAN-ID of a disabled PDO may be that of another.
        """
        cob_ids = [
            CobId.from_raw(raw)
            for values in self._values.values()
            if values[_TYPE] == {_BY_EVENTS} and values[_EVENT_TIMER] == {0}
            for raw in values[_COB_ID]
        ]
        return {(cob_id.can_id, cob_id.extended) for cob_id in cob_ids if cob_id.valid}


class StreamProblems:
    """Watches how often PDOs come, and the load of a bus of *bit_rate* (bit/s; None: unknown, and not judged)."""

    def __init__(self, bit_rate: int | None) -> None:
        self._bits_of_window = None if bit_rate is None else bit_rate / _WINDOWS
        self._window, self._bits, self._most_bits = 0, 0, 0
        self._begin = Moment(0, 0.0)
        self._full: TimesOf[str] = TimesOf()
        self._pdos: dict[Address, _Pdo] = {}
        self._syncs = 0

    def take_sync(self) -> None:
        """Count a SYNC."""
        self._syncs += 1

    def take_pdo(self, moment: Moment, frame: Frame) -> None:
        """Look at *frame*, a PDO."""
        window = int(moment.time_s * _WINDOWS)
        pdo = self._pdos.get((frame.can_id, frame.extended))
        if pdo is None:
            pdo = self._pdos[frame.can_id, frame.extended] = _Pdo(window, moment, self._syncs, 1)
        elif pdo.window == window:
            pdo.count += 1
        else:
            pdo.next_window(window, moment, self._syncs)
        pdo.compare(moment, frame.data)

    def take(self, moment: Moment, frame: Frame) -> None:
        """Count the bits of *frame*, of any kind, if the bit rate is known."""
        if self._bits_of_window is None:
            return
        window = int(moment.time_s * _WINDOWS)
        if window != self._window:
            self._close()
            self._window, self._begin, self._bits = window, moment, 0
        self._bits += least_frame_bits(min(len(frame.data), 8), extended=frame.extended, remote=frame.remote)

    def _close(self) -> None:
        if self._bits_of_window is not None and self._bits > _FULL * self._bits_of_window:
            self._full.note(self._begin, "")
            self._most_bits = max(self._most_bits, self._bits)

    def problems(self, event_driven: Collection[Address]) -> Iterator[Problem]:
        """Return PDOs that flood the bus, and times at which it was full.

        Of the CAN-IDs *event_driven* it is known that only events transmit them: no timer makes them come evenly.
        """
        for (can_id, extended), pdo in sorted(self._pdos.items()):
            pdo.judge(self._syncs)
            named = f"0x{can_id:0{8 if extended else 3}X}"
            if pdo.turns.times is not None:
                text = f"{named} alternates between two values, each with its own period"
                look = f"which nodes have {named} in a TPDO"
                yield Problem(TWO_SENDERS, text, f"senders of {named}", look, pdo.turns.times)
            if pdo.floods and ((can_id, extended) in event_driven or not pdo.is_cyclic):
                text = f"{named} was received up to {plural(pdo.most, 'time')} in 0.1 s"
                yield Problem(FLOOD, text, f"the sender of {named}",
                              "its inhibit time, and which of its values changes continuously",
                              Moments.at(*pdo.floods))  # fmt: skip
        self._close()
        self._bits = 0
        for moments in self._full.values():
            share = self._most_bits / (self._bits_of_window or 1)
            text = f"frames took up to {share:.0%} of the bit rate in 0.1 s, stuff bits aside"
            look = "which CAN-IDs are more frequent then than at other times"
            if share > 1:
                look = "whether the bit rate is right: the load cannot exceed it"
            yield Problem(LOAD, text, "all nodes", look, moments)
