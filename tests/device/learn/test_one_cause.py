"""What a refusal proves: one cause alone, and never what another one explains; drawn devices and their own rules."""

from __future__ import annotations

from pathlib import Path

import pytest
from hypothesis import HealthCheck, Phase, example, given, settings
from hypothesis import strategies as st

from dvtcli.domain.object_dictionary import Access
from dvtcli.domain.pdo import Direction
from dvtcli.files.eds.reader import read_eds
from dvtcli.simulator.device.family import Family
from dvtcli.simulator.device.memory import Refusal
from dvtcli.simulator.device.strict_device import StrictDevice
from dvtcli.simulator.network.family_file import load_family
from tests.cli.commands.bench import Bench, Ran
from tests.device.learn.virtual import VirtualWire
from tests.harness.sample import heavy
from tests.small_eds import Eds, plain, var

#: data types by length in bits, of more than one kind where there is one
KINDS = {1: (0x01,), 8: (0x05, 0x02), 16: (0x06, 0x03), 32: (0x07, 0x04, 0x08), 64: (0x1B, 0x15, 0x11)}
SENDS, TAKES = (Access.RO, Access.RW, Access.RWR), (Access.RW, Access.RWW, Access.WO)


def described(objects: list[tuple[str, int]]) -> Eds:
    """A plain device whose mappable objects are *objects* only, access and data type of each, from 0x2000."""
    eds = plain()
    for index in list(eds.objects):
        if index >= 0x2000:
            del eds.objects[index]
    for number, (access, kind) in enumerate(objects):
        eds.variable(0x2000 + number, var(f"Object {number}", kind, 0, access, 1))
    return eds


def learnt(folder: Path, eds: Eds, family: Family) -> Ran:
    path = folder / "drawn.eds"
    path.write_text(eds.text())
    device = StrictDevice(read_eds(path).dictionary, family, 1)
    with VirtualWire(device).bench({"eds": str(path)}) as bench:
        return bench.run("learn --yes --json")


def values(ran: Ran, where: str = "profile") -> dict[str, object]:
    return {value["key"]: value["value"] for value in ran.document[where]}


@heavy
def test_a_boolean_that_a_granularity_of_8_keeps_out_says_nothing_of_its_access(tmp_path: Path) -> None:
    eds = described([("rw", 0x01), ("ro", 0x05), ("rw", 0x05), ("ro", 0x07)])
    ran = learnt(tmp_path, eds, load_family("generic")._replace(granularity=8))
    assert ran.code == 0, ran
    assert (values(ran)["rw_in_tpdo"], values(ran)["rw_in_rpdo"]) == ("fine", "fine")
    assert "rw" in values(ran, "family")["tpdo_access"]  # type: ignore[operator]
    path = tmp_path / "drawn.eds"
    with Bench((str(path),), {"eds": str(path)}) as bench:
        assert bench.run("learn --yes --save right").code == 0
        assert bench.run("map tpdo1 2002:0/8").code == 0


@pytest.mark.parametrize("direction", list(Direction))
def test_an_access_that_is_refused_with_every_length_is_learnt(direction: Direction, tmp_path: Path) -> None:
    own, family = ("ro", "rw"), load_family("generic")._replace(tpdo_access=frozenset({Access.RO}))
    if direction is Direction.RPDO:
        own, family = ("rww", "rw"), load_family("generic")._replace(rpdo_access=frozenset({Access.RWW}))
    ran = learnt(tmp_path, described([(access, kind) for kind in (0x05, 0x07) for access in own]), family)
    assert values(ran)[f"rw_in_{direction}"] == "error"


def test_objects_that_are_refused_for_their_access_are_not_too_long(tmp_path: Path) -> None:
    """Only rw objects have 32 bits, and the device sends none that is rw."""
    eds = described([("ro", 0x05), ("ro", 0x06), ("rw", 0x07)])
    ran = learnt(tmp_path, eds, load_family("generic")._replace(tpdo_access=frozenset({Access.RO})))
    assert values(ran).get("max_entry_bits") in (None, 32), ran


class Moody(StrictDevice):
    """Refuses an entry with *index* twice, then takes it: as while it was busy."""

    index, left = 0x2002, 2

    def download(self, index: int, sub_index: int, data: bytes) -> None:
        if (index & 0xFE00) == 0x1A00 and sub_index and data[2:] == self.index.to_bytes(2, "little") and self.left:
            self.left -= 1
            raise Refusal(0x0604_0041)
        super().download(index, sub_index, data)


def test_what_contradicts_another_answer_is_asked_again(tmp_path: Path) -> None:
    eds = described([("ro", 0x05), ("rw", 0x05), ("rw", 0x06)])
    path = tmp_path / "drawn.eds"
    path.write_text(eds.text())
    device = Moody(read_eds(path).dictionary, load_family("generic"), 1)
    device.index = 0x2001
    with VirtualWire(device).bench({"eds": str(path)}) as bench:
        ran = bench.run("learn --yes --json")
    assert ran.code == 0, ran
    asked = {probe["name"]: probe["abort"] for probe in ran.document["probes"] if str(probe["pdo"])[0] == "t"}
    assert (asked["access rw"], asked["access rw, again"], device.left) == ("0x06040041", None, 0)
    assert values(ran)["rw_in_tpdo"] == "fine"


objects = st.lists(
    st.tuples(st.sampled_from([*SENDS, *TAKES]), st.sampled_from([kind for kinds in KINDS.values() for kind in kinds])),
    min_size=1, max_size=8,
)  # fmt: skip
accesses = st.sets(st.sampled_from([Access.RO, Access.RW, Access.RWR, Access.CONST]), min_size=1)
taking = st.sets(st.sampled_from([Access.RW, Access.RWW, Access.WO]), min_size=1)


@settings(
    deadline=None,
    max_examples=max(3, settings().max_examples // 4),
    suppress_health_check=[HealthCheck.function_scoped_fixture],
    phases=(Phase.explicit, Phase.generate),  # a device is small as it is drawn, and each takes a second to learn
)
@given(objects, accesses, taking, st.sampled_from([1, 8]), st.sampled_from([8, 16, 32, 64]))
@example(
    [(Access.RO, 0x03), (Access.RW, 0x02), (Access.RW, 0x15)], {Access.RO}, {Access.RW}, 1, 16
)  # fits differ by way
def test_nothing_is_learnt_that_is_not_so(
    tmp_path: Path, chosen: list[tuple[Access, int]], sends: set[Access], takes: set[Access], step: int, most: int
) -> None:
    family = load_family("generic")._replace(
        tpdo_access=frozenset(sends), rpdo_access=frozenset(takes), granularity=step, max_entry_bits=most
    )
    ran = learnt(tmp_path, described([(str(access), kind) for access, kind in chosen]), family)
    assert ran.code == 0, ran
    found, of_family = values(ran), values(ran, "family")
    for key, access, allowed in (
        ("rw_in_tpdo", Access.RW, sends), ("rww_in_tpdo", Access.RWW, sends), ("rw_in_rpdo", Access.RW, takes),
    ):  # fmt: skip
        assert found.get(key) in (None, "fine" if access in allowed else "error"), (key, found[key], ran.document)
    assert found.get("granularity") in (None, step)
    lengths = {length for length, kinds in KINDS.items() for _, kind in chosen if kind in kinds}
    told = found.get("max_entry_bits")
    assert told is None or (isinstance(told, int) and all(length <= told or length > most for length in lengths))
    for way, allowed in (("tpdo", sends), ("rpdo", takes)):
        listed = of_family.get(f"{way}_access")
        if isinstance(listed, list):
            assert {access for access, _ in chosen if str(access) in listed} == {a for a, _ in chosen if a in allowed}
