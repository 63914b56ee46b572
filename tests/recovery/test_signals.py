"""Signals in the middle of a change, whoever still reads: the exit code says what the device holds then.

Real processes on a served node: dvtcli in a child, and canopen, which knows nothing of dvtcli, reads what it left.
"""

from __future__ import annotations

import itertools
import os
import random
import signal
import subprocess
import sys
import threading
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

import can
import canopen
import pytest

from tests import process
from tests.harness.sample import heavy
from tests.posix import SIGHUP
from tests.process import PATIENCE_S, environment
from tests.recovery.bench import MAP, STEPS, Bench
from tests.simulator.serve.served import wait_for

pytestmark = pytest.mark.skipif(os.name == "nt", reason="signals of POSIX")

CODES = {signal.SIGINT: 130, signal.SIGTERM: 143, SIGHUP: 129}
CLOSED = ((), ("stdout",), ("stderr",), ("stdout", "stderr"))
#: the state object of a Gen4, and what it says (the published Gen4 manual)
STATE, PRE_OPERATIONAL, OPERATIONAL = 0x5110, 0x7F, 0x05
#: the NMT command (CiA 301, 7.2.8.3.1.2)
RESET_NODE = 0x81
TCL = "catch {dvtcli " + " ".join(MAP) + "}\nputs never\ndvtcli pdo\n"
SCRIPT = "pdo -q\n" + " ".join(MAP) + "\nset tpdo2 --timer 70\n"


@contextmanager
def foreign(bench: Bench) -> Iterator[canopen.RemoteNode]:
    """The node as canopen sees it."""
    bus = can.Bus(interface="socketcand", host="127.0.0.1", port=bench.wire.port, channel="can0", ignore_config=True)
    network = canopen.Network(bus=bus)
    network.notifier = can.Notifier(bus, network.listeners, 0.1)
    try:
        node = network.add_node(canopen.RemoteNode(5, canopen.ObjectDictionary()))
        node.sdo.RESPONSE_TIMEOUT = PATIENCE_S
        yield node
    finally:
        network.notifier.stop()
        bus.shutdown()


def held(bench: Bench) -> dict[tuple[int, int], bytes]:
    """What the node holds of its first two TPDOs, and its NMT state."""
    with foreign(bench) as node:
        places = [(0x1800, 1), (0x1800, 2), (0x1801, 1), (0x1801, 5), (STATE, 0)]
        for index in (0x1A00, 0x1A01):
            places += [(index, sub) for sub in range(node.sdo.upload(index, 0)[0] + 1)]
        return {place: node.sdo.upload(*place) for place in places}


def start(bench: Bench) -> dict[tuple[int, int], bytes]:
    """The node in OPERATIONAL."""
    with foreign(bench) as node:
        node.nmt.state = "OPERATIONAL"
        assert node.sdo.upload(STATE, 0)[0] == OPERATIONAL
    return held(bench)


def stopped(
    bench: Bench, number: int, closed: tuple[str, ...], step: object, *words: str, times: int = 1
) -> tuple[int, str]:
    """Run dvtcli with *words*, whose SDO download *step* brings the signal *number*; its exit code and stderr.

    Instead of a number, `reset` is the NMT command that resets the node.
    """
    before, begun = bench.wire.downloads, threading.Event()

    def strike(at: int) -> None:
        begun.wait(PATIENCE_S)
        first = step if isinstance(step, int) else at - before
        if at == bench.wire.downloads and at - before in range(first, first + times):
            for name in closed if at - before == first else ():
                getattr(child, name).close()
            child.send_signal(number)

    if isinstance(step, int):
        bench.wire.at_download = strike
    else:
        bench.wire.at_nmt = lambda command: strike(bench.wire.downloads) if command == RESET_NODE else None
    child = process.start([*bench.words, "--yes", *words], pipes=True)
    begun.set()
    stderr = b"" if "stderr" in closed else child.stderr.read()
    child.wait(PATIENCE_S)
    child.stdout.close()
    child.stderr.close()
    bench.wire.at_download = bench.wire.at_nmt = lambda _number: None
    return child.returncode, stderr.decode()


def cases(count: int) -> list[tuple[int, tuple[str, ...], str, int]]:
    """*count* of all combinations, every signal, every closed pipe and every way in among the first ones."""
    everything = list(itertools.product(CODES, CLOSED, ("map", "script", "atomic", "tcl"), range(2, STEPS + 1)))
    random.Random(9).shuffle(everything)
    return everything[:count]


#: where a store that is proved is struck: where a value is changed to test the reset and put back, at the store's own
#: download, where that value is changed again, at the reset
STRUCK = (1, 2, 3, 4, "reset")


def store_cases(count: int) -> list[tuple[int, tuple[str, ...], str, object]]:
    """As `cases`, of stores."""
    everything: list[tuple[int, tuple[str, ...], str, object]] = [
        *itertools.product(CODES, CLOSED, ("store",), STRUCK[:1]),
        *itertools.product(CODES, CLOSED, ("prove",), STRUCK),
    ]
    random.Random(9).shuffle(everything)
    return everything[:count]


def pytest_generate_tests(metafunc: pytest.Metafunc) -> None:
    for name, made in (("case", cases), ("store_case", store_cases)):
        if name in metafunc.fixturenames:
            metafunc.parametrize(name, made(metafunc.config.getoption("--signals")), ids=str)


@pytest.mark.counted
def test_a_change_is_rolled_back_whoever_reads(
    bench: Bench, tmp_path: Path, case: tuple[int, tuple[str, ...], str, int]
) -> None:
    number, closed, way, step = case
    files = {"script": SCRIPT, "atomic": SCRIPT, "tcl": TCL}
    words = list(MAP)
    if way in files:
        script = tmp_path / f"x.{'tcl' if way == 'tcl' else 'dvt'}"
        script.write_text(files[way])
        words = ["run", str(script), *(["--atomic"] if way == "atomic" else [])]
    before = start(bench)
    code, stderr = stopped(bench, number, closed, step, *words)
    assert code == CODES[signal.Signals(number)], stderr
    assert held(bench) == before
    assert not bench.journals()
    if "stderr" not in closed:
        assert "Traceback" not in stderr
        assert "everything is as before" in stderr or "terminated" in stderr or "rolled back" in stderr


@pytest.mark.parametrize("closed", CLOSED)
def test_an_atomic_script_takes_the_lines_before_back(bench: Bench, tmp_path: Path, closed: tuple[str, ...]) -> None:
    script = tmp_path / "x.dvt"
    script.write_text(SCRIPT)
    before = start(bench)
    code, stderr = stopped(bench, signal.SIGTERM, closed, STEPS + 1, "run", str(script), "--atomic")
    assert code == 143, stderr
    assert held(bench) == before
    assert not bench.journals()


def test_another_script_keeps_them_and_says_so(bench: Bench, tmp_path: Path) -> None:
    script = tmp_path / "x.dvt"
    script.write_text(SCRIPT)
    before = start(bench)
    code, stderr = stopped(bench, signal.SIGINT, (), STEPS + 1, "run", str(script))
    assert code == 130, stderr
    assert f"the changes of {script}:2 stay" in stderr
    after = held(bench)
    assert after[0x1800, 1] == bytes.fromhex("01020000")
    assert after[0x1801, 5] == before[0x1801, 5]
    assert after[STATE, 0][0] == PRE_OPERATIONAL
    assert "was OPERATIONAL and is PRE-OPERATIONAL now" in stderr


@pytest.mark.parametrize("number", [signal.SIGINT, signal.SIGTERM])
@pytest.mark.parametrize("nested", [False, True])
def test_a_signal_between_two_lines_lets_no_further_one_run(
    bench: Bench, tmp_path: Path, number: signal.Signals, nested: bool
) -> None:
    """It comes while the node is asked to store, which is waited for: nothing of that line is left to be stopped."""
    script, inner = tmp_path / "x.dvt", tmp_path / "inner.dvt"
    first, last = "set tpdo2 --timer 70\nstore\n", f"export {tmp_path}/late.dcf\nset tpdo2 --timer 90\n"
    inner.write_text(first)
    script.write_text(f"run {inner}\n{last}" if nested else first + last)
    before = start(bench)
    code, stderr = stopped(bench, number, (), 2, "run", str(script))
    assert code == CODES[number], stderr
    assert bench.wire.downloads == 2, "the store was the last thing that was written"
    assert not (tmp_path / "late.dcf").exists(), "nor is anything read for a line that was not begun"
    file = inner if nested else script
    assert f"the changes of {file}:1, {file}:2 stay" in stderr
    after = held(bench)
    assert after[0x1801, 5] == (70).to_bytes(2, "little")
    assert {place for place in after if after[place] != before[place]} - {(STATE, 0)} == {(0x1801, 5)}
    assert not bench.journals()


def test_a_hang_up_that_comes_twice_insists_on_nothing(bench: Bench) -> None:
    before = start(bench)
    code, stderr = stopped(bench, SIGHUP, ("stdout", "stderr"), 4, *MAP, times=3)
    assert code == 129, stderr
    assert held(bench) == before
    assert not bench.journals()


@pytest.mark.parametrize("number", [signal.SIGINT, signal.SIGTERM])
@pytest.mark.parametrize("atomic", [False, True])
def test_whoever_insists_leaves_it_to_recover(
    bench: Bench, tmp_path: Path, number: signal.Signals, atomic: bool
) -> None:
    script = tmp_path / "x.dvt"
    script.write_text("set tpdo2 --timer 70\n" + " ".join(MAP))
    before = start(bench)
    step = 4 + atomic
    words = ["run", str(script), "--atomic"] if atomic else list(MAP)
    code, stderr = stopped(bench, number, (), step, *words, times=4)
    assert code == 7, stderr
    (journal,) = bench.journals()
    assert f"recover` finishes it, with the journal {journal}" in stderr
    assert held(bench) != before
    code, _, stderr = bench.run("recover", "--yes")
    assert code == 0, stderr
    with foreign(bench) as node:
        node.nmt.state = "OPERATIONAL"
    assert held(bench) == before


@pytest.mark.drawn(2)
@pytest.mark.parametrize("redirected", [">&-", "2>&-", ">&- 2>&-", "<&- >&- 2>&-"])
def test_missing_streams_are_no_fault(bench: Bench, redirected: str) -> None:
    words = " ".join(f"'{word}'" for word in [sys.executable, "-m", "dvtcli", *bench.words, *MAP])
    ran = subprocess.run(["/bin/sh", "-c", f"{words} {redirected}"], env=environment(), check=False)
    assert ran.returncode == 0
    assert held(bench)[0x1800, 1] == bytes.fromhex("01020000")
    assert not bench.journals()


@pytest.mark.drawn(4)
@pytest.mark.parametrize("closed", CLOSED[1:])
@pytest.mark.parametrize("options", [[], ["--json"], ["-vv"]])
def test_a_reader_that_leaves_changes_nothing_of_a_change(
    bench: Bench, closed: tuple[str, ...], options: list[str]
) -> None:
    code, stderr = stopped(bench, 0, closed, 3, *MAP, *options)
    assert code == 0, stderr
    assert held(bench)[0x1800, 1] == bytes.fromhex("01020000")
    code, stderr = stopped(bench, 0, closed, 1, "write", "1018:1", "5", *options)
    assert code == 1, stderr


def test_a_store_that_is_stopped_says_what_is_stored_and_changes_nothing_else(
    bench: Bench, store_case: tuple[int, tuple[str, ...], str, object]
) -> None:
    number, closed, way, step = store_case
    assert bench.run(*MAP)[0] == 0
    before, pdos = start(bench), bench.pdos()
    code, stderr = stopped(bench, number, closed, step, "store", *(["--prove"] if way == "prove" else []))
    assert code in (0, CODES[signal.Signals(number)]), stderr
    assert code or way == "store" or step == "reset", "what is not proved is no success; at the reset it comes too late"
    is_ahead = way == "prove" and step in (1, 2)
    assert bench.pdos() == pdos, "nor is anything left of the test of the reset"
    assert held(bench) == before
    assert not bench.journals()
    if "stderr" not in closed:
        assert "Traceback" not in stderr
        said = (
            "the signal was too late: the command is complete"
            if code == 0
            else "stopped"
            if is_ahead
            else "acknowledged the store, which is not proved"
        )
        assert said in stderr
    with bench.wire.at_work:
        bench.wire.device.restart()
        bench.wire.device.boot_up()
        bench.wire.device.take_outbox()
    assert (bench.pdos() == pdos) is not is_ahead, "it is stored, unless it was stopped ahead of that"


@heavy
@pytest.mark.parametrize("number", [signal.SIGINT, signal.SIGTERM])
def test_a_second_signal_before_the_answer_rolls_back_and_says_so(
    bench: Bench, tmp_path: Path, number: signal.Signals
) -> None:
    before, said = start(bench), tmp_path / "stderr"
    downloads = bench.wire.downloads

    def twice(at: int) -> None:
        if at == downloads + 4:
            child.send_signal(number)
            wait_for(lambda: "stopping at the next safe point" in said.read_text(), "its answer")
            child.send_signal(number)
            bench.wire.await_frame()  # it goes on without the answer, which it would take if it came now

    with bench.wire.at_work, said.open("wb") as stderr_file:
        child = subprocess.Popen(
            [sys.executable, "-m", "dvtcli", *bench.words, *MAP, "--yes"],
            stdin=subprocess.DEVNULL, stdout=subprocess.DEVNULL, stderr=stderr_file, env=environment(),
        )  # fmt: skip
        bench.wire.at_download = twice
    assert child.wait(PATIENCE_S) == CODES[number], said.read_text()
    stderr = said.read_text()
    assert "stopped at once, in step 4 of 8" in stderr
    assert "rolled back: everything is as before" in stderr
    assert held(bench) == before
    assert not bench.journals()
