"""Devices whose mapping count is read-only: entries are written, and fillers stand for those that are not used."""

from __future__ import annotations

from dataclasses import replace
from functools import lru_cache
from pathlib import Path

import pytest
from hypothesis import given
from hypothesis import strategies as st
from platformdirs import user_config_dir

from dvtcli.device.node import Node
from dvtcli.domain.object_dictionary import ObjectDictionary
from dvtcli.domain.pdo import Pdo, PdoMappingEntry
from dvtcli.domain.profile import GENERIC, DeviceProfile
from dvtcli.errors import DeviceRefused, RuleError
from dvtcli.files.eds.reader import read_eds
from dvtcli.simulator.device.family import Family
from dvtcli.simulator.device.strict_device import StrictDevice
from dvtcli.simulator.network.family_file import family_eds
from dvtcli.simulator.network.twin_bus import TwinBus
from tests.laws.bench import NODE, DirectBus, DirectSdo, FaultySdo, refuse
from tests.process import run

TPDO1 = Pdo.parse("tpdo1")
ENTRIES = tuple(PdoMappingEntry(index, 0, bits) for index, bits in ((0x6041, 16), (0x606C, 32), (0x6061, 8)))
#: a dummy of 8 bits, as a published file of such a controller has in its unused entries
DUMMY = 0x0005_0008


def text_of_eds(filler: int) -> str:
    """The generic device with a TPDO1 of eight entries that is always counted as eight."""
    head, rest = family_eds("generic").read_text("utf-8").split("[1A00sub0]", 1)
    mapping, tail = rest.split("[1A01]", 1)
    mapping = mapping.replace("AccessType=rw", "AccessType=ro", 1).replace("DefaultValue=0x01", "DefaultValue=0x08", 1)
    mapping = mapping.replace("DefaultValue=0x00000000", f"DefaultValue=0x{filler:08X}")
    return f"{head}[1A00sub0]{mapping}[1A01]{tail}"


@lru_cache
def described(folder: Path, filler: int) -> ObjectDictionary:
    path = folder / f"fixed-{filler:X}.eds"
    path.write_text(text_of_eds(filler), "utf-8")
    return read_eds(path).dictionary


@pytest.fixture(scope="module")
def folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    return tmp_path_factory.mktemp("fixed")


def profile(filler: int) -> DeviceProfile:
    return replace(GENERIC, filler=filler)


def device(folder: Path, filler: int) -> StrictDevice:
    made = StrictDevice(described(folder, filler), Family(filler=filler), NODE)
    made.boot_up()
    made.take_outbox()
    return made


def words(bus: DirectBus) -> list[int]:
    return [int.from_bytes(bus.sdo(NODE).upload(0x1A00, sub), "little") for sub in range(9)]


@pytest.mark.parametrize("filler", [0, DUMMY])
def test_what_is_mapped_reads_back_and_the_rest_is_filled(folder: Path, filler: int) -> None:
    bus = DirectBus.of(device(folder, filler))
    node = Node(bus, NODE, described(folder, filler), profile(filler))
    before = node.pdo(TPDO1)
    assert before.mapping == ENTRIES[:1], "fillers are no entries"
    node.configure({TPDO1: replace(before, mapping=ENTRIES)})
    assert words(bus) == [8, *(entry.raw for entry in ENTRIES), *[filler] * 5]
    assert node.pdo(TPDO1).mapping == ENTRIES
    node.configure({TPDO1: replace(node.pdo(TPDO1), mapping=ENTRIES[1:])})
    assert words(bus) == [8, *(entry.raw for entry in ENTRIES[1:]), *[filler] * 6]
    node.undo()
    node.undo()
    assert node.pdo(TPDO1) == before
    assert isinstance(bus.channel, DirectSdo)
    assert not [write for write in bus.channel.writes if write[:2] == (0x1A00, 0)], "the count is never written"


@given(
    wanted=st.lists(st.sampled_from(ENTRIES), min_size=1, max_size=3, unique=True),
    refused=st.integers(1, 20),
)
def test_a_refused_write_anywhere_leaves_the_old_entries(
    wanted: list[PdoMappingEntry], refused: int, tmp_path_factory: pytest.TempPathFactory
) -> None:
    folder = tmp_path_factory.getbasetemp()
    made = device(folder, DUMMY)
    bus = DirectBus(made, FaultySdo(DirectSdo(made), refuse, refused))
    node = Node(bus, NODE, described(folder, DUMMY), profile(DUMMY))
    before, raw = node.pdo(TPDO1), words(bus)
    try:
        node.configure({TPDO1: replace(before, mapping=tuple(wanted))})
    except DeviceRefused:
        assert words(bus) == raw
        assert node.pdo(TPDO1) == before
    else:
        assert node.pdo(TPDO1).mapping == tuple(wanted)


def test_without_the_profile_the_mapping_is_static(folder: Path) -> None:
    bus = DirectBus.of(device(folder, 0))
    node = Node(bus, NODE, described(folder, 0), GENERIC)
    with pytest.raises(RuleError, match="static"):
        node.configure({TPDO1: replace(node.pdo(TPDO1), mapping=ENTRIES)})


def test_a_twin_takes_entries_and_the_device_keeps_its_own(folder: Path) -> None:
    bus = DirectBus.of(device(folder, DUMMY))
    family = Family(filler=DUMMY)
    twin = TwinBus(
        bus, lambda node_id, backing: StrictDevice(described(folder, DUMMY), family, node_id, backing=backing)
    )
    try:
        node = Node(twin, NODE, described(folder, DUMMY), profile(DUMMY))
        node.configure({TPDO1: replace(node.pdo(TPDO1), mapping=ENTRIES)})
        assert node.pdo(TPDO1).mapping == ENTRIES
        assert isinstance(bus.channel, DirectSdo)
        assert bus.channel.writes == []
    finally:
        twin.close()


def test_a_users_profile_makes_such_a_device_mappable(tmp_path: Path) -> None:
    eds, own = tmp_path / "fixed.eds", Path(user_config_dir("dvtcli")) / "profiles" / "mine.toml"
    eds.write_text(text_of_eds(0), "utf-8")
    own.parent.mkdir(parents=True)
    own.write_text('name = "mine"  # ours\ntitle = "Fixed count"  # ours\nfiller = 0  # ours\n', "utf-8")

    def mapped(*words: str) -> int:
        words = ("--sim", str(eds), *words, "map", "tpdo1", "6041", "606C")
        return run(words).returncode

    assert [mapped("-p", "mine"), mapped("-p", "mine", "--dry-run"), mapped()] == [0, 0, 1]
