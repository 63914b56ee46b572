"""The formats of recordings: the modules in `recordings/`."""

from __future__ import annotations

from collections.abc import Mapping
from functools import cache
from pathlib import Path

from dvtcli.errors import UsageError
from dvtcli.files.recordings.recording_format import RecordingFormat

_REFUSED = {
    ".db": "the writer of .db files loses frames that are written shortly before its end",
    ".csv": "the frames' data would be base64, and the channel is lost; decoded values can be written so",
}


@cache
def formats() -> Mapping[str, RecordingFormat]:
    """Return every format by suffix, read-only formats last."""
    from dvtcli.files.recordings.asc import AscFormat
    from dvtcli.files.recordings.blf import BlfFormat
    from dvtcli.files.recordings.candump import CandumpFormat
    from dvtcli.files.recordings.mdf import MdfFormat
    from dvtcli.files.recordings.trc import TrcFormat
    from dvtcli.files.recordings.wireshark import PcapFormat, PcapngFormat

    found: tuple[RecordingFormat, ...] = (
        AscFormat(), BlfFormat(), CandumpFormat(), MdfFormat(), PcapFormat(), PcapngFormat(), TrcFormat(),
    )  # fmt: skip
    ordered = sorted(found, key=lambda format_: (not format_.is_written, format_.suffix))
    return {format_.suffix: format_ for format_ in ordered}


def written() -> Mapping[str, RecordingFormat]:
    """Return the formats that dvtcli writes."""
    return {suffix: one for suffix, one in formats().items() if one.is_written}


def format_of(path: Path, *, reading: bool = False) -> RecordingFormat:
    """Return the format of *path*.

    Raises UsageError if no lossless format has its suffix, or the required package is missing.
    """
    suffix = path.suffix.lower()
    known = formats() if reading else written()
    if suffix not in known:
        raise _refused(path, suffix, known, reading=reading)
    known[suffix].require()
    return known[suffix]


def _refused(path: Path, suffix: str, known: Mapping[str, RecordingFormat], *, reading: bool) -> UsageError:
    others = f"take one of {' '.join(known)}"
    if suffix in _REFUSED and not reading:
        return UsageError(f"{path.name}: {_REFUSED[suffix]}", hint=others)
    if suffix in formats():
        return UsageError(f"{path.name}: {suffix} files are only read", hint=others)
    if reading and path.is_dir():
        return UsageError(f"{path} is a directory", hint="name a recording in it")
    by = f"{'its content or by ' if reading else ''}{suffix or 'a name without a suffix'}"
    return UsageError(
        f"{path.name}: no format is known by {by}",
        hint=", ".join(f"{one} ({format_.title})" for one, format_ in known.items()),
    )
