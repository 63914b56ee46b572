"""A small recording: TPDO2 of one node, whose velocity rises."""

from __future__ import annotations

from pathlib import Path

from dvtcli.domain.ports import Frame
from dvtcli.files.recordings.recording_file import Recorder

#: 2023-11-14, in seconds since 1970
BEGIN_S = 1_700_000_000.0


def velocity(value: int, at_s: float) -> Frame:
    """TPDO2 of a Gen4 as node 1 sends it: velocity, torque, battery current."""
    data = value.to_bytes(4, "little", signed=True) + (120).to_bytes(2, "little") + b"\x88\xff"
    return Frame(0x281, data, timestamp_s=BEGIN_S + at_s)


def ramp(path: Path, count: int = 50) -> Path:
    """Record *count* frames, a tenth of a second apart, whose velocity rises by ten each."""
    with Recorder(path) as recorder:
        for n in range(count):
            recorder.write(velocity(10 * n - 100, n / 10))
    return path
