"""`bus.send` and `bus.replay`: what they send, what they ask, and what they do not take."""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path

import pytest

import dvtcli
from dvtcli import errors
from dvtcli.domain.ports import Frame
from dvtcli.files.recordings.recording_file import Recorder
from dvtcli.results import FramesSent, Replayed

BEGIN_S = 1_700_000_000.0


@pytest.fixture(scope="module")
def bus() -> Iterator[dvtcli.Bus]:
    with dvtcli.simulate("gen4") as found:
        yield found


@pytest.fixture
def recording(tmp_path: Path) -> Path:
    path = tmp_path / "run.log"
    with Recorder(path) as recorder:
        for number, can_id in enumerate((0x7A0, 0x601, 0x7A1)):
            recorder.write(Frame(can_id, b"\x40\x17\x10\0\0\0\0\0", timestamp_s=BEGIN_S + number / 100))
    return path


def test_frames_are_sent(bus: dvtcli.Bus) -> None:
    sent = bus.send("7A0#1027", "7A1#", count=2, every_s=0.001)
    assert isinstance(sent, FramesSent)
    assert sent
    assert (sent.outcome.sent, sent.outcome.wanted) == (4, 4)


def test_what_nodes_act_on_needs_yes(bus: dvtcli.Bus, recording: Path) -> None:
    with pytest.raises(errors.SafetyRefusal, match="SYNC"):
        bus.send("080#")
    assert bus.send("080#", yes=True)
    with pytest.raises(errors.SafetyRefusal, match="0x601 SDO request node 1"):
        bus.replay(recording)
    with bus.dry_run():
        assert not bus.send("000#8101")


def test_a_recording_is_played(bus: dvtcli.Bus, recording: Path) -> None:
    played = bus.replay(recording, rate=4, without=["sdo"], loops=2)
    assert isinstance(played, Replayed)
    assert played
    assert (played.outcome.sent, dict(played.left_out)) == (4, {"frames that were not chosen": 1})
    assert bus.replay(recording, yes=True, within_s=(0.01, 1.0)).outcome.sent == 2


@pytest.mark.parametrize(
    "wrong",
    [
        {"count": 0},
        {"every_s": 0.1},
        {"every_s": "1"},
        {"count": 2, "for_s": 1.0},
        {"nodes": [128]},
    ],
)
def test_send_takes_nothing_else(bus: dvtcli.Bus, wrong: dict[str, object]) -> None:
    with pytest.raises(errors.UsageError):
        bus.send("7A0#00", **wrong)  # type: ignore[arg-type]
    with pytest.raises(errors.UsageError):
        bus.send()


@pytest.mark.parametrize(
    "wrong",
    [{"rate": -1}, {"loops": 0}, {"within_s": 3}, {"only": "sdo"}, {"without": ["nothing"]}, {"channel": 1}],
)
def test_replay_takes_nothing_else(bus: dvtcli.Bus, recording: Path, wrong: dict[str, object]) -> None:
    with pytest.raises(errors.UsageError):
        bus.replay(recording, **wrong)  # type: ignore[arg-type]
