"""Frames with every bit named, as answers. Knows no terminal and no session."""

from __future__ import annotations

from dataclasses import dataclass
from typing import ClassVar

from dvtcli.domain.ports import Frame
from dvtcli.domain.typed_frame import frame_text
from dvtcli.domain.wall_clock import utc
from dvtcli.operations.results.documents import Answer, Document, Short, hex_bytes
from dvtcli.watch.explain.parts import FramePart

#: what is in a frame for the protocol's sake
_ASIDE = frozenset({"index", "reserved", "n: bytes without data", "e: transfer type", "s: size", "without data", "c"})


def _tells(part: FramePart) -> bool:
    return not part.in_id and not part.is_bit_of_value and part.name not in _ASIDE


def part_document(part: FramePart) -> Document:
    """One element of `parts` in `dvtcli.explain/1`."""
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


@dataclass(frozen=True, slots=True)
class FrameExplained(Answer):
    """A frame with what it is (*kind*, *label*), the *node* it is about where known, and its *parts*."""

    renderer: ClassVar = "explained_lines:explained_lines"
    at_leisure: ClassVar = True

    frame: Frame
    kind: str
    label: str
    node: int | None
    parts: tuple[FramePart, ...]
    exit_code: int = 0

    @property
    def what(self) -> str:
        """What it is, and of which node."""
        if self.frame.remote and self.kind == "heartbeat":
            return f"node guarding request, node {self.node}"
        kind = "remote request of " if self.frame.remote else ""
        return f"{kind}{self.label}{f', node {self.node}' if self.node else ''}"

    @property
    def short(self) -> str:
        """What it says in one line: its service's word, its objects' values; no single bits of either."""
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
            "parts": [part_document(part) for part in self.parts],
        }


@dataclass(frozen=True, slots=True)
class TracedFrame(Short):
    """One frame of an exchange, explained; *sent* says that it is one of ours, *secret* that its value is not shown."""

    frame: FrameExplained
    sent: bool
    secret: bool = False

    def document(self) -> Document:
        """One element of `frames` in `dvtcli.trace/1`."""
        at = utc(self.frame.frame.timestamp_s)
        return {"time": at, "sent": self.sent, "secret": self.secret, **self.frame.content()}


@dataclass(frozen=True, slots=True)
class Traced(Answer):
    """The frames of the last exchange, oldest first."""

    renderer: ClassVar = "explained_lines:trace_lines"
    at_leisure: ClassVar = True

    frames: tuple[TracedFrame, ...]
    exit_code: int = 0

    def document(self) -> Document:
        """`dvtcli.trace/1`."""
        return {"schema": "dvtcli.trace/1", "frames": [frame.document() for frame in self.frames]}
