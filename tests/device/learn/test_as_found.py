"""A learnt device stands for the one it was learnt of: it starts with what was found, and answers commands the same."""

from __future__ import annotations

from pathlib import Path

import pytest

from dvtcli.domain.pdo import Direction
from dvtcli.errors import InputFileError
from dvtcli.files.profiles import profile_names
from dvtcli.files.sim_state import Values
from dvtcli.operations.session.simulated_nodes import simulated_device, simulated_nodes
from dvtcli.simulator.device.pdo_checks import CHECKS
from dvtcli.simulator.device.strict_device import StrictDevice
from dvtcli.simulator.network.family_file import family_eds, load_family
from tests.cli.commands.bench import Bench, Ran
from tests.cli.commands.bus import device
from tests.device.learn.cells import some
from tests.device.learn.virtual import VirtualWire
from tests.laws.bench import dictionary
from tests.simulator.serve.served import served

FAMILIES = ("canopennode", "espac", "gen4", "generic", "lely", "roboteq", "tmcm")
#: The abort code of a check that is not answered as the family does: a value for parameter error that stays.
OTHERWISE = 0x0609_0030
#: What is done to a device before it is learnt, as far as it takes that.
BEFORE = ("clear tpdo2 --yes", "set tpdo1 --timer 77", "write 1017 250", "write 1016:1 0x00070190", "disable rpdo2")
#: Commands that read, change, are refused by rules and refused by the device, one after the other.
COMMANDS = (
    "pdo --json", "node --json", "read 1017 --json", "read 5FFE --json", "write 1017 0x12345 --json",
    "write 1000 1 --json", "map tpdo2 1001 --json", "map tpdo2 5FFE --json", "set tpdo1 --timer 12 --json",
    "set tpdo1 --type 245 --json", "set rpdo1 --type 252 --json", "set tpdo1 --inhibit 40000 --json",
    "set tpdo1 --cob-id 0x701 --json", "set tpdo1 --cob-id 0x20000 --json", "enable tpdo2 --json",
    "enable rpdo2 --json", "--force write 1A00:1 0 --json", "--force write 1A00:0 65 --json",
    "--force write 1800:1 0x181 --json", "--force write 1800:2 241 --json", "--force write 1800:4 1 --json",
    "undo --json", "clear rpdo1 --json", "nmt start --json", "set tpdo1 --timer 33 --json", "nmt reset-comm --json",
    "pdo --json", "store --json", "write 1010:1 0x12345678 --json", "nmt reset-node --json", "pdo --json",
    "restore --json", "nmt reset-node --json", "pdo --json",
)  # fmt: skip


def pytest_generate_tests(metafunc: pytest.Metafunc) -> None:
    some(metafunc, "family", FAMILIES, 0.5)
    some(metafunc, "check", list(CHECKS), 0.5)


def awake(one: StrictDevice, stored: Values) -> StrictDevice:
    """*one* as it is after power-on with *stored*, whose boot-up message nobody heard."""
    one.power_on(stored)
    one.boot_up()
    one.take_outbox()
    return one


def kept_by(family: str) -> Values:
    """What a device of *family* keeps as somebody left it, which is not as it comes from its maker."""
    one = device(family)
    with VirtualWire(one).bench({"yes": True}) as bench:
        for line in (*BEFORE, "store"):
            bench.run(line)
    return one.areas.kept()


def learnt(one: StrictDevice, options: dict[str, str]) -> StrictDevice:
    """The simulated device that `learn --save` makes of *one*."""
    with VirtualWire(one).bench(options) as bench:
        ran = bench.run("learn --isolated --yes --save pump --json")
        assert ran.code == 0, ran
    (simulated,) = simulated_nodes(("./pump",))
    made = simulated_device(simulated)
    made.boot_up()
    made.take_outbox()
    return made


def outcome(ran: Ran) -> list[object]:
    """The exit code of a command, and what it says of the device."""
    keys = ("error", "abort", "place", "state", "rule", "rpdos", "tpdos", "pdos", "value", "raw", "text")
    return [ran.code, *({key: found[key] for key in keys if key in found} for found in ran.documents)]


def raw(bench: Bench, place: str) -> str:
    """The bytes of an object of the selected node."""
    return str(bench.run(f"read {place} --json").document["raw"])


def outcomes(one: StrictDevice, options: dict[str, str]) -> list[tuple[str, list[object]]]:
    with VirtualWire(one).bench({"yes": True, **options}) as bench:
        return [(line, outcome(bench.run(line))) for line in COMMANDS]


@pytest.mark.counted
def test_commands_end_the_same_on_a_device_and_on_what_was_learnt_of_it(family: str) -> None:
    kept, options = kept_by(family), {"eds": str(family_eds(family)), "profile": family}
    if family not in profile_names():
        del options["profile"]
    twin = learnt(awake(device(family), kept), options)
    found, wanted = outcomes(twin, options), outcomes(awake(device(family), kept), options)
    assert [pair for pair in zip(found, wanted, strict=True) if pair[0] != pair[1]] == []
    assert {code for _, (code, *_) in wanted} >= {0, 1}


@pytest.mark.counted
def test_commands_end_the_same_whichever_check_a_device_answers_otherwise(check: str) -> None:
    answers = {way: {check: OTHERWISE} for way in Direction}
    family, options = load_family("generic")._replace(answers=answers), {"eds": str(family_eds("generic"))}

    def original() -> StrictDevice:
        return awake(StrictDevice(dictionary("generic"), family, 1), {})

    found, wanted = outcomes(learnt(original(), options), options), outcomes(original(), options)
    assert [pair for pair in zip(found, wanted, strict=True) if pair[0] != pair[1]] == []


def test_what_is_in_ram_only_is_what_the_learnt_device_starts_with_and_a_restore_brings_the_defaults() -> None:
    one = device("generic", 6)
    with VirtualWire(one).bench() as bench:
        assert bench.run("set tpdo2 --timer 77 --yes").code == 0
        assert bench.run("write 6083 1234 --yes").code == 0
        assert bench.run("learn --yes --save pump").code == 0
    with Bench(("./pump", "generic"), {"yes": True}) as bench:
        assert bench.run("node --json").document["nodes"][0]["node"] == 6
        assert [raw(bench, place) for place in ("1801:5", "6083", "1800:1")] == ["4D 00", "D2 04 00 00", "86 01 00 40"]
        assert bench.run("restore").code == 0
        assert bench.run("nmt reset-node 6").code == 0
        assert raw(bench, "6083") != "D2 04 00 00"


def test_with_another_node_id_what_follows_it_follows_that() -> None:
    with VirtualWire(device("generic", 6)).bench() as bench:
        assert bench.run("learn --yes --save pump").code == 0
    with Bench(("./pump@9",)) as bench:
        assert raw(bench, "1800:1") == "89 01 00 40"


def test_a_served_device_that_kept_nothing_yet_starts_so_too(tmp_path: Path) -> None:
    with VirtualWire(device("generic", 6)).bench() as bench:
        assert bench.run("write 6083 1234 --yes").code == 0
        assert bench.run("learn --yes --save pump").code == 0
    with served(tmp_path, str(Path("pump").resolve()), "--state", str(tmp_path / "kept")) as nodes:
        assert "1234" in nodes.dvtcli("-n", "6", "read", "6083").stdout


@pytest.mark.parametrize("text", ["{}", "[", '{"schema": "dvtcli.sim-state/1", "node": 300, "values": {}}'])
def test_a_damaged_file_of_what_was_found_is_named(text: str) -> None:
    with VirtualWire(device("generic")).bench() as bench:
        assert bench.run("learn --yes --save pump").code == 0
    Path("pump/found.json").write_text(text)
    with pytest.raises(InputFileError, match=r"pump/found\.json"):
        simulated_nodes(("./pump",))
