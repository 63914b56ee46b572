"""`download FILE` with the simulated boot loader: what the device holds is what is said, wherever it ends."""

from __future__ import annotations

from binascii import crc32
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import pytest

import dvtcli
from dvtcli.domain.nmt import NmtState
from dvtcli.domain.ports import Frame
from dvtcli.errors import SafetyRefusal
from dvtcli.simulator.device.boot_loader import FACTORY_PROGRAM, BootLoader
from dvtcli.simulator.device.memory import Refusal
from dvtcli.simulator.device.simulated_faults import read_faults
from dvtcli.simulator.device.strict_device import StrictDevice
from dvtcli.simulator.network.family_file import load_family
from tests import process
from tests.bus.devices import device, dictionary
from tests.cli.commands.bench import Bench, Ran
from tests.virtual_time import VirtualTimeBus

PROGRAM = bytes(count * 7 % 251 for count in range(3000))
HEX = ":10010000214601360121470136007EFE09D2190140\n:00000001FF\n"


class Loading:
    """A node with a boot loader on a bus that outlives the program, and a file for it."""

    def __init__(self, folder: Path, *faults: str, device_: StrictDevice | None = None, **options: Any) -> None:
        nodes = [device_ or device(1, "loader")]
        self.bus = VirtualTimeBus(nodes, faults=read_faults(faults, [1]), simulated=False)
        self.file = folder / "fw.bin"
        self.file.write_bytes(PROGRAM)
        words = {"node": 1, "profile": "loader", "journal": str(folder / "state"), "yes": True, **options}
        self.bench = Bench((), words, self.bus)

    @property
    def held(self) -> bytes | None:
        loader = self.bus.nodes[0].device.loader
        assert loader is not None
        return loader.program

    @property
    def control(self) -> int:
        return self.bus.nodes[0].device.upload(0x1F51, 1)[0]

    def run(self, *words: str) -> Ran:
        return self.bench.run(" ".join(["download", str(self.file), *words]))


@pytest.fixture
def loading(tmp_path: Path) -> Iterator[Loading]:
    made = Loading(tmp_path)
    with made.bench:
        yield made


def test_a_program_is_loaded_checked_started_and_seen_to_run(loading: Loading) -> None:
    ran = loading.run("--expect", "crc32")
    assert (ran.code, loading.held, loading.control) == (0, PROGRAM, 1)
    assert f"0x{crc32(PROGRAM):08X} (before: 0x{crc32(FACTORY_PROGRAM):08X}), as expected" in ran.stdout
    assert "was not completed" not in loading.bench.run("read 1000").stderr
    document = loading.run("--json").document
    assert (document["schema"], document["identification"]) == ("dvtcli.program/1", crc32(PROGRAM))
    assert (document["bytes"], document["restarted"]) == (3000, True)


@pytest.mark.parametrize("busy", [0x08000022, 0x08000021, 0x06060000])
def test_a_loader_that_refuses_while_it_is_busy_is_waited_for(busy: int, tmp_path: Path) -> None:
    loading = Loading(tmp_path)
    loader = loading.bus.nodes[0].device.loader
    assert loader is not None
    loader.busy = busy
    with loading.bench:
        ran = loading.run("--expect", "crc32")
    assert (ran.code, loading.held, loading.control) == (0, PROGRAM, 1), ran


@pytest.mark.parametrize("fault", ["lose-response@2", "lose-request@2"])
@pytest.mark.parametrize("busy", [0x08000022, 0x08000021, 0x06060000])
def test_a_loader_that_still_clears_when_it_is_told_again_is_waited_for(busy: int, fault: str, tmp_path: Path) -> None:
    """The answer to the first command takes too long, and the second is refused meanwhile."""
    loading = Loading(tmp_path, fault)
    loader = loading.bus.nodes[0].device.loader
    assert loader is not None
    loader.busy = busy
    with loading.bench:
        ran = loading.run("--expect", "crc32")
    assert (ran.code, loading.held, loading.control) == (0, PROGRAM, 1), ran


class _Once(BootLoader):
    """A boot loader that refuses to clear what is cleared."""

    refusal = 0x06090030

    def take(self, index: int, data: bytes, state: NmtState) -> bool:
        if index == 0x1F51 and data == b"\3" and self.read(0x1F51) == b"\3":
            raise Refusal(self.refusal)
        return super().take(index, data, state)


@pytest.mark.parametrize("absent", [(), (0x1F57,)])
@pytest.mark.parametrize("refusal", [0x06090030, 0x08000020, 0x08000022])
def test_a_loader_that_clears_only_once_is_not_given_up(refusal: int, absent: tuple[int, ...], tmp_path: Path) -> None:
    """The answer to the first command is lost, and the second is refused: there is nothing to clear."""
    family = load_family("loader")._replace(absent={(index, 0): 0x06020000 for index in absent})
    loading = Loading(tmp_path, "lose-response@2", device_=StrictDevice(dictionary("loader"), family, 1))
    node = loading.bus.nodes[0].device
    node.loader = _Once()
    node.loader.refusal = refusal
    with loading.bench:
        ran = loading.run()
    assert (ran.code, loading.held, loading.control) == (0, PROGRAM, 1), ran


class _Stopped(BootLoader):
    """A boot loader that refuses to stop a program; its program control reads *said* at first."""

    def __init__(self, said: int) -> None:
        super().__init__()
        self._control = said

    def take(self, index: int, data: bytes, state: NmtState) -> bool:
        if index == 0x1F51 and data == b"\0":
            raise Refusal(0x06090030)
        return super().take(index, data, state)


@pytest.mark.parametrize(("said", "code"), [(0, 0), (3, 0), (1, 1), (0x81, 1)])
def test_a_loader_that_refuses_to_stop_what_is_stopped_is_not_given_up(said: int, code: int, tmp_path: Path) -> None:
    """One that runs its program, or says something else, is: nothing was cleared then."""
    loading = Loading(tmp_path)
    loading.bus.nodes[0].device.loader = _Stopped(said)
    with loading.bench:
        ran = loading.run()
    assert (ran.code, loading.held == PROGRAM) == (code, code == 0), ran
    assert ("0x06090030" in ran.stderr) == (code == 1)


def test_a_loader_that_does_not_clear_is_said(tmp_path: Path) -> None:
    loading = Loading(tmp_path, "lose-request@2", "refuse@3=0x06090030")
    with loading.bench:
        ran = loading.run()
    assert (ran.code, "0x06090030" in ran.stderr, loading.held) == (7, True, FACTORY_PROGRAM), ran


class _Idle(BootLoader):
    """A boot loader that acknowledges the command to start a program, and does not start it."""

    def take(self, index: int, data: bytes, state: NmtState) -> bool:
        return super().take(index, data, state) and False


def test_a_program_that_does_not_start_is_not_said_to_run(tmp_path: Path) -> None:
    loading = Loading(tmp_path)
    loading.bus.nodes[0].device.loader = _Idle()
    with loading.bench:
        ran = loading.run("--expect", "crc32")
    assert (ran.code, loading.held, loading.control) == (7, PROGRAM, 0), ran
    assert "sent no boot-up message within 20 s" in ran.stderr
    assert "was started, and is not known to run" in " ".join(ran.stderr.split())


def test_another_refusal_of_the_flash_status_ends_it(tmp_path: Path) -> None:
    loading = Loading(tmp_path)
    loader = loading.bus.nodes[0].device.loader
    assert loader is not None
    loader.busy = 0x06010000
    with loading.bench:
        ran = loading.run()
    ran.failed(7, "0x06010000")


@pytest.mark.parametrize("absent", [(0x1F57,), (0x1F56,), (0x1F56, 0x1F57)])
def test_a_loader_without_status_or_identification(absent: tuple[int, ...], tmp_path: Path) -> None:
    family = load_family("loader")._replace(absent={(index, 0): 0x06020000 for index in absent})
    loading = Loading(tmp_path, device_=StrictDevice(dictionary("loader"), family, 1), profile="generic")
    for index in absent:
        with pytest.raises(Refusal):
            loading.bus.nodes[0].device.upload(index, 1)
    with loading.bench:
        ran = loading.run()
    assert (ran.code, loading.held, loading.control) == (0, PROGRAM, 1), ran


def test_a_restart_that_was_not_heard_is_not_denied(tmp_path: Path) -> None:
    """Some devices send no boot-up message: whether this one restarted nobody knows."""
    loading = Loading(tmp_path)
    loading.bus.nodes[0].device.family = loading.bus.nodes[0].device.family._replace(boot_up_message=False)
    with loading.bench:
        ran = loading.run()
    assert ran.code == 0, ran.stderr
    assert "runs: it answers so; no boot-up message was received" in " ".join(ran.stdout.split())


def test_an_intel_hex_file(loading: Loading, tmp_path: Path) -> None:
    loading.file = tmp_path / "fw.hex"
    loading.file.write_text(HEX)
    assert loading.run().code == 0
    assert loading.held == bytes.fromhex("214601360121470136007EFE09D21901")


@pytest.mark.parametrize(
    ("name", "data", "code"),
    [
        ("fw.elf", b"1", 2),
        ("fw.bin", b"", 4),
        ("fw.hex", b":1001\n", 4),
        ("fw.hex", b"\xff\xfe", 4),
        ("fw.hex", b":00000001FF\n", 4),
        ("fw.hex", b":020000040000FA\n:0100000000FF\n:020000040900F1\n:0100000000FF\n:00000001FF\n", 4),
    ],
)
def test_files_that_are_no_program(loading: Loading, tmp_path: Path, name: str, data: bytes, code: int) -> None:
    loading.file = tmp_path / name
    loading.file.write_bytes(data)
    ran = loading.run()
    assert (ran.code, loading.held) == (code, FACTORY_PROGRAM)
    assert str(loading.file) in ran.stderr


def test_it_asks_first_and_says_what_will_happen(tmp_path: Path) -> None:
    made = Loading(tmp_path, yes=False)
    with made.bench:
        ran = made.run()
        assert (ran.code, made.held, made.control) == (6, FACTORY_PROGRAM, 1)
        assert "stop program 1, clear it, load fw.bin (3,000 bytes) and start that?" in " ".join(ran.stderr.split())


def test_a_dry_run_sends_nothing(loading: Loading) -> None:
    sent: list[Frame] = []
    loading.bench.run("read 1000")
    loading.bus.tap(lambda frame, ours: sent.append(frame) if ours and frame.data[0] >> 5 in (1, 6) else None)
    ran = loading.run("--dry-run")
    assert (ran.code, sent, loading.held) == (0, [], FACTORY_PROGRAM)
    assert "Nothing was sent" in ran.stdout


def test_a_node_that_was_operational_is_pre_operational_from_then_on(loading: Loading) -> None:
    loading.bench.run("nmt start 1")
    ran = loading.run()
    assert (ran.code, loading.held) == (0, PROGRAM)
    assert "nmt start 1" in ran.stderr
    assert int(loading.bus.nodes[0].device.state) == 127


def test_another_program_than_there_is(loading: Loading) -> None:
    ran = loading.run("--program", "2")
    assert ran.code == 1
    assert "no program 2" in ran.stderr
    assert loading.held == FACTORY_PROGRAM


CASES = {
    "refuse@1=0x08000022": (1, FACTORY_PROGRAM, "its old firmware runs"),
    "lose-response@1": (0, PROGRAM, "runs"),
    "refuse@2=0x06060000": (7, FACTORY_PROGRAM, "the old firmware or none"),
    "lose-request@2": (0, PROGRAM, "runs"),
    "lose-response@2": (0, PROGRAM, "runs"),
    "reset@2": (7, FACTORY_PROGRAM, "the old firmware or none"),
    "refuse@3=0x06060000": (7, None, "no firmware that is known to be complete"),
    "reset@3": (7, None, "no firmware that is known to be complete"),
    "silent@3": (7, None, "no firmware that is known to be complete"),
    "refuse@4=0x08000000": (7, PROGRAM, "was loaded and not started"),
    "lose-response@4": (0, PROGRAM, "runs"),
    "silent@4": (7, PROGRAM, "whether it runs is not known"),
    "flash-fails": (7, None, "no firmware that is known to be complete"),
}


@pytest.mark.parametrize("fault", CASES)
def test_a_failure_says_what_the_device_holds(fault: str, tmp_path: Path) -> None:
    code, held, said = CASES[fault]
    made = Loading(tmp_path, fault)
    with made.bench:
        ran = made.run()
        assert (ran.code, made.held) == (code, held), ran.stderr
        assert said in " ".join((ran.stdout + ran.stderr).split())


def test_a_program_that_is_not_the_one_that_was_sent_is_not_started(tmp_path: Path) -> None:
    made = Loading(tmp_path, "flash-alters")
    with made.bench:
        ran = made.run("--expect", "crc32")
        assert (ran.code, made.control) == (7, 0)
        assert f"expected is 0x{crc32(PROGRAM):08X}" in ran.stderr


def test_without_expect_the_profile_says_what_is_expected(tmp_path: Path) -> None:
    made = Loading(tmp_path)
    with made.bench:
        assert "as profile loader expects" in made.run().stdout
        document = made.run("--json").document
        assert (document["expected"], document["expected_by"]) == (crc32(PROGRAM), "loader")
        document = made.run("--expect", "crc32", "--json").document
        assert (document["expected"], document["expected_by"]) == (crc32(PROGRAM), None)
    made = Loading(tmp_path, "flash-alters")
    with made.bench:
        ran = made.run()
        assert (ran.code, made.control) == (7, 0)
        assert "profile loader says what is expected" in " ".join(ran.stderr.split())
        altered = crc32(made.held or b"")
        assert (made.run("--expect", hex(altered)).code, made.control) == (0, 1)


def test_where_no_profile_says_it_is_shown(tmp_path: Path) -> None:
    made = Loading(tmp_path, profile="generic")
    with made.bench:
        assert "not compared" in made.run().stdout


@pytest.mark.parametrize(
    ("expected", "code", "said"),
    [
        (f"1 = {crc32(PROGRAM)}", 0, "as profile mine expects"),
        ("1 = 0x10203", 7, "expected is 0x00010203"),
        ("2 = 0x10203", 0, "not compared"),
    ],
)
def test_a_profile_of_ones_own(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, expected: str, code: int, said: str
) -> None:
    monkeypatch.setenv("XDG_CONFIG_HOME", str(tmp_path))
    folder = tmp_path / "dvtcli" / "profiles"
    folder.mkdir(parents=True)
    text = f'name = "mine"\ntitle = "Mine"\n[software_identification]\n{expected}\n'
    (folder / "mine.toml").write_text(text, "utf-8")
    made = Loading(tmp_path, profile="mine")
    with made.bench:
        ran = made.run()
        assert (ran.code, said in ran.stdout + ran.stderr) == (code, True), ran.stderr


@pytest.mark.parametrize("at", range(0, 460, 23))
def test_power_loss_at_any_frame(at: int, tmp_path: Path) -> None:
    """The node loses its power with frame *at*, and comes up again 0.3 s later: then it can be loaded."""
    made = Loading(tmp_path)
    node, frames = made.bus.nodes[0], 0

    def lose(frame: Frame, ours: bool) -> None:
        nonlocal frames
        if ours and frame.can_id == 0x601:
            frames += 1
            if frames == at:
                node.device.restart()
                node.server.reset()
                node.device.boot_up()

    with made.bench:
        made.bench.run("read 1000")
        made.bus.tap(lose)
        ran = made.run("--expect", "crc32")
        held = {0: PROGRAM, 7: made.held}.get(ran.code, FACTORY_PROGRAM)
        assert made.held == held, ran.stderr
        assert (ran.code == 0) == ("runs:" in ran.stdout)
        if ran.code == 7:
            assert made.held is None or "the old firmware or none" in ran.stderr or made.held == PROGRAM
            assert "was not completed" in made.bench.run("read 1000").stderr
        frames = 1 << 30
        assert made.run("--expect", "crc32").code == 0
        assert (made.held, made.control) == (PROGRAM, 1)
        assert "was not completed" not in made.bench.run("read 1000").stderr


def test_what_was_not_completed_is_said_until_it_is_forgotten(tmp_path: Path) -> None:
    made = Loading(tmp_path, "refuse@3=0x06060000")
    with made.bench:
        assert made.run().code == 7
        assert "fw.bin" in made.bench.run("read 1000").stderr
    bus = VirtualTimeBus([device(1, "loader")], simulated=False)
    with Bench((), {"node": 1, "profile": "loader", "journal": str(tmp_path / "state")}, bus) as again:
        said = " ".join(again.run("read 1000").stderr.split())
        assert "no firmware that is known to be complete" in said
        assert "download the firmware again" in said
        assert again.run("download --forget").code == 0
        assert "nothing was noted" in again.run("download --forget").stdout


def test_words_that_do_not_fit(loading: Loading) -> None:
    for line in ("download", f"download {loading.file} --forget", f"download {loading.file} --expect x"):
        assert loading.bench.run(line).code == 2
    assert loading.held == FACTORY_PROGRAM


@pytest.mark.parametrize("code", [130, 143])
def test_a_signal_before_the_old_program_is_cleared_leaves_it_running(loading: Loading, code: int) -> None:
    """It comes when the program is stopped, and ends the command with its own exit code."""

    def stop(frame: Frame, ours: bool) -> None:
        if ours and frame.data[:4] == bytes.fromhex("2F511F01"):
            loading.bench.session.cancellation.asked(code, insists=True)

    loading.bench.session.open_network().bus.tap(stop)
    ran = loading.run()
    assert (ran.code, loading.held, loading.control) == (code, FACTORY_PROGRAM, 1), ran
    assert "stopped before the old program was cleared" in ran.stderr


def test_from_python(tmp_path: Path) -> None:
    (tmp_path / "fw.bin").write_bytes(PROGRAM)
    with dvtcli.simulate("loader") as bus:
        with pytest.raises(SafetyRefusal):
            bus.node().download(tmp_path / "fw.bin")
        loaded = bus.node().download(tmp_path / "fw.bin", expect="crc32", yes=True)
        assert (loaded.after, loaded.restarted) == (crc32(PROGRAM), True)
        assert bus.node().read("1F51:1").value == 1


@pytest.mark.parametrize("fault", ["flash-fails", "flash-alters"])
def test_a_node_without_a_boot_loader_has_no_flash_that_fails(fault: str) -> None:
    ran = process.dvtcli("--sim", "generic", "--fault", fault, "pdo")
    assert (ran.returncode, ran.stdout) == (2, "")
    assert "has no boot loader" in ran.stderr
