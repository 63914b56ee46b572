"""Backups are found by bus, node and identity, named by their time; and CAN-IDs are given up before they are taken."""

from __future__ import annotations

import os
from pathlib import Path

import pytest

from dvtcli.device.change.change_guard import BackingUp, Backup, backups, pdos_freeing_can_ids_first, way_to
from dvtcli.device.change.change_history import ChangeHistory
from dvtcli.device.change.plan_document import Identity
from dvtcli.device.read_pdos import read_pdo
from dvtcli.domain.cob_id import CobId
from dvtcli.domain.pdo import Pdo, PdoConfig
from dvtcli.domain.plan import PdoChange, Plan, plan_pdo
from dvtcli.domain.script_line import identity_line
from dvtcli.errors import SafetyRefusal
from tests.laws.bench import DirectSdo, booted

IDENTITY: Identity = {"vendor": 0x1A, "product": 2, "revision": 3, "serial": 4}


def backup(folder: Path, name: str, identity: Identity | None = IDENTITY, behind: int = 0) -> str:
    """Write a backup that pins *identity* (None for none) *behind* so many lines; its name."""
    pinned = [] if identity is None else [identity_line(identity)]
    (folder / name).write_text("\n".join(["# a line"] * behind + pinned + ["clear tpdo1"]), "utf-8")
    return name


def test_those_of_this_node_of_this_bus_and_device_are_found_oldest_first(tmp_path: Path) -> None:
    late = backup(tmp_path, "can0-5-20261122T041120.123456Z.dvt")
    early = backup(tmp_path, "can0-5-20250101T000000.000000Z.dvt")
    backup(tmp_path, "can0-7-20251122T041120.123456Z.dvt")
    backup(tmp_path, "can1-5-20251122T041120.123456Z.dvt")
    backup(tmp_path, "can0-5-20251122T041120.123456Z.txt")
    backup(tmp_path, "can0-5-20251123T041120.123456Z.dvt", {**IDENTITY, "product": 5})
    backup(tmp_path, "can0-5-20251124T041120.123456Z.dvt", None)
    (tmp_path / "can0-5-20251125T041120.123456Z.dvt").mkdir()
    found = backups(tmp_path, "can0", 5, IDENTITY)
    assert [one.path.name for one in found] == [early, late]
    assert [one.stamp for one in found] == ["20250101T000000.000000Z", "20261122T041120.123456Z"]


@pytest.mark.parametrize(("behind", "found"), [(0, 1), (4, 1), (5, 0)])
def test_the_identity_stands_among_the_first_five_lines(tmp_path: Path, behind: int, found: int) -> None:
    backup(tmp_path, "can0-5-20261122T041120.123456Z.dvt", behind=behind)
    assert len(backups(tmp_path, "can0", 5, IDENTITY)) == found


@pytest.mark.parametrize(
    ("when", "made"),
    [
        ("2026-11-22", True),
        ("20261122T0411", True),
        ("2026-11-22 04:11:20.123456", True),
        ("2026-11-22 04:12", False),
        ("1122", False),
        ("newest", False),
        ("", False),
    ],
)
def test_a_time_is_as_exact_as_it_is_given(when: str, made: bool) -> None:
    assert Backup(Path(), "20261122T041120.123456Z").was_made(when) == made


SDO = DirectSdo(booted())


def pdo(text: str, cob_id: int) -> tuple[Pdo, PdoConfig]:
    """A PDO of the generic drive as it would be with this COB-ID."""
    one = Pdo.parse(text)
    held = read_pdo(SDO, one)
    return one, held.with_parameters(cob_id=CobId.from_raw(cob_id))


@pytest.mark.parametrize(
    ("held", "wanted", "order"),
    [
        ({"tpdo1": 0x181, "tpdo2": 0x281}, {"tpdo1": 0x281, "tpdo2": 0x301}, ["tpdo2", "tpdo1"]),
        ({"tpdo1": 0x181, "tpdo2": 0x281}, {"tpdo1": 0x301, "tpdo2": 0x181}, ["tpdo1", "tpdo2"]),
        ({"tpdo1": 0x181, "tpdo2": 0x281, "tpdo3": 0x381}, {"tpdo1": 0x281, "tpdo2": 0x381, "tpdo3": 0x481},
         ["tpdo3", "tpdo2", "tpdo1"]),
        ({"tpdo1": 0x181, "tpdo2": 0x281}, {"tpdo1": 0x281, "tpdo2": 0x181}, ["tpdo1", "tpdo2"]),  # nobody can begin
        ({"tpdo1": 0x181, "tpdo2": 0x8000_0281}, {"tpdo1": 0x281, "tpdo2": 0x301}, ["tpdo1", "tpdo2"]),  # it is off
        ({"tpdo1": 0x181, "tpdo2": 0x281}, {"tpdo1": 0x8000_0281, "tpdo2": 0x301}, ["tpdo1", "tpdo2"]),  # it stays off
        ({"tpdo1": 0x181, "tpdo2": 0x2000_0281}, {"tpdo1": 0x281, "tpdo2": 0x301}, ["tpdo1", "tpdo2"]),  # 29 bits
    ],
)  # fmt: skip
def test_a_can_id_is_given_up_before_another_pdo_gets_it(
    held: dict[str, int], wanted: dict[str, int], order: list[str]
) -> None:
    before, after = (dict(pdo(*row) for row in rows.items()) for rows in (held, wanted))
    assert [str(change.pdo) for change in way_to(before, after)] == order
    assert [
        str(change.pdo)
        for change in pdos_freeing_can_ids_first(plan_pdo(one, before[one], after[one]) for one in before)
    ] == order


def test_what_is_right_already_is_left_alone() -> None:
    before = dict(pdo(*row) for row in {"tpdo1": 0x181, "tpdo2": 0x281}.items())
    after = dict(pdo(*row) for row in {"tpdo1": 0x181, "tpdo2": 0x301}.items())
    assert [str(change.pdo) for change in way_to(before, after)] == ["tpdo2"]
    assert way_to(before, before) == ()


def held(text: str, event_timer: int) -> tuple[Pdo, PdoConfig]:
    one = Pdo.parse(text)
    config = read_pdo(SDO, one)
    return one, config.with_parameters(event_timer=event_timer)


@pytest.fixture
def kept(tmp_path: Path) -> BackingUp:
    """Backups of node 5, of which there is one, with TPDO1 and TPDO2 at 10 ms."""
    history = ChangeHistory(tmp_path / "state" / "changes", "can0")
    backing_up = BackingUp(tmp_path / "state" / "backups", "can0", 5, history)
    assert backing_up.needed(IDENTITY, {}), "there is none yet"
    backing_up.make(IDENTITY, dict([held("tpdo1", 10), held("tpdo2", 10)]), ())
    return backing_up


def test_a_backup_is_needed_where_nothing_that_is_kept_says_what_a_pdo_holds(kept: BackingUp) -> None:
    assert not kept.needed(IDENTITY, {})
    assert not kept.needed(IDENTITY, dict([held("tpdo1", 10), held("tpdo2", 10)]))
    assert kept.needed(IDENTITY, dict([held("tpdo1", 10), held("tpdo2", 20)]))
    assert kept.needed({**IDENTITY, "serial": 5}, {}), "of another device of its kind"


def test_what_undo_remembers_needs_no_backup(kept: BackingUp) -> None:
    before, after, other = held("tpdo1", 20), held("tpdo1", 30), held("tpdo2", 20)
    kept.history.add(Plan(5, (plan_pdo(before[0], before[1], after[1]),)), IDENTITY)
    for known in (before, after):
        assert not kept.needed(IDENTITY, dict([known]))
    assert kept.needed(IDENTITY, dict([before, other]))
    assert kept.needed(IDENTITY, dict([held("tpdo1", 40)]))
    kept.history.path(5, IDENTITY).write_text("rubbish", "utf-8")
    assert kept.needed(IDENTITY, dict([before])), "it is not known what it remembered"
    assert not kept.needed(IDENTITY, {})


def test_what_undo_remembers_may_be_all_that_is_unlike(kept: BackingUp) -> None:
    one, config = held("tpdo1", 20)
    kept.history.add(Plan(5, (PdoChange(one, config, config, ()),)), IDENTITY)
    assert not kept.needed(IDENTITY, {one: config})


@pytest.mark.skipif(os.name != "posix", reason="Windows has no modes of this kind")
def test_backups_that_others_could_have_written_are_not_believed(kept: BackingUp) -> None:
    kept.folder.chmod(0o777)
    with pytest.raises(SafetyRefusal, match="everybody can write it"):
        kept.needed(IDENTITY, {})
