"""The formats of recordings: the modules in `recordings/`, and a file's format by its content, whatever its name."""

from __future__ import annotations

import re
from collections.abc import Mapping
from functools import cache
from itertools import takewhile
from pathlib import Path

from dvtcli.errors import UsageError
from dvtcli.files.input_file import read_input_head
from dvtcli.files.recordings.recording_format import RecordingFormat, encoding_of

_REFUSED = {
    ".db": "the writer of .db files loses frames that are written shortly before its end",
    ".csv": "the frames' data would be base64, and the channel is lost; decoded values can be written so",
}


@cache
def formats() -> Mapping[str, RecordingFormat]:
    """Return every format by suffix, read-only formats last."""
    from dvtcli.files.recordings.blf import BlfFormat
    from dvtcli.files.recordings.mdf import MdfFormat
    from dvtcli.files.recordings.text_logs import AscFormat, CandumpFormat, TrcFormat
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
        return UsageError(f"{path.name}: {suffix} files can only be read", hint=others)
    if reading and path.is_dir():
        return UsageError(f"{path} is a directory", hint="name a recording in it")
    by = f"{'its content or by ' if reading else ''}{suffix or 'a name without a suffix'}"
    return UsageError(
        f"{path.name}: no format is known by {by}",
        hint="; ".join(_known() if reading else (f"{one} ({format_.title})" for one, format_ in known.items())),
    )


#: bytes of a file that are looked at, its lines, and characters of the first line
_MOST_BYTES, _MOST_LINES, _MOST_CHARACTERS = 65_536, 200, 400
#: a line of words in front of a log, as people paste them, and how many lines there may be
_WORDS, MOST_WORDS = re.compile(r"\s*[^\W\d_]{2}"), 5
#: beginnings of the formats with a suffix of their own
_BEGINNINGS = {
    b"LOGG": ".blf", b"MDF     ": ".mf4", b"\x0a\x0d\x0d\x0a": ".pcapng", b"\xd4\xc3\xb2\xa1": ".pcap",
    b"\xa1\xb2\xc3\xd4": ".pcap", b"\x4d\x3c\xb2\xa1": ".pcap", b"\xa1\xb2\x3c\x4d": ".pcap",
}  # fmt: skip
_LINES = (
    (re.compile(r"\(\d+\.\d+\)\s+\S+\s+[0-9A-Fa-f]{3,8}##?[0-9A-FRa-f]*.*"), ".log"),
    (re.compile(r"(?:date\s+\w{3}\s|base\s+(?:hex|dec)\b).*", re.I), ".asc"),
    (re.compile(r";\$FILEVERSION=.*|;##+"), ".trc"),
)
#: what is read beside the formats with a suffix: see `pasted`
_PRINTED = "text of candump, PCAN-View, BUSMASTER, SavvyCAN, python-can or dvtcli; frames such as 705#05"
#: what a YAML file of a network is called here
NETWORK_FILE = "a network file"
#: what people mistake for a recording: beginnings of files, and of first lines
_OTHERS = {
    b"SQLite format 3": "an SQLite database", b"PK\x03\x04": "a ZIP archive", b"\x1f\x8b": "a gzip archive",
    b"PAR1": "a Parquet file of values; plot reads it", b"%PDF": "a PDF document", b"\x7fELF": "a program",
}  # fmt: skip
_OTHER_LINES = (
    (re.compile(r"\[(?:FileInfo|DeviceInfo|DeviceComissioning)\].*", re.I), "an EDS or DCF file"),
    (re.compile(r'VERSION\s+".*|BO_ \d+ .*'), "a DBC file"),
    (re.compile(r"<\?xml .*|<\w+.*"), "an XML file"),
    (re.compile(r"time,frame,.*|time_s,.*"), "a CSV file of values; plot reads it"),
    (re.compile(r"(?:nodes|bus|drive):.*"), NETWORK_FILE),
    (re.compile(r"No\.\s+Time\s+Source\s+Destination\b.*"), "a list of packets from Wireshark; a .pcapng is read"),
    (re.compile(r"Chn\s+Identifier\s+Flg\b.*"), "a log of Kvaser CanKing; a .asc is read"),
    (re.compile(r"Timestamp(?:Epoch)?;BusChannel;.*"), "a CSV file of a CSS logger; its .mf4 is read"),
    (re.compile(r"ASCII Trace IXXAT .*"), "a trace of IXXAT's MiniMon; a .asc is read"),
    (
        re.compile(r"[tr][0-9A-F]{3}[0-8](?:[0-9A-F]{2})*(?:[0-9A-F]{4})?|[TR][0-9A-F]{8}[0-8](?:[0-9A-F]{2})*"),
        "lines of an SLCAN interface; what dvtcli's log makes of them is read",
    ),
    (re.compile(r"\[\w[\w .-]*\]"), "a file of sections, as EDS, DCF and INI files are"),
    (
        re.compile(r'\{.*|\[\s*(?:[\[{"\]].*|-?\d+(?:\.\d+)?\s*[,\]].*)?'),
        "JSON of another kind than dvtcli's frames",
    ),
)


def recognised(path: Path) -> RecordingFormat:
    """Return the format of the recording *path* by its content, else by its suffix.

    Raises UsageError if the file is missing or of another format, which is named; or if no format has the suffix.
    """
    found = _by_content(_head(path))
    if isinstance(found, str):
        raise UsageError(f"{path} is not a recording of frames: it is {found}", hint="; ".join(_known()))
    if found is None:
        if path.suffix.lower() not in formats() and not path.is_dir():
            _require_content(path)
        return format_of(path, reading=True)
    found.require()
    return found


def _require_content(path: Path) -> None:
    """Raise UsageError if *path* is missing or empty."""
    try:
        size = path.stat().st_size
    except OSError as failed:
        raise UsageError(f"{path}: {failed.strerror or failed}", hint="; ".join(_known())) from failed
    if not size and path.is_file():
        raise UsageError(f"{path} is empty", hint="; ".join(_known()))


def other_format(path: Path) -> str:
    """What *path* is by its content if it is not a recording: `an XML file`; empty if nothing is recognised."""
    found = _by_content(_head(path))
    return found if isinstance(found, str) else ""


def is_recording(path: Path) -> bool:
    """Whether *path* has the suffix or the content of a recording; False for a missing file without the suffix."""
    return path.suffix.lower() in formats() or isinstance(_by_content(_head(path)), RecordingFormat)


def _head(path: Path) -> bytes:
    """The beginning of *path*; empty if it cannot be read: who opens it says why."""
    try:
        return b"" if path.is_fifo() else read_input_head(path, _MOST_BYTES)  # what is in a pipe comes once
    except OSError:
        return b""


def _known() -> list[str]:
    return [*(f"{suffix} ({format_.title})" for suffix, format_ in formats().items()), _PRINTED]


def _by_content(head: bytes) -> RecordingFormat | str | None:
    """The format, the name of another one, or None if nothing is recognised."""
    from dvtcli.files.recordings.pasted import PASTED, is_fence, shown_text

    for beginning, suffix in _BEGINNINGS.items():
        if head.startswith(beginning):
            return formats()[suffix]
    for beginning, name in _OTHERS.items():
        if head.startswith(beginning):
            return name
    text = head.decode(encoding_of(head), "replace")
    whole = text.splitlines() if len(head) < _MOST_BYTES else text.splitlines()[:-1]
    begin = whole[:_MOST_LINES]
    lines = [line for line in map(shown_text, begin) if line.strip() and not is_fence(line)]
    is_quoted = next((line for line in begin if line.strip()), "").lstrip()[:1] in (">", "`", "~")
    for pattern, suffix in _LINES if not is_quoted else ():  # the readers of these formats take no quotations
        if lines and pattern.fullmatch(lines[0].lstrip()[:_MOST_CHARACTERS]):
            return formats()[suffix]
    for format_ in PASTED:
        if format_.is_in(lines):
            return format_
    first = lines[0].lstrip()[:_MOST_CHARACTERS] if lines else ""
    other = next((name for pattern, name in _OTHER_LINES if pattern.fullmatch(first)), None)
    if other is not None:
        return other
    words = list(takewhile(_WORDS.match, lines[:MOST_WORDS]))  # the reader names the first of them
    behind = lines[len(words) :] if words else []
    return next((format_ for format_ in PASTED if format_.is_in(behind)), None)
