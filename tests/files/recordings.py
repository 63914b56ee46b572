"""Frames for tests of recordings, and the formats that there are."""

from __future__ import annotations

from hypothesis import strategies as st

from dvtcli.domain.ports import Frame
from dvtcli.files.recordings.formats import written
from tests.small_recording import BEGIN_S

#: suffixes of all formats that are written, and of those that can do more
FORMATS = tuple(written())
APPENDABLE = tuple(suffix for suffix, one in written().items() if one.appends)
ROTATING = tuple(suffix for suffix, one in written().items() if one.rotates)


def frames(*, remote: bool = True) -> st.SearchStrategy[list[Frame]]:
    """One frame or more, in the order of their times, which are whole milliseconds."""
    return st.lists(st.tuples(st.integers(1, 5_000), one_frame(remote=remote)), min_size=1, max_size=30).map(_timed)


@st.composite
def one_frame(draw: st.DrawFn, *, remote: bool) -> Frame:
    extended = draw(st.booleans())
    can_id = draw(st.integers(0, 0x1FFF_FFFF if extended else 0x7FF))
    is_remote = remote and draw(st.booleans())
    data = b"" if is_remote else draw(st.binary(max_size=8))
    return Frame(can_id, data, extended, is_remote, dlc=draw(st.integers(0, 8)) if is_remote else 0)


def _timed(gaps: list[tuple[int, Frame]]) -> list[Frame]:
    at_ms, timed = 0, []
    for gap_ms, frame in gaps:
        at_ms += gap_ms
        timed.append(frame._replace(timestamp_s=BEGIN_S + at_ms / 1000))
    return timed
