"""`learn` leaves no trace, whatever a device refuses: a value that it would not take back is never replaced."""

from __future__ import annotations

from collections.abc import Mapping

import pytest

from dvtcli.domain.nmt import NmtCommand
from dvtcli.domain.pdo import Direction
from dvtcli.simulator.device.pdo_checks import CHECKS
from dvtcli.simulator.device.strict_device import StrictDevice
from dvtcli.simulator.network.family_file import load_family
from tests.device.learn.cells import some
from tests.device.learn.virtual import VirtualWire
from tests.harness.sample import heavy
from tests.laws.bench import dictionary

NO = 0x0602_0000
FAMILIES = ("canopennode", "generic", "lely")


def refusing(family: str, *checks: str) -> StrictDevice:
    """A device of *family* that refuses what *checks* are about, with a code of its own."""
    answers = {way: dict.fromkeys(checks, NO) for way in Direction}
    one = StrictDevice(dictionary(family), load_family(family)._replace(answers=answers), 1)
    one.boot_up()
    return one


def held(one: StrictDevice) -> Mapping[tuple[int, int], bytes]:
    """All that its PDOs' objects hold, also behind the counts."""
    indices = (index for index in one.dictionary if 0x1400 <= index < 0x1C00)
    return {(index, sub): one.value(index, sub) for index in indices for sub in one.dictionary[index].entries}


def pytest_generate_tests(metafunc: pytest.Metafunc) -> None:
    every = [(family, check) for family in FAMILIES for check in CHECKS]
    some(metafunc, "family,check", every, 2)


@heavy
@pytest.mark.parametrize("operational", [False, True], ids=["PRE-OPERATIONAL", "OPERATIONAL"])
def test_a_device_that_refuses_one_thing_is_as_it_was(family: str, check: str, operational: bool) -> None:
    one = refusing(family, check)
    if operational:
        one.nmt(NmtCommand.START)
    before = held(one)
    with VirtualWire(one).bench() as bench:
        ran = bench.run("learn --isolated --yes --json")
    assert held(one) == before, ran
    assert ran.code == 0, ran


@heavy
def test_entries_that_do_not_go_back_are_asked_of_a_pdo_whose_do() -> None:
    """Unused entries hold 0, which such a device does not take: a PDO that maps something is asked instead."""
    one = refusing("canopennode", "entry-zero")
    before = held(one)
    with VirtualWire(one).bench() as bench:
        consent = " ".join(bench.run("learn").stderr.split())
        ran = bench.run("learn --yes --json")
    assert "instead, off meanwhile, if an entry of 0 cannot be rolled back" in consent
    assert ran.code == 0, ran
    assert held(one) == before
    asked = ran.document["pdos"]
    assert all(before[0x1A00 if pdo[0] == "t" else 0x1600, 0] for pdo in asked)
    family_values = {value["key"]: value["value"] for value in ran.document["family"]}
    assert family_values[f"answers.{asked[0][:4]}.entry-zero"] == NO


def test_where_no_pdo_maps_anything_what_needs_no_mapping_is_learnt() -> None:
    one = refusing("generic", "entry-zero")
    for base in (0x1600, 0x1A00):
        for number in range(4):
            one.set_value(base + number, 0, b"\0")
            for entry in range(1, 9):
                if entry in one.dictionary[base + number].entries:
                    one.set_value(base + number, entry, bytes(4))
    for base in (0x1400, 0x1800):
        for number in range(4):
            cob_id = int.from_bytes(one.value(base + number, 1), "little") | 1 << 31
            one.set_value(base + number, 1, cob_id.to_bytes(4, "little"))
    before = held(one)
    with VirtualWire(one).bench() as bench:
        ran = bench.run("learn --isolated --yes --json")
    assert (ran.code, held(one)) == (0, before), ran
    keys = {value["key"] for value in ran.document["profile"]}
    assert "transmission_types" in keys
    assert "max_entries" not in keys
