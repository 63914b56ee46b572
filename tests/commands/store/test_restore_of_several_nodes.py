"""`restore` of several nodes: all are checked before the first, and it is said which took it and which did not."""

from __future__ import annotations

import pytest

from tests.commands.bench import Bench, beside
from tests.commands.bus import device

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
    assert (ran.code, "node 1, 3 restored its defaults, and node 2 did not" in " ".join(ran.stderr.split())) == (
        7,
        True,
    )
    assert "-n 2 restore" in ran.stderr
