"""Frames as results: received and decoded, sent and replayed, and a lost or returned bus."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from functools import lru_cache
from typing import ClassVar, Literal

from dvtcli.domain.cob_id import can_id_text
from dvtcli.domain.datatypes import Value
from dvtcli.domain.hint import Action, Hint
from dvtcli.domain.ports import Frame
from dvtcli.domain.scaling import Scaling
from dvtcli.domain.text import join_some, plural
from dvtcli.domain.times import local_clock, utc
from dvtcli.domain.typed_frame import frame_text
from dvtcli.errors import DvtcliError, ended_with
from dvtcli.operations.results.documents import Answer, Document, Short, hex_bytes, json_value, physical_document
from dvtcli.watch.frame_parts import FramePart
from dvtcli.watch.frame_reader import OTHER, Reading

#: protocol parts of a frame
_ASIDE = frozenset({"index", "reserved", "n: bytes without data", "e: transfer type", "s: size", "without data", "c"})


def _tells(part: FramePart) -> bool:
    return not part.in_id and not part.is_bit_of_value and part.name not in _ASIDE


def part_document(part: FramePart) -> Document:
    """An element of `parts` in `dvtcli.explain/1`."""
    return {
        "place": part.place,
        "in_can_id": part.in_id,
        "start_bit": part.start_bit,
        "bits": part.bits,
        "raw": part.raw,
        "name": part.name.strip(),
        "object": part.object,
        "text": part.text,
        "byte_order": "big" if part.is_big_endian else "little",
    }


def reading_document(reading: Reading) -> Document:
    """The fields of a frame in words, the same in all documents of frames."""
    facts = reading.facts
    fields = {name: value if value is None else json_value(value) for name, value in facts.items()} if facts else {}
    return {"what": reading.what, "text": reading.text, "fields": fields}


@dataclass(frozen=True, slots=True)
class FrameExplained(Answer):
    """A frame explained: *kind*, *label*, its *node* if known, its *parts*, and what it says as a whole."""

    renderer: ClassVar = "frame_lines:explained_lines"
    use_pager: ClassVar = True

    frame: Frame
    kind: str
    label: str
    node: int | None
    parts: tuple[FramePart, ...]
    reading: Reading
    exit_code: int = 0

    @property
    def what(self) -> str:
        """The frame's meaning and node."""
        if self.frame.remote and self.kind == "heartbeat":
            return f"node guarding request, node {self.node}"
        kind = "remote request of " if self.frame.remote else ""
        return f"{kind}{self.label}{f', node {self.node}' if self.node else ''}"

    @property
    def short(self) -> str:
        """The frame's contents in a line, without its service: of a PDO the values, without single bits."""
        if self.reading.text:
            service = self.kind.upper()
            text = "" if self.frame.remote else self.reading.text
            return "" if text == service else text.removeprefix(f"{service} ")
        said = ((f"{part.object} {part.text}".strip(), part) for part in self.parts)
        return ", ".join(words for words, part in said if words and _tells(part))

    def document(self) -> Document:
        """`dvtcli.explain/1`."""
        return {"schema": "dvtcli.explain/1", **self.content()}

    def content(self) -> Document:
        """The frame and its parts, without a schema."""
        return {
            "frame": frame_text(self.frame),
            "cob_id": self.frame.can_id,
            "extended": self.frame.extended,
            "remote": self.frame.remote,
            "data": hex_bytes(self.frame.data),
            "kind": self.kind,
            "label": self.label,
            "node": self.node,
            **reading_document(self.reading),
            "parts": [part_document(part) for part in self.parts],
        }


@dataclass(frozen=True, slots=True)
class TracedFrame(Short):
    """A frame of an exchange, explained; *sent*: by us; *secret*: its value is hidden."""

    frame: FrameExplained
    sent: bool
    secret: bool = False

    def document(self) -> Document:
        """An element of `frames` in `dvtcli.trace/1`."""
        at = utc(self.frame.frame.timestamp_s)
        return {"time": at, "sent": self.sent, "secret": self.secret, **self.frame.content()}


@dataclass(frozen=True, slots=True)
class Traced(Answer):
    """The frames of the last exchange, oldest first."""

    renderer: ClassVar = "frame_lines:trace_lines"
    use_pager: ClassVar = True

    frames: tuple[TracedFrame, ...]
    exit_code: int = 0

    def document(self) -> Document:
        """`dvtcli.trace/1`."""
        return {"schema": "dvtcli.trace/1", "frames": [frame.document() for frame in self.frames]}


@dataclass(slots=True)  # not frozen: a recording has a million, and a frozen one takes five times as long to make
class FrameSeen(Answer):
    """A frame: *kind*, *label*, its *node* and *pdo* if known, and *signals* by name.

    *signals* are raw; *scalings* has their scalings, *objects* their objects (`606C:00`), as far as known.
    *mapped_bytes* is the length of its mapping if the frame does not fit. *layout_from* names the layout's source,
    empty for none; *layout_is_guess*: the source is not about this very node. *reading* is the frame in words.
    """

    renderer: ClassVar = "frame_lines:frame_lines"

    frame: Frame
    kind: str
    label: str = ""
    node: int | None = None
    pdo: str | None = None
    signals: Mapping[str, Value] = field(default_factory=dict)
    scalings: Mapping[str, Scaling] = field(default_factory=dict)
    exit_code: int = 0
    objects: Mapping[str, str] = field(default_factory=dict)
    mapped_bytes: int | None = None
    layout_from: str = ""
    layout_is_guess: bool = False
    reading: Reading = OTHER

    def document(self) -> Document:
        """`dvtcli.frame/1`."""
        signals = self.signals
        return {
            "schema": "dvtcli.frame/1",
            "time": utc(self.frame.timestamp_s),
            "kind": self.kind,
            "node": self.node,
            "pdo": self.pdo,
            "cob_id": self.frame.can_id,
            "extended": self.frame.extended,
            "remote": self.frame.remote,
            "data": hex_bytes(self.frame.data),
            "signals": {name: json_value(value) for name, value in signals.items()} if signals else {},
            "physical": {
                name: physical_document(signals[name], meaning)
                for name, meaning in self.scalings.items()
                if name in signals
            }
            if signals
            else {},
            "objects": {name: place for name, place in self.objects.items() if name in signals} if signals else {},
            "layout_from": self.layout_from or None,
            "layout_is_guess": self.layout_is_guess,
            **reading_document(self.reading),
        }

    def matches(self, text: str) -> bool:
        """Tell whether *text* (lower case) is in the name of the frame, a signal or an object."""
        return (
            self._is_called(text)
            or text in self.reading.text.lower()
            or any(self._has(name, text) for name in self.signals)
        )

    def _has(self, name: str, text: str) -> bool:
        return text in _signal(self.objects.get(name, ""), name)

    def _is_called(self, text: str) -> bool:
        return text in _who(self.frame.can_id, self.frame.extended, self.label, self.node, self.kind)

    def chosen(self, text: str) -> FrameSeen:
        """Keep only signals with *text* (lower case) in their names, or their frame's."""
        if not self.signals or self._is_called(text):
            return self
        return replace(self, signals={name: value for name, value in self.signals.items() if self._has(name, text)})


@lru_cache(maxsize=4096)
def _who(can_id: int, extended: bool, label: str, node: int | None, kind: str) -> str:
    """Name a frame in lower case, for a search."""
    return f"{can_id_text(can_id, extended=extended)} {label} node {node} {kind}".lower()


@lru_cache(maxsize=4096)
def _signal(place: str, name: str) -> str:
    """Name a signal and its object in lower case, for a search."""
    return f"{place} {name}".lower()


@dataclass(frozen=True, slots=True)
class PlottedSignal(Short):
    """A signal of a plot: name, *count* of samples, minimum and maximum (raw), *drawing*, if any."""

    name: str
    object: str
    meaning: Scaling
    count: int
    low: float
    high: float
    drawing: tuple[str, ...] = ()

    @property
    def unit(self) -> str:
        """The physical unit, empty for none."""
        return self.meaning.unit

    def document(self) -> Document:
        """An element of `signals` in `dvtcli.plot/1`."""
        low, high = (float(self.meaning.number(end)) for end in (self.low, self.high))
        physical = {"low": low, "high": high, "unit": self.unit} if self.meaning.has_number else None
        return {
            "name": self.name, "object": self.object, "unit": self.meaning.scale, "samples": self.count,
            "low": self.low, "high": self.high, "physical": physical,
        }  # fmt: skip


@dataclass(frozen=True, slots=True)
class Plotted(Answer):
    """Signals of a recording over time; *output* is the picture's file, None if drawn as text."""

    renderer: ClassVar = "frame_lines:plot_lines"

    file: str
    signals: tuple[PlottedSignal, ...]
    seconds: float
    output: str | None = None
    exit_code: int = 0

    def document(self) -> Document:
        """`dvtcli.plot/1`."""
        return {
            "schema": "dvtcli.plot/1",
            "file": self.file,
            "output": self.output,
            "seconds": round(self.seconds, 6),
            "signals": [signal.document() for signal in self.signals],
        }


GatewayHappening = Literal["connected", "left", "written", "nmt", "note", "warning"]


@dataclass(frozen=True, slots=True)
class GatewayEvent(Short):
    """An event at *time_s* (s since 1970), in words as *text*; *client* caused it, None for nobody.

    A write has *node*, *object* and *data* (hexadecimal); *data* is None for a passcode.
    """

    event: GatewayHappening
    time_s: float
    text: Hint | str
    client: str | None = None
    node: int | None = None
    object: str | None = None
    data: str | None = None

    def document(self) -> Document:
        """`dvtcli.gateway-event/1`."""
        return {
            "schema": "dvtcli.gateway-event/1",
            "time": utc(self.time_s),
            "event": self.event,
            "client": self.client,
            "node": self.node,
            "object": self.object,
            "data": self.data,
            "text": self.text,
        }


@dataclass(frozen=True, slots=True)
class BusEvent(Answer):
    """The *bus* by its name is gone, and *why*, or is back after *after_s* seconds; at *time_s* (s since 1970)."""

    renderer: ClassVar = "frame_lines:bus_event_lines"

    bus: str
    time_s: float
    why: str = ""
    after_s: float | None = None
    exit_code: int = 0

    @property
    def text(self) -> str:
        """The event in a line, with the time of day."""
        if self.after_s is None:
            said = f"is gone ({self.why}): waiting for it"
        else:
            said = f"is back after {self.after_s:.1f} s"
        return f"{local_clock(self.time_s)}  {self.bus} {said}"

    def document(self) -> Document:
        """`dvtcli.bus/1`."""
        return {
            "schema": "dvtcli.bus/1",
            "time": utc(self.time_s),
            "bus": self.bus,
            "event": "gone" if self.after_s is None else "back",
            "why": self.why or None,
            "after_s": None if self.after_s is None else round(self.after_s, 3),
        }


#: as many wanted frames, or more, are sent until somebody breaks it off: nobody is told their number
NO_END = 10**9


@dataclass(frozen=True, slots=True)
class Outcome(Short):
    """The outcome of *wanted* frames: *handed* to the interface in *seconds*, delays, errors.

    *late_s* is the maximum delay, *nearly_s* that of 99 %; None without times. *interrupted* is the exit code of an
    interruption.
    """

    wanted: int
    handed: int = 0
    seconds: float = 0.0
    late_s: float | None = None
    nearly_s: float | None = None
    error_frames: int = 0
    failure: DvtcliError | None = None
    interrupted: int = 0

    @property
    def counted(self) -> str:
        """Say how many of how many were handed over; without total if endless."""
        if self.handed == self.wanted or self.wanted >= NO_END:
            return plural(self.handed, "frame")
        return f"{self.handed} of {plural(self.wanted, 'frame')}"

    @property
    def sent(self) -> int | None:
        """The number of frames on the bus; None if unknown after error frames."""
        return None if self.error_frames else self.handed

    @property
    def error(self) -> DvtcliError | None:
        """The error if the bus failed or error frames came; None otherwise, also after Ctrl-C."""
        error: DvtcliError
        if self.failure is not None:
            failed = self.failure
            error = type(failed)(failed.text, why=failed.why, hint=failed.hint, state="unknown")
        elif self.error_frames:
            error = DvtcliError(
                f"{self.error_frames} error frames were received: it is unknown which frames are on the wire",
                hint=Hint(
                    Action.GIVE,
                    {"verbose": None},
                    "check that a node is connected and powered, with this bit rate; {} shows the state of the "
                    "controller",
                ),
                state="unknown",
            )
        else:
            return None
        were = "was" if self.counted == "1 frame" else "were"
        error.state_text = f"{self.counted} {were} handed to the interface"
        return error

    @property
    def exit_code(self) -> int:
        """The exit code of the failure (the bus: 5), 130 after Ctrl-C, 1 if unknown."""
        if self.failure is not None:
            return self.failure.exit_code
        return self.interrupted or (1 if self.error_frames else 0)

    def fields(self) -> Document:
        """The common fields of documents of sent frames."""
        return {
            "wanted": self.wanted,
            "handed_over": self.handed,
            "sent": self.sent,
            "seconds": round(self.seconds, 6),
            "late_max_ms": None if self.late_s is None else round(self.late_s * 1000, 3),
            "late_p99_ms": None if self.nearly_s is None else round(self.nearly_s * 1000, 3),
            "error_frames": self.error_frames,
            "failure": None if self.failure is None else self.failure.text,
        }


class OfFrames:
    """What results about sent frames share; true if all were sent."""

    __slots__ = ()
    outcome: Outcome

    def __bool__(self) -> bool:
        return self.outcome.sent == self.outcome.wanted

    @property
    def exit_code(self) -> int:
        """As `Outcome.exit_code`."""
        return self.outcome.exit_code

    @property
    def failure(self) -> DvtcliError | None:
        """The error if the bus failed or error frames came; None otherwise, also after Ctrl-C."""
        return self.outcome.error

    @property
    def failure_of_document(self) -> DvtcliError | None:
        """The error for a nonzero exit code, for programs."""
        code = self.exit_code
        text = f"interrupted: {self.outcome.counted} handed to the interface"
        return ended_with(code, text, state="unknown") if code else None


@dataclass(frozen=True, slots=True)
class FrameToSend(Short):
    """A frame, with its possible *effects* on nodes (empty if nobody is known to act on it).

    A *secret* frame's value, a passcode, is left out.
    """

    explained: FrameExplained
    effects: str
    secret: bool = False

    @property
    def text(self) -> str:
        """The frame, its kind and contents, in a line."""
        one = self.explained
        said = "its value is not shown" if self.secret else one.short
        return f"{frame_text(one.frame)}  {one.what}{f': {said}' if said else ''}"

    def document(self) -> Document:
        """An element of `frames` in `dvtcli.send/1`."""
        one = self.explained
        return {
            "frame": frame_text(one.frame),
            "kind": one.kind,
            "label": one.label,
            "node": one.node,
            "text": "" if self.secret else one.short,
            "effects": self.effects,
        }


@dataclass(frozen=True, slots=True)
class FramesSent(OfFrames, Answer):
    """The outcome of *frames*; true if all were sent."""

    renderer: ClassVar = "frame_lines:sent_lines"

    frames: tuple[FrameToSend, ...]
    outcome: Outcome
    dry_run: bool = False

    def document(self) -> Document:
        """`dvtcli.send/1`."""
        return {
            "schema": "dvtcli.send/1",
            "dry_run": self.dry_run,
            **self.outcome.fields(),
            "frames": [frame.document() for frame in self.frames],
        }


@dataclass(frozen=True, slots=True)
class FramesToReplay(Short):
    """Frames of a recording with the same CAN-ID and effect: kind, number, effects on nodes, what they say in words.

    *effects* is empty if nobody is known to act on them.
    """

    can_id: int
    extended: bool
    remote: bool
    label: str
    node: int | None
    count: int
    effects: str
    words: tuple[str, ...] = ()

    @property
    def what(self) -> str:
        """The CAN-ID and kind of its frames."""
        kind = "remote request of " if self.remote else ""
        of = f" node {self.node}" if self.node else ""
        return f"0x{self.can_id:0{8 if self.extended else 3}X} {kind}{self.label}{of}"

    @property
    def text(self) -> str:
        """The row in a line."""
        said = ": ".join(filter(None, (self.effects, join_some(self.words))))
        return f"{self.what}, {plural(self.count, 'frame')}{f': {said}' if said else ''}"

    def document(self) -> Document:
        """An element of `frames` in `dvtcli.replay/1`."""
        return {
            "cob_id": self.can_id,
            "extended": self.extended,
            "remote": self.remote,
            "label": self.label,
            "node": self.node,
            "count": self.count,
            "effects": self.effects,
            "texts": list(self.words),
        }


@dataclass(frozen=True, slots=True)
class Replayed(OfFrames, Answer):
    """The outcome of the recording *file*: its *frames*, and *left_out* frames by reason.

    True if all frames were sent.
    """

    renderer: ClassVar = "frame_lines:replayed_lines"

    file: str
    frames: tuple[FramesToReplay, ...]
    outcome: Outcome
    left_out: tuple[tuple[str, int], ...] = ()
    dry_run: bool = False

    def document(self) -> Document:
        """`dvtcli.replay/1`."""
        return {
            "schema": "dvtcli.replay/1",
            "file": self.file,
            "dry_run": self.dry_run,
            **self.outcome.fields(),
            "frames": [frame.document() for frame in self.frames],
            "left_out": [{"reason": reason, "frames": count} for reason, count in self.left_out],
        }
