"""Sent frames and replayed recordings as results."""

from __future__ import annotations

from dataclasses import dataclass
from typing import ClassVar

from dvtcli.domain.hint import Action, Hint
from dvtcli.domain.text import join_some, plural
from dvtcli.domain.typed_frame import frame_text
from dvtcli.errors import DvtcliError, ended_with
from dvtcli.operations.results.documents import Answer, Document, Short
from dvtcli.operations.results.frames import FrameExplained

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
