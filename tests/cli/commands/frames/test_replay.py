"""`replay FILE`: what is chosen, asked about and sent, and that what is recorded of it again is the same."""

from __future__ import annotations

import os
import tempfile
from pathlib import Path

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from dvtcli.domain.frame_bits import frame_bits
from dvtcli.domain.ports import Frame
from dvtcli.domain.typed_frame import frame_filter
from dvtcli.errors import BusUnavailable
from dvtcli.files.recordings.recording_file import Recorder, read_recording
from dvtcli.simulator.network.family_file import family_eds
from dvtcli.watch.service import service_of
from tests.cli.commands.bench import Bench
from tests.files.recordings import BEGIN_S, frames
from tests.harness.sample import heavy
from tests.process import dvtcli
from tests.virtual_time import VirtualTimeBus

#: words that filters are made of, with what they mean, said another way
FILTERS = {
    "181": lambda frame: (frame.can_id, frame.extended) == (0x181, False),
    "100-3FF": lambda frame: not frame.extended and 0x100 <= frame.can_id <= 0x3FF,
    "00000000-0FFFFFFF": lambda frame: frame.extended and frame.can_id < 1 << 28,
    "1:1": lambda frame: frame.can_id % 2 == 1,
    "sdo": lambda frame: not frame.extended and frame.can_id >> 7 in (0xB, 0xC) and frame.can_id % 128 > 0,
    "node=5": lambda frame: not frame.extended and frame.can_id % 128 == 5 and 0x80 < frame.can_id < 0x780
    and frame.can_id >> 7 not in (2, 13),
    "tpdo2": lambda frame: not frame.extended and 0x281 <= frame.can_id <= 0x2FF,
    "5:rpdo1": lambda frame: (frame.can_id, frame.extended) == (0x205, False),
}  # fmt: skip


def told(frame: Frame) -> tuple[int, bool, bool, bytes, int]:
    return frame.can_id, frame.extended, frame.remote, frame.data, frame.dlc


def recorded(path: Path, sent: list[Frame]) -> Path:
    with Recorder(path) as recorder:
        for frame in sent:
            recorder.write(frame)
    return path


def replayed(bench: Bench, line: str) -> tuple[int, list[tuple[float, Frame]]]:
    """The exit code of *line*, and what it sent, with the bus's time."""
    found: list[tuple[float, Frame]] = []
    bus = bench.session.open_network().bus
    stop = bus.tap(lambda frame, ours: found.append((bus.now_s(), frame)) if ours else None)
    ran = bench.run(line)
    stop()
    return ran.code, found


def on_an_empty_bus() -> Bench:
    """A bus on which nobody is, so that nothing is read ahead of a replay."""
    return Bench((), bus=VirtualTimeBus([]))


@pytest.mark.parametrize("text", FILTERS)
@given(frames())
def test_a_filter_means_what_it_says(text: str, some: list[Frame]) -> None:
    matches = frame_filter(text)
    for frame in [*some, Frame(0x181, b""), Frame(0x205, b""), Frame(0x605, b""), Frame(0x285, b"")]:
        service = service_of(frame.can_id, extended=frame.extended)
        assert matches(frame, *service) is FILTERS[text](frame), frame


@given(frames(), st.sampled_from(["log", "asc", "blf"]), st.lists(st.sampled_from(sorted(FILTERS)), max_size=2),
       st.sampled_from([0.5, 1.0, 4.0]), st.integers(1, 3))  # fmt: skip
def test_what_is_replayed_is_what_was_recorded(
    some: list[Frame], suffix: str, words: list[str], rate: float, loops: int
) -> None:
    """Frame by frame, and each as long after the first one; a recording of it is that recording again."""
    with tempfile.TemporaryDirectory() as folder, on_an_empty_bus() as bench:
        path = recorded(Path(folder) / f"run.{suffix}", some)
        assert [told(one) for one in read_recording(path)] == [told(one) for one in some]
        meant = [one for one in read_recording(path) if not words or any(FILTERS[word](one) for word in words)]
        only = "".join(f" --filter {word}" for word in words)
        code, sent = replayed(bench, f"replay {path}{only} --rate {rate} --loop {loops} --yes")
        if not meant:
            assert (code, sent) == (2, [])
            return
        assert code == 0
        assert [told(one) for _, one in sent] == [told(one) for one in meant] * loops
        for (at_s, _), one in zip(sent, meant, strict=False):
            assert (at_s - sent[0][0]) * rate == pytest.approx(one.timestamp_s - meant[0].timestamp_s, abs=2e-5)
        again = recorded(
            Path(folder) / "again.log",
            [one._replace(timestamp_s=BEGIN_S + at_s) for at_s, one in sent[: len(meant)]],
        )
        assert [told(one) for one in read_recording(again)] == [told(one) for one in meant]


@settings(max_examples=max(5, settings().max_examples // 5))
@given(st.integers(0, 9), st.integers(0, 9))
def test_a_part_of_it_is_replayed(first: int, last: int) -> None:
    some = [Frame(0x7A0 + n, b"", timestamp_s=BEGIN_S + n) for n in range(10)]
    with tempfile.TemporaryDirectory() as folder, on_an_empty_bus() as bench:
        path = recorded(Path(folder) / "run.log", some)
        code, sent = replayed(bench, f"replay {path} --from {first} --to {last} --without 7A3")
        meant = [n for n in range(first, last + 1) if n != 3]
        assert [one.can_id - 0x7A0 for _, one in sent] == meant
        assert code == (0 if meant else 2)


def test_frames_that_are_older_than_the_first_one_are_sent_too(tmp_path: Path) -> None:
    """As in candump's logs of several interfaces put together; `--from` says that they are not meant."""
    path = tmp_path / "run.log"
    path.write_text("(5.0) can0 7A0#\n(1.1) can0 7A1#\n(1.2) can0 7A2#\n", "utf-8")
    with on_an_empty_bus() as bench:
        code, sent = replayed(bench, f"replay {path}")
        assert (code, [one.can_id for _, one in sent]) == (0, [0x7A0, 0x7A1, 0x7A2])
        assert len(replayed(bench, f"replay {path} --to 1")[1]) == 3
        assert len(replayed(bench, f"replay {path} --from 0")[1]) == 1


def test_a_recorded_apply_asks(tmp_path: Path) -> None:
    """Its SDO writes, NMT commands and whatever else nodes act on; without an answer nothing is sent."""
    with Bench() as bench:
        bus = bench.session.open_network().bus
        received: list[Frame] = []
        stop = bus.tap(lambda frame, ours: received.append(frame) if ours else None)
        assert bench.run("map tpdo1 606C --event").code == 0
        stop()
        path = recorded(tmp_path / "apply.log", received)
        bench.session.network.nodes.clear()
        code, sent = replayed(bench, f"replay {path}")
        assert code == 6
        assert all(frame.data[0] >> 5 == 2 for _, frame in sent), "only uploads"
        said = bench.run(f"replay {path}").stderr
        assert "SDO request to node 1: it writes" in said
        assert "write 1800:01" in said
        assert "606C:00" in said, "the mapped object in words"
        assert "--yes" in said
        table = bench.run(f"replay {path} --dry-run")
        assert (table.code, "SDO request to node 1: it writes" in table.stdout) == (0, True)
        assert bench.run(f"replay {path} --without sdo").code in (0, 2)


def test_a_replayed_apply_does_it_again(tmp_path: Path) -> None:
    received: list[Frame] = []
    with Bench() as bench:
        bench.session.open_network().bus.tap(lambda frame, ours: received.append(frame) if ours else None)
        assert bench.run("map tpdo1 606C --event").code == 0
    path = recorded(tmp_path / "apply.log", [one._replace(timestamp_s=BEGIN_S + n) for n, one in enumerate(received)])
    with Bench() as bench:
        assert bench.run(f"replay {path} --yes").code == 0
        assert bench.run("pdo tpdo1 --json").document["pdos"][0]["mapping"][0]["object"] == "606C:00"


def test_errors_and_can_fd_are_left_out_and_counted(tmp_path: Path) -> None:
    path = tmp_path / "run.log"
    path.write_text(
        "(1.000000) can0 7A0#01\n(1.100000) can0 7A0##1AABB\n(1.200000) can0 20000004#0000000000000000\n"
        "(1.300000) can0 7A0#02\n",
        "utf-8",
    )
    with on_an_empty_bus() as bench:
        document = bench.run(f"replay {path} --json").document
        assert document["sent"] == 2
        assert {one["reason"]: one["frames"] for one in document["left_out"]} == {
            "CAN FD frames": 1, "error frames": 1,
        }  # fmt: skip


def test_of_several_channels_one_is_chosen(tmp_path: Path) -> None:
    path = tmp_path / "run.log"
    path.write_text("(1.0) can0 7A0#01\n(1.1) can1 7A1#02\n(1.2) can0 7A0#03\n", "utf-8")
    with on_an_empty_bus() as bench:
        refused = bench.run(f"replay {path}")
        refused.failed(2, "can0, can1")
        assert [one.data for _, one in replayed(bench, f"replay {path} --from-channel can0")[1]] == [b"\1", b"\3"]
        assert [one.data for _, one in replayed(bench, f"replay {path} --from-channel all")[1]] == [b"\1", b"\2", b"\3"]
        assert bench.run(f"replay {path} --from-channel can7").code == 2


@heavy
@pytest.mark.parametrize("words", ["--rate 0", "--rate 100"])
def test_the_load_stays_within_its_share(tmp_path: Path, words: str) -> None:
    """With a node OPERATIONAL no second has more than half the bus, also where the recording has more."""
    some = [Frame(0x7A0, bytes(8), timestamp_s=BEGIN_S + n / 1000) for n in range(1500)]
    path = recorded(tmp_path / "run.log", some)
    with Bench() as bench:
        bus = bench.session.open_network().bus
        bus.bitrate = 125_000  # type: ignore[misc]
        assert bench.run("disable tpdo2").code == 0
        assert bench.run("nmt start").code == 0
        seen: list[tuple[float, Frame]] = []
        bus.tap(lambda frame, _ours: seen.append((bus.now_s(), frame)))
        document = bench.run(f"replay {path} {words} --json").document
        assert document["sent"] == 1500
        assert document["seconds"] > 2
        begun_s = next(at_s for at_s, frame in seen if frame.can_id == 0x7A0)
        ended_s = seen[-1][0]
        for second in range(int(begun_s), int(ended_s) + 1):
            within = [frame for at_s, frame in seen if begun_s <= at_s and second <= at_s < second + 1]
            assert sum(frame_bits(one.can_id, one.data, one.extended, one.remote) for one in within) <= 62_500


def test_ctrl_c_says_how_many_were_sent(tmp_path: Path) -> None:
    path = recorded(tmp_path / "run.log", [Frame(0x7A0, b"", timestamp_s=BEGIN_S + n) for n in range(9)])
    with on_an_empty_bus() as bench:
        bus, sent = bench.session.open_network().bus, []

        def stop(frame: Frame, _ours: bool) -> None:
            sent.append(frame)
            if len(sent) == 4:
                bench.session.cancellation.asked(130, insists=False)

        bus.tap(stop)
        ran = bench.run(f"replay {path}")
        assert (ran.code, len(sent)) == (130, 4)
        assert "4 of 9 frames sent" in ran.stdout


class Short(VirtualTimeBus):
    """A bus that is gone after three frames."""

    taken = 0

    def send(self, frame: Frame) -> None:
        self.taken += 1
        if self.taken > 3:
            raise BusUnavailable(f"{self.name} failed (send)")
        super().send(frame)


def test_a_bus_that_goes_ends_it(tmp_path: Path) -> None:
    path = recorded(tmp_path / "run.log", [Frame(0x7A0, b"", timestamp_s=BEGIN_S + n) for n in range(9)])
    with Bench((), bus=Short([])) as bench:
        document = bench.run(f"replay {path} --json").document
        assert (document["sent"], document["wanted"]) == (3, 9)


def test_a_file_that_changes_meanwhile_is_not_sent_further(tmp_path: Path) -> None:
    """What was agreed to is what is sent."""
    path = recorded(tmp_path / "run.log", [Frame(0x7A0, b"", timestamp_s=BEGIN_S + n) for n in range(3)])
    with on_an_empty_bus() as bench:
        sent: list[Frame] = []

        def change(frame: Frame, _ours: bool) -> None:
            sent.append(frame)
            if len(sent) == 3:
                path.write_text("(1.0) can0 000#0100\n", "utf-8")

        bench.session.open_network().bus.tap(change)
        ran = bench.run(f"replay {path} --loop 3")
        assert (ran.code, len(sent), "is not the file" in ran.stderr) == (6, 3, True)
        assert "3 of 9 frames" in ran.stderr


def test_a_file_that_is_cut_short_meanwhile_is_no_success(tmp_path: Path) -> None:
    """Also where it ends with a whole line, so that what is left can be read."""
    path = recorded(tmp_path / "run.log", [Frame(0x7A0, bytes(8), timestamp_s=BEGIN_S + n) for n in range(900)])
    line = path.read_bytes().index(b"\n") + 1
    with on_an_empty_bus() as bench:
        cut = False

        def shorten(_frame: Frame, _ours: bool) -> None:
            nonlocal cut
            if not cut:
                os.truncate(path, path.stat().st_size // line // 2 * line)
                cut = True

        bench.session.open_network().bus.tap(shorten)
        ran = bench.run(f"replay {path}")
        assert (ran.code, "is not the file" in ran.stderr, "of 900 frames" in ran.stderr) == (6, True, True)


def test_without_a_bit_rate_nothing_is_sent_as_fast_as_possible(tmp_path: Path) -> None:
    path = recorded(tmp_path / "run.log", [Frame(0x7A0, b"", timestamp_s=BEGIN_S)])
    with Bench((), bus=VirtualTimeBus([], simulated=False)) as bench:
        ran = bench.run(f"replay {path} --rate 0")
        ran.failed(2, "bit rate")


def test_names_come_from_the_nodes_that_are_known(tmp_path: Path) -> None:
    path = recorded(tmp_path / "run.log", [Frame(0x301, bytes(6), timestamp_s=BEGIN_S)])
    with Bench((), {"sim": ("gen4@1",), "eds": str(family_eds("gen4"))}) as bench:
        rows = bench.run(f"replay {path} --dry-run --json").document["frames"]
        assert rows[0]["label"] == "RPDO2"
        assert "received by RPDO2 of node 1" in rows[0]["effects"]


def test_a_dry_run_needs_no_bus(tmp_path: Path) -> None:
    path = tmp_path / "run.log"
    path.write_text("(1.000000) can0 605#2B17100064000000\n(1.100000) can0 185#37\n(1.200000) can0 7A0#01\n", "utf-8")
    ran = dvtcli("replay", str(path), "--dry-run")
    assert ran.returncode == 0, ran.stderr
    assert "SDO request to node 5: it writes" in " ".join(ran.stdout.split())
    assert "dry run: none of 3 frames was sent" in ran.stdout
    assert "no bus is chosen" in ran.stderr
    assert dvtcli("replay", str(path)).returncode == 5, "who sends needs one"
