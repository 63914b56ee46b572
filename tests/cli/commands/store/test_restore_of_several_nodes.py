"""`restore` of several nodes: all are checked before the first, and it is said which took it and which did not."""

from __future__ import annotations

import pytest

from tests.cli.commands.bench import Bench, beside
from tests.cli.commands.bus import device

OPTIONS = {"node": (1, 2, 3), "eds": "generic", "yes": True}


def test_each_node_gets_its_defaults_back() -> None:
    with Bench((), OPTIONS, beside([device("generic", n) for n in (1, 2, 3)])) as bench:
        for node_id in (1, 2, 3):
            assert bench.run(f"write {node_id}:1017 700").code == 0
        ran = bench.run("restore --prove")
        assert ran.code == 0, ran
        for node_id in (1, 2, 3):
            assert bench.session.node(node_id).sdo.upload(0x1017, 0) == (500).to_bytes(2, "little")


def test_no_node_is_restored_where_one_cannot() -> None:
    devices = [device("generic", 1), device("generic", 2)]
    with Bench((), {**OPTIONS, "node": (1, 2, 3)}, beside(devices)) as bench:
        ran = bench.run("restore")
    assert (ran.code, "0x1011" in ran.stdout) == (5, False), ran


@pytest.mark.parametrize("group", ["communication", "application", "1"])
def test_a_group_of_each(group: str) -> None:
    with Bench((), OPTIONS, beside([device("generic", n) for n in (1, 2, 3)])) as bench:
        ran = bench.run(f"restore {group}")
    assert (ran.code, ran.stdout.count("acknowledged")) == (0, 3), ran


def test_who_refused_is_named() -> None:
    bus = beside([device("generic", n) for n in (1, 2, 3)], "2:refuse@1=0x08000020")
    with Bench((), OPTIONS, bus) as bench:
        ran = bench.run("restore")
    assert (ran.code, "nodes 1 and 3 restored the defaults, and node 2 did not" in " ".join(ran.stderr.split())) == (
        7,
        True,
    )
    assert "-n 2 restore" in ran.stderr


@pytest.mark.parametrize("words", ["restore", "restore --prove"])
@pytest.mark.parametrize("fault", ["silent@1", "lose-response@1"])
def test_a_lost_answer_leaves_it_unknown_who_restored(fault: str, words: str) -> None:
    with Bench((), OPTIONS, beside([device("generic", n) for n in (1, 2, 3)], f"2:{fault}")) as bench:
        ran = bench.run(words)
    said = " ".join(ran.stderr.split())
    assert (ran.code, "-n 2 restore" in said) == (7, True), ran
    assert "nodes 1 and 3 restored the defaults, and whether node 2 restored them is not known" in said


def test_a_node_without_its_defaults_is_not_among_those_that_restored() -> None:
    with Bench((), OPTIONS, beside([device("generic", n) for n in (1, 2, 3)], "2:restores-nothing")) as bench:
        for node_id in (1, 2, 3):
            assert bench.run(f"write {node_id}:1017 700").code == 0
        assert bench.run("store").code == 0
        ran = bench.run("restore --prove")
    said = " ".join(ran.stderr.split())
    assert (ran.code, "-n 2 restore" in said) == (7, True), ran
    assert "nodes 1 and 3 restored the defaults, and node 2 may not have the defaults (not proved)" in said


def test_no_node_is_restored_before_a_later_one_is_refused() -> None:
    with Bench(("generic@1", "gen4-locked@2"), {"node": (1, 2), "yes": True}) as bench:
        ran = bench.run("restore")
        assert (ran.code, "-n 2 login" in " ".join(ran.stderr.split()), ran.stdout) == (1, True, ""), ran
        assert "the access level is too low" in ran.stderr


def test_no_node_is_restored_before_a_later_one_that_obeys_no_reset() -> None:
    master = device("gen4", 2)
    assert master.family.master_object is not None
    master.set_value(*master.family.master_object, b"\1")
    with Bench((), {"node": (1, 2), "yes": True}, beside([device("generic", 1), master])) as bench:
        ran = bench.run("restore --prove")
        assert (ran.code, ran.stdout) == (1, ""), ran
        assert "node 2 ignores the NMT reset" in ran.stderr
