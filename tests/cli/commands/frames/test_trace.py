"""`trace last`: the last exchange, frame by frame, and in the file of a bug."""

from __future__ import annotations

import os
import stat
from collections.abc import Iterator
from pathlib import Path

import pytest

from dvtcli.bus.receiver import REMEMBERED
from dvtcli.cli.boundary import exit_code_of
from dvtcli.files.user_folders import user_folder
from dvtcli.operations.frames.last_exchange import keep_exchange
from tests.cli.commands.bench import Bench
from tests.harness.sample import heavy


def test_a_write_is_shown_with_its_answers() -> None:
    with Bench(in_real_time=True) as bench:
        assert bench.run("write 1017 7").code == 0
        found = bench.run("trace last --count 2 --json").document["frames"]
        assert [(one["sent"], one["frame"]) for one in found] == [
            (True, "601#4017100000000000"),
            (False, "581#4B17100007000000"),
        ]
        text = bench.run("trace last").stdout
        assert "-> 601#2B17100007000000" in text
        assert "write 1017:00 Producer heartbeat time = 7 ms" in text


@pytest.mark.parametrize("fault", ["refuse@3=0x06090030", "lose-request@3"])
def test_the_refused_write_is_shown_whatever_was_read_behind_it(fault: str) -> None:
    """A way back reads the other PDOs, which takes more than the frames that are shown else."""
    with Bench(in_real_time=True, options={"fault": (fault,), "timeout": 0.2}) as bench:
        assert bench.run("map tpdo1 6041 606C").code in (1, 5)
        found = bench.run("trace last --json").document["frames"]
        assert len(found) > 32
        assert found[0]["frame"].startswith("601#23001A01"), found[0]
        bench.run("set tpdo2 --timer 5")
        assert len(bench.run("trace last --count 4 --json").document["frames"]) == 4


def test_an_abort_is_in_words() -> None:
    with Bench(in_real_time=True) as bench:
        assert bench.run("read 2FFF --force").code != 0
        assert "object does not exist in the object dictionary" in bench.run("trace last").stdout


def test_kinds_of_frames_are_selected() -> None:
    with Bench(in_real_time=True) as bench:
        bench.run("read 2FFF --force")
        bench.run("read 1001")
        found = bench.run("trace last --only sdo-abort --json").document["frames"]
        assert [(one["what"], one["frame"][:4]) for one in found] == [("sdo-abort", "581#")]
        two = bench.run("trace last --count 2 --only sdo --json").document["frames"]
        assert [one["sent"] for one in two] == [True, False]
        assert two == bench.run("trace last --json").document["frames"][-2:]
        none = bench.run("trace last --only emcy")
        assert (none.code, none.stdout) == (0, "")
        assert "no frame of the last exchange is of the kinds emcy" in none.stderr


def test_it_sends_nothing_and_stays_bounded() -> None:
    with Bench(in_real_time=True) as bench:
        for _ in range(REMEMBERED):
            bench.session.node().sdo.upload(0x1001, 0)
        bus = bench.session.open_network().bus
        before = bus.exchanged()
        assert len(before) == REMEMBERED
        assert bench.run("trace last --count 256").code == 0
        assert bus.exchanged() == before


def test_pdos_do_not_push_an_exchange_out() -> None:
    with Bench(in_real_time=True) as bench:
        bench.run("nmt start")
        bench.run("read 1017")
        bench.session.wire.sleep(0.05)
        kinds = {one["kind"] for one in bench.run("trace last --json").document["frames"]}
        assert kinds <= {"nmt", "sdo", "emcy", "heartbeat"}


def test_a_passcode_is_not_shown() -> None:
    with Bench(("gen4-locked",), in_real_time=True) as bench:
        bench.session.node().sdo.download(0x5000, 2, b"\x44\x44")
        ran = bench.run("trace last")
        assert "4444" not in ran.stdout
        assert "its value is not shown" in ran.stdout


def test_without_an_exchange_it_says_where_it_works() -> None:
    ran = Bench().run("trace last")
    ran.failed(2, "-vv")


@heavy
def test_the_exchange_of_a_run_that_failed_is_kept_for_another_one() -> None:
    kept = user_folder("state") / "last-exchange.txt"
    with Bench(in_real_time=True) as bench:
        assert bench.run("read 1017").code == 0
        assert bench.run("read FFFF:x").code == 2
    assert not kept.exists(), "nothing failed on the bus"
    with Bench(in_real_time=True) as bench:
        assert bench.run("write 1018:1 5 --force").stderr.splitlines()[-1] == "  frames  dvtcli trace last"
        message = bench.run("write 1018:1 5 --force --json").document["message"]
        assert message.splitlines()[-1] == "  frames  dvtcli trace last"
    if os.name == "posix":
        assert stat.S_IMODE(kept.stat().st_mode) == 0o600
    ran = Bench().run("trace last --count 1000")
    assert (ran.code, "of a failed run" in ran.stderr) == (0, True)
    assert "attempt to write a read-only object" in ran.stdout
    with Bench(in_real_time=True) as bench:
        assert bench.run("read 5FFF --force").code == 1
    assert [path.name for path in kept.parent.glob("last-*")] == [kept.name], "the newest alone"
    assert "5FFF" in Bench().run("trace last").stdout
    assert "1018" not in Bench().run("trace last").stdout


def test_a_passcode_is_not_kept() -> None:
    with Bench(("gen4-locked",), in_real_time=True) as bench:
        bench.session.node().sdo.download(0x5000, 2, b"\x44\x44")
        assert bench.run("read 5FFF --force").code == 1
    assert "4444" not in (user_folder("state") / "last-exchange.txt").read_text()
    ran = Bench().run("trace last")
    assert "4444" not in ran.stdout
    assert "its value is not shown" in ran.stdout


@pytest.mark.parametrize(
    "damaged",
    [b"", b"rubbish\n", b"2026-11-23T14:33:20Z -> 601#40\xff\n", b"2026-11-23T14:33:20Z ?? 601#40\n", b"x -> 601#40\n"],
)
def test_a_kept_exchange_that_is_damaged_is_none(damaged: bytes) -> None:
    kept = user_folder("state") / "last-exchange.txt"
    kept.parent.mkdir(parents=True)
    kept.write_bytes(damaged)
    assert Bench().run("trace last").code == 2


def test_what_is_broken_off_while_it_is_kept_leaves_no_file_behind() -> None:
    class Stopped(list[str]):
        def __iter__(self) -> Iterator[str]:
            yield self[0]
            raise KeyboardInterrupt

    with pytest.raises(KeyboardInterrupt):
        keep_exchange(Stopped(["2026-11-23T14:33:20Z -> 601#4017100000000000"]))
    assert not list(user_folder("state").iterdir())


@pytest.mark.skipif(os.name != "posix", reason="Windows has no modes of this kind")
def test_where_it_cannot_be_kept_the_failure_is_told_all_the_same(tmp_path: Path) -> None:
    kept = user_folder("state")
    kept.parent.mkdir(parents=True)
    kept.symlink_to(tmp_path / "elsewhere")
    with Bench(in_real_time=True) as bench:
        ran = bench.run("read 5FFF --force")
    assert (ran.code, "trace last" in ran.stderr) == (1, False)


def test_a_bugs_file_has_the_last_exchange() -> None:
    with Bench(in_real_time=True) as bench:
        bench.run("read 1017")

        def fails() -> None:
            raise ZeroDivisionError("a bug")

        ran = bench._ran(lambda: exit_code_of(bench.session, fails))
        assert ran.code == 70
        path = ran.stderr.partition("report it with ")[2].split()[0]
        assert "-> 601#4017100000000000" in Path(path).read_text("utf-8")


def test_an_error_at_the_prompt_names_it() -> None:
    with Bench(("gen4",), {"fault": ("refuse@3=0x06040041",)}) as bench:
        ran = bench.run("map tpdo1 606C 6041")
        assert ran.stderr.splitlines()[-1] == "  frames  dvtcli trace last", "nothing follows a line of its own"
    with Bench(("gen4",), {"fault": ("refuse@3=0x06040041",)}) as bench:
        bench.session.at_prompt = True
        assert "trace last" not in bench.run("map tpdo1 606C:x").stderr, "nothing was sent"
        ran = bench.run("map tpdo1 606C 6041")
        assert (ran.code, ran.stderr.splitlines()[-1]) == (1, "  frames  trace last")
        assert "object cannot be mapped" in bench.run("trace last --count 1000").stdout
        assert "trace last" in bench.run("read 5FFF").stderr
        assert bench.run("read 5FFF --json").document["message"].splitlines()[-1] == "  frames  trace last"
