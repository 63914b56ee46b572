"""A family answers each check of its PDO parameters in its own way; folders of the user's own are families, too."""

from __future__ import annotations

from pathlib import Path

import pytest

from dvtcli.domain.abort import Abort
from dvtcli.errors import InputFileError
from dvtcli.files.eds.reader import read_eds
from dvtcli.simulator.device.pdo_checks import CHECKS
from dvtcli.simulator.device.strict_device import StrictDevice
from dvtcli.simulator.network.family_file import family_eds, load_family_folder, read_family
from tests.cli.commands.bench import Bench
from tests.simulator.bench import Aborted, Client

#: TPDO1 of the generic family is valid with one entry; TPDO3 and RPDO3 are off, and emptied.
ON, OFF = 0x1800, 0x1802
OWN = 0x0606_0000
#: check → downloads (index, sub-index, value, size), the last of which it answers
ASKED: dict[str, list[tuple[int, int, int, int]]] = {
    "cob-id-again": [(ON, 1, 0x40000181, 4)],
    "cob-id-while-valid": [(ON, 1, 0x1B1, 4)],
    "restricted": [(0x1A02, 1, 0x60410010, 4), (0x1A02, 0, 1, 1), (OFF, 1, 0x601, 4)],
    "beyond-frame": [(0x1A02, 1, 0x60410010, 4), (0x1A02, 0, 1, 1), (OFF, 1, 0x999, 4)],
    "empty-enabled": [(OFF, 1, 0x1B1, 4)],
    "type": [(OFF, 2, 241, 1)],
    "type-without-rtr": [(OFF, 1, 0xC0000381, 4), (OFF, 2, 252, 1)],
    "type-while-valid": [(ON, 2, 1, 1)],
    "inhibit-while-valid": [(ON, 3, 10, 2)],
    "event-while-valid": [(ON, 5, 10, 2)],
    "sync-start-while-valid": [(ON, 6, 10, 1)],
    "count-again": [(0x1A00, 0, 1, 1)],
    "count-while-valid": [(0x1A00, 0, 0, 1)],
    "count-beyond": [*((0x1A02, sub, 0x10010008, 4) for sub in range(1, 9)), (0x1A02, 0, 9, 1)],
    "count-over-zero": [(0x1A02, 1, 0, 4), (0x1A02, 0, 1, 1)],
    "count-over-no-bits": [(0x1A02, 1, 0x60410000, 4), (0x1A02, 0, 1, 1)],
    "too-many-bits": [*((0x1A02, sub, 0x60640020, 4) for sub in range(1, 4)), (0x1A02, 0, 3, 1)],
    "entry-again": [(0x1A00, 1, 0x60410010, 4)],
    "entry-while-valid": [(0x1A00, 1, 0x60640020, 4)],
    "entry-again-counted": [(0x1A02, 1, 0x60410010, 4), (0x1A02, 0, 1, 1), (0x1A02, 1, 0x60410010, 4)],
    "entry-while-counted": [(0x1A02, 1, 0x60410010, 4), (0x1A02, 0, 1, 1), (0x1A02, 1, 0x60640020, 4)],
    "entry-zero": [(0x1A02, 1, 0, 4)],
    "missing-object": [(0x1A02, 1, 0x5FFE0010, 4)],
    "missing-sub-index": [(0x1A02, 1, 0x6041EE10, 4)],
    "not-mappable": [(0x1A02, 1, 0x10180120, 4)],
    "wrong-direction": [(0x1602, 1, 0x60410010, 4)],
    "entry-too-long": [(0x1A02, 1, 0x60410020, 4)],
    "entry-too-short": [(0x1A02, 1, 0x60410008, 4)],
    "dummy": [(0x1A02, 1, 0x00050008, 4)],
    "dummy-sub-index": [(0x1602, 1, 0x00050108, 4)],
}
#: what the family must be for a check to be made at all
NEEDS = {
    "rtr-bit": ('rtr_bit = { tpdo = "set", rpdo = "set" }', [(OFF, 1, 0x80000381, 4)]),
    "extended": ("extended_ids = false", [(OFF, 1, 0xA0000381, 4)]),
    "inhibit-high": ("max_inhibit_time = 100", [(OFF, 3, 101, 2)]),
    "event-high": ("max_event_timer = 100", [(OFF, 5, 101, 2)]),
    "no-entry": ("max_entries = 4", [(0x1A02, 5, 0x60410010, 4)]),
    "entry-bits": ("max_entry_bits = 8", [(0x1A02, 1, 0x60410010, 4)]),
    "granularity": ("granularity = 8", [(0x1A02, 1, 0x60410004, 4)]),
}


#: what may have limits in a file: name of its checks → object, sub-index, its size (bytes), and a value
LIMITED = {
    "cob-id": (OFF, 1, 4, 0x80000381), "type": (OFF, 2, 1, 9), "inhibit": (OFF, 3, 2, 9), "event": (OFF, 5, 2, 9),
    "sync-start": (OFF, 6, 1, 9), "count": (0x1A02, 0, 1, 2), "entry": (0x1A02, 1, 4, 0x60410010),
}  # fmt: skip
LIMITS = [f"{name}-{side}-limit" for name in LIMITED for side in ("above", "below")]


def limited(check: str, folder: Path, answer: int) -> int:
    """What a download outside a limit that only the file states is answered."""
    name, side = check.removesuffix("-limit").rsplit("-", 1)
    index, sub_index, size, value = LIMITED[name]
    limit = f"HighLimit={value - 1}" if side == "above" else f"LowLimit={value + 1}"
    header = f"[{index:X}sub{sub_index:X}]\n"
    text = family_eds("generic").read_text().replace("\r\n", "\n")
    assert header in text
    (folder / "limited.eds").write_text(text.replace(header, f"{header}{limit}\n"))
    own = "\n".join(f'[answers.{way}]\n"{check}" = {answer}' for way in ("tpdo", "rpdo"))
    family = read_family("own", f'like = "generic"\n{own}', "own")
    device = StrictDevice(read_eds(folder / "limited.eds").dictionary, family, 1)
    device.boot_up()
    client = Client.on(device)
    try:
        if name == "entry":
            client.write(index, 0, 0, 1)
        client.write(index, sub_index, value, size)
    except Aborted as aborted:
        return aborted.code
    return 0


def answered(text: str, downloads: list[tuple[int, int, int, int]]) -> int:
    """What the last of *downloads* answers on a generic device that *text* makes another one, 0 for accepted."""
    device = StrictDevice(
        read_eds(family_eds("generic")).dictionary, read_family("own", f'like = "generic"\n{text}', "own"), 1
    )
    device.boot_up()
    client = Client.on(device)
    for index, sub_index, value, size in [(0x1A02, 0, 0, 1), (0x1602, 0, 0, 1), *downloads[:-1]]:
        client.write(index, sub_index, value, size)
    try:
        client.write(*downloads[-1])
    except Aborted as aborted:
        return aborted.code
    return 0


def test_every_check_is_asked() -> None:
    assert {*ASKED, *NEEDS, *LIMITS} == set(CHECKS)


@pytest.mark.parametrize("check", [*ASKED, *NEEDS])
def test_a_family_answers_in_its_own_way(check: str) -> None:
    text, downloads = NEEDS.get(check) or ("", ASKED[check])
    for code in (OWN, 0):
        own = "\n".join(f'[answers.{way}]\n"{check}" = {code}' for way in ("tpdo", "rpdo"))
        assert answered(f"{text}\n{own}", downloads) == code


@pytest.mark.parametrize("check", LIMITS)
def test_a_family_answers_its_own_way_outside_a_limit_of_the_file(check: str, tmp_path: Path) -> None:
    assert limited(check, tmp_path, OWN) == OWN


@pytest.mark.parametrize("answer", [OWN, 0, None])
def test_a_family_answers_too_many_bits_also_under_a_fixed_count(answer: int | None, tmp_path: Path) -> None:
    text = family_eds("generic").read_text("utf-8").replace("\r\n", "\n")
    before, section, rest = text.partition("[1A02sub0]\n")
    fixed = rest.replace("AccessType=rw", "AccessType=ro", 1).replace("DefaultValue=0x02", "DefaultValue=3", 1)
    (tmp_path / "fixed.eds").write_text(f"{before}{section}{fixed}", "utf-8")
    own = "" if answer is None else f'[answers.tpdo]\n"too-many-bits" = {answer}'
    family = read_family("own", f'like = "generic"\n{own}', "own")
    device = StrictDevice(read_eds(tmp_path / "fixed.eds").dictionary, family, 1)
    device.boot_up()
    client = Client.on(device)
    for sub_index in (1, 2, 3):
        client.write(0x1A02, sub_index, 0x60640020, 4)
    try:
        client.write(OFF, 1, 0x381, 4)
        code = 0
    except Aborted as aborted:
        code = aborted.code
    assert code == (Abort.PDO_LENGTH if answer is None else answer)


def test_types_by_direction() -> None:
    text = "pdo_types = { tpdo = [[1, 1, 0], [241, 241, 0], [254, 255, 0x06090031]], rpdo = [[252, 252, 0]] }"
    assert [answered(text, [(OFF, 2, value, 1)]) for value in (1, 241, 2, 255)] == [0, 0, 0x06090030, 0x06090031]
    assert [answered(text, [(0x1402, 2, value, 1)]) for value in (1, 252)] == [0x06090030, 0]


class TestFolder:
    """`--sim ./pump`: a family of the user's own."""

    def test_it_behaves_as_its_file_says(self, tmp_path: Path) -> None:
        folder = tmp_path / "pump"
        folder.mkdir()
        (folder / "simulated.toml").write_text('like = "tmcm"\nmax_entries = 2\n')
        assert load_family_folder(folder).max_entries == 2
        with Bench((str(folder),)) as bench:
            ran = bench.run("map tpdo1 6041 6061 6064 --force --json")
            assert (ran.code, ran.document["abort"]) == (1, "0x06090011"), ran
        with Bench((f"{folder}@7",)) as bench:
            assert bench.run("pdo tpdo1 --json").document["node"] == 7

    def test_a_folder_without_an_eds_that_is_like_none(self, tmp_path: Path) -> None:
        (tmp_path / "simulated.toml").write_text("max_entries = 2\n")
        with Bench((str(tmp_path),)) as bench:
            ran = bench.run("pdo --json")
            assert (ran.code, "no EDS files" in ran.document["text"]) == (4, True), ran

    def test_a_wrong_key_names_file_and_line(self, tmp_path: Path) -> None:
        (tmp_path / "simulated.toml").write_text('like = "tmcm"\nmax_entrys = 2\n')
        with pytest.raises(InputFileError, match="max_entrys"):
            load_family_folder(tmp_path)
