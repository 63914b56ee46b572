"""`--signal` and the plant: objects of in-process simulated nodes that move, in real time."""

from __future__ import annotations

import time
from pathlib import Path

import pytest

from tests.cli.commands.bench import Bench, Ran
from tests.harness.sample import heavy


def run(line: str, *signals: str, sim: tuple[str, ...] = ("gen4",), node: int | None = None) -> Ran:
    with Bench(sim=sim, options={"signal": signals, "node": node}) as bench:
        return bench.run(line)


def value(bench: Bench, place: str) -> int:
    ran = bench.run(f"read {place}")
    assert ran.code == 0, ran.stderr
    return int(ran.stdout.split(" = ")[1].split()[0])


def test_a_constant_is_what_a_read_finds() -> None:
    assert "= 77 " in run("read 606C", "606C=const(77)").stdout


def test_a_signal_names_its_node() -> None:
    sim = ("gen4", "generic@9")
    assert "= 77 " in run("read 606C", "9:606C=const(77)", sim=sim, node=9).stdout
    assert "= -1500 " in run("read 606C", "9:606C=const(77)", sim=sim, node=1).stdout


def test_what_moves_is_read_anew() -> None:
    with Bench(sim=("generic",), options={"signal": ("6401:1=ramp(0,30000,60s)",)}) as bench:
        first, until = value(bench, "6401:1"), time.monotonic() + 60
        while value(bench, "6401:1") <= first:
            assert time.monotonic() < until


@heavy
def test_a_target_velocity_moves_the_actual_one() -> None:
    with Bench(sim=("generic",)) as bench:
        assert value(bench, "606C") == value(bench, "606C") == -1500
        assert bench.run("write 60FF 500").code == 0
        for controlword in (6, 7, 15):
            assert bench.run(f"write 6040 {controlword}").code == 0
        until = time.monotonic() + 60
        while value(bench, "606C") != 500:
            assert time.monotonic() < until
        position = value(bench, "6064")
        while value(bench, "6064") == position:
            assert time.monotonic() < until


def test_pdos_are_configured_beside_a_signal() -> None:
    signals = ("606C=sine(1500,500ms)", "6041=walk(5,0,100,20ms)")
    with Bench(sim=("gen4",), options={"signal": signals}) as bench:
        assert bench.run("map tpdo1 606C 6041 --type 255 --inhibit 10").code == 0
        assert bench.run("undo").code == 0


@pytest.mark.parametrize(
    ("signal", "says"),
    [
        ("606C=tan(1)", "sine(AMPLITUDE,PERIOD)"),
        ("606C=sine(1)", "write sine(AMPLITUDE,PERIOD)"),
        ("606C=sine(1,x)", "not a period"),
        ("5FFF=const(1)", "no object 5FFF:00 that holds a number"),
        ("1008=const(1)", "no object 1008:00 that holds a number"),
        ("1800:2=const(1)", "1800:02"),
        ("7:606C=const(1)", "no simulated node 7"),
        ("606C=csv(/nowhere/log.csv,1)", "/nowhere/log.csv: No such file"),
    ],
)
def test_wrong_signals(signal: str, says: str) -> None:
    ran = run("read 6041", signal)
    assert ran.code == 2
    assert "--signal" in ran.stderr
    assert says in ran.stderr


def test_two_signals_for_one_object() -> None:
    ran = run("read 6041", "606C=const(1)", "1:606C:0=const(2)")
    ran.failed(2, "already")


def test_without_a_simulated_node() -> None:
    options = {"signal": ("606C=const(1)",), "interface": "virtual", "channel": "x", "node": 1}
    with Bench(sim=(), options=options) as bench:
        ran = bench.run("read 606C")
    ran.failed(2, "--signal: only simulated nodes have signals")


def test_a_wrong_row_is_named(tmp_path: Path) -> None:
    path = tmp_path / "log.csv"
    path.write_text("time,speed\n0,1\n1,fast\n")
    ran = run("read 606C", f"606C=csv({path},speed)")
    assert ran.code == 4
    assert f"{path}:3" in ran.stderr
