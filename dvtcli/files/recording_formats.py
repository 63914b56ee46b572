"""Which formats recordings of frames have, by suffix, and what each can do. Reads and writes nothing."""

from __future__ import annotations

import struct
import zlib
from pathlib import Path

from can.io.blf import BLFParseError

from dvtcli.errors import UsageError

#: Formats by suffix.
FORMATS = {
    ".asc": "Vector ASCII",
    ".blf": "Vector binary",
    ".log": "candump",
    ".mf4": "ASAM MDF, needs asammdf",
    ".pcapng": "Wireshark",
    ".trc": "PEAK",
}
#: Formats that are only read, by suffix.
ONLY_READ = {".pcap": "tcpdump"}
APPENDABLE = (".blf", ".log")
ROTATING = (".asc", ".blf", ".log")
TEXT = (".asc", ".log", ".trc")
CAPTURES = (".pcap", ".pcapng")
FLUSHED = (*TEXT, ".pcapng")
_REFUSED = {
    ".db": "the writer of .db files loses frames that are written shortly before its end",
    ".csv": "the frames' data would be base64, and the channel is lost; for values give --decode",
}
#: what python-can's readers raise at a file that is damaged or of another format
BROKEN = (
    ValueError, LookupError, TypeError, AttributeError, NotImplementedError, struct.error, zlib.error, BLFParseError,
)  # fmt: skip
#: what the writers leave out, by suffix
NO_REMOTE = (".trc",)


def checked_suffix(path: Path, *, reading: bool = False) -> str:
    """The suffix of *path*; UsageError where no lossless format has it, or the package for it is missing."""
    suffix = path.suffix.lower()
    if suffix in _REFUSED and not reading:
        raise UsageError(f"{path.name}: {_REFUSED[suffix]}", hint=f"take one of {' '.join(FORMATS)}")
    if suffix in ONLY_READ and not reading:
        raise UsageError(f"{path.name}: {suffix} files are only read", hint=f"take one of {' '.join(FORMATS)}")
    known = FORMATS | ONLY_READ if reading else FORMATS
    if suffix not in known:
        raise UsageError(
            f"{path.name}: no format is known by {suffix or 'a name without a suffix'}",
            hint=", ".join(f"{one} ({what})" for one, what in known.items()),
        )
    if suffix == ".mf4":
        _need_asammdf()
    return suffix


def _need_asammdf() -> None:
    from importlib.util import find_spec

    if find_spec("asammdf") is None:
        raise UsageError(".mf4 files need asammdf", hint="pip install 'dvtcli[mdf]'")
