"""What a node may say by itself: that it has started, that its state changed, that something went wrong.

Does not know how frames arrive, nor what is done about it.
"""

from __future__ import annotations

from dataclasses import dataclass

from dvtcli.domain.nmt import NmtState


@dataclass(frozen=True, slots=True)
class BootUp:
    """A node said that it has started (CiA 301, 7.2.8.3.3)."""

    node_id: int
    timestamp_s: float = 0.0


@dataclass(frozen=True, slots=True)
class StateChange:
    """A node's heartbeat carries another state than before; *before* is None where none was known."""

    node_id: int
    before: NmtState | None
    after: NmtState
    timestamp_s: float = 0.0


@dataclass(frozen=True, slots=True)
class Emergency:
    """An emergency message: *code* (CiA 301, table 26), *register* (0x1001) and the maker's five bytes."""

    node_id: int
    code: int
    register: int
    manufacturer: bytes
    timestamp_s: float = 0.0


@dataclass(frozen=True, slots=True)
class HeardEmergency:
    """One error code of a node as often as it was heard: *count* times, first at *first_s*, and the *last* message."""

    count: int
    first_s: float
    last: Emergency


NodeEvent = BootUp | StateChange | Emergency
