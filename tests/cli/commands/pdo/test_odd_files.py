"""Files as makers write them: what cannot be changed is refused before anything is written, what can be is changed."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import pytest

from tests.cli.commands.bench import Bench, Ran
from tests.small_eds import INPUTS, OUTPUTS, U8, U16, U32, Eds, Section, communication, mapping, plain, var

FIRST = {"tpdo": INPUTS << 16 | 0x0108, "rpdo": OUTPUTS << 16 | 0x0108}
COMMUNICATION = {"tpdo": 0x1800, "rpdo": 0x1400}
MAPPING = {"tpdo": 0x1A00, "rpdo": 0x1600}
BASE = {"tpdo": INPUTS, "rpdo": OUTPUTS}
both = pytest.mark.parametrize("direction", ["tpdo", "rpdo"])


def bench(eds: Eds, name: str = "odd.eds", **options: Any) -> Bench:
    path = Path(name).resolve()
    path.write_text(eds.text())
    return Bench((str(path),), {"yes": True, **options})


def changed(direction: str, entries: list[int] | None = None, count: int | None = None, **more: Any) -> Eds:
    """A plain device whose first PDO of *direction* is another one; *more* are sub-indices of its communication."""
    eds = plain()
    words = [FIRST[direction], 0, 0, 0] if entries is None else entries
    held = sum(map(bool, words)) if count is None else count
    cob_id = more.pop("cob_id", 0x181 if direction == "tpdo" else 0x201)
    eds.record(COMMUNICATION[direction], "Communication 1", communication(cob_id, **more))
    eds.record(MAPPING[direction], "Mapping 1", mapping(held, words))
    return eds


def refused_before_any_write(one: Bench, line: str, *words: str) -> Ran:
    """*line* ends with 1 and all of *words*, and the node has taken no write."""
    writes: list[str] = []
    one.session.node()
    network = one.session._network
    assert network is not None
    network.bus.tap(lambda frame, sent: writes.append(frame.data.hex()) if sent and frame.data[0] >> 5 == 1 else None)
    ran = one.run(line)
    assert ran.code == 1, ran
    assert not writes
    assert all(word in ran.stderr for word in words), ran.stderr
    return ran


@both
def test_a_kept_can_id_that_is_restricted_gives_way_to_an_automatic_one(direction: str) -> None:
    with bench(changed(direction, cob_id=0x180)) as one:
        assert one.run(f"set {direction}1 --timer 20").code == 0, "nothing of this switches it off"
        refused_before_any_write(one, f"map {direction}1 {BASE[direction]:X}:2 --cob-id keep", "CAN-ID 0x180 is restr")
        assert one.run(f"map {direction}1 {BASE[direction]:X}:2").code == 0
        (row,) = one.run(f"pdo {direction}1 --json").document["pdos"]
        assert (row["cob_id"], row["enabled"]) == ({"tpdo": 0x181, "rpdo": 0x201}[direction], True)
        back = one.run("undo")
        back.failed(1, "it is off now")
        (row,) = one.run(f"pdo {direction}1 --json").document["pdos"]
        assert row["enabled"] is False


@both
@pytest.mark.parametrize("access", ["ro", "const"])
def test_a_cob_id_that_cannot_be_written(direction: str, access: str) -> None:
    fixed = var("COB-ID", U32, 0x181 if direction == "tpdo" else 0x201, access)
    with bench(changed(direction, sub1=fixed)) as one:
        for line in ("map {}1 {:X}:2", "set {}1 --inhibit 5", "disable {}1", "clear {}1"):
            text = line.format(direction, BASE[direction])
            refused_before_any_write(one, text, f"COB-ID of {direction.upper()}1 is {access}", "06010002")
        assert one.run(f"set {direction}1 --timer 20").code == 0


@both
def test_a_cob_id_that_cannot_be_written_leaves_a_pdo_off(direction: str) -> None:
    with bench(changed(direction, sub1=var("COB-ID", U32, 0x80000191, "ro"))) as one:
        refused_before_any_write(one, f"map {direction}1 {BASE[direction]:X}:2", "is ro", "--off leaves one off")
        assert one.run(f"map {direction}1 {BASE[direction]:X}:2 --off").code == 0


@both
def test_a_cob_id_of_16_bits(direction: str) -> None:
    with bench(changed(direction, sub1=var("COB-ID", U16, 0x191))) as one:
        refused_before_any_write(
            one, f"map {direction}1 {BASE[direction]:X}:2", "16 bits", "CiA 301 has 32", "06070012"
        )
        refused_before_any_write(one, f"disable {direction}1", "16 bits")


@both
@pytest.mark.parametrize("sub", [2, 3, 5])
def test_another_parameter_of_another_length(direction: str, sub: int) -> None:
    with bench(changed(direction, **{f"sub{sub}": var("odd", U32, 0)})) as one:
        option = {2: "--type 254", 3: "--inhibit 5", 5: "--timer 5"}[sub]
        refused_before_any_write(one, f"set {direction}1 {option}", "32 bits", "06070013")


@both
def test_a_mapping_with_its_count_only(direction: str) -> None:
    with bench(changed(direction, entries=[])) as one:
        refused_before_any_write(one, f"map {direction}1 {BASE[direction]:X}:1", "has at most 0", "06090011")
        assert one.run(f"disable {direction}1").code == 0


@both
def test_an_entry_that_can_be_written_and_not_read(direction: str) -> None:
    eds = changed(direction, cob_id=0x80000191)
    eds.objects[MAPPING[direction]][1][2]["AccessType"] = "wo"
    with bench(eds) as one:
        objects = f"{BASE[direction]:X}:1 {BASE[direction]:X}:2"
        refused_before_any_write(one, f"map {direction}1 {objects}", "mapping entry 2", "cannot be read back")
        assert one.run(f"map {direction}1 {BASE[direction]:X}:3").code == 0


@both
def test_a_mapping_with_a_gap(direction: str) -> None:
    eds = changed(direction)
    del eds.objects[MAPPING[direction]][1][3]
    with bench(eds) as one:
        objects = " ".join(f"{BASE[direction]:X}:{n}" for n in (1, 2, 3))
        refused_before_any_write(one, f"map {direction}1 {objects}", "3 entries were requested", "has at most 2")
        assert one.run(f"map {direction}1 {BASE[direction]:X}:1 {BASE[direction]:X}:2").code == 0


@both
@pytest.mark.parametrize("entries", [9, 20, 64])
def test_more_than_8_entries_where_the_file_has_them(direction: str, entries: int) -> None:
    eds = changed(direction, entries=[FIRST[direction], *[0] * (entries - 1)])
    eds.record(BASE[direction], "Bits", {
        n: var(f"Bit {n}", 0x0001, 0, "ro" if direction == "tpdo" else "rww", 1) for n in range(1, 65)
    })  # fmt: skip
    eds.record(MAPPING[direction], "Mapping 1", mapping(0, [0] * entries))
    with bench(eds) as one:
        objects = " ".join(f"{BASE[direction]:X}:{n:X}" for n in range(1, entries + 1))
        assert one.run(f"map {direction}1 {objects}").code == 0
        assert one.run("verify").code == 0
        back = one.run("undo")
        assert (back.code, "it is off and empty now" in back.stderr) == (1, True), "it was enabled and empty"
        if entries < 64:
            more = f"{objects} {BASE[direction]:X}:{entries + 1:X}"
            refused_before_any_write(one, f"map {direction}1 {more}", f"has at most {entries}")


@both
def test_a_pdo_that_is_enabled_and_empty(direction: str) -> None:
    with bench(changed(direction, entries=[0, 0, 0, 0])) as one:
        refused_before_any_write(
            one, f"set {direction}1 --inhibit 5", "has no mapped objects: an empty PDO cannot be enabled"
        )
        ran = one.run(f"map {direction}1 {BASE[direction]:X}:2")
        name = direction.upper()
        assert ran.code == 0
        assert f"{name}1 is enabled and empty now, and a device may refuse that configuration" in ran.stderr
        assert "an undo leaves it off and empty" in ran.stderr
        back = one.run("undo")
        assert back.code == 1
        assert (
            f"{name}1 was enabled and empty, and the device refuses that configuration: it is off and empty now"
            in back.stderr
        )
        (row,) = one.run(f"pdo {direction}1 --json").document["pdos"]
        assert (row["enabled"], row["mapping"], row["cob_id"]) == (False, [], 0x181 if direction == "tpdo" else 0x201)


@both
def test_a_roll_back_of_a_pdo_that_was_enabled_and_empty(direction: str) -> None:
    with bench(changed(direction, entries=[0, 0, 0, 0]), fault=("refuse@4=08000021",)) as one:
        ran = one.run(f"map {direction}1 {BASE[direction]:X}:2 {BASE[direction]:X}:3")
        assert ran.code == 1, ran
        assert "it is off and empty now" in ran.stderr
        assert "rolled back as far as the device accepts" in ran.stderr


def test_a_mapping_that_the_file_itself_forbids() -> None:
    """The factory maps what PDOMapping=0 says cannot be mapped: many files do."""
    eds = changed("tpdo", entries=[0x60010008, 0, 0, 0])
    eds.variable(0x6001, var("Status", U8, 0, "ro", 0))
    with bench(eds) as one:
        ran = one.run("map tpdo1 6000:2")
        assert (ran.code, "an undo leaves it off and empty" in ran.stderr) == (0, True)
        assert one.run("undo").code == 1
        assert one.run("pdo tpdo1 --json").document["pdos"][0]["mapping"] == []


def test_a_default_outside_its_limits() -> None:
    eds = changed("tpdo", sub3=var("Inhibit time", U16, 0xFFFF, HighLimit=0x7FFF))
    with bench(eds) as one:
        refused_before_any_write(one, "set tpdo1 --inhibit 4000", "above the limit 3276.7 ms")
        ran = one.run("set tpdo1 --inhibit 5")
        assert (ran.code, "at inhibit time 50" in ran.stderr) == (0, True), ran.stderr
        back = one.run("undo")
        back.failed(1, "it is at inhibit time 50 now")


def test_limits_of_every_write_count_also_of_those_between() -> None:
    limited = var("COB-ID", U32, 0x181, HighLimit=0x7FF)
    with bench(changed("tpdo", sub1=limited)) as one:
        refused_before_any_write(one, "map tpdo1 6000:2", "COB-ID 0x80000181 is above the limit 0x000007FF")
    with bench(
        changed("tpdo", sub1=var("COB-ID", U32, "$NODEID+0x180", LowLimit="$NODEID+0x180", HighLimit=0xFFFFFFFF)),
        "x.eds",
    ) as one:
        refused_before_any_write(one, "map tpdo1 6000:2 --cob-id 0x181 --off", "x") if False else None
        assert one.run("map tpdo1 6000:2").code == 0


def test_limits_without_a_choice_do_not_count() -> None:
    eds = changed("tpdo", sub5=var("Event timer", U16, 0, LowLimit=0, HighLimit=0))
    with bench(eds) as one:
        assert one.run("set tpdo1 --timer 20").code == 0


@pytest.mark.parametrize("default", [None, "", "0x0", "0", "broken", "0x1FFFFFFFFF"])
def test_a_cob_id_without_a_usable_default_is_off_and_never_nmt(default: str | None) -> None:
    with bench(changed("tpdo", sub1=var("COB-ID", U32, default))) as one:
        (row,) = one.run("pdo tpdo1 --json").document["pdos"]
        assert (row["enabled"], row["cob_id"]) == (False, 0)
        assert one.run("map tpdo1 6000:2").code == 0
        assert one.run("undo").code == 0
        assert "2147483648" in one.run("read 1800:1").stdout


def dcf(node_id: int = 5, **more: Any) -> Eds:
    eds = changed("tpdo", **more)
    eds.more.append(Section("DeviceComissioning", {"NodeID": str(node_id), "Baudrate": "250"}))
    return eds


def test_the_node_id_of_a_dcf_is_taken_by_a_simulated_node() -> None:
    with bench(dcf(), "odd.dcf") as one:
        assert one.session.node_id() == 5
        assert one.run("pdo tpdo1 --json").document["node"] == 5
    path = Path("odd.dcf").resolve()
    with Bench((f"{path}@7", "gen4", str(path))) as one:
        assert one.session.open_network().simulated_ids == (7, 1, 5)
    with Bench((str(path), str(path))) as one:
        assert one.session.open_network().simulated_ids == (5, 1)


def test_a_node_id_that_no_node_has_is_not_taken() -> None:
    with bench(dcf(0), "odd.dcf") as one:
        assert one.session.node_id() == 1


def test_a_state_object_tells_the_state_whatever_the_file_has_for_it() -> None:
    """A DCF that was read from a drive holds the state that it was in; a family that asks the object waits for it."""
    eds = dcf(1)
    eds.info |= {"VendorNumber": 0x1E, "ProductNumber": 0x0705302D}
    eds.record(0x1018, "Identity", {
        n: var(f"Part {n}", U32, value, "ro") for n, value in enumerate((0x1E, 0x0705302D, 0, 0), 1)
    })  # fmt: skip
    eds.variable(0x5110, var("NMT state", U8, 0, "ro", 0, ParameterValue=5))
    with bench(eds, "odd.dcf") as one:
        assert "127" in one.run("read 5110").stdout
        assert one.run("map tpdo1 6000:2").code == 0
        assert one.run("nmt start").code == 0
        assert one.run("map tpdo1 6000:3").code == 0


def test_what_could_be_enabled_and_never_disabled_again_is_not_enabled() -> None:
    limited = var("COB-ID", U32, 0x80000191, HighLimit=0x7FFFFFFF)
    with bench(changed("tpdo", sub1=limited)) as one:
        for line in ("enable tpdo1", "map tpdo1 6000:2"):
            refused_before_any_write(one, line, "could neither be rolled back after this", "no-way-back")
        assert one.run("map tpdo1 6000:2 --off").code == 0
        assert one.run("undo").code == 0


@both
def test_a_pdo_whose_cob_id_cannot_be_read_may_be_enabled(direction: str) -> None:
    with bench(changed(direction, sub1=var("COB-ID", U32, 0x191, "wo"))) as one:
        for line in ("clear {}1", "disable {}1", "set {}1 --inhibit 5", "map {}1 {:X}:1 --off"):
            refused_before_any_write(one, line.format(direction, BASE[direction]), "01 cannot be read")
        assert one.run(f"set {direction}1 --timer 5").code == 0


@pytest.mark.parametrize("access", ["ro", "const"])
def test_a_store_that_takes_no_signature(access: str) -> None:
    eds = changed("tpdo")
    eds.record(0x1010, "Store", {1: var("Save all", U32, 1, access)})
    eds.record(0x1011, "Restore", {1: var("Load all", U32, 1, access)})
    with bench(eds) as one:
        for word in ("store", "restore"):
            refused_before_any_write(one, word, f"is {access} in", "it accepts no signature")


def test_a_dummy_that_the_file_denies_is_refused_also_where_the_profile_has_it() -> None:
    eds = changed("rpdo")
    eds.info |= {"VendorNumber": 0x1E, "ProductNumber": 0x0705302D}
    eds.dummies = (6,)
    with bench(eds) as one:
        ran = one.run("map rpdo1 dummy/8 6200:2")
        assert ran.code == 2, ran.stderr
        assert one.run("map rpdo1 dummy/16 6200:2").code == 0


def test_a_family_s_device_without_the_object_that_tells_its_state_is_heard() -> None:
    eds = changed("tpdo")
    eds.info |= {"VendorNumber": 0x1E, "ProductNumber": 0x0705302D}
    with bench(eds) as one:
        assert one.run("nmt start").code == 0
        assert one.run("map tpdo1 6000:2").code == 0


def test_a_device_of_a_family_maps_what_the_family_maps() -> None:
    """Gen4 takes objects in a TPDO that the host may write (`rww`); a device of its identity does, too."""
    eds = changed("tpdo", entries=[OUTPUTS << 16 | 0x0108, 0])
    eds.info |= {"VendorNumber": 0x1E, "ProductNumber": 0x0705302D}
    with bench(eds) as one:
        assert one.run("map tpdo1 6000:1").code == 0
        back = one.run("undo")
        assert back.code == 0, back.stderr
        assert one.run("map tpdo1 6200:3").code == 0
