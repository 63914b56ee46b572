"""PDOs that are not whole are shown, take part in the clash check, and are repaired."""

from __future__ import annotations

import re
from pathlib import Path
from typing import Any

import pytest

from dvtcli.domain.abort import Abort
from dvtcli.files.eds.reader import read_eds
from dvtcli.simulator.device.memory import Refusal
from dvtcli.simulator.device.strict_device import StrictDevice
from dvtcli.simulator.network.family_file import load_family
from tests.cli.commands.bench import Bench, Ran
from tests.cli.commands.bus import Wire
from tests.harness.sample import heavy
from tests.small_eds import INPUTS, U32, Eds, communication, mapping, plain, var

FIRST = INPUTS << 16 | 0x0108


def bench(eds: Eds, name: str = "odd.eds") -> Bench:
    path = Path(name).resolve()
    path.write_text(eds.text())
    return Bench((str(path),), {"yes": True})


def row(ran: Ran, pdo: str) -> dict[str, Any]:
    found = [one for one in ran.document["pdos"] if one["pdo"] == pdo]
    return found[0]


def count_above(count: int = 9, cob_id: int = 0x181) -> Eds:
    eds = plain()
    eds.record(0x1800, "Communication 1", communication(cob_id))
    eds.record(0x1A00, "Mapping 1", mapping(count, [FIRST, FIRST + 0x100, FIRST + 0x200, FIRST + 0x300]))
    return eds


def without(index: int, cob_id: int = 0x281) -> Eds:
    """TPDO2 enabled, one of its parameters missing."""
    eds = plain()
    eds.record(0x1801, "Communication 2", communication(cob_id))
    eds.record(0x1A01, "Mapping 2", mapping(1, [FIRST, 0, 0, 0]))
    del eds.objects[index]
    return eds


@pytest.mark.parametrize("count", [5, 9, 64, 65, 0xFD])
def test_a_count_above_the_entries_is_shown_with_those_that_can_be_read(count: int) -> None:
    with bench(count_above(count)) as one:
        shown = row(one.run("pdo --all --json"), "tpdo1")
        assert (shown["enabled"], len(shown["mapping"])) == (True, 4)
        assert shown["inconsistent"] == f"its count is {count}, but 0x1A00:05 cannot be read"
        text = one.run("pdo").stdout
        assert f"TPDO1 is inconsistent: its count is {count}, but 0x1A00:05 cannot be read; map or clear" in text
        assert "is inconsistent" in one.run("pdo tpdo1").stdout


@pytest.mark.parametrize("line", ["map tpdo1 6000:1 6000:2", "clear tpdo1", "disable tpdo1"])
def test_a_count_above_the_entries_is_repaired_and_what_was_is_put_back_as_far_as_the_device_takes_it(
    line: str,
) -> None:
    with bench(count_above()) as one:
        ran = one.run(line)
        assert ran.code == 0, ran.stderr
        assert one.run("verify").code == 0
        mended = row(one.run("pdo --all --json"), "tpdo1")
        assert (mended["inconsistent"] is None) is (line != "disable tpdo1")
        back = one.run("undo")
        assert back.code == (0 if line == "disable tpdo1" else 1), back.stderr
        after = row(one.run("pdo --all --json"), "tpdo1")
        if line == "disable tpdo1":
            assert "off and empty" not in ran.stderr + back.stderr
            assert (after["enabled"], after["inconsistent"] is None) == (True, False)
            return
        assert "off and empty" in ran.stderr
        assert "off and empty" in back.stderr
        assert (after["enabled"], after["mapping"], after["inconsistent"]) == (False, [], None)


def test_a_warning_of_the_way_back_claims_no_more_than_undo_does() -> None:
    with bench(count_above()) as one:
        before = row(one.run("pdo --all --json"), "tpdo1")
        said = " ".join(one.run("disable tpdo1").stderr.split())
        assert "a device may refuse that configuration" in said
        assert "if it does, an undo leaves it off" in said
        assert one.run("undo").code == 0
        assert row(one.run("pdo --all --json"), "tpdo1") == before


@heavy
def test_the_same_entries_again_repair_the_count() -> None:
    with bench(count_above()) as one:
        assert one.run("map tpdo1 6000:1 6000:2 6000:3 6000:4").code == 0
        assert row(one.run("pdo --all --json"), "tpdo1")["inconsistent"] is None


def test_it_is_not_enabled_as_it_stands() -> None:
    with bench(count_above(cob_id=0x80000181)) as one:
        ran = one.run("enable tpdo1")
        assert ran.code == 1
        assert "map tpdo1 OBJECT…` or `dvtcli --sim " in ran.stderr
        assert " clear tpdo1` repairs it" in ran.stderr
        (said,) = one.run("enable tpdo1 --json").document["findings"]
        assert (said["rule"], said["place"], said["abort"]) == ("inconsistent-pdo", "0x1A00:00", "0x06040042")
        assert row(one.run("pdo --all --json"), "tpdo1")["enabled"] is False
        left_off = one.run("set tpdo1 --timer 20 --json")
        assert left_off.code == 0
        assert "inconsistent-pdo" not in left_off.stdout


def test_its_can_id_counts_as_used() -> None:
    with bench(count_above()) as one:
        ran = one.run("map tpdo2 6000:1 --cob-id 0x181")
        assert ran.code == 1
        assert "CAN-ID 0x181 is already used by TPDO1" in ran.stderr


def test_a_raw_write_repairs_it_and_one_that_breaks_it_is_refused() -> None:
    with bench(count_above(cob_id=0x80000181)) as one:
        assert one.run("write 1A00:0 0 --force").code == 0
        ran = one.run("write 1A00:0 9")
        assert ran.code == 1
        assert "the count would be 9, but 0x1A00:05 cannot be read" in ran.stderr
        assert one.run("write 1A00:0 4").code == 0
        assert row(one.run("pdo --all --json"), "tpdo1")["inconsistent"] is None


def test_a_communication_parameter_without_its_mapping() -> None:
    with bench(without(0x1A01)) as one:
        shown = row(one.run("pdo --all --json"), "tpdo2")
        assert (shown["enabled"], shown["cob_id"], shown["mapping"]) == (True, 0x281, [])
        assert shown["inconsistent"] == "its mapping 0x1A01:00 cannot be read"
        assert "disable tpdo2 switches it off" in one.run("pdo").stdout
        assert one.run("map tpdo1 6000:1 --cob-id 0x281").code == 1
        ran = one.run("map tpdo2 6000:1")
        ran.failed(1, "TPDO2 of this device has no mapping")
        assert one.run("disable tpdo2").code == 0
        back = one.run("undo")
        back.failed(1, "refuses that configuration")
        assert one.run("clear tpdo2").code == 0
        assert not row(one.run("pdo --all --json"), "tpdo2")["enabled"]


def test_a_mapping_without_its_communication_parameter() -> None:
    with bench(without(0x1801)) as one:
        shown = row(one.run("pdo --all --json"), "tpdo2")
        assert (shown["enabled"], shown["cob_id"], len(shown["mapping"])) == (None, None, 1)
        assert shown["inconsistent"] == "its COB-ID 0x1801:01 cannot be read"
        assert re.search(r"TPDO2 +- +\? ", one.run("pdo --all").stdout)
        picture = one.run("pdo tpdo2").stdout
        assert re.search(r"^  COB-ID +- \? \(default 0x281\)$", picture, re.M), picture
        ran = one.run("disable tpdo2")
        ran.failed(1, "it is not known whether TPDO2 is off")
        assert "--force" not in ran.stderr, "there is nothing that could be sent"
        forced = one.run("disable tpdo2 --force")
        forced.failed(1, "it is not known whether TPDO2 is off")
        ran = one.run("map tpdo2 6000:2")
        ran.failed(1, "TPDO2 of this device has no COB-ID")
        assert one.run("map tpdo2 6000:2 --off").code == 0
        assert one.run("undo").code == 0
        assert one.run("clear tpdo2").code == 0
        assert row(one.run("pdo --all --json"), "tpdo2")["mapping"] == []
        assert one.run("map tpdo1 6000:3").code == 0, "the others are compared without it"


def test_a_pdo_whose_cob_id_cannot_be_read_is_not_the_one_that_a_proof_changes() -> None:
    eds = plain()
    half = communication(0x281)
    del half[1]
    eds.record(0x1801, "Communication 2", half)
    eds.record(0x1A01, "Mapping 2", mapping(1, [FIRST, 0, 0, 0]))
    with bench(eds) as one:
        assert one.run("map tpdo1 6000:2").code == 0
        assert "of TPDO2" not in one.run("store --prove").stdout


def test_a_file_with_half_a_pdo_wishes_that_half_only() -> None:
    whole, half = plain(), plain()
    del half.objects[0x1800]
    half.record(0x1A01, "Mapping 2", mapping(1, [FIRST, 0, 0, 0]))
    del half.objects[0x1801]
    path = Path("half.dcf").resolve()
    path.write_text(half.text())
    with bench(whole) as one:
        ran = one.run(f"verify '{path}'")
        assert ran.code == 3
        assert ran.stdout.splitlines()[0].strip() == "TPDO2  0x1A01 is nothing, expected 6000:01/8"
        assert "1 of 4 PDOs differs" in ran.stdout
        assert one.run("map tpdo2 6000:1 --off").code == 0
        assert one.run(f"verify '{path}'").code == 0


def test_what_was_set_and_is_no_longer_there_differs() -> None:
    with bench(count_above(cob_id=0x80000181)) as one:
        assert one.run("map tpdo1 6000:1 --off").code == 0
        assert one.run("write 1A00:0 9 --force").code == 1, "the device refuses it"
        assert one.run("verify tpdo1").code == 0


@pytest.mark.parametrize("line", ["map tpdo1 6000:1", "clear tpdo1", "disable tpdo1", "enable tpdo1"])
def test_a_dry_run_says_the_same(line: str) -> None:
    with bench(count_above()) as one:
        tried, done = one.run(f"{line} --dry-run"), one.run(line)
        assert tried.code == done.code
        assert ("way-back" in tried.stderr) is ("way-back" in done.stderr)


@pytest.mark.parametrize(
    ("entries", "said"),
    [
        ([INPUTS << 16 | 0x0120, INPUTS << 16 | 0x0220, FIRST], "TPDO1 is enabled with 72 bits: a PDO has at most 64"),
        ([FIRST, 0, FIRST], "TPDO1 is enabled with mapping entry 2 empty"),
    ],
)
def test_an_enabled_pdo_that_no_frame_can_hold_is_remarked_on(entries: list[int], said: str) -> None:
    eds = plain()
    eds.record(0x1A00, "Mapping 1", mapping(3, [*entries, 0]))
    with bench(eds) as one:
        assert said in one.run("pdo --all").stdout
        assert one.run("clear tpdo1").code == 0
        assert "TPDO1 is enabled" not in one.run("pdo --all").stdout


# --- all PDOs at once


def unreadable(*numbers: int, access: str = "wo") -> Eds:
    """TPDO1, TPDO2 and RPDO1 enabled with one object each; the COB-ID of TPDO*numbers* has that *access*."""
    eds = plain()
    for number in (1, 2):
        subs = communication(0x181 + 0x100 * (number - 1))
        if number in numbers:
            subs[1] = var("COB-ID", U32, 0x181 + 0x100 * (number - 1), access)
        eds.record(0x17FF + number, f"Communication {number}", subs)
        eds.record(0x19FF + number, f"Mapping {number}", mapping(1, [FIRST, 0, 0, 0]))
    return eds


@pytest.mark.parametrize(("access", "why"), [("wo", "0x1801:01 cannot be read"), ("ro", "COB-ID of TPDO2 is ro")])
def test_clear_all_clears_what_can_be_and_names_the_others(access: str, why: str) -> None:
    with bench(unreadable(2, access=access)) as one:
        before = row(one.run("pdo --all --json"), "tpdo2")
        if access == "wo":
            assert [before[key] for key in ("enabled", "cob_id", "extended", "rtr_allowed")] == [None] * 4
        ran = one.run("clear all")
        assert ran.code == 0, ran.stderr
        said = " ".join(ran.stderr.split())
        assert "TPDO2 is not changed" in said
        assert why in said
        after = one.run("pdo --all --json")
        for pdo in ("tpdo1", "rpdo1"):
            assert (row(after, pdo)["enabled"], row(after, pdo)["mapping"]) == (False, [])
        assert row(after, "tpdo2") == before
        assert one.run("verify").code == 0
        assert one.run("undo").code == 0
        assert row(one.run("pdo --all --json"), "tpdo1")["enabled"]


def test_clear_all_is_refused_where_none_can_be_cleared() -> None:
    eds = unreadable(1, 2)
    for index in (0x1400, 0x1401, 0x1600, 0x1601):
        del eds.objects[index]
    with bench(eds) as one:
        ran = one.run("clear all")
        ran.failed(1, "0x1800:01 cannot be read")


# --- without an EDS


class Refusing(StrictDevice):
    """A device that refuses to tell *hidden*, with *code*."""

    hidden: tuple[int, ...] = ()
    code: int = Abort.NO_OBJECT

    def upload(self, index: int, sub_index: int) -> bytes:
        if index in self.hidden:
            raise Refusal(self.code)
        return super().upload(index, sub_index)


def undescribed(*hidden: int, code: int = Abort.NO_OBJECT, pdos: int = 2) -> Refusing:
    eds = plain()
    for number in range(3, pdos + 1):
        eds.record(0x17FF + number, "Communication", communication(0x80000181))
        eds.record(0x19FF + number, "Mapping", mapping(1, [FIRST, 0, 0, 0]))
    path = Path("undescribed.eds")
    path.write_text(eds.text())
    made = Refusing(read_eds(path).dictionary, load_family("generic"), 1)
    made.hidden, made.code = hidden, code
    return made


@pytest.mark.parametrize("code", [0x06020000, 0x06090011, 0x06010001, 0x06010000, 0x08000000])
def test_without_an_eds_a_mapping_without_a_cob_id_is_shown(code: int) -> None:
    with Wire(undescribed(0x1801, code=code)) as wire, Bench((), {**wire.options, "yes": True}) as one:
        shown = {pdo["pdo"]: pdo for pdo in one.run("pdo --all --json").document["pdos"]}
        assert list(shown) == ["tpdo1", "tpdo2", "rpdo1", "rpdo2"]
        assert shown["tpdo2"]["inconsistent"] == "its COB-ID 0x1801:01 cannot be read"
        assert one.run("set tpdo1 --cob-id 0x1A7").code == 0, "the others are compared without it"


def test_without_an_eds_a_cob_id_without_a_mapping_is_shown() -> None:
    with Wire(undescribed(0x1A01)) as wire, Bench((), {**wire.options, "yes": True}) as one:
        shown = {pdo["pdo"]: pdo for pdo in one.run("pdo --all --json").document["pdos"]}
        assert shown["tpdo2"]["inconsistent"] == "its mapping 0x1A01:00 cannot be read"


def test_without_an_eds_the_search_goes_on_behind_half_a_pdo() -> None:
    with Wire(undescribed(0x1804, pdos=6)) as wire, Bench((), {**wire.options, "yes": True}) as one:
        shown = [pdo["pdo"] for pdo in one.run("pdo --all --json").document["pdos"]]
        assert shown == [*(f"tpdo{number}" for number in range(1, 7)), "rpdo1", "rpdo2"]
