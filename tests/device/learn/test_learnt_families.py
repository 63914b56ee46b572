"""Learn a simulated device: the family that is written answers every question as the device did, which is unchanged."""

from __future__ import annotations

from pathlib import Path

import pytest

from dvtcli.domain.object_dictionary import ObjectDictionary
from dvtcli.files.eds.reader import read_eds
from dvtcli.simulator.device.family import Family
from dvtcli.simulator.device.strict_device import StrictDevice
from dvtcli.simulator.network.family_file import family_eds, load_family, load_family_folder
from tests.cli.commands.bench import Bench
from tests.device.learn.cells import some
from tests.device.learn.questions import put, questions
from tests.device.learn.virtual import own

FAMILIES = ("canopennode", "espac", "gen4", "generic", "lely", "roboteq", "tmcm")
#: Objects in which a device tells how its last refusal came about: those are its own.
OF_THE_DEVICE = {(0x5310, 0)}


def dump(bench: Bench) -> dict[tuple[int, int], bytes]:
    """Every object that can be read."""
    node = bench.session.node()
    assert node.dictionary is not None
    held = {}
    for entry in node.dictionary.entries():
        if entry.access.readable and (entry.index, entry.sub_index) not in OF_THE_DEVICE:
            try:
                held[entry.index, entry.sub_index] = node.bus.sdo(node.node_id).upload(entry.index, entry.sub_index)
            except Exception as refused:  # noqa: BLE001 - that it is refused has to be so afterwards, too
                held[entry.index, entry.sub_index] = str(refused).encode()
    return held


def booted(eds: Path | ObjectDictionary, family: Family) -> StrictDevice:
    """A device of *family* that has just booted; an EDS that many are made of is read once by who makes them."""
    device = StrictDevice(read_eds(eds).dictionary if isinstance(eds, Path) else eds, family, 1)
    device.boot_up()
    return device


def differing(eds: Path, original: Family, learnt: Family) -> tuple[list[str], int]:
    """The questions that both answer differently, and how many were put."""
    dictionary = read_eds(eds).dictionary
    asked = questions(dictionary)
    found = []
    for question in asked:
        said, now = (put(booted(dictionary, family), question) for family in (original, learnt))
        if said != now:
            found.append(f"{question.name}: {said} became {now}")
    return found, len(asked)


def pytest_generate_tests(metafunc: pytest.Metafunc) -> None:
    some(metafunc, "name,by", [(name, by) for name in FAMILIES for by in ("its profile", "generic")])
    some(metafunc, "other", [name for name in FAMILIES if name != "generic"], 0.7)


@pytest.mark.counted
def test_what_is_learnt_answers_the_same(name: str, by: str) -> None:
    with own(name, {} if by == "its profile" else {"profile": by}) as bench:
        before = dump(bench)
        ran = bench.run("learn --isolated --yes --save pump")
        assert ran.code == 0, (ran.stdout, ran.stderr)
        assert dump(bench) == before
    found, asked = differing(family_eds(name), load_family(name), load_family_folder(Path("pump")))
    assert asked >= 60
    assert not found


@pytest.mark.counted
def test_the_questions_tell_families_apart(other: str) -> None:
    """A comparison that finds nothing proves something only where it would."""
    assert len(differing(family_eds(other), load_family(other), load_family("generic"))[0]) > 1
