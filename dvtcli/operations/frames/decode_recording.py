"""Decode a recording by a DBC file, an EDS or the nodes' mappings: rows, signals over time, their origin."""

from __future__ import annotations

import json
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from dataclasses import asdict, dataclass
from functools import cache
from pathlib import Path
from typing import TYPE_CHECKING, Any, TextIO

from dvtcli.domain.hint import Action, Hint
from dvtcli.domain.text import plural
from dvtcli.errors import DvtcliError, InputFileError, UsageError
from dvtcli.files.recordings.recording_file import check_readable, read_recorded
from dvtcli.files.values.value_file import WholeFile, checked_form, is_value_file, next_part, read_values
from dvtcli.files.values.value_rows import LONG, Origin, ParquetForm
from dvtcli.operations.frames.explain_frame import frame_seen
from dvtcli.operations.frames.recorded import decoder_for, is_copy, shown_path
from dvtcli.operations.network.described_nodes import described_nodes, network_config_of
from dvtcli.operations.user.refused_options import refuse_options
from dvtcli.watch.decoder import Misfits
from dvtcli.watch.frame_reader import FrameReader
from dvtcli.watch.table import SignalRows, all_columns, fill, fill_rows, find_tracks

if TYPE_CHECKING:
    from dvtcli.domain.network.network_config import NetworkConfig
    from dvtcli.domain.ports import Frame
    from dvtcli.files.recordings.recording_format import RecordedFrame
    from dvtcli.operations.results import Facts, FrameSeen
    from dvtcli.operations.results.documents import Document
    from dvtcli.operations.session.session import SessionNodes
    from dvtcli.operations.user.session_user import SessionUser
    from dvtcli.watch.decoder import Decoder
    from dvtcli.watch.table import Place, Track


def decode_recording(
    session: SessionNodes,
    path: Path,
    nodes: tuple[int, ...] | None = None,
    dbc: str | None = None,
    text: str = "",
    only: frozenset[str] = frozenset(),
) -> Iterator[FrameSeen]:
    """Yield the decoded frames of the recording at *path*, with *text* (lower case) in a name; see `decoder_for`.

    *only* are kinds of frames, as in `typed_frame.READ_KINDS`; none: all.

    Raises UsageError if the file is missing or its format unknown, and at the end if no known signal has *text* in its
    name; InputFileError, after the frames before it, where the file is damaged.
    """
    check_readable(path)
    config = network_config_of(dbc)
    decoder = decoder_for(session, nodes, dbc, path, config)
    misfits = Misfits(decoder.layout, session.reporter.warning)
    seen = _seen_frames(session, path, misfits, _readers(session, decoder, dbc, config), only)
    if only:
        seen = _or_note(session, path, seen, only)
    return _matching(session, path, seen, decoder, text) if text else seen


@dataclass(frozen=True, slots=True)
class ValuesOptions:
    """Options of recorded values: *layout* of a .parquet file (None: long), *source* (None: the actual recorder).

    A new file begins by *rotation* (seconds, bytes; 0: never), and with *append* after an existing file.
    *only* are kinds of frames, as in `typed_frame.READ_KINDS`; none: all.
    """

    layout: str | None = None
    source: str | None = None
    rotation: tuple[float, int] = (0.0, 0)
    append: bool = False
    only: frozenset[str] = frozenset()


DEFAULTS = ValuesOptions()


def write_values(
    session: SessionNodes,
    path: Path,
    target: TextIO | Path,
    nodes: tuple[int, ...] | None = None,
    dbc: str | None = None,
    text: str = "",
    options: ValuesOptions = DEFAULTS,
) -> SignalRows:
    """Write the values of the recording at *path* to *target*: CSV to a text, else by the file's suffix.

    A row per frame, in the long layout of a .parquet file a row per value; a column per signal with *text* (lower
    case) in its name, and frames of services are rows in words. *options* has options of a .parquet file; its recorder
    defaults to the recording's name. If the recording is damaged, what is before that gets another name. Raises
    UsageError if no such signal is known and no frame is a row in words, DvtcliError if *target* cannot be written;
    else as `decode_recording`.
    """
    check_readable(path)
    config = network_config_of(dbc)
    decoder = decoder_for(session, nodes, dbc, path, config)
    reader_of = _readers(session, decoder, dbc, config)
    rows = SignalRows(decoder, text, reader_of(""), options.only)
    if text and len(rows.decoder) and not rows.columns:
        raise UsageError(f"no signal has {text!r} in its name", hint=Hint(Action.DECODE, why="shows its contents"))
    if (
        not rows.columns
        and not options.only
        and not _has_rows(session, path, SignalRows(decoder, text, reader_of("first")))
    ):
        raise UsageError(
            "values of signals need a mapping, and none is known",
            hint=Hint(Action.GIVE, {"dbc": None}, "give {}")
            + Hint(Action.GIVE, {"eds": None}, ", {}")
            + Hint(Action.GIVE, {"node_id": None}, ", {}")
            + Hint(Action.GIVE, {"nodes": None}, " or {}"),
        )
    form = None
    if isinstance(target, Path):
        is_live = dbc is None and session.base.eds is None and not rows.decoder.identities
        asked = tuple(range(1, 128)) if is_live else ()
        form = parquet_form(session, target, rows.decoder, options, path.name, asked=asked, dbc=dbc)
    frames = _seen(session, path, rows, reader_of)
    if isinstance(target, Path):
        _write_file(session, rows, frames, target, text, form)
    else:
        from dvtcli.files.values.text_values import CsvWriter

        writer = CsvWriter(target, rows)
        for frame, _ in frames:
            writer.write(frame)
    if options.only and not rows.frames:
        session.reporter.note(_no_frame_of(path, options.only))
    if rows.other:
        session.reporter.note(f"left out: {plural(rows.other, 'frame')} without known signals")
    return rows


def values_into_file(
    session: SessionNodes,
    path: Path,
    target: Path,
    nodes: tuple[int, ...] | None = None,
    dbc: str | None = None,
    text: str = "",
    options: ValuesOptions = DEFAULTS,
) -> Facts:
    """Write the values in the recording at *path* into *target*, a .csv, .parquet or .jsonl; else as `write_values`."""
    from dvtcli.operations.results import Facts
    from dvtcli.operations.session.save_script import ask_before_overwriting

    checked_form(target)
    ask_before_overwriting(session, target)
    rows = write_values(session, path, target, nodes, dbc, text, options)
    session.made.append(str(target))
    names = [column.header for column in rows.columns]
    said = (("file", str(target)), ("frames", rows.frames), ("columns", names))
    return Facts("decode", said, (f"{target}: {plural(rows.frames, 'frame')}, {plural(len(names), 'signal')}",))


def _readers(
    session: SessionNodes, decoder: Decoder, dbc: str | None, config: NetworkConfig | None
) -> Callable[[str], FrameReader]:
    """Return what gives the reader of a channel: nodes of two buses may have one node-ID."""
    described = described_nodes(session, dbc, config)
    return cache(lambda _channel: FrameReader(decoder, described))


def _has_rows(session: SessionUser, path: Path, rows: SignalRows) -> bool:
    """Whether a frame of the recording at *path* is one of *rows*; a damage behind it does not matter.

    If there is none, a note counts the error and CAN FD frames.
    """
    return any(rows.values(recorded.frame) is not None for recorded in _classic_frames(session, path))


def _seen(
    session: SessionUser, path: Path, rows: SignalRows, reader_of: Callable[[str], FrameReader]
) -> Iterator[tuple[Frame, str]]:
    """Yield the frames of the recording at *path* with channels; reports frames that do not fit their layout.

    *rows* read each by the reader of its channel.
    """
    misfits = Misfits(rows.decoder.layout, session.reporter.warning)
    for recorded in _classic_frames(session, path):
        misfits.look(recorded.frame)
        rows.reader = reader_of(recorded.channel)
        yield recorded.frame, recorded.channel


def _write_file(
    session: SessionUser,
    rows: SignalRows,
    frames: Iterable[tuple[Frame, str]],
    target: Path,
    text: str,
    form: ParquetForm | None,
) -> None:
    """Write *rows* of *frames* to *target*; if the recording is damaged, what is before that to another file."""

    def document(frame: Frame) -> Document:
        return frame_seen(frame, rows.decoder, rows.reading).chosen(text).document()

    try:
        to = WholeFile(target, rows, document, form)
        damage: list[InputFileError] = []
        try:
            for frame, bus in _until_damage(frames, damage):
                to.write(frame, bus)
        except BaseException:
            to.discard()
            raise
        if damage:
            kept = next_part(target.with_stem(f"{target.stem}-until-damage"))
            to.complete(kept.name)
            session.reporter.warning(
                f"{target} is not written; the {plural(rows.frames, 'frame')} before the damage are in {kept}"
            )
            raise damage[0]
        to.complete()
    except OSError as failed:
        raise DvtcliError(
            f"{target}: {failed.strerror or failed} after {plural(rows.frames, 'frame')}",
            place=str(target),
            hint="an older file of that name is unchanged",
        ) from failed


def _until_damage(frames: Iterable[tuple[Frame, str]], damage: list[InputFileError]) -> Iterator[tuple[Frame, str]]:
    """Yield *frames* until they raise InputFileError, which *damage* gets: not what a writer of them raises."""
    try:
        yield from frames
    except InputFileError as damaged:
        damage.append(damaged)


def _classic_frames(session: SessionUser, path: Path) -> Iterator[RecordedFrame]:
    """Yield the frames of the recording at *path* without error and CAN FD frames; a note counts these at the end."""
    errors = fd_frames = 0
    damage: InputFileError | None = None
    try:
        for recorded in read_recorded(path):
            if recorded.error:
                errors += 1
            elif recorded.fd:
                fd_frames += 1
            else:
                yield recorded
    except InputFileError as damaged:
        damage = damaged
    left_out = [plural(count, f"{kind} frame") for count, kind in ((errors, "error"), (fd_frames, "CAN FD")) if count]
    if left_out:
        said = f"left out: {' and '.join(left_out)}"
        is_checkable = errors and not is_copy(path)
        session.reporter.note(Hint(Action.CHECK, {"file": path}, f"{said}; {{}} counts them") if is_checkable else said)
    if damage is not None:
        raise damage


def _seen_frames(
    session: SessionUser,
    path: Path,
    misfits: Misfits,
    reader_of: Callable[[str], FrameReader],
    only: frozenset[str],
) -> Iterator[FrameSeen]:
    for recorded in _classic_frames(session, path):
        misfits.look(recorded.frame)
        reader = reader_of(recorded.channel)
        seen = frame_seen(recorded.frame, reader.decoder, reader.read(recorded.frame))
        if not only or seen.reading.is_one_of(only):
            yield seen


def _no_frame_of(path: Path, kinds: frozenset[str]) -> str:
    return f"no frame in {path.name} is of the kinds {', '.join(sorted(kinds))}"


def _or_note(
    session: SessionUser, path: Path, frames: Iterable[FrameSeen], only: frozenset[str]
) -> Iterator[FrameSeen]:
    """Yield *frames*; a note says that there are none of the kinds *only*."""
    found = None
    for found in frames:
        yield found
    if found is None:
        session.reporter.note(_no_frame_of(path, only))


def _matching(
    session: SessionNodes, path: Path, frames: Iterable[FrameSeen], decoder: Decoder, text: str
) -> Iterator[FrameSeen]:
    count = 0
    for seen in frames:
        if seen.matches(text):
            count += 1
            yield seen.chosen(text)
    if not count:
        if not SignalRows(decoder, text).columns:
            raise _unnamed(text, path)
        session.reporter.note(f"{shown_path(path)}: no frame in it carries a signal with {text!r} in its name")


def _unnamed(text: str, path: Path) -> UsageError:
    said = f"nothing in {path} has {text!r} in its name"
    hint = Hint(Action.GIVE, {"filter": None}, "without {}")
    if not is_copy(path):
        hint += Hint(Action.DECODE, {"file": path}, ", {} shows its contents")
    return UsageError(said, hint=hint)


def recorded_tracks(
    session: SessionNodes,
    path: Path,
    signals: Sequence[str],
    nodes: tuple[int, ...] | None = None,
    dbc: str | None = None,
) -> tuple[list[Track], tuple[float, float]]:
    """Return the tracks of *signals* (names or objects) with samples in the recording, and its time span (s).

    A recording has frames, or values by `log --decode` with units in the columns.

    Raises UsageError for an unknown signal or without samples; the decoder is that of `decoder_for`.
    """
    tracks: Mapping[Any, Track]
    if is_value_file(path):
        refuse_options({"node_ids": nodes, "dbc": dbc}, f"not for {path.name}, which has decoded values")
        values = read_values(path)
        tracks = by_number = find_tracks(signals, dict(enumerate(values.columns)))
        span_s = fill_rows(by_number, values.rows)
    else:
        check_readable(path)
        decoder = decoder_for(session, nodes, dbc, path)
        tracks = by_place = find_tracks(signals, all_columns(decoder))
        span_s = fill(by_place, _fitting(session, path, by_place, decoder), decoder)
    found = [track for track in tracks.values() if track.values]
    if not found:
        names = ", ".join(track.name for track in tracks.values())
        raise UsageError(
            f"{path} has no sample of {names}", hint=Hint(Action.DECODE, {"file": path}, "shows its contents")
        )
    return found, span_s


def _fitting(session: SessionUser, path: Path, tracks: Mapping[Place, Track], decoder: Decoder) -> Iterator[Frame]:
    """Yield the frames of the recording at *path*; reports frames of *tracks* that do not fit their layout."""
    addresses = {address for address, _ in tracks}
    misfits = Misfits(decoder.layout, session.reporter.warning)
    for recorded in _classic_frames(session, path):
        frame = recorded.frame
        if (frame.can_id, frame.extended) in addresses:
            misfits.look(frame)
        yield frame


#: the largest file with a hash
_MOST_BYTES = 64 << 20


def parquet_form(
    session: SessionNodes,
    path: Path,
    decoder: Decoder,
    options: ValuesOptions,
    recorder: str,
    *,
    asked: tuple[int, ...] = (),
    dbc: str | None = None,
) -> ParquetForm | None:
    """Return the options for *path* if it is a .parquet file; None for other formats.

    *recorder* is the default recorder. Nodes of *decoder* in *asked* are asked for their identity (0x1018); that of
    others is from the network file *dbc*, or from the source of *decoder*.
    """
    if not is_parquet(path):
        if given := {name: None for name in ("layout", "source") if getattr(options, name)}:
            raise UsageError(f"only for a .parquet file, not for {path.name}", given=given, hint="leave it out")
        return None
    layout, source = options.layout or LONG, options.source or recorder
    nodes = sorted({each.service.node for each in decoder.layouts.values() if each.service.node})
    identities = dict(decoder.identities)
    identities.update(_of_file(dbc))
    identities.update({node_id: _of_node(session, node_id) for node_id in nodes if node_id in asked})
    serials = {
        node_id: serial for node_id in nodes if (serial := identities.get(node_id, {}).get("serial")) is not None
    }
    facts = {"layout": layout, "source": source, **_of_bus(session), **_of_files(session, dbc)}
    facts["nodes"] = json.dumps([{"node": node_id, **identities.get(node_id, {})} for node_id in nodes])
    metadata = {f"dvtcli.{key}": text for key, text in facts.items()}
    return ParquetForm(layout, Origin(source, serials, metadata))


def is_parquet(path: Path) -> bool:
    """Tell by its suffix whether *path* is a .parquet file."""
    return path.suffix.lower() == ".parquet"


def _of_bus(session: SessionNodes) -> dict[str, str]:
    from dvtcli.version import __version__

    facts = {"version": __version__}
    wire = session.wire if session.is_open else None
    bit_rate = session.base.bitrate if wire is None else None if wire.simulated else wire.bitrate
    if wire is not None:
        facts["bus"] = wire.name
    if bit_rate is not None:
        facts["bitrate"] = str(bit_rate)
    return facts


def _of_files(session: SessionUser, dbc: str | None) -> dict[str, str]:
    """Return the file that describes the frames, and its SHA-256."""
    from hashlib import sha256

    from dvtcli.files.input_file import read_input
    from dvtcli.operations.session.simulated_nodes import file_or_family

    key, file = ("network_file", Path(dbc)) if dbc is not None else ("eds", None)
    if file is None and session.base.eds is not None:
        file = file_or_family(session.base.eds)
    if file is None:
        return {}
    return {key: file.name, f"{key}_sha256": sha256(read_input(file, _MOST_BYTES, "file of a network")).hexdigest()}


def _of_file(dbc: str | None) -> dict[int, Mapping[str, int | None]]:
    """Return the identities of nodes in the network file *dbc*."""
    if dbc is None or Path(dbc).suffix.lower() not in (".yaml", ".yml"):
        return {}
    from dvtcli.operations.plans.read_network_config import read_network_config

    return {node.node_id: asdict(node.identity) for node in read_network_config(dbc).nodes}


def _of_node(session: SessionNodes, node_id: int) -> Mapping[str, int | None]:
    from dvtcli.device.read_pdos import read_identity
    from dvtcli.domain.network.network_state import IDENTITY_NAMES

    sdo = session.node(node_id).sdo
    return {name: read_identity(sdo, sub_index) for sub_index, name in enumerate(IDENTITY_NAMES, 1)}
