"""A recording sent again, in its own time or another: chosen, shown as a table, asked about once, and sent."""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import TYPE_CHECKING

from dvtcli.domain.hint import Action, Hint
from dvtcli.domain.text import join_some, plural
from dvtcli.domain.typed_frame import FrameFilter, frame_filter
from dvtcli.errors import SafetyRefusal, UsageError
from dvtcli.files.recordings.recording_file import check_readable, read_recorded
from dvtcli.operations.frames.explain_frame import KnownParties
from dvtcli.operations.frames.layouts import open_wire
from dvtcli.operations.network.described_nodes import described_nodes
from dvtcli.operations.network.live_network import nobody_chose
from dvtcli.operations.results.frames import FramesToReplay, Outcome, Replayed
from dvtcli.watch.frame_effect import effects
from dvtcli.watch.frame_reader import FrameReader

if TYPE_CHECKING:
    from dvtcli.domain.ports import CanopenBus, Frame
    from dvtcli.domain.sdo_frame import SdoValues
    from dvtcli.files.recordings.recording_format import RecordedFrame
    from dvtcli.operations.session.session import Session, SessionNodes
    from dvtcli.operations.user.session_user import SessionUser
    from dvtcli.watch.decoder import Decoder

#: maximum rows of the table before the question
_MOST_ROWS = 40
#: pause between passes of a single-frame recording (s)
_ALONE_S = 0.1
#: times since 1970 count as equal within (s)
_CLOSE_S = 1e-6
#: what frames of these kinds say is shown, up to so many texts of one kind
_SAID, _MOST_WORDS = frozenset({"sdo", "mpdo", "emcy", "time", "lss"}), 100
ALL = "all"


@dataclass(frozen=True, slots=True)
class Choice:
    """The part of a recording to send, and how.

    *rate* is the speed relative to the recording, 0: as fast as the load limit allows; *from_s* and *to_s* are seconds
    from the first frame; *only* and *without* are for `frame_filter`; *channel* is a channel's name or `all`; *loops*
    is the number of repetitions.
    """

    rate: float = 1.0
    from_s: float = float("-inf")
    to_s: float = float("inf")
    only: Sequence[str] = ()
    without: Sequence[str] = ()
    channel: str | None = None
    loops: int = 1


def replay_recording(
    session: Session, path: Path, choice: Choice, nodes: Sequence[int] = (), file: str | None = None
) -> Replayed:
    """Replay the part *choice* of the recording at *path* with the recorded timing.

    A late frame does not delay others. CAN FD and error frames are left out and counted. Asks once, as `send_frames`,
    with a table of frames. Raises UsageError for an unknown suffix or an empty part; InputFileError if the file is
    invalid; SafetyRefusal without consent or if the file changes. A dry run sends nothing, and needs no bus if none is
    chosen.
    """
    filters = _filters(choice.only), _filters(choice.without)
    check_readable(path)
    bus = None if session.dry_run and not nodes and nobody_chose(session) else open_wire(session)
    if bus is not None:
        _require_limit(bus, choice)
    known = KnownParties(session, nodes, file, on_bus=bus is not None)
    part = _Part(path, choice, filters, known.decoder, remote=bus is None or bus.carries_remote_frames)
    found = part.summed_up(_Words(session, FrameReader(known.decoder, described_nodes(session, file))))
    rows = _rows(found, known)
    if bus is None:
        session.reporter.note("no bus is chosen: the pre-defined connection set tells which frames nodes act on")
    elif not session.options.yes and not all(row.effects for row in rows):
        known.look_around()
        rows = _rows(found, known)
    wanted = found.count * choice.loops
    left_out = tuple((reason, count) for reason, count in found.left_out.items() if count)
    if session.dry_run:
        return Replayed(str(path), rows, Outcome(wanted), left_out, dry_run=True)
    _ask(session, path, choice, found, rows)
    from dvtcli.operations.frames.put_on_bus import put_on_bus

    outcome = put_on_bus(session, part.due(found), wanted, always_share=not choice.rate)
    return Replayed(str(path), rows, outcome, left_out)


def _filters(texts: Sequence[str]) -> list[FrameFilter]:
    try:
        return [frame_filter(text) for text in texts]
    except ValueError as wrong:
        raise UsageError(str(wrong)) from wrong


def _require_limit(bus: CanopenBus, choice: Choice) -> None:
    if not choice.rate and bus.bitrate is None and not bus.simulated:
        raise UsageError(
            f"the bus is filled up to a share of it, and the bit rate of {bus.name} is not known",
            given={"rate": 0},
            hint=Hint(Action.GIVE_BIT_RATE, why="says it") + Hint(Action.GIVE, {"rate": None}, "or give another {}"),
        )


#: frames that count as equal: CAN-ID, extended, remote, and the bytes that decide the effect on nodes
_Kind = tuple[int, bool, bool, bytes]


@dataclass(slots=True)
class _Found:
    """The result of a first pass: frames by kind, what they say, first and last time, omissions."""

    kinds: Counter[_Kind] = field(default_factory=Counter)
    words: dict[_Kind, dict[str, None]] = field(default_factory=dict)
    left_out: Counter[str] = field(default_factory=Counter)
    channels: set[str] = field(default_factory=set)
    first_s: float = 0.0
    last_s: float = 0.0

    @property
    def count(self) -> int:
        return self.kinds.total()

    def pass_s(self, rate: float) -> float:
        """Return the duration of a pass: the next begins a mean distance after the last frame."""
        if not rate:
            return 0.0
        span_s = self.last_s - self.first_s
        return (span_s + (span_s / (self.count - 1) if self.count > 1 else _ALONE_S)) / rate


@dataclass(slots=True)
class _Words:
    """What frames tell nodes, in words, without passcodes."""

    session: SessionNodes
    reader: FrameReader
    _secret: SdoValues = field(init=False)

    def __post_init__(self) -> None:
        self._secret = self.session.secrets.in_frames(unknown=True)

    def of(self, frame: Frame) -> str:
        """What *frame* writes, reports or configures, the next frame of the recording; empty for any other frame."""
        shown, is_secret = self._secret.without(frame)
        reading = self.reader.read(shown)
        if reading.what == "sdo" and (reading.facts.get("step") != "start" or reading.facts.get("transfer") != "write"):
            return ""
        return reading.text if reading.what in _SAID and not is_secret else ""


class _Part:
    """The chosen frames of a recording."""

    def __init__(
        self, path: Path, choice: Choice, filters: tuple[list[FrameFilter], list[FrameFilter]], decoder: Decoder,
        *, remote: bool,
    ) -> None:  # fmt: skip
        self._path, self._choice, self._decoder, self._remote = path, choice, decoder, remote
        self._only, self._without = filters
        self._state = _state(path)

    def summed_up(self, words: _Words) -> _Found:
        """Count the frames, and read what they say.

        Raises UsageError if there are none, or several channels without a choice.
        """
        found = _Found()
        late_s = float("-inf")
        for frame, channel in self._frames(found.left_out):
            if not found.kinds:
                found.first_s = frame.timestamp_s
            late_s = found.last_s = max(late_s, frame.timestamp_s)
            kind = _kind(frame)
            found.kinds[kind] += 1
            text = words.of(frame)
            if text and len(texts := found.words.setdefault(kind, {})) < _MOST_WORDS:
                texts[text] = None
            found.channels.add(channel)
        if not found.count:
            said = ", ".join(f"{reason} ({count})" for reason, count in found.left_out.items() if count)
            raise UsageError(
                f"no frame of {self._path.name} is left to send: {said}",
                hint=Hint(Action.DECODE, {"file": self._path}, "shows its contents"),
            )
        if self._choice.channel is None and len(found.channels) > 1:
            named = join_some(sorted(found.channels))
            raise UsageError(
                f"{self._path.name} has frames of several channels: {named}",
                hint=Hint(Action.GIVE, {"from_channel": min(found.channels)}, "selects a channel")
                + Hint(Action.GIVE, {"from_channel": "all"}, ", {} sends them all"),
            )
        return found

    def due(self, found: _Found) -> Iterator[tuple[float | None, Frame]]:
        """Yield each frame with its time (s from the first; None: at once); raises SafetyRefusal for a changed file."""
        rate, pass_s = self._choice.rate, found.pass_s(self._choice.rate)
        for number in range(self._choice.loops):
            if _state(self._path) != self._state:
                raise _changed(self._path)
            due_s = 0.0
            left = Counter(found.kinds)
            for frame, _ in self._frames(Counter()):
                kind = _kind(frame)
                left[kind] -= 1
                if left[kind] < 0:
                    raise _changed(self._path)
                if not rate:
                    yield None, frame
                    continue
                due_s = max(due_s, (frame.timestamp_s - found.first_s) / rate)
                yield number * pass_s + due_s, frame
            if any(left.values()):
                raise _changed(self._path)

    def _frames(self, left_out: Counter[str]) -> Iterator[tuple[Frame, str]]:
        """Yield the chosen frames with channels; *left_out* counts the others."""
        began_s: float | None = None
        for frame in read_recorded(self._path):
            reason = self._cannot(frame)
            if not frame.error and began_s is None:
                began_s = frame.frame.timestamp_s
            if not reason and began_s is not None:
                reason = self._unmeant(frame, frame.frame.timestamp_s - began_s)
            if reason:
                left_out[reason] += 1
            else:
                yield frame.frame, frame.channel

    def _cannot(self, one: RecordedFrame) -> str:
        if one.error:
            return "error frames"
        if one.fd:
            return "CAN FD frames"
        return "remote frames, which the bus does not carry" if one.frame.remote and not self._remote else ""

    def _unmeant(self, one: RecordedFrame, at_s: float) -> str:
        choice = self._choice
        if choice.channel not in (None, ALL, one.channel):
            return "frames of other channels"
        if not choice.from_s - _CLOSE_S <= at_s <= choice.to_s + _CLOSE_S:
            return "frames before the first or after the last second that was chosen"
        if not self._only and not self._without:
            return ""
        service = self._decoder.layout(one.frame).service
        meant = not self._only or any(matches(one.frame, *service) for matches in self._only)
        if not meant or any(matches(one.frame, *service) for matches in self._without):
            return "frames that were not chosen"
        return ""


def _state(path: Path) -> tuple[int, int, int]:
    """Return a mark that changes when a file is written."""
    found = path.stat()
    return found.st_ino, found.st_size, found.st_mtime_ns


def _changed(path: Path) -> SafetyRefusal:
    return SafetyRefusal(f"{path} is not the file that was shown", hint="replay it when no program writes it")


def _kind(frame: Frame) -> _Kind:
    """Group frames of the same effect: NMT by both bytes, SDO requests by the first byte.

    SDO servers may have any CAN-ID.
    """
    return frame.can_id, frame.extended, frame.remote, frame.data[: 2 if frame.can_id == 0 else 1]


def _rows(found: _Found, known: KnownParties) -> tuple[FramesToReplay, ...]:
    """Return a row per effect, by CAN-ID."""
    from dvtcli.domain.ports import Frame

    counted: Counter[tuple[int, bool, bool, str]] = Counter()
    words: dict[tuple[int, bool, bool, str], dict[str, None]] = {}
    for (can_id, extended, remote, data), count in found.kinds.items():
        said = effects(Frame(can_id, data, extended=extended, remote=remote), known.parties)
        counted[can_id, extended, remote, said] += count
        kind = can_id, extended, remote, data
        words.setdefault((can_id, extended, remote, said), {}).update(found.words.get(kind, {}))
    rows = []
    for (can_id, extended, remote, effect), count in sorted(counted.items()):
        service = known.decoder.layout(Frame(can_id, b"", extended=extended)).service
        texts = tuple(words[can_id, extended, remote, effect])
        rows.append(FramesToReplay(can_id, extended, remote, service.label, service.node, count, effect, texts))
    return tuple(rows)


def _ask(session: SessionUser, path: Path, choice: Choice, found: _Found, rows: Sequence[FramesToReplay]) -> None:
    """Show what would be sent, and ask if nodes act on it."""
    for row in rows[:_MOST_ROWS]:
        session.reporter.note(row.text)
    if len(rows) > _MOST_ROWS:
        more = f"and {plural(len(rows) - _MOST_ROWS, 'more row')}: {{}} shows all"
        session.reporter.note(Hint(Action.GIVE, {"dry_run": True}, more))
    asked = [row for row in rows if row.effects]
    if asked:
        said = join_some(row.what for row in asked)
        often = f" {choice.loops} times" if choice.loops > 1 else ""
        session.consent(
            f"nodes act on {sum(row.count for row in asked)} of {found.count} frames of {path.name} ({said}); "
            f"send them{often}?"
        )
