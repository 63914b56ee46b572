"""What the values of objects mean is said by every command, and a value may be typed with its unit."""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path

import pytest

import dvtcli
from dvtcli.domain.object_dictionary import ObjectDictionary, ObjectType, OdEntry, OdObject
from dvtcli.domain.object_scalings import ObjectScalings
from dvtcli.errors import UsageError
from dvtcli.files.profiles import standards
from dvtcli.files.user_folders import user_folder
from tests.cli.commands.bench import Bench

PROFILE = """
like = "gen4"
name = "truck"
title = "Truck"

[physical]
1017 = "1/16 V"                   # not truly so: an object that anybody may write
"2400:00" = { values = { 0 = "off", 1 = "slow" } }

[aliases]
battery_limit = "1017:00"
"""


@pytest.fixture(scope="module")
def gen4() -> Iterator[Bench]:
    with Bench(("gen4",)) as bench:
        yield bench


@pytest.fixture
def truck() -> Iterator[Bench]:
    folder = user_folder("config") / "profiles"
    folder.mkdir(parents=True, exist_ok=True)
    (folder / "truck.toml").write_text(PROFILE, "utf-8")
    with Bench(("gen4",), {"profile": "truck"}) as bench:
        yield bench
    (folder / "truck.toml").unlink()


def test_what_a_virtual_pdo_writes_itself_is_said_in_its_unit(gen4: Bench) -> None:
    said = gen4.run("write 60FF 1000rpm")
    assert said.code == 1
    assert "0x60FF:00 is -1500 rpm, expected 1000 rpm" in said.stderr
    assert "a virtual PDO ties it: `dvtcli --sim gen4 vpdo motor`" in said.stderr


def test_a_limit_is_written_in_volts(truck: Bench) -> None:
    ran = truck.run("write battery_limit 48V")
    assert ran.code == 0
    assert "31.25 V (500)  ->  48.0 V (768)" in ran.stdout
    assert "= 48.0 V (768)" in truck.run("read 1017").stdout
    assert truck.run("read 1017 --json").document["physical"] == {
        "value": 48.0, "unit": "V", "text": "48.0 V", "bits": [],
    }  # fmt: skip
    assert truck.run("read 1017 --json").document["value"] == 768
    assert "= 768 (0x0300)" in truck.run("read 1017 --as u16").stdout
    assert "= 2.5 V (40)" in (truck.run('write 1017 "2.5 V (40)"'), truck.run("read 1017"))[1].stdout


@pytest.mark.parametrize(
    ("value", "says", "hint"),
    [
        ("48mA", "it is in V, mV, kV, not in mA", "0.0 V to 4095.94 V"),
        ("48.01V", "the nearest values are 48.0 V (768) and 48.06 V (769)", "a number alone is raw"),
        ("5000V", "80000 does not fit UNSIGNED16", "0.0 V to 4095.94 V"),
        ("48.5", "is not a number", "with the unit"),
    ],
)
def test_what_does_not_fit_is_refused(truck: Bench, value: str, says: str, hint: str) -> None:
    ran = truck.run(f"write battery_limit {value}")
    assert ran.code == 2
    assert says in ran.stderr
    assert hint in ran.stderr
    assert "(500)" in truck.run("read 1017").stdout


def test_from_python() -> None:
    with dvtcli.simulate("gen4") as bus:
        node = bus.node(1)
        node.write(0x1017, "2 s")
        read = node.read("1017")
        assert (read.value, read.physical, read.unit, read.text) == (2000, 2000, "ms", "2000 ms")
        with pytest.raises(UsageError, match="not in V"):
            node.write(0x1017, "2 V")


def test_a_network_file_sets_in_volts_too(gen4: Bench, tmp_path: Path) -> None:
    file = tmp_path / "one.yaml"
    file.write_text('nodes: {drive: {node_id: 1, sdo: [{object: 1017, value: "0.7 s"}]}}\n', "utf-8")
    assert gen4.run(f"apply {file} --yes").code == 0
    assert "= 700 ms (0x02BC)" in gen4.run("read 1017").stdout
    file.write_text('nodes: {drive: {node_id: 1, sdo: [{object: 1017, value: "0.7 V"}]}}\n', "utf-8")
    assert gen4.run(f"apply {file} --yes").code == 4


def test_the_mapping_says_units(gen4: Bench) -> None:
    mapped = gen4.run("pdo tpdo4 --json").document["pdos"][0]["mapping"][0]
    assert (mapped["unit"], mapped["factor"], mapped["offset"]) == ("V", 0.0625, 0.0)
    assert "1/16 V" in gen4.run("pdo tpdo4").stdout


def described(device_type: int, name: str) -> ObjectScalings:
    entries = [
        OdEntry(0x1000, 0, "Device type", default=device_type.to_bytes(4, "little")), OdEntry(0x6041, 0, name),
        OdEntry(0x6841, 0, name), OdEntry(0x6000, 1, "Inputs"), OdEntry(0x1017, 0, "Heartbeat", unit="10 ms"),
    ]  # fmt: skip
    objects = {one.index: OdObject(one.index, one.name, ObjectType.VAR, {one.sub_index: one}) for one in entries}
    return ObjectScalings((), standards(), ObjectDictionary(objects))


@pytest.mark.parametrize(
    ("device_type", "name", "drive", "module"),
    [
        (0x20192, "anything", True, False),
        (0x30191, "anything", False, True),
        (0x30191, "Status word", False, True),
        (0, "STATUSWORD", True, False),
        (0, "Flags", False, False),
    ],
)
def test_a_standard_counts_for_its_devices(device_type: int, name: str, drive: bool, module: bool) -> None:
    scalings = described(device_type, name)
    assert bool(scalings.of(0x6041, 0).states) == drive
    assert bool(scalings.of(0x6841, 0).states) == drive  # a drive's second axis
    assert bool(scalings.of(0x6000, 1).bits) == module
    assert scalings.of(0x1800, 3).scale == "0.1 ms"
    assert scalings.of(0x1017, 0).text(5) == "50 ms (5)"  # the device's own file knows better


def test_every_rule_of_a_standard_names_it() -> None:
    folder = Path(dvtcli.__file__).parent / "families" / "standard"
    for path in sorted(folder.glob("*.toml")):
        named = ""
        for line in path.read_text("utf-8").splitlines():
            named = line if line.startswith("[") else named
            if "=" in line.partition("#")[0]:
                assert "# CiA " in line or "# CiA " in named, line
