"""`read OBJECT -o FILE` and `write OBJECT @FILE`: bytes as they are, the way of every other write around them."""

from __future__ import annotations

import os
import signal
import time
from collections.abc import Iterator
from pathlib import Path

import pytest

from dvtcli.cli.signals import catch_signals
from dvtcli.domain.ports import Frame
from tests.bus.devices import device
from tests.cli.commands.bench import Bench
from tests.virtual_time import VirtualTimeBus

DATA = bytes(count * 7 % 251 for count in range(5000))


@pytest.fixture
def bench(tmp_path_factory: pytest.TempPathFactory) -> Iterator[Bench]:
    bus = VirtualTimeBus([device(1)], simulated=False)
    options = {"node": 1, "profile": "generic", "journal": str(tmp_path_factory.mktemp("state"))}
    with Bench((), options, bus) as made:
        yield made


def held(bench: Bench) -> bytes:
    bus = bench.session.wire
    assert isinstance(bus, VirtualTimeBus)
    return bus.nodes[0].device.value(0x2002)


def test_there_and_back(bench: Bench, tmp_path: Path) -> None:
    source, target = tmp_path / "in.bin", tmp_path / "out.bin"
    source.write_bytes(DATA)
    ran = bench.run(f"write 2002 @{source}")
    assert (ran.code, held(bench)) == (0, DATA)
    assert "5,000 bytes" in ran.stdout
    assert max(map(len, ran.stdout.splitlines())) <= 100
    ran = bench.run(f"read 2002 -o {target}")
    assert (ran.code, target.read_bytes()) == (0, DATA)
    assert ran.stdout == f"{target}: 5,000 bytes of 0x2002:00 of node 1\n"
    assert target.stat().st_mode == source.stat().st_mode, "others may read it as they may any file"
    assert len(bench.run("read 2002 --as os").stdout) < 600
    assert bench.run("undo").code == 0
    assert held(bench) != DATA


def test_json_has_all_of_it(bench: Bench, tmp_path: Path) -> None:
    (tmp_path / "in.bin").write_bytes(DATA)
    assert bench.run(f"write 2002 @{tmp_path / 'in.bin'} --json").document["steps"][0]["after"] == DATA.hex(" ").upper()
    assert bench.run("read 2002 --json").document["raw"] == DATA.hex(" ").upper()
    document = bench.run(f"read 2002 -o {tmp_path / 'out.bin'} --json").document
    assert (document["object"], document["bytes"], document["schema"]) == ("2002:00", 5000, "dvtcli.object-file/1")


def test_an_at_sign_of_a_text_is_doubled(bench: Bench) -> None:
    assert bench.run("write 2002 @@home --as vs").code == 0
    assert held(bench) == b"@home"


def test_files_that_are_no_object(bench: Bench, tmp_path: Path) -> None:
    before = bench.run("read 2002").stdout
    (tmp_path / "empty").touch()
    with (tmp_path / "large").open("wb") as large:
        large.truncate((1 << 20) + 1)
    codes = {name: bench.run(f"write 2002 @{tmp_path / name}").code for name in ("none", "empty", "large")}
    assert codes == {"none": 2, "empty": 4, "large": 4}
    assert bench.run(f"write 2002 @{tmp_path / 'empty'} --as vs").code == 2
    assert bench.run("read 2002").stdout == before


def test_an_existing_file_is_asked_for_and_none_is_left_half(bench: Bench, tmp_path: Path) -> None:
    there = tmp_path / "there"
    there.write_bytes(b"mine")
    assert bench.run(f"read 2002 -o {there}").code == 6
    assert bench.run(f"read 7FFF -o {tmp_path / 'other'} --yes").code == 1
    assert there.read_bytes() == b"mine"
    assert sorted(path.name for path in tmp_path.iterdir() if path.is_file()) == ["there"]


def test_a_dry_run_writes_to_the_twin_alone(bench: Bench, tmp_path: Path) -> None:
    (tmp_path / "in.bin").write_bytes(DATA)
    assert bench.run(f"write 2002 @{tmp_path / 'in.bin'} --dry-run").code == 0
    assert held(bench) != DATA


def test_how_far_it_is_is_said(bench: Bench, tmp_path: Path) -> None:
    (tmp_path / "in.bin").write_bytes(DATA)
    said: list[tuple[str, int, int]] = []
    bench.run("read 1000")
    bench.session.reporter.progress = lambda *words: said.append(words)  # type: ignore[method-assign]
    bench.run(f"write 2002 @{tmp_path / 'in.bin'}")
    bench.run(f"read 2002 -o {tmp_path / 'out.bin'}")
    writing = [words for words in said if "writing" in words[0]]
    reading = [words for words in said if "reading 0x2002:00:" in words[0]]
    assert writing[0] == ("node 1: writing 0x2002:00: 448 of 5,000 bytes", 448, 5000)
    assert reading[-1][1:] == (4928, 5000)


@pytest.fixture
def handlers() -> Iterator[None]:
    """Whatever catches signals here is put back."""
    names = [name for name in ("SIGINT", "SIGTERM", "SIGHUP") if hasattr(signal, name)]
    before = {name: signal.getsignal(getattr(signal, name)) for name in names}
    yield
    for name, handler in before.items():
        signal.signal(getattr(signal, name), handler)


def test_ctrl_c_in_the_middle_leaves_the_old_value(bench: Bench, tmp_path: Path, handlers: None) -> None:
    """The signal is a real one, caught as the program does, and comes with a segment in the middle of the data."""
    catch_signals(bench.session.cancellation)
    (tmp_path / "in.bin").write_bytes(DATA)
    before = held_before(bench)
    sent: list[bytes] = []

    def interrupt(frame: Frame, ours: bool) -> None:
        if ours and frame.can_id == 0x601:
            sent.append(frame.data)
            if len([one for one in sent if one[0] & 0x7F == 100]) == 1 and frame.data[0] == 100:
                os.kill(os.getpid(), signal.SIGINT)
                time.sleep(0.001)  # where the signal is taken

    bench.session.wire.tap(interrupt)
    ran = bench.run(f"write 2002 @{tmp_path / 'in.bin'}")
    assert ran.code == 130
    assert "rolled back" in ran.stderr
    assert held(bench) == before
    assert bytes.fromhex("80 02 20 00 00 00 00 08") in sent
    assert bench.run("recover").code == 0
    assert bench.run(f"write 2002 @{tmp_path / 'in.bin'}").code == 0
    assert held(bench) == DATA


def held_before(bench: Bench) -> bytes:
    bench.run("read 1000")
    return held(bench)
