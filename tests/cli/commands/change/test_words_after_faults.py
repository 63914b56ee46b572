"""What is said after a fault of the node fits what was heard: a restart, a lost answer, silence."""

from __future__ import annotations

from pathlib import Path

import pytest

from dvtcli.simulator.device.strict_device import StrictDevice
from tests.cli.commands.bench import Bench, beside, impatient
from tests.cli.commands.bus import device
from tests.harness.sample import heavy

MAP = "map tpdo1 6041 606C"


def sim(*faults: str) -> Bench:
    return Bench(("gen4",), {"fault": faults, "yes": True, "timeout": 0.2})


@pytest.mark.parametrize("number", [1, 3, 6])
def test_a_node_that_restarts_in_a_change_is_not_called_silent(number: int) -> None:
    with sim(f"reset@{number}") as bench:
        ran = bench.run(MAP)
    assert ran.code == 5
    assert "why     it restarted during the check: its boot-up message was received" in ran.stderr
    assert "hint    check its supply, then try again" in ran.stderr
    assert "check that the bit rate" not in ran.stderr
    assert "rolled back" in ran.stderr


def test_a_node_that_restarts_soon_after_it_came_up_is_not_taken_for_two() -> None:
    with sim("reset@1") as bench:
        ran = bench.run(MAP)
    assert "two boot-ups" not in ran.stderr
    assert "two nodes" not in ran.stderr


def test_a_node_whose_answer_was_lost_is_not_called_silent() -> None:
    with sim("lose-response@3") as bench:
        ran = bench.run(MAP)
    assert ran.code == 5
    assert "why     it answers again: a request or answer was lost or late, or it restarted unnoticed" in ran.stderr
    assert "check that the bit rate" not in ran.stderr
    assert "--timeout" in ran.stderr


def test_a_node_that_restarts_instead_of_storing_is_not_told_to_store_what_is_lost() -> None:
    with Bench(("generic",), {"fault": ("reset@1",), "yes": True, "profile": impatient()}) as bench:
        ran = bench.run("store")
    assert ran.code == 5
    assert "it restarted instead: unstored values are lost; set them again, then `dvtcli --sim generic" in ran.stderr


@pytest.mark.parametrize("name", ["set.dvt", "set.txt"])
def test_what_shows_what_a_restart_took_from_a_script_runs_as_it_is(tmp_path: Path, name: str) -> None:
    file = tmp_path / name
    file.write_text("set rpdo1 --timer 50\nset tpdo1 --timer 9\n", "utf-8")
    with Bench(("generic",), {"fault": ("reset@2",), "yes": True, "timeout": 0.2}) as bench:
        ran = bench.run(f"run {file}")
        assert ran.code == 5
        assert "restarted: unstored values are lost (RPDO1); see `dvtcli " in ran.stderr
        command = ran.stderr.partition("; see `")[2].partition("`")[0].partition(" generic ")[2]
    with Bench(("generic",)) as anew:
        verifies = name.endswith(".dvt")
        assert command.split()[0] == ("verify" if verifies else "pdo")
        assert anew.run(command).code == (3 if verifies else 0)


@heavy
def test_a_node_that_stays_silent_in_the_roll_back_is_to_be_brought_back_first(tmp_path: Path) -> None:
    with sim("silent@3") as bench:
        ran = bench.run(MAP)
    assert ran.code == 7
    assert "hint    bring the node back first (power, wiring, `dvtcli --sim gen4 scan`)" in ran.stderr
    options = {"yes": True, "timeout": 0.2, "journal": str(tmp_path), "node": 1}
    with Bench((), options, beside([device("generic")], "silent@3")) as bench:
        ran = bench.run("map tpdo1 6064")
    assert ran.code == 7
    assert "bring the node back first (power, wiring, `dvtcli " in ran.stderr
    assert " scan`); then `dvtcli " in ran.stderr
    assert " recover` finishes it, with the journal " in ran.stderr


def test_a_bus_that_failed_is_to_be_brought_back_first() -> None:
    with sim("bus-error@3") as bench:
        ran = bench.run(MAP)
    assert ran.code == 7
    assert (
        "hint    restore the bus first (`dvtcli --sim gen4 doctor` checks it); then check it with `dvtcli --sim"
        in ran.stderr
    )


def test_answers_that_are_none_get_the_next_step() -> None:
    with sim("malformed@3") as bench:
        ran = bench.run(MAP)
    assert ran.code == 5
    assert "hint    there may be two nodes with one node-ID, or another SDO client; -vv shows the frames" in ran.stderr


def running_master() -> StrictDevice:
    """A gen4 that is the master: its state is an object, so that leaving the gate is a download of its own."""
    master = device("gen4")
    master.set_value(0x5800, 0, b"\x01")
    return master


@pytest.mark.parametrize(
    ("line", "number", "said"),
    [
        ("store", 4, "0x1010:01 acknowledged the store"),
        ("set tpdo1 --timer 40", 4, "TPDO1 was written and verified"),
    ],
)
def test_a_node_that_vanishes_once_it_has_acknowledged_is_said_to_have_done_so(
    line: str, number: int, said: str, tmp_path: Path
) -> None:
    options = {"yes": True, "timeout": 0.2, "journal": str(tmp_path), "node": 1}
    with Bench((), options, beside([running_master()], f"silent@{number}")) as bench:
        assert bench.script("write 2800 0").code == 0
        ran = bench.script(line)
    assert ran.code == 5
    assert f"state   unknown: {said} before that; it was not seen to be OPERATIONAL again" in ran.stderr
    assert "node 1 was OPERATIONAL, but does not answer now" in ran.stderr
    assert "nothing was written" not in ran.stderr
