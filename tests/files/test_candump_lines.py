"""A line of candump's log is the frame that python-can's reader makes of it, whichever of the two reads it here."""

from __future__ import annotations

from pathlib import Path
from tempfile import TemporaryDirectory

import can
from hypothesis import example, given
from hypothesis import strategies as st

from dvtcli.bus.can_message import frame_of
from dvtcli.domain.ports import Frame
from dvtcli.files.recordings.recording_file import Recorder, read_recorded
from dvtcli.files.recordings.recording_format import message_of

times = st.floats(0, 9e9).map("{:.6f}".format)
channels = st.sampled_from(["can0", "vcan1", "0", "007", "slcan_2"])
numbers = st.one_of(st.integers(0, 0x7FF).map("{:03X}".format), st.integers(0, 0x1FFFFFFF).map("{:08X}".format))
contents = st.one_of(
    st.binary(max_size=8).map(bytes.hex),
    st.binary(max_size=64).filter(lambda data: len(data) in (12, 16, 64)).map(lambda data: f"#1{data.hex()}"),
    st.sampled_from(["R", "R0", "R8"]),
)
ends = st.sampled_from(["", " R", " T", " "])


@given(times, channels, numbers, contents, ends, st.booleans())
@example("1.5", "can0", "181", "", "", False)
@example("1.5", "can0", "1FFFFFFF", "0102030405060708", " T", False)
def test_a_line_is_what_python_can_makes_of_it(
    time: str, channel: str, can_id: str, content: str, end: str, is_upper: bool
) -> None:
    line = f"({time}) {channel} {can_id}#{content.upper() if is_upper else content}{end}\n"
    with TemporaryDirectory() as folder:
        path = Path(folder) / "one.log"
        path.write_text(line, "utf-8")
        found = [(read.frame, read.channel, read.fd) for read in read_recorded(path)]
        expected = [
            (frame_of(message), str(message.channel), message.is_fd) for message in can.CanutilsLogReader(str(path))
        ]
    assert found == expected


frames = st.builds(
    lambda can_id, extended, data, time_s: Frame(can_id if extended else can_id & 0x7FF, data, extended, False, time_s),
    st.integers(0, 0x1FFF_FFFF),
    st.booleans(),
    st.binary(max_size=8),
    st.floats(0, 9e9),
)


@given(st.lists(frames, min_size=1, max_size=4), st.booleans())
def test_a_line_is_written_as_python_can_writes_it(written: list[Frame], appended: bool) -> None:
    """Also if the clock goes back."""
    with TemporaryDirectory() as folder:
        own, other = Path(folder) / "own.log", Path(folder) / "other.log"
        for path in (own, other):
            path.write_text("(1.000000) can0 181# R\n" if appended else "", "utf-8")
        with Recorder(own, append=appended) as recorder, can.CanutilsLogWriter(str(other), append=appended) as writer:
            for frame in written:
                recorder.write(frame)
                writer.on_message_received(message_of(frame))
        assert own.read_text("utf-8") == other.read_text("utf-8")
