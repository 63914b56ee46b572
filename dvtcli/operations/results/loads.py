"""The result of `load`."""

from __future__ import annotations

from dataclasses import dataclass, field
from fractions import Fraction
from typing import TYPE_CHECKING, ClassVar

from dvtcli.domain.network.worst_case_load import most_frames
from dvtcli.operations.results.documents import Answer, Document, Short
from dvtcli.watch.service import service_of

if TYPE_CHECKING:
    from dvtcli.domain.network.network_state import Identifier
    from dvtcli.domain.network.worst_case_load import StreamLoad, WorstCaseLoad
    from dvtcli.watch.statistics import Counted, FrameCount


@dataclass(frozen=True, slots=True)
class Measured(Short):
    """Measured traffic: frames counted in *seconds*, and damaged or lost frames."""

    count: FrameCount
    seconds: float
    error_frames: int = 0
    lost_frames: int = 0

    def load(self, bit_rate: int) -> float:
        """The share of a bus at *bit_rate* bit/s taken by the frames, with actual stuff bits."""
        return self.count.bits / (self.seconds * bit_rate) if self.seconds else 0.0

    def share(self, identifier: Identifier, bit_rate: int) -> float:
        """The share of the frames of a CAN-ID."""
        counted = self.count.by_id.get(identifier)
        return 0.0 if counted is None or not self.seconds else counted.bits / (self.seconds * bit_rate)

    def rate_hz(self, identifier: Identifier) -> float:
        """The frames per second of a CAN-ID."""
        counted = self.count.by_id.get(identifier)
        return 0.0 if counted is None or not self.seconds else counted.frames / self.seconds


@dataclass(frozen=True, slots=True)
class FrameLoad(Short):
    """A CAN-ID: *needs* are computed, empty if only received; *heard* is measured."""

    identifier: Identifier
    needs: tuple[StreamLoad, ...] = ()
    heard: Counted | None = None

    @property
    def label(self) -> str:
        """Name it: by the pre-defined connection set if only received."""
        if self.needs:
            return self.needs[0].stream.label
        can_id, extended = self.identifier
        return service_of(can_id, extended=extended).label

    @property
    def node(self) -> int | None:
        """Its node."""
        if self.needs:
            return self.needs[0].stream.node
        can_id, extended = self.identifier
        return service_of(can_id, extended=extended).node


@dataclass(frozen=True, slots=True)
class NetworkLoad(Answer):
    """The worst-case load of a network (*need*), fitting bit rates, and the *measured* load.

    *file* and *bus* name their sources; *is_assumed*: the bit rate is assumed.
    """

    renderer: ClassVar = "load_lines:load_lines"
    use_pager: ClassVar = True

    need: WorstCaseLoad
    fitting: tuple[int, ...]
    file: str = ""
    bus: str = ""
    is_assumed: bool = False
    measured: Measured | None = None
    exit_code: int = field(default=0, init=False)

    def __bool__(self) -> bool:
        """Tell whether every frame is in time in the worst case."""
        return self.need.fits

    @property
    def expected(self) -> float | None:
        """The load by computed rates with the bits of received frames.

        Only of frames computed and received, without EMCY; None without a measurement.
        """
        measured = self.measured
        if measured is None or not measured.seconds:
            return None
        bits = Fraction(0)
        for frame in self.frames:
            if frame.heard is not None and frame.needs and frame.needs[0].stream.kind != "emcy":
                rates = [
                    Fraction(1_000_000) / n.stream.frame.period_us for n in frame.needs if n.stream.frame.period_us
                ]
                bits += sum(rates, Fraction(0)) * frame.heard.bits / frame.heard.frames
        return float(bits / self.need.bit_rate)

    @property
    def too_often(self) -> tuple[FrameLoad, ...]:
        """Frames received more often than in the worst case: the node differs, or two nodes transmit them."""
        return tuple(frame for frame in self.frames if self._is_too_often(frame))

    def _is_too_often(self, one: FrameLoad) -> bool:
        if one.heard is None or not one.needs or self.measured is None:
            return False
        most = most_frames((need.stream for need in one.needs), self.measured.seconds)
        return most is not None and one.heard.frames > most

    @property
    def frames(self) -> tuple[FrameLoad, ...]:
        """Every CAN-ID computed or received, in order of priority."""
        needs: dict[Identifier, list[StreamLoad]] = {}
        for need in self.need.needs:
            needs.setdefault((need.stream.frame.can_id, need.stream.frame.extended), []).append(need)
        heard = self.measured.count.by_id if self.measured is not None else {}
        only_received = [identifier for identifier in heard if identifier not in needs]
        order = sorted(
            [*needs, *only_received],
            key=lambda frame_address: (
                frame_address[0] >> 18 if frame_address[1] else frame_address[0],
                frame_address[1],
                frame_address[0],
            ),
        )
        return tuple(
            FrameLoad(frame_address, tuple(needs.get(frame_address, ())), heard.get(frame_address))
            for frame_address in order
        )

    def document(self) -> Document:
        """`dvtcli.load/1`."""
        return {
            "schema": "dvtcli.load/1",
            "file": self.file or None,
            "bus": self.bus or None,
            "bit_rate_assumed": self.is_assumed,
            **need_document(self.need),
            "fitting_bit_rates": list(self.fitting),
            "assumed": list(self.need.assumed),
            "measured": self._measured(),
            "frames": [self._frame(frame) for frame in self.frames],
        }

    def _measured(self) -> Document | None:
        measured = self.measured
        if measured is None or not measured.seconds:
            return None
        return {
            "seconds": round(measured.seconds, 3),
            "frames": measured.count.frames,
            "error_frames": measured.error_frames,
            "lost_frames": measured.lost_frames,
            "load": round(measured.load(self.need.bit_rate), 6),
            "expected_load": None if self.expected is None else round(self.expected, 6),
        }

    def _frame(self, one: FrameLoad) -> Document:
        can_id, extended = one.identifier
        heard = one.heard
        return {
            "cob_id": can_id,
            "extended": extended,
            "what": one.label,
            "node": one.node,
            "worst": [_need(need) for need in one.needs],
            "measured": None
            if heard is None or self.measured is None
            else {
                "frames": heard.frames,
                "rate_hz": round(self.measured.rate_hz(one.identifier), 3),
                "load": round(self.measured.share(one.identifier, self.need.bit_rate), 6),
                "too_often": self._is_too_often(one),
                "shortest_ms": None if heard.shortest_s is None else round(1000 * heard.shortest_s, 3),
                "longest_ms": None if heard.longest_s is None else round(1000 * heard.longest_s, 3),
            },
        }


def need_document(need: WorstCaseLoad) -> Document:
    """The load of a network in all."""
    return {
        "bit_rate": need.bit_rate,
        "load": None if need.total is None else round(float(need.total), 6),
        "limited_load": round(float(need.limited), 6),
        "unlimited": [_who(stream.node, stream.label) for stream in need.unlimited],
        "late": [_who(stream_need.stream.node, stream_need.stream.label) for stream_need in need.late],
        "fits": need.fits,
    }


def _need(need: StreamLoad) -> Document:
    stream = need.stream
    return {
        "kind": stream.kind,
        "label": stream.label,
        "remote": stream.frame.remote,
        "length": stream.frame.data_bytes,
        "bits": stream.frame.bits,
        "period_us": _number(stream.frame.period_us),
        "why": stream.why,
        "assumed": stream.assumed,
        "jitter_us": _number(stream.frame.jitter_us),
        "load": None if need.share is None else round(float(need.share), 6),
        "response_us": _number(need.response_us),
        "deadline_us": _number(stream.deadline_us),
        "late": need.is_late,
    }


def _number(time_us: Fraction | int | None) -> float | None:
    return None if time_us is None else round(float(time_us), 3)


def _who(node: int | None, label: str) -> str:
    return label if node is None else f"{node}:{label.lower()}"
