from __future__ import annotations

import re
from dataclasses import replace
from itertools import takewhile
from pathlib import Path

import pytest
from hypothesis import given
from hypothesis import strategies as st

import dvtcli
from dvtcli.domain.pdo import Direction, split_dummy
from dvtcli.domain.profile import GENERIC, BitPolicy, PreOperational, Severity, VpdoGroup
from dvtcli.errors import InputFileError, UsageError
from dvtcli.files.profiles import (
    builtin_names,
    load_profile,
    may_be_of,
    profile_for_identity,
    profile_names,
    read_profile,
)
from tests.surroundings import HOMES, kept_in

FOLDER = Path(dvtcli.__file__).parent / "families"
HEAD = 'name = "x"\ntitle = "X"\n'


def read(text: str) -> None:
    read_profile(f"{HEAD}{text}\n", "x.toml")


def test_the_families_are_there() -> None:
    assert profile_names() == tuple(sorted(path.parent.name for path in FOLDER.glob("*/profile.toml")))
    assert {"generic", "gen4", "tmcm"} <= set(profile_names())
    assert [load_profile(name).name for name in profile_names()] == list(profile_names())


def test_the_generic_file_and_the_code_agree() -> None:
    assert load_profile("generic") == GENERIC


@pytest.mark.parametrize("path", sorted(FOLDER.glob("*/profile.toml")), ids=lambda path: path.parent.name)
def test_every_value_names_its_source(path: Path) -> None:
    """A paper that the head of the file names (`"EDS" = …`), CiA, or `assumed`: beside the value or above it."""
    lines = path.read_text(encoding="utf-8").splitlines()
    head = " ".join(takewhile(lambda line: line.startswith("#"), lines))
    papers = map(re.escape, re.findall(r'"([^"]+)" = \S', head))
    source = re.compile("|".join(("#.*(assumed", r"CiA \d{3}", *papers)) + ")", re.IGNORECASE)
    table, previous, missing = "", "", []
    for number, line in enumerate(lines, 1):
        if line.startswith("["):
            table = previous
        elif "=" in line.partition("#")[0] and not (source.search(line) or source.search(table)):
            missing.append(f"{path.name}:{number}: {line}")
        previous = line
    assert not missing, "say its source after it, or above its table: a paper that the file's head names, or assumed"


@pytest.mark.parametrize(
    ("name", "row"),
    [
        ("generic", (None, None, None, "keep", "keep", True, "no", (1,), None)),
        ("gen4", (5, 8, 1, "clear", "clear", False, "required", (1,), {1, 5, 6, 7})),
        ("espac", (9, 8, 1, "clear", "clear", False, "required", (1,), {1, 2, 3, 4})),
        ("tmcm", (None, None, 8, "set", "set", False, "no", (2, 1), None)),
        ("roboteq", (4, 8, 8, "set", "keep", True, "advised", (), None)),
    ],
)
def test_families_by_behaviour(name: str, row: tuple[object, ...]) -> None:
    profile = load_profile(name)
    assert row == (
        profile.pdo_count,
        profile.max_entries,
        profile.granularity,
        profile.rtr_bit[Direction.TPDO],
        profile.rtr_bit[Direction.RPDO],
        profile.extended_ids,
        profile.pre_operational_gate,
        profile.store.sub_indices,
        profile.dummies,
    )


@pytest.mark.parametrize(
    ("vendor", "product", "name"),
    [
        (0x1E, 0x0705_302D, "gen4"),
        (0x1E, 0x0705_6E1E, "gen4"),
        (0x1E, 0x0701_0001, "espac"),
        (0x1E, 0x0806_0000, "generic"),
        (0x286, 0x1844, "tmcm"),
        (0x469, 0xFFFF_FFFF, "roboteq"),
        (0, 0, "generic"),
        (0xFFFF_FFFF, 0x0705_302D, "generic"),
    ],
)
def test_a_device_s_identity_chooses_its_family(vendor: int, product: int, name: str) -> None:
    assert profile_for_identity(vendor, product).name == name


def test_objects_and_reasons_of_a_device_that_guards_its_state() -> None:
    profile = load_profile("gen4")
    assert (profile.state_object, profile.state_request) == ((0x5110, 0), (0x2800, 0))
    assert (profile.master_object, profile.extended_error) == ((0x5800, 0), (0x5310, 0))
    assert sorted(profile.reasons) == [*range(1, 14), 16, 17, 32, 33]
    assert profile.reasons[4] == "the node is not pre-operational"
    assert profile.login is not None
    assert (profile.login.level, profile.login.needed) == ((0x5000, 1), 4)
    covered = [index for index in (0x1006, 0x1010, 0x1800, 0x2800, 0x3300, 0x60FF) if profile.login.asked_for(index)]
    assert covered == [0x1010, 0x1800, 0x2800, 0x3300]
    assert (profile.store.only_pre_operational, profile.store.timeout_s) == (True, 20)
    assert [index for index in (0x1006, 0x1200, 0x1A00, 0x2800, 0x3000) if profile.store.needed_for(index)] == [
        0x1200,
        0x1A00,
    ]


def test_virtual_pdos() -> None:
    groups = load_profile("espac").vpdo
    assert {name: (group.index, group.none) for name, group in groups.items()} == {
        "motor": (0x3000, 0x20FF),
        "digital-out": (0x3100, 0x23FF),
        "analogue-out": (0x3200, 0x24FF),
        "digital-in": (0x3300, 0x21FF),
        "analogue-in": (0x3400, 0x22FF),
    }
    drives = tuple((index, index) for index in (0x6040, 0x6072, 0x60FF))
    assert groups["motor"] == VpdoGroup(0x3000, ((0x2020, 0x2021), (0x2040, 0x2040), (0x2060, 0x2060)), 0x20FF, drives)
    motors = [value for value in (0x2020, 0x2022, 0x2060, 0x20FF, 0x2121) if groups["motor"].allows(value)]
    assert motors == [0x2020, 0x2060, 0x20FF]


def test_advice_on_what_to_map() -> None:
    gen4 = load_profile("gen4")
    assert "6800" in (gen4.why_not_in_tpdo(0x2121) or "")
    assert "6C01" in (gen4.why_not_in_tpdo(0x2220) or "")
    assert [index for index in (0x20FF, 0x6800, 0x6C01, 0x606C) if gen4.why_not_in_tpdo(index)] == []
    assert gen4.rww_in_tpdo is Severity.WARNING
    assert load_profile("tmcm").rw_in_tpdo is Severity.ERROR


def test_transmission_types() -> None:
    tmcm = load_profile("tmcm")
    assert [value for value in (0, 1, 240, 241, 252, 253, 254, 255) if tmcm.allows_type(value)] == [1, 240, 254, 255]
    assert [value for value in range(256) if not GENERIC.allows_type(value)] == list(range(241, 252))
    assert "event timer" in tmcm.type_notes[240]
    assert 254 not in tmcm.type_notes


def test_the_notes_dummy_lists_can_skip_16_bits() -> None:
    for name, word in (("espac", 0x0003_0010), ("gen4", 0x0006_0010)):
        (entry,) = split_dummy(16, load_profile(name).dummies or ())
        assert entry.raw == word


@pytest.mark.parametrize(("name", "hint"), [("gen5", "did you mean 'gen4'?"), ("zzz", ", ".join(builtin_names()[:2]))])
def test_unknown_names_get_a_hint(name: str, hint: str) -> None:
    with pytest.raises(UsageError, match=name) as caught:
        load_profile(name)
    assert (caught.value.hint or "").startswith(hint)


@pytest.mark.parametrize(
    ("text", "line", "words", "hint"),
    [
        ("granularty = 1", 3, "granularty: unknown key", "did you mean 'granularity'?"),
        ("[store]\ntimout_s = 2", 4, "store.timout_s: unknown key", "did you mean 'timeout_s'?"),
        ("[vpdo.motor]\nindex = 1\nnone = 0\nvalue = []", 6, "vpdo.motor.value: unknown key", "'values'?"),
        ("zzz = 1", 3, "zzz: unknown key", None),
        ("# nothing\n\npdo_count = 0", 5, "pdo_count: 0 is not within 1..512", None),
        ("pdo_count = true", 3, "must be a whole number, not true", None),
        ('max_entries = "8"', 3, "must be a whole number, not '8'", None),
        ("extended_ids = 1", 3, "must be true or false, not 1", None),
        ("title2 = 1", 3, "unknown key", "did you mean 'title'?"),
        ('pre_operational_gate = "advise"', 3, "must be required, advised or no", "did you mean 'advised'?"),
        ('rw_in_tpdo = "warn"', 3, "must be error, warning, note or fine", "did you mean 'warning'?"),
        ('state_object = "5110"', 3, "must be an object such as '6C01:01'", None),
        ("state_object = 0x5110", 3, "must be an object", None),
        ("dummies = [1, 8]", 3, "8 is not within 1..7", None),
        ("dummies = 1", 3, "must be a list, not 1", None),
        ("dummies = true", 3, "must be a list, not true", None),
        ("transmission_types = [[9, 1]]", 3, "the first is above the last", None),
        ("transmission_types = [[1, 2, 3]]", 3, "must be a pair", None),
        ("product_masks = [[0xFF00, 0x1234]]", 3, "can never match", None),
        ('[rtr_bit]\ntpdo = "set"', 3, "rtr_bit: the key 'rpdo' is missing", None),
        ('[rtr_bit]\ntpdo = "on"\nrpdo = "keep"', 4, "rtr_bit.tpdo: must be keep, set or clear", None),
        ("store = 1", 3, "store: must be a table", None),
        ("[store]\ntimeout_s = 0", 4, "0 s is not within", None),
        ('[store]\ntimeout_s = "2"', 4, "must be a number of seconds", None),
        ('[reasons]\nfour = "x"', 4, "reasons.four: the key must be a number", None),
        ('[type_notes]\n1-256 = "x"', 4, "the key must be within 0..255", None),
        ('[type_notes]\n9-1 = "x"', 4, "the lower number first", None),
        ("[reasons]\n4 = 4", 4, "reasons.4: must be a text", None),
        ('[aliases]\n"Seat switch" = "2124:00"', 4, "small letters", "did you mean 'seat_switch'?"),
        ('[aliases]\nseat = "2124"', 4, "aliases.seat: must be an object", None),
        ('[warn_mapped]\n21XX = "x"', 4, "the key must be a number", None),
        ('like = "gen5"', 3, "unknown built-in profile 'gen5'", "did you mean 'gen4'?"),
        ("pdo_count = ", "3:13", "Invalid value", None),
        ("pdo_count = 1\npdo_count = 2", "4:14", "Cannot overwrite a value", None),
        ("[software_identification]\n0 = 1\n", 4, "the key must be a program, 1…254", None),
        ("[software_identification]\n255 = 1\n", 4, "the key must be a program, 1…254", None),
        ("[software_identification]\n1 = -1\n", 4, "-1 is not within 0..4294967295", None),
    ],
)
def test_complaints_name_line_and_key(text: str, line: int | str, words: str, hint: str | None) -> None:
    with pytest.raises(InputFileError, match=re.escape(words)) as caught:
        read(text)
    assert caught.value.place == f"x.toml:{line}"
    assert (hint or "") in (caught.value.hint or "")
    assert hint is not None or caught.value.hint is None


def test_a_table_says_only_what_differs() -> None:
    base = read_profile(HEAD + 'like = "gen4"\n', "x.toml")
    profile = read_profile(HEAD + 'like = "gen4"\n[store]\ntimeout_s = 30\n[aliases]\npressure = "6C01:02"\n', "x.toml")
    assert profile.aliases == {**base.aliases, "pressure": "6C01:02"}
    assert profile.store == replace(base.store, timeout_s=30.0)


@pytest.mark.parametrize("missing", ["name", "title"])
def test_a_profile_has_a_name_and_a_title(missing: str) -> None:
    text = "\n".join(line for line in HEAD.splitlines() if not line.startswith(missing))
    with pytest.raises(InputFileError, match=f"'{missing}' is missing"):
        read_profile(text, "x.toml")


def test_a_file_starts_from_the_profile_it_is_like() -> None:
    profile = read_profile(HEAD + 'like = "roboteq"\npdo_count = 2\n', "x.toml")
    assert (profile.name, profile.pdo_count, profile.max_entries) == ("x", 2, 8)
    assert profile.rtr_bit[Direction.TPDO] is BitPolicy.SET
    assert profile.pre_operational_gate is PreOperational.ADVISED


@given(st.text(max_size=60))
def test_junk_is_an_input_file_error(text: str) -> None:
    place = "x.toml:1"
    try:
        read(text)
    except InputFileError as error:
        place = error.place or ""
    assert re.fullmatch(r"x\.toml:\d+(:\d+)?", place)


def test_a_built_in_profile_s_vendors_are_known_without_parsing_it() -> None:
    profiles = [load_profile(name) for name in builtin_names()]
    vendors = {vendor for profile in profiles for vendor in profile.vendor_ids}
    assert {0x1E, 0x469} <= vendors
    for profile in profiles:
        assert {one for one in (0, 1, *vendors) if may_be_of(profile.name, one)} == set(profile.vendor_ids)


FAMILIES = sorted(FOLDER.glob("*/*.eds"))


@pytest.mark.parametrize("path", FAMILIES, ids=lambda path: path.stem)
def test_a_simulated_family_s_identity_chooses_the_profile_of_its_name(path: Path) -> None:
    text = path.read_text(encoding="utf-8")
    vendor, product = (re.search(rf"^{key}Number=(\w+)", text, re.MULTILINE) for key in ("Vendor", "Product"))
    assert vendor is not None
    assert product is not None
    wanted = path.stem if path.stem in profile_names() and load_profile(path.stem).vendor_ids else "generic"
    found = profile_for_identity(int(vendor[1], 0), int(product[1], 0)).name
    assert found == wanted, f"{path.name}: its VendorNumber and ProductNumber choose {found}, not {wanted}"


def test_one_s_own_profile_counts_as_it_is_now(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """A process that was asked before it was written, after it changed, or with another home, is told the truth."""
    for name in HOMES:
        monkeypatch.setenv(name, str(tmp_path))
    assert profile_for_identity(0x1E, 0x0705302D).name == "gen4"
    own = kept_in(tmp_path) / "profiles" / "pump.toml"
    own.parent.mkdir(parents=True)
    for title in ("Pump", "Pump controller"):
        head = f'name = "pump"\ntitle = "{title}"\nlike = "gen4"\n'
        own.write_text(f"{head}vendor_ids = [0x1E]\nproduct_codes = [0x0705302D]\n", "utf-8")
        assert profile_for_identity(0x1E, 0x0705302D) == load_profile("pump")
        assert load_profile("pump").title == title
    for name in HOMES:
        monkeypatch.setenv(name, str(tmp_path / "another"))
    assert profile_for_identity(0x1E, 0x0705302D).name == "gen4"
    with pytest.raises(UsageError):
        load_profile("pump")
