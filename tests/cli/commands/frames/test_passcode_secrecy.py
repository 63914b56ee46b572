"""A passcode that passes on the bus is in no recording."""

from __future__ import annotations

import re
import signal
import subprocess
import sys
from collections.abc import Callable
from pathlib import Path

import can
import pytest

from dvtcli.cli.boundary import exit_code_of
from dvtcli.domain.datatypes import U16
from dvtcli.domain.object_dictionary import ObjectDictionary, ObjectType, OdEntry, OdObject
from dvtcli.domain.ports import Frame
from dvtcli.files.user_folders import user_folder
from dvtcli.operations.session.steady_listener import Listener
from dvtcli.operations.user.secret_objects import Secrets
from tests.cli.commands.bench import Bench
from tests.harness.sample import heavy
from tests.simulator.serve.served import PATIENCE_S, bus_words, own_environment, served, wait_for

LOGIN = Frame(0x601, bytes.fromhex("2B 00 50 02 44 44 00 00"), timestamp_s=1.0)
OTHERS = (
    Frame(0x601, bytes.fromhex("2B 00 50 03 01 00 00 00"), timestamp_s=1.0),
    Frame(0x581, bytes.fromhex("60 00 50 02 00 00 00 00"), timestamp_s=1.0),
    Frame(0x181, bytes.fromhex("2B 00 50 02 44 44 00 00"), timestamp_s=1.0),
)


class Replayed:
    """A bus on which *LOGIN* and others pass at once."""

    def __init__(self) -> None:
        self._frames = (LOGIN, *OTHERS)

    def tap(self, callback: Callable[[Frame, bool], None]) -> Callable[[], None]:
        self._callback = callback
        return lambda: None

    def drain(self) -> None:
        """Nothing has arrived before."""

    def pass_on(self, frame: Frame) -> None:
        self._callback(frame, False)

    def idle(self, duration_s: float) -> None:
        assert duration_s > 0
        for frame in self._frames:
            self.pass_on(frame)
        self._frames = ()

    def lost_frame_count(self) -> int:
        return 0


def test_a_transfer_whose_beginning_found_no_room_is_followed_all_the_same() -> None:
    bus = Replayed()
    with Listener(bus, Secrets.known().in_frames(), waiting=2) as listener:
        listener.take(1.0)
        for data in ("01 00 00 00 00 00 00 00", "02 00 00 00 00 00 00 00"):
            bus.pass_on(Frame(0x185, bytes.fromhex(data), timestamp_s=1.0))
        bus.pass_on(Frame(0x601, bytes.fromhex("21 00 50 02 04 00 00 00"), timestamp_s=1.0))
        assert [frame.can_id for frame in listener.take()] == [0x185, 0x185]
        bus.pass_on(Frame(0x601, bytes.fromhex("07 44 44 44 44 00 00 00"), timestamp_s=1.0))
        (kept,) = listener.take()
    assert kept.data[1:] == bytes(7)


def test_the_value_is_kept_as_zeros_and_nothing_else_is_touched() -> None:
    with Listener(Replayed(), Secrets.known().in_frames()) as listener:
        kept, *others = listener.take(1.0)
    assert kept.data == bytes.fromhex("2B 00 50 02 00 00 00 00")
    assert [frame.data for frame in others] == [frame.data for frame in OTHERS]


def test_lines_that_may_hold_a_passcode() -> None:
    secrets = Secrets.known()
    for line in (
        "write 5000:2 1", "write 0x5000:02 0x4444", "sdo_wnx 1 0x5000 2 0x4444", "sdo_wnx 1 5000 02 17476 2",
        "sdo_wn 1 20480 2 17476 2", "sdo_wn 1 0x5000 0x002 17476 2", "write 5000-2 17476", "write 0X5000:2 17476",
        "write 5000.2 17476", "write 0x5000.02 17476", "dvtcli write 5000.2 17476",
        "write 5000h:02h 17476", "write 5000H:2 17476", "write 3:5000:2 17476",
    ):  # fmt: skip
        assert secrets.in_line(line), line
    for line in ("read 5000:1", "write 5000:3 1", "map tpdo1 5000:21", "write 1017 5000", "login 4"):
        assert not secrets.in_line(line), line


def test_a_passcode_s_object_may_be_named_as_this_device_calls_it() -> None:
    door = OdEntry(0x5000, 2, "Passcode", U16, denotation="Door code")
    dictionary = ObjectDictionary({0x5000: OdObject(0x5000, "Access", ObjectType.RECORD, {2: door})})
    secrets = Secrets.known()
    assert secrets.in_line("write door_code 17476", [dictionary])
    assert secrets.in_line('write "Door code (Access)" 17476', [dictionary])
    assert not secrets.in_line("write 1017 5", [dictionary])


@pytest.mark.parametrize("line", ["write passcode 17476", 'write "Access level.Passcode" 17476', "write PassCode 1"])
def test_a_passcode_s_object_may_be_named(line: str) -> None:
    with Bench(("gen4-locked",)) as bench:
        bench.session.node()
        assert bench.session.is_secret(line)
        assert not bench.session.is_secret("write producer_heartbeat_time 1000")
        assert bench.run(f"{line} --as u16").code == 6


HAND_WRITTEN = {
    "in segments": ("2100500202000000", "0B44440000000000"),
    "in two segments": ("2100500208000000", "0044444444444444", "1D44000000000000"),
    "by a block": ("C600500202000000", "8144440000000000", "D548C90000000000"),
    "in six bytes": ("2B0050024444",),
    "without the bit for expedited": ("2000500244440000",),
    "without its beginning": ("0B44440000000000",),
    "after an abort": ("2100500202000000", "8000500200000405", "0B44440000000000"),
}


@heavy
@pytest.mark.parametrize("way", HAND_WRITTEN)
def test_a_passcode_that_is_sent_by_hand_is_nowhere(way: str) -> None:
    """Neither in what `send` says, nor in `trace last`, -vv, the kept exchange, or the file of a bug."""
    with Bench(("gen4-locked",), in_real_time=True) as bench:
        bench.session.node()
        shown = [bench.run(f"send 601#{data} --yes -vv") for data in HAND_WRITTEN[way]]
        shown.append(bench.run(f"send {' '.join(f'601#{data}' for data in HAND_WRITTEN[way])} --yes --json"))
        shown += [bench.run("trace last --count 200"), bench.run("trace last --count 200 --json")]
        assert bench.run("read 5FFF --force").code == 1
        ran = bench._ran(lambda: exit_code_of(bench.session, _fails))
        crashed = Path(ran.stderr.partition("report it with ")[2].split()[0]).read_text("utf-8")
    kept = (user_folder("state") / "last-exchange.txt").read_text()
    shown.append(Bench().run("trace last --count 200 --json"))
    for text in (kept, crashed, *(one.stdout + one.stderr for one in shown)):
        told = re.sub(r"\d\d:\d\d:\d\d\.\d+", "", text)
        assert "4444" not in told
        assert "44 44" not in told
        assert "17476" not in told
        assert "48C9" not in told, "its checksum tells it, too"
    assert "(value not kept)" in kept
    for data in HAND_WRITTEN[way]:
        spaced = " ".join(data[at : at + 2] for at in range(0, len(data), 2))
        lines = (f"send 601#{data}", f"send 601#{data}0", f"explain '601 {spaced}'", f"send 0x601 {spaced} 00 00 00")
        for line in (*lines, f"explain 601 [8] {spaced}", f"send 601#{spaced.replace(' ', '.')} --yes"):
            assert bench.session.is_secret(line) or "4444" not in data, line


def _fails() -> None:
    raise ZeroDivisionError("a bug")


@heavy
@pytest.mark.parametrize("name", ["run.log", "run.asc", "run.trc"])
def test_a_log_has_the_login_but_not_the_passcode(tmp_path: Path, name: str) -> None:
    path = tmp_path / name
    with served(tmp_path, "gen4-locked@1") as server:
        process = subprocess.Popen(
            [sys.executable, "-m", "dvtcli", *bus_words(server.port), "log", str(path)],
            stdout=subprocess.PIPE, stderr=subprocess.PIPE, encoding="utf-8", env=own_environment(tmp_path),
        )  # fmt: skip
        assert process.stderr is not None
        assert "Ctrl-C ends it" in process.stderr.readline()
        bus = server.attach()
        bus.send(can.Message(arbitration_id=0x601, data=LOGIN.data, is_extended_id=False))
        bus.send(can.Message(arbitration_id=0x7E0, data=b"END", is_extended_id=False))
        wait_for(lambda: path.exists() and b"7E0" in path.read_bytes(), "the last frame in the file")
        process.send_signal(signal.SIGINT)
        process.communicate(timeout=PATIENCE_S)
    written = path.read_bytes().replace(b" ", b"")
    assert b"2B00500200000000" in written
    assert b"4444" not in written
