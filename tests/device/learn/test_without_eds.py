"""A device that no file describes: `learn --save` writes an EDS of what it read, by which `--sim ./NAME` works."""

from __future__ import annotations

from pathlib import Path

import pytest

from dvtcli.files.eds.reader import read_eds
from dvtcli.simulator.device.family import Family
from dvtcli.simulator.device.strict_device import StrictDevice
from dvtcli.simulator.network.family_file import load_family, load_family_folder
from tests.bus.devices import unknown, unknown_dictionary
from tests.cli.commands.bench import Bench
from tests.cli.commands.bus import Wire
from tests.device.learn.cells import some
from tests.device.learn.questions import put, questions
from tests.device.learn.virtual import VirtualWire, own

pytestmark = pytest.mark.drawn(4, "without eds")

FAMILIES = ("canopennode", "generic", "lely")
WORDS = "pdo --all", "read 1000", "read 1018:2", "read 1800:01", "read 1400:02", "read 1A00:01"


def shown(bench: Bench) -> list[str]:
    """What reading says, without the names that a file gives."""
    documents = [bench.run(f"{word} --json").document for word in WORDS]
    pdos = [(one["pdo"], one["cob_id"], one["enabled"], one["transmission_type"]) for one in documents[0]["pdos"]]
    return [str(pdos), *(str(document["raw"]) for document in documents[1:])]


def pytest_generate_tests(metafunc: pytest.Metafunc) -> None:
    some(metafunc, "name", FAMILIES, 0.25)


@pytest.mark.counted
def test_what_is_learnt_without_a_file_answers_the_same(name: str) -> None:
    wire = VirtualWire(unknown(1, name))
    with wire.bench({"profile": "generic"}) as bench:
        before = shown(bench)
        ran = bench.run("learn --isolated --yes --save pump")
        assert (ran.code, "pump.eds" in ran.stdout) == (0, True), ran
        assert "no EDS of node 1 is known" in ran.stderr
        assert shown(bench) == before
    eds = Path("pump/pump.eds")
    with Bench(("./pump",)) as bench:
        assert shown(bench) == before
        checked = bench.run(f"eds check {eds} --json").document
    assert checked["count"]["error"] == 0, checked
    asked = [one for one in questions(read_eds(eds).dictionary) if not by_access(one.name)]
    assert len(asked) >= 60
    learnt, differing = load_family_folder(Path("pump")), []
    for question in asked:
        said, now = put(booted(unknown(1, name)), question), put(device_of(eds, learnt), question)
        if said != now:
            differing.append(f"{question.name}: {said} became {now}")
    assert not differing


def by_access(name: str) -> bool:
    """Whether a question is about an object whose access says that it goes the other way: only a file tells that."""
    return "a mappable" in name or (name.startswith("RPDO") and name.endswith(("10180120", "10000020")))


def device_of(eds: Path, family: Family) -> StrictDevice:
    """A device that has just booted."""
    return booted(StrictDevice(read_eds(eds).dictionary, family, 1))


def booted(made: StrictDevice) -> StrictDevice:
    made.boot_up()
    return made


def test_its_cob_ids_follow_the_node_id() -> None:
    node = unknown(5)
    wire = VirtualWire(node)
    with wire.bench({"node": 5}) as bench:
        assert bench.run("learn --yes --save pump").code == 0
    dictionary = read_eds(Path("pump/pump.eds")).dictionary
    for index, node_id, wanted in ((0x1800, 5, 0x185), (0x1800, 9, 0x189), (0x1401, 9, 0x309), (0x1014, 9, 0x89)):
        entry = dictionary.entry(index, 0 if index == 0x1014 else 1)
        assert entry is not None
        assert int.from_bytes(entry.initial(node_id) or b"", "little") & 0x7FF == wanted


@pytest.mark.parametrize(("rate", "kbit"), [(None, ()), (250_000, (250,))])
def test_the_bit_rate_that_is_known_is_in_it(rate: int | None, kbit: tuple[int, ...]) -> None:
    options = {} if rate is None else {"bitrate": rate}
    with Wire(unknown(1, "canopennode")) as wire, Bench((), wire.options | options) as bench:
        ran = bench.run("learn --yes --save pump")
    assert ran.code == 0, ran
    assert read_eds(Path("pump/pump.eds")).dictionary.info.bit_rates_kbit == kbit
    assert ("nobody said the bus's bit rate" in ran.stderr) is (rate is None)


@pytest.mark.parametrize("both", [False, True], ids=["refused", "taken"])
def test_an_object_of_the_other_direction_is_asked_for(both: bool) -> None:
    """Where it is taken it may be mapped both ways, and the EDS says so; else its refusal is the simulated one's."""
    family = load_family("generic")
    if both:
        every = family.tpdo_access | family.rpdo_access
        family = family._replace(tpdo_access=every, rpdo_access=every)
    node = StrictDevice(unknown_dictionary(), family, 1)
    wire = VirtualWire(node)
    with wire.bench({"profile": "generic"}) as bench:
        for line in ("map tpdo1 6041", "map rpdo1 6040"):
            assert bench.run(line).code == 0
        ran = bench.run("learn --yes --save pump --json")
        assert ran.code == 0, ran
    asked = [row for row in ran.document["probes"] if row["name"] == "object of the other direction"]
    assert {row["pdo"][:4]: row["accepted"] for row in asked} == {"tpdo": both, "rpdo": both}
    access = {index: read_eds(Path("pump/pump.eds")).dictionary.entry(index, 0).access for index in (0x6040, 0x6041)}
    assert (access[0x6041] is access[0x6040]) is both
    codes = {row["key"]: row["value"] for row in ran.document["family"] if "wrong-direction" in row["key"]}
    assert set(codes.values()) == (set() if both else {0x06040041})


@pytest.mark.parametrize(
    ("family", "said"), [("tmcm", "nodes with its identity use the last file"), ("canopennode", "-p pump")]
)
def test_who_uses_what_was_saved_is_told(family: str, said: str) -> None:
    with own(family) as bench:
        told = " ".join(bench.run("learn --save pump --yes").stdout.split())
    assert said in told
    assert ("with its identity" in told) == ("-p pump" not in told)
    with own(family, {"profile": "pump"} if "-p" in said else {}) as bench:
        assert bench.run("node --json").document["nodes"][0]["profile"] == "pump"
