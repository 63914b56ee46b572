"""What was heard at each bit rate, as an answer. Knows no terminal and no session."""

from __future__ import annotations

from dataclasses import dataclass
from typing import ClassVar

from dvtcli.operations.results.documents import Answer, Document, Short


@dataclass(frozen=True, slots=True)
class HeardAt(Short):
    """How many *frames* and *error_frames* came while a bus was listened to at *bit_rate* (bit/s)."""

    bit_rate: int
    frames: int
    error_frames: int

    def document(self) -> Document:
        """One bit rate of `dvtcli.bit-rate/1`."""
        return {"bit_rate": self.bit_rate, "frames": self.frames, "error_frames": self.error_frames}


@dataclass(frozen=True, slots=True)
class BitRateFound(Answer):
    """The *bit_rate* (bit/s) at which frames come without errors; None where there is none, or the bus is silent.

    *heard* is what came at each bit rate that was tried, in *seconds* each; *complete* whether all of the standard's
    were tried, or the one was found. *listen_only*: not a word was said.
    """

    renderer: ClassVar = "bit_rate_lines:bit_rate_lines"

    bus: str
    bit_rate: int | None
    heard: tuple[HeardAt, ...]
    seconds: float
    listen_only: bool = True
    complete: bool = True

    def __bool__(self) -> bool:
        return self.bit_rate is not None

    @property
    def silent(self) -> bool:
        """Whether nothing came at all, neither frames nor errors."""
        return not any(heard_at.frames or heard_at.error_frames for heard_at in self.heard)

    @property
    def exit_code(self) -> int:
        """1 where no bit rate was found."""
        return 0 if self else 1

    def document(self) -> Document:
        """`dvtcli.bit-rate/1`."""
        return {
            "schema": "dvtcli.bit-rate/1",
            "bus": self.bus,
            "bit_rate": self.bit_rate,
            "silent": self.silent,
            "heard": [heard_at.document() for heard_at in self.heard],
            "seconds": self.seconds,
            "listen_only": self.listen_only,
            "complete": self.complete,
        }
