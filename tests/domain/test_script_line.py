"""Script lines that repeat a configuration."""

from __future__ import annotations

from dataclasses import replace

from dvtcli.domain.cob_id import CobId
from dvtcli.domain.pdo import Pdo, PdoCommunicationParameter, PdoConfig, PdoMappingEntry
from dvtcli.domain.plan import plan_pdo
from dvtcli.domain.script_line import backup_lines, change_line, end_state


def config(raw: int, *entries: int, mpdo: int | None = None) -> PdoConfig:
    mapping = tuple(PdoMappingEntry.from_raw(entry) for entry in entries)
    return PdoConfig(PdoCommunicationParameter(CobId.from_raw(raw)), mapping, mpdo)


def test_a_backup_disables_what_can_be_disabled_before_it_sets_anything() -> None:
    pdos = {
        Pdo.parse("tpdo1"): config(0x181, 0x60410010),
        Pdo.parse("tpdo2"): config(0x281, 0x60410010),
        Pdo.parse("rpdo1"): config(0x201, mpdo=0xFF),
        Pdo.parse("rpdo2"): config(0x8000_0301),
    }
    lines = backup_lines({"vendor": 0x1E}, pdos, {Pdo.parse("tpdo2")})
    assert [line.split(" --")[0] for line in lines] == [
        "# dvtcli script 1",
        "require identity vendor=0x0000001E",
        "# no serial number",
        "disable tpdo1 rpdo2",
        "map tpdo1 6041:00/16",
        "map tpdo2 6041:00/16",
        "# rpdo1 is a multiplexed PDO (count 0xFF) and is not changed",
        "clear rpdo2",
        "set rpdo2",
    ]


def test_a_backup_names_each_dummy_itself() -> None:
    (line,) = [line for line in backup_lines({}, {Pdo.parse("rpdo1"): config(0x201, 0x00050008)}) if "map" in line]
    assert line.startswith("map rpdo1 0005:00/8 ")


def test_a_backup_leaves_off_what_no_pdo_may_be_and_alone_what_is_inconsistent() -> None:
    odd = replace(config(0x281, 0x60410010), held_count=9, unread=((0x1A01, 2),))
    lines = backup_lines({}, {Pdo.parse("tpdo1"): config(0x180, 0x60410010), Pdo.parse("tpdo2"): odd})
    assert lines[2:] == [
        "disable tpdo1",
        "map tpdo1 6041:00/16 --cob-id 0x180 --rtr --off",
        "# tpdo1 was enabled with CAN-ID 0x180, which CiA 301 does not allow for PDOs: it stays off",
        "# tpdo2 is inconsistent (its count is 9, but 0x1A01:02 cannot be read): 6041:00/16 --cob-id 0x281 --rtr and "
        "is not changed",
    ]
    (kept,) = backup_lines({}, {Pdo.parse("tpdo1"): config(0x2000_0180, 0x60410010)})[3:]
    assert kept == "map tpdo1 6041:00/16 --cob-id 0x00000180 --extended --rtr"


def test_a_pdo_that_became_a_multiplexed_one_is_set_and_one_that_was_one_is_written_whole() -> None:
    pdo, off = Pdo.parse("tpdo1"), PdoCommunicationParameter(CobId(0x181, valid=False))
    entry = PdoMappingEntry(0x6041, 0, 16)
    empty, multiplexed = PdoConfig(off, ()), PdoConfig(off, (), mpdo=0xFE)
    mapped, held = PdoConfig(off, (entry,)), PdoConfig(off, (), mpdo=0xFF, multiplexed=(entry,))
    became = [change_line(plan_pdo(pdo, before, multiplexed)) for before in (empty, mapped, held)]
    assert became == ["set tpdo1 --mpdo sam"] * 3
    assert change_line(plan_pdo(pdo, mapped, held)) == "set tpdo1 --mpdo dam"
    assert change_line(plan_pdo(pdo, multiplexed, empty)) == "clear tpdo1"
    assert change_line(plan_pdo(pdo, multiplexed, mapped)).startswith("map tpdo1 6041:00/16 ")


def test_another_first_object_of_a_multiplexed_pdo_is_mapped_before() -> None:
    pdo, on = Pdo.parse("tpdo1"), PdoCommunicationParameter(CobId(0x181))
    earlier, later = (PdoMappingEntry(0x6041, 0, 16), PdoMappingEntry(0x6000, 1, 8))
    wanted = PdoConfig(on, (), mpdo=0xFF, multiplexed=(later,))
    for before in (PdoConfig(on, (earlier,)), PdoConfig(on, (), mpdo=0xFF, multiplexed=(earlier,))):
        assert change_line(plan_pdo(pdo, before, wanted)).splitlines() == [
            "clear tpdo1",
            "map tpdo1 6000:01/8 --cob-id 0x181 --rtr --off",
            "set tpdo1 --mpdo dam",
            "enable tpdo1",
        ]


def test_of_states_an_end_state_keeps_what_a_node_needs_to_take_the_other_lines() -> None:
    lines = ["fpo 3 pre", "login 4", "write 1017:00 500", "write 1017:00 700", "fpo 3 op", "nmt preop"]
    assert end_state(lines, {}, {}) == ["fpo 3 pre", "login 4", "nmt preop", "write 1017:00 700"]
