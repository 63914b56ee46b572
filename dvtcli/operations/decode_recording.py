"""A recording, decoded: by a DBC file, by the mapping in an EDS, or by what the nodes hold now."""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path
from typing import TYPE_CHECKING, TextIO

from dvtcli.errors import UsageError
from dvtcli.files.recording import check_readable, read_recording
from dvtcli.operations.frame_answer import frame_seen
from dvtcli.operations.recorded import decoder_for

if TYPE_CHECKING:
    from dvtcli.operations.results import FrameSeen
    from dvtcli.operations.session import Session
    from dvtcli.watch.decoder import Decoder


def decode_recording(
    session: Session, path: Path, nodes: tuple[int, ...] | None = None, dbc: str | None = None, text: str = ""
) -> Iterator[FrameSeen]:
    """The frames of the recording at *path* that have *text* (small letters) in their names; see `decoder_for`.

    UsageError for a suffix that is no format, InputFileError where the file is none of it.
    """
    check_readable(path)
    return _fitting(path, decoder_for(session, nodes, dbc), text)


def write_values(
    session: Session,
    path: Path,
    target: TextIO,
    nodes: tuple[int, ...] | None = None,
    dbc: str | None = None,
    text: str = "",
) -> None:
    """Write the values in the recording at *path* to *target* as CSV: a row for each frame, a column for each signal.

    UsageError where no mapping is known; else as `decode_recording`.
    """
    from dvtcli.watch.table import write_csv

    check_readable(path)
    decoder = decoder_for(session, nodes, dbc)
    if not len(decoder):
        raise UsageError("--csv needs a mapping, and none is known", hint="give --dbc, --eds, -n or --sim")
    table = write_csv(target, (one.frame for one in _fitting(path, decoder, text)), decoder)
    if table.other:
        session.tell.note(f"{table.other} frames without known signals were left out")


def _fitting(path: Path, decoder: Decoder, text: str) -> Iterator[FrameSeen]:
    seen = (frame_seen(frame, decoder) for frame in read_recording(path))
    return (one for one in seen if one.matches(text))
