"""`read A B …`, and `read … --every --for`: several objects once, or again and again."""

from __future__ import annotations

import csv
from collections.abc import Iterator
from pathlib import Path

import pytest

from dvtcli.operations.session.simulated_nodes import simulated_device, simulated_nodes
from tests.bus.devices import device
from tests.cli.commands.bench import Bench
from tests.virtual_time import VirtualTimeBus


@pytest.fixture
def bench() -> Iterator[Bench]:
    bus = VirtualTimeBus([device(1), device(3)])
    with Bench((), {"node": 1, "profile": "generic"}, bus) as made:
        yield made


def test_several_objects_of_several_nodes(bench: Bench) -> None:
    ran = bench.run("read 1000 3:1017")
    assert (ran.code, len(ran.stdout.splitlines())) == (0, 2)
    assert ran.stdout.startswith("node 1  0x1000:00")
    assert "node 3  0x1017:00" in ran.stdout
    document = bench.run("read 1000 3:1017 --json").document
    assert document["schema"] == "dvtcli.values/1"
    assert [(one["node"], one["object"]) for one in document["values"]] == [(1, "1000:00"), (3, "1017:00")]


def test_one_object_answers_as_ever(bench: Bench) -> None:
    assert bench.run("read 1017 --json").document["schema"] == "dvtcli.value/1"
    assert not bench.run("read 1000 1017").stdout.startswith("node")


def test_again_and_again(bench: Bench) -> None:
    """In virtual time: a moment each 100 ms, both ends included, and what was seen of it."""
    bus = bench.session.open_network().bus
    assert isinstance(bus, VirtualTimeBus)
    numbers = iter(range(1, 100))
    bus.tap(lambda frame, ours: bus.nodes[0].device.set_value(0x1017, 0, next(numbers).to_bytes(2, "little"))
            if ours and frame.data[:3] == b"\x40\x00\x10" else None)  # fmt: skip
    ran = bench.run("read 1000 1017 3:1017 --every 100ms --for 500ms")
    lines = ran.stdout.splitlines()
    times = [line.split(" s ")[0].strip() for line in lines[:6]]
    assert (ran.code, times) == (0, ["0.000", "0.100", "0.200", "0.300", "0.400", "0.500"])
    assert "  1:1017:00 3 " in lines[2]
    row = next(line.split() for line in lines[7:] if line.split()[:2] == ["1", "1017:00"])
    assert "6x" in row
    assert row[-1] == "▁▂▄▅▇█"
    documents = bench.run("read 1017 --every 100ms --for 200ms --json").documents
    assert [one["schema"] for one in documents] == ["dvtcli.values/1"] * 3 + ["dvtcli.watched-values/1"]
    assert documents[-1]["objects"][0]["samples"] == 3


def test_into_a_csv_file(bench: Bench, tmp_path: Path) -> None:
    file = tmp_path / "run.csv"
    assert bench.run(f"read 1000 3:1017 --every 1s --for 2s -o {file}").code == 0
    rows = list(csv.reader(file.read_text("utf-8").splitlines()))
    assert rows[0] == ["time_s", "1:1000:00", "3:1017:00 [ms]"]
    assert [row[0] for row in rows[1:]] == ["0.000", "1.000", "2.000"]
    assert {row[2] for row in rows[1:]} == {"500"}
    assert bench.run(f"read 1000 --every 1s --for 2s -o {file}").code == 6
    assert bench.run(f"read 1000 --every 1s --for 2s -o {tmp_path / 'run.txt'}").code == 2


def test_what_cannot_be_read_ends_it(bench: Bench) -> None:
    assert bench.run("read 1000 7FFF").code == 1
    assert bench.run("read 1000 7FFF --every 1s --for 2s").code == 1


def test_of_each_node_that_is_named() -> None:
    """With -n 1,3 a word without a node is meant of both, at each moment; one with a node of that."""
    with Bench((), {"node": (1, 3), "profile": "generic"}, VirtualTimeBus([device(1), device(3)])) as bench:
        documents = bench.run("read 1017 --every 1s --for 1s --json").documents
        assert [[one["node"] for one in each["values"]] for each in documents[:-1]] == [[1, 3], [1, 3]]
        assert [one["node"] for one in bench.run("read 1017 1000 --json").documents[0]["values"]] == [1, 1]
        mixed = bench.run("read 1017 3:1000 --json").document["values"]
        assert [(one["node"], one["object"]) for one in mixed] == [(1, "1017:00"), (3, "1017:00"), (3, "1000:00")]


@pytest.mark.parametrize("words", ["velocity actual value", "1017 velocity actual value", "Velocity actual value 1017"])
def test_a_name_without_its_quotes_is_said(words: str) -> None:
    with Bench(("gen4@1",)) as bench:
        ran = bench.run(f"read {words}")
        assert ran.code == 2
        assert "is one name; write" in ran.stderr
        assert bench.run("read 1000 nonsense").code == 2
        assert bench.run("read 1017 'velocity actual value'").code == 0


def test_so_is_one_that_only_the_nodes_profile_has() -> None:
    bus = VirtualTimeBus([simulated_device(one) for one in simulated_nodes(["gen4@1"])], simulated=False)
    with Bench((), {"sim": (), "node": 1}, bus) as bench:
        assert "is one name; write torque_actual" in bench.run("read 1017 torque actual").stderr
        assert "is one name" not in bench.run("read 1000 nonsense").stderr


@pytest.mark.parametrize("line", ["read 1000 1017 -o x.bin", "read 1000 --for 2s", "read", "read 1000 --every 0"])
def test_words_that_do_not_fit(bench: Bench, line: str) -> None:
    assert bench.run(line).code == 2
