"""Logs as people paste them: what candump, dvtcli and python-can print, and exports of other tools, line by line.

Each is recognised by its first lines, whatever the file is called.
"""

from __future__ import annotations

import base64
import json
import re
from collections.abc import Collection, Iterator
from dataclasses import dataclass, field
from datetime import datetime
from itertools import pairwise
from pathlib import Path
from typing import Any, BinaryIO, ClassVar

import can

from dvtcli.domain.cob_id import CAN_ID_MASK, fits
from dvtcli.domain.ports import Frame
from dvtcli.domain.text import plural
from dvtcli.files.recordings.recording_format import (
    MOST_CHARACTERS,
    CountedLines,
    LostLineError,
    RecordedFrame,
    RecordingFormat,
)

_FLAGS = re.I | re.ASCII
_DATA = r"(?P<data>[0-9A-F]{2}(?: [0-9A-F]{2})*)?"
#: colours and other escapes of a terminal
_ESCAPES = re.compile(r"\x1b\[[0-9;]*[A-Za-z]")
#: the marks of a quotation in a mail or a forum, and the lines around a block of code
_QUOTED, _FENCE = re.compile(r"\s*(?:> ?)+"), re.compile(r"\s*(?:`{3,}|~{3,})\s*\w*")
#: maximum bytes of a frame: classic CAN and CAN FD
_MOST_BYTES, _MOST_FD_BYTES = 8, 64
_DAY_S = 86_400
#: maximum times (s) from line to line, and the maximum first one
_LONGEST_DELTA_S, _LONGEST_FIRST_S = 1e6, 10


@dataclass(slots=True)
class Times:
    """The clock of a log: *start_s* is its beginning (s since 1970), *is_delta*: times are from line to line.

    Of a BUSMASTER log *of_day_s* is the time of day of its beginning, *offset_s* what is added to its times, and
    *is_decimal* how its numbers are written.
    """

    start_s: float = 0.0
    is_delta: bool = False
    of_day_s: float = 0.0
    offset_s: float | None = None
    is_decimal: bool = False
    last_s: float = field(default=0.0, init=False)

    def at(self, time_s: float) -> float:
        """The time of a line with *time_s*, counted from the beginning or from the line before."""
        self.last_s = self.last_s + time_s if self.is_delta else time_s
        return self.start_s + self.last_s

    def of_clock(self, time_s: float) -> float:
        """The time of a line with the time of day *time_s*: after midnight the next day begins."""
        while self.last_s - time_s > _DAY_S / 2:
            time_s += _DAY_S
        self.last_s = time_s
        return self.start_s + time_s


class PastedFormat(RecordingFormat):
    """A format of lines: a frame in each that fits *line*, nothing in those that fit *aside*."""

    suffix = ".txt"
    title = "pasted text"
    is_written = False
    tells = True
    #: what a line with a frame looks like, and one without
    line: ClassVar[re.Pattern[str]]
    #: length of the longest line; a frame of 64 bytes takes some 330 characters
    most_characters: ClassVar[int] = 400
    aside: ClassVar[re.Pattern[str]] = re.compile(r"\s*")
    #: maximum bytes of a frame that its line does not mark as CAN FD; more than 8 are CAN FD without a mark
    most_bytes: ClassVar[int] = _MOST_FD_BYTES

    def match(self, text: str) -> re.Match[str] | None:
        """The match of `line` with *text*; None for a longer text than `most_characters`."""
        return self.line.fullmatch(text) if len(text) <= self.most_characters else None

    def is_in(self, lines: list[str]) -> bool:
        """Whether *lines*, the first of a file that are not empty, are of this format."""
        return bool(lines) and self.match(lines[0]) is not None

    def source(self, raw: BinaryIO, _path: Path) -> Any:
        """Return the file's lines."""
        return CountedLines(raw)

    def reader(self, source: Any) -> Iterator[RecordedFrame]:
        """Iterate over the frames, line by line."""
        times, channels = Times(), set[str]()
        for raw in source:
            text = shown_text(raw)
            if len(text) > self.most_characters:
                raise LostLineError(source.line, text)
            found = self.line.fullmatch(text)
            frame = None if found is None else self.frame(found, times)
            if frame is not None:
                length = len(frame.frame.data)
                most_bytes = _MOST_FD_BYTES if frame.fd else self.most_bytes
                if not fits(frame.frame.can_id, extended=frame.frame.extended) or length > most_bytes:
                    raise LostLineError(source.line, text)
                channels.add(frame.channel)
                yield frame if frame.fd or length <= _MOST_BYTES else frame._replace(fd=True)
            elif found is None and not (is_fence(text) or self.is_aside(text, channels)):
                raise LostLineError(source.line, text)
            elif found is None:
                self.take_aside(text, times)

    def is_aside(self, text: str, _channels: Collection[str]) -> bool:
        """Whether *text*, behind frames of *channels*, is not a frame, nor a damaged one."""
        return self.aside.fullmatch(text) is not None

    def take_aside(self, text: str, times: Times) -> None:
        """Take what a line without a frame says about times."""

    def frame(self, found: re.Match[str], times: Times) -> RecordedFrame | None:
        """The frame of a line, None for an event that is not a frame."""
        raise NotImplementedError


def shown_text(line: str) -> str:
    """*line* without colours, the marks of a quotation, and the blanks at its end."""
    text = _ESCAPES.sub("", line).rstrip()
    quoted = _QUOTED.match(text)
    return text if quoted is None else text[quoted.end() :]


def is_fence(text: str) -> bool:
    """Whether *text* begins or ends a block of code, as forums and issue trackers have them."""
    return _FENCE.fullmatch(text) is not None


def _frame(
    found: re.Match[str],
    time_s: float,
    *,
    extended: bool | None = None,
    remote: bool = False,
    length: int | None = None,
) -> Frame:
    """The frame in the groups `id` (hex) and `data` (hex); without *extended* more than four digits are 29 bits.

    Raises ValueError if it has not *length* bytes, None: its length is not said.
    """
    digits = found["id"]
    is_long = len(digits) > 4 if extended is None else extended
    data = b"" if remote else bytes.fromhex(found["data"] or "")
    if not remote and length is not None:
        _require_length(data, length)
    return Frame(int(digits, 16), data, is_long, remote, time_s, length or 0 if remote else 0)


def _require_length(data: bytes, length: int) -> None:
    """Raise ValueError if *data* has not *length* bytes."""
    if len(data) != length:
        raise ValueError(f"the length {length} is not that of the {plural(len(data), 'byte')} after it")


class CandumpScreen(PastedFormat):
    """What candump prints: with any of -t, -x, -a and -c."""

    title = "candump's screen"
    line = re.compile(
        r"\s*(?:\((?P<time>[-\d .:]+)\)\s+)?(?P<channel>[^\s(\[]+)\s+(?:[RT]X\s+\S\s+\S\s+)?"
        r"(?P<id>[0-9A-F]{8}|[0-9A-F]{3})\s+\[(?P<length>\d{1,2})\](?:\s+(?P<remote>remote request)|\s*"
        + _DATA + r")(?:\s+'.*)?(?:\s+(?P<error>ERRORFRAME))?", _FLAGS,
    )  # fmt: skip
    aside = re.compile(r"\s*|\s+(?!.*\[\d)(?![0-9A-F\s]+$)[A-Za-z-]+.*|.*[$#] ?(?:candump .*)?|\^C.*", _FLAGS)

    def is_in(self, lines: list[str]) -> bool:
        """Whether the first of *lines* is a frame, maybe behind a shell's line that runs candump."""
        return super().is_in(lines[1:] if lines and " candump " in lines[0] else lines)

    def is_aside(self, text: str, channels: Collection[str]) -> bool:
        """Whether *text* is not a frame: words without a length, that do not begin as a line of *channels*."""
        first, *more = text.split() or [""]
        begins = first in channels or (first and not more and any(channel.startswith(first) for channel in channels))
        return not begins and super().is_aside(text, channels)

    def frame(self, found: re.Match[str], times: Times) -> RecordedFrame:
        """The frame of a line; of -ta, -tz and -tA the time as printed, of -td counted from line to line.

        candump prints the length of CAN FD frames with two digits.
        """
        text = found["time"] or "0"
        time_s = float(text) if text.count("-") < 2 else datetime.fromisoformat(text).astimezone().timestamp()
        length = int(found["length"])
        frame = _frame(found, times.at(time_s), remote=bool(found["remote"]), length=length)
        if found["error"]:
            return RecordedFrame(frame._replace(can_id=frame.can_id & CAN_ID_MASK), found["channel"], error=True)
        return RecordedFrame(frame, found["channel"], fd=len(found["length"]) > 1)


class CompactFrames(PastedFormat):
    """Frames as `explain` and cansend take them, `705#05`, or as candump -L prints them, quoted or not.

    Without a time a channel has a name such as can0: `send 705#05` is a command.
    """

    title = "frames such as 705#05"
    most_bytes = _MOST_BYTES
    line = re.compile(
        r"\s*(?:\((?P<time>\d+\.\d+)\)\s+)?(?:(?P<channel>(?(time)[^\s(#]+|[A-Z]+\d+))\s+)?(?P<id>[0-9A-F]{8}|[0-9A-F]{3})#"
        r"(?:R(?P<length>[0-8]?)|#[0-9A-F](?P<fd>(?:[0-9A-F]{2})*)|(?P<data>(?:[0-9A-F]{2}\.?)*))(?:\s+[RT])?", _FLAGS,
    )  # fmt: skip

    def is_in(self, lines: list[str]) -> bool:
        """Whether the first of *lines* is a frame; without a time only if no line has a time, else it is damaged."""
        times = [found["time"] for found in map(self.match, lines) if found is not None]
        return super().is_in(lines) and (times[0] is not None or not any(times))

    def frame(self, found: re.Match[str], times: Times) -> RecordedFrame:
        """The frame of a line; a line without a time has that of the line before."""
        digits, length = found["id"], found["length"]
        data = bytes.fromhex((found["fd"] or found["data"] or "").replace(".", ""))
        time_s = times.at(float(found["time"])) if found["time"] else times.last_s
        can_id, is_error = int(digits, 16), int(digits, 16) > CAN_ID_MASK and digits[0] in "23"
        frame = Frame(
            can_id & CAN_ID_MASK if is_error else can_id, data, len(digits) > 3, length is not None, time_s,
            int(length or 0),
        )  # fmt: skip
        return RecordedFrame(frame, found["channel"] or "", error=is_error, fd=found["fd"] is not None)


def _is_clock(times: list[float]) -> bool:
    """Whether *times* (s) are of a clock, though they go back: frames of two interfaces come a little out of order."""
    if times[0] > _LONGEST_FIRST_S or max(times) > _LONGEST_DELTA_S:
        return True
    behind = times[1:]  # the first time from line to line is 0
    part = -(-len(behind) // 4)
    back = max(before - after for before, after in pairwise(times))
    return min(behind[-part:]) > max(behind[:part]) and back < (max(behind) - min(behind)) / 10


class CandumpDeltas(PastedFormat):
    """What candump -td prints: times from line to line."""

    title = "candump's screen with -td"
    line = CandumpScreen.line

    def __init__(self) -> None:
        self._screen = CandumpScreen()

    def is_in(self, lines: list[str]) -> bool:
        """Whether times go back, as those from line to line do, and are not of a clock."""
        found = [match["time"] for match in map(self.match, lines) if match]
        times = [float(text) for text in found if text and text.count("-") < 2]
        goes_back = any(before > after for before, after in pairwise(times))
        return self._screen.is_in(lines) and goes_back and not _is_clock(times)

    def reader(self, source: Any) -> Iterator[RecordedFrame]:
        """Iterate over the frames with their times added up."""
        time_s = 0.0
        for recorded in self._screen.reader(source):
            time_s += recorded.frame.timestamp_s
            yield recorded._replace(frame=recorded.frame._replace(timestamp_s=time_s))


class Busmaster(PastedFormat):
    """BUSMASTER's log, with the times of its three modes."""

    suffix = ".log"
    title = "BUSMASTER"
    line = re.compile(
        r"(?P<time>\d+:\d\d:\d\d:\d{3,6})\s+[RT]x\s+(?P<channel>\d+)\s+(?P<id>(?:0x)?[0-9A-F]+)\s+"
        r"(?P<kind>[sx]r?)\s+(?P<length>\d+)(?:\s+(?P<data>[0-9A-F]{1,3}(?:\s+[0-9A-F]{1,3})*))?", _FLAGS,
    )  # fmt: skip
    aside = re.compile(r"\s*|\*\*\*.*|.*\b(?:ERR|Error).*", re.I)
    _START = re.compile(r"\*\*\*START DATE AND TIME (\d+):(\d+):(\d+) (\d+):(\d+):(\d+):(\d+)")

    def is_in(self, lines: list[str]) -> bool:
        """Whether the head of a BUSMASTER log is there."""
        return any(text.startswith("***BUSMASTER") for text in lines[:3])

    def take_aside(self, text: str, times: Times) -> None:
        """Take date, numbers and the kind of times from the head."""
        if (start := self._START.match(text)) is not None:
            day, month, year, hour, minute, second, ms = map(int, start.groups())
            times.of_day_s = 3600 * hour + 60 * minute + second + ms / 1000
            times.start_s = datetime(year, month, day).astimezone().timestamp()
        times.is_decimal |= text.startswith("***DEC")
        times.is_delta |= text.startswith("***RELATIVE")

    def frame(self, found: re.Match[str], times: Times) -> RecordedFrame:
        """The frame of a line; a time before the log's beginning counts from there."""
        *clock, part = found["time"].split(":")
        time_s = sum(int(word) * unit for word, unit in zip(clock, (3600, 60, 1), strict=True)) + int(part) / 10 ** len(
            part
        )
        if times.is_delta:
            at_s = times.at(time_s) + times.of_day_s
        else:
            if times.offset_s is None:
                times.offset_s = 0.0 if time_s + 1 > times.of_day_s else times.of_day_s
            at_s = times.of_clock(time_s) + times.offset_s
        base = 10 if times.is_decimal else 16
        kind = found["kind"].lower()
        data = b"" if "r" in kind else bytes(int(word, base) for word in (found["data"] or "").split())
        can_id = int(found["id"].lower().removeprefix("0x"), base)
        length = int(found["length"])
        if "r" in kind:
            return RecordedFrame(Frame(can_id, data, "x" in kind, True, at_s, length), found["channel"])
        _require_length(data, length)
        return RecordedFrame(Frame(can_id, data, "x" in kind, timestamp_s=at_s), found["channel"])


class SavvyCan(PastedFormat):
    """SavvyCAN's CSV (GVRET); its times are microseconds."""

    suffix = ".csv"
    title = "SavvyCAN"
    line = re.compile(
        r"(?P<time>\d+),(?P<id>[0-9A-F]{1,8}),(?P<extended>true|false),(?:[RT]x,)?(?P<channel>\d+),(?P<length>\d+)"
        r"(?P<data>(?:,[0-9A-F]{0,2})*)", _FLAGS,
    )  # fmt: skip
    aside = re.compile(r"\s*|Time Stamp,.*")

    def is_in(self, lines: list[str]) -> bool:
        """Whether the head of a SavvyCAN file is there."""
        return bool(lines) and lines[0].startswith("Time Stamp,ID,Extended,")

    def frame(self, found: re.Match[str], times: Times) -> RecordedFrame:
        """The frame of a line; its columns of bytes may be more than it has."""
        length = int(found["length"])
        data = bytes(int(word, 16) for word in found["data"].split(",") if word)[:length]
        _require_length(data, length)
        extended = found["extended"].lower() == "true"
        frame = Frame(int(found["id"], 16), data, extended, timestamp_s=times.at(int(found["time"]) / 1e6))
        return RecordedFrame(frame, found["channel"])


class PcanView(PastedFormat):
    """Lines of PCAN-View's trace as text, without the head of a .trc file."""

    title = "PCAN-View"
    line = re.compile(
        r"\s*\d+(?:\)\s+(?P<whole>\d+)|\)?\s+(?P<time>\d+\.\d+))\s+(?:(?P<kind>DT|RR|ST|ER|EC|EV|F[DBE]|BI)\s+)?(?:\d\s+)?(?:(?P<way>[RT]x)\s+)?"
        r"(?P<id>[0-9A-F]{8}|[0-9A-F]{4})\s+(?:[RT]x\s+)?(?:-\s+)?(?P<length>\d{1,2})"
        r"(?:\s+(?P<remote>RTR)|\s+" + _DATA[:-1] + r")?", _FLAGS,
    )  # fmt: skip
    aside = re.compile(r"\s*|;.*|\s*\d+\)?\s+\d+\.\d+\s+(?:Warng|Error|ST|ER|EC|EV)\b.*")

    def frame(self, found: re.Match[str], times: Times) -> RecordedFrame:
        """The frame of a line; its times are milliseconds, its length may be a code of CAN FD."""
        remote, length = bool(found["remote"]) or found["kind"] == "RR", int(found["length"])
        fd = (found["kind"] or "").upper() in ("FD", "FB", "FE", "BI")
        if fd and len(bytes.fromhex(found["data"] or "")) == can.util.dlc2len(length):
            length = can.util.dlc2len(length)
        time_s = float(found["time"] or found["whole"]) / 1000
        return RecordedFrame(_frame(found, times.at(time_s), remote=remote, length=length), fd=fd)


class PythonCanScreen(PastedFormat):
    """What python-can's logger prints."""

    title = "python-can's screen"
    line = re.compile(
        r"Timestamp:\s+(?P<time>\d+\.\d+)\s+ID:\s+(?P<id>[0-9A-F]+)\s+(?P<kind>[SX])"
        r"(?P<flags>(?:\s+(?:[RT]x|EI|BS|[ERF]))*)\s+DL:\s*(?P<length>\d+)(?:\s+" + _DATA[:-1] + r")?"
        r"(?:\s+'.*?')?(?:\s+Channel:\s+(?P<channel>\S+))?", _FLAGS,
    )  # fmt: skip

    def frame(self, found: re.Match[str], times: Times) -> RecordedFrame:
        """The frame of a line."""
        flags = found["flags"].upper().split()
        extended, remote = found["kind"].upper() == "X", "R" in flags
        frame = _frame(
            found, times.at(float(found["time"])), extended=extended, remote=remote, length=int(found["length"])
        )
        return RecordedFrame(frame, found["channel"] or "", "E" in flags, "F" in flags)


class PythonCanCsv(PastedFormat):
    """python-can's .csv, whose data is base64."""

    suffix = ".csv"
    title = "python-can's CSV"
    line = re.compile(
        r"(?P<time>\d+\.\d+),0x(?P<id>[0-9A-F]+),(?P<extended>[01]),(?P<remote>[01]),(?P<error>[01]),(?P<length>\d+),"
        r"(?P<data>[A-Za-z0-9+/=]*)", _FLAGS,
    )  # fmt: skip
    aside = re.compile(r"\s*|timestamp,.*")

    def is_in(self, lines: list[str]) -> bool:
        """Whether the head of such a file is there."""
        return bool(lines) and lines[0].startswith("timestamp,arbitration_id,extended,remote,error,dlc,data")

    def frame(self, found: re.Match[str], times: Times) -> RecordedFrame:
        """The frame of a line."""
        remote = found["remote"] == "1"
        data = b"" if remote else base64.b64decode(found["data"], validate=True)
        length = int(found["length"])
        if not remote:
            _require_length(data, length)
        time_s = times.at(float(found["time"]))
        frame = Frame(int(found["id"], 16), data, found["extended"] == "1", remote, time_s, length if remote else 0)
        return RecordedFrame(frame, "", found["error"] == "1")


class DecodedText(PastedFormat):
    """What `decode` prints: the time of day, CAN-ID, kind and bytes."""

    title = "a decoding's text"
    most_characters = MOST_CHARACTERS
    line = re.compile(
        r"(?P<time>\d\d:\d\d:\d\d\.\d{6})(?P<zone>[+-]\d\d:\d\d)  0x(?P<id>[0-9A-F]{8}|[0-9A-F]{3})  .{18,}?  "
        r"(?:(?P<remote>remote request)|no data|" + _DATA + r")(?:\s{2,}.*|\s*)", re.ASCII,
    )  # fmt: skip

    def frame(self, found: re.Match[str], times: Times) -> RecordedFrame:
        """The frame of a line, on the first days since 1970: the text has no date."""
        at = datetime.fromisoformat(f"1970-01-01T{found['time']}{found['zone']}")
        return RecordedFrame(_frame(found, times.of_clock(at.timestamp()), remote=bool(found["remote"])))


class TracedText(PastedFormat):
    """What `trace` prints, and the exchange that dvtcli keeps of a failed run."""

    title = "a trace's text"
    most_characters = MOST_CHARACTERS
    line = re.compile(
        r"\s*(?:(?P<ms>\d+\.\d) ms |(?P<iso>\d{4}-\S+Z))\s+(?:->|<-)\s+(?P<id>[0-9A-F]{8}|[0-9A-F]{3})#"
        r"(?:(?P<remote>R)(?P<length>\d?)|(?P<data>(?:[0-9A-F]{2})*))(?:\s.*)?", re.ASCII,
    )  # fmt: skip

    def frame(self, found: re.Match[str], times: Times) -> RecordedFrame:
        """The frame of a line."""
        iso = found["iso"]
        time_s = datetime.fromisoformat(iso.replace("Z", "+00:00")).timestamp() if iso else float(found["ms"]) / 1000
        length = int(found["length"] or 0) if found["remote"] else None
        return RecordedFrame(_frame(found, times.at(time_s), remote=bool(found["remote"]), length=length))


class FrameDocuments(PastedFormat):
    """The documents of `monitor` and of `decode --json`: a frame in each line."""

    suffix = ".jsonl"
    title = "dvtcli's frames as JSON"
    most_characters = MOST_CHARACTERS
    line = re.compile(r'\{"schema": ?"dvtcli\..*\}')

    def is_in(self, lines: list[str]) -> bool:
        """Whether there is a document of a frame."""
        return any(text.startswith('{"schema"') and "dvtcli.frame/1" in text[:40] for text in lines)

    def frame(self, found: re.Match[str], times: Times) -> RecordedFrame | None:
        """The frame of a document; None for other documents, as of a lost bus."""
        document = json.loads(found[0])
        if document["schema"] != "dvtcli.frame/1":
            return None
        time_s = datetime.fromisoformat(document["time"].replace("Z", "+00:00")).timestamp()
        data = bytes.fromhex(document["data"])
        return RecordedFrame(
            Frame(document["cob_id"], data, document["extended"], document["remote"], times.at(time_s))
        )


#: in the order in which they are tried
PASTED: tuple[PastedFormat, ...] = (
    Busmaster(), SavvyCan(), PythonCanCsv(), FrameDocuments(), PythonCanScreen(), TracedText(), DecodedText(),
    CandumpDeltas(), CandumpScreen(), PcanView(), CompactFrames(),
)  # fmt: skip
