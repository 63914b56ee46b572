"""Extract signals over time from a recording."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any

from dvtcli.domain.hint import Action, Hint
from dvtcli.errors import UsageError
from dvtcli.files.recordings.read_recording import check_readable, read_recording
from dvtcli.files.values.value_file import is_value_file, read_values
from dvtcli.operations.frames.recorded import decoder_for
from dvtcli.watch.decoder import Misfits
from dvtcli.watch.table import all_columns
from dvtcli.watch.tracks import fill, fill_rows, find_tracks

if TYPE_CHECKING:
    from dvtcli.domain.ports import Frame
    from dvtcli.operations.session.session_nodes import SessionNodes
    from dvtcli.operations.user.session_user import SessionUser
    from dvtcli.watch.decoder import Decoder
    from dvtcli.watch.table import Place
    from dvtcli.watch.tracks import Track


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
    for frame in read_recording(path):
        if (frame.can_id, frame.extended) in addresses:
            misfits.look(frame)
        yield frame
