"""`--fault`: things that go wrong with in-process simulated nodes, in real time."""

from __future__ import annotations

import pytest

from tests.cli.commands.bench import Bench, Ran

MAP = "map tpdo1 6401:1 606C --sync 1"


def run(line: str, *faults: str, sim: tuple[str, ...] = ("generic",)) -> tuple[Ran, Ran]:
    """What *line* did, and the PDOs afterwards."""
    with Bench(sim=sim, options={"fault": faults, "timeout": 0.1}) as bench:
        return bench.run(line), bench.run("pdo --json")


@pytest.mark.parametrize(
    ("fault", "code"),
    [
        ("refuse@4=0x06040041", 1),
        ("lose-request@4", 5),
        ("lose-response@4", 5),
        ("late@4=0.15", 5),
        ("malformed@4", 5),
        ("reset@4=0.3", 5),
        ("duplicate@4", 0),
        ("foreign@4", 0),
        ("toggle@4", 0),
    ],
)
def test_a_change_ends_old_or_new(fault: str, code: int) -> None:
    ran, after = run(MAP, fault)
    assert ran.code == code, ran.stderr
    mapping = [entry["object"] for entry in after.document["pdos"][0]["mapping"]]
    assert mapping == (["6041:00"] if code else ["6401:01", "606C:00"])


def test_the_step_that_was_named_is_the_one_that_fails() -> None:
    ran, _ = run(MAP, "refuse@4=0x06040041")
    assert "refused step 4 of" in ran.stderr


def test_a_dead_bus_ends_at_once() -> None:
    ran, after = run(MAP, "bus-error@4")
    assert ran.code == 7
    assert after.code == 5


def test_a_fault_of_another_node_leaves_the_first_alone() -> None:
    sim = ("generic", "generic@9")
    assert run(MAP, "9:refuse@1=0x08000000", sim=sim)[0].code == 0
    assert run(MAP.replace("tpdo1", "9:tpdo1"), "9:refuse@1=0x08000000", sim=sim)[0].code == 1


def test_stores() -> None:
    assert "0x06060000" in run("store", "store-fails")[0].stderr
    assert run("store", "slow-store=0.3")[0].code == 0


@pytest.mark.parametrize("fault", ["what@3", "refuse@3", "9:silent@1"])
def test_a_wrong_fault_is_a_usage_error(fault: str) -> None:
    ran, _ = run("pdo", fault)
    assert ran.code == 2
    assert fault in ran.stderr


@pytest.mark.parametrize(
    ("fault", "why"),
    [
        ("alters@1=9999:0:5", "the node has no object 9999:00"),
        ("enable-alters=9999:0:5", "the node has no object 9999:00"),
        ("alters@1=1801:4:5", "the node has no object 1801:04"),
        ("alters@1=1801:2:256", "1801:02 has 1 byte only"),
        ("9:alters@1=1801:5:65536", "1801:05 has 2 bytes only"),
    ],
)
def test_an_object_that_the_node_lacks_or_that_is_too_small_is_a_usage_error(fault: str, why: str) -> None:
    ran, _ = run("set tpdo1 --timer 100", fault, sim=("generic", "generic@9"))
    assert ran.code == 2
    assert why in ran.stderr


@pytest.mark.parametrize("line", ["set tpdo1 --timer 100", "write 1800:5 100", "map tpdo1 606C"])
@pytest.mark.parametrize("altered", ["1801:2:5", "1A01:1:0x60610008"])
def test_another_pdo_that_was_altered_beside_a_change_is_not_stored(line: str, altered: str) -> None:
    with Bench(sim=("generic",), options={"fault": (f"alters@1={altered}",)}) as bench:
        assert bench.run(line).code == 0
        ran = bench.run("store")
        assert ran.code == 6
        assert "TPDO2 differs from its verified value" in ran.stderr
        assert bench.run("store --force").code == 0


def test_faults_need_a_simulated_node_and_the_start() -> None:
    assert run("pdo", "silent@1", sim=())[0].code == 2
    with Bench(sim=("generic",)) as bench:
        assert bench.run("pdo --fault silent@1").code == 2
