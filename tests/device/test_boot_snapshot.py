"""What a node came up with stands for what is stored only while all of it was read, and nothing written, since."""

from __future__ import annotations

from dvtcli.device.read_pdos import read_pdo
from dvtcli.device.store.pending import BootSnapshot
from dvtcli.domain.pdo import Pdo
from tests.laws.bench import DirectSdo, booted

TPDO1, TPDO2 = Pdo.parse("tpdo1"), Pdo.parse("tpdo2")
SDO = DirectSdo(booted())
FIRST, SECOND = read_pdo(SDO, TPDO1), read_pdo(SDO, TPDO2)
BOTH = {TPDO1: FIRST, TPDO2: SECOND}


def test_without_a_boot_up_nobody_knows_what_was_written_before() -> None:
    boot_snapshot = BootSnapshot()
    boot_snapshot.read(0, BOTH)
    assert boot_snapshot.why_not(0, BOTH) == "no boot-up message was received"
    assert BootSnapshot().why_not(1, BOTH) == "its PDOs were not read after its last boot-up"


def test_what_was_read_after_the_boot_up_counts_until_the_next() -> None:
    boot_snapshot = BootSnapshot()
    boot_snapshot.read(1, BOTH)
    assert boot_snapshot.why_not(1, BOTH) == ""
    assert boot_snapshot.why_not(2, BOTH) == "its PDOs were not read after its last boot-up"


def test_parts_of_it_may_be_read_one_after_the_other() -> None:
    boot_snapshot = BootSnapshot()
    boot_snapshot.read(1, {TPDO1: FIRST})
    assert boot_snapshot.why_not(1, BOTH) == "not all its PDOs were read after its last boot-up"
    assert boot_snapshot.why_not(1, {TPDO1: FIRST}) == ""
    boot_snapshot.read(1, BOTH)
    assert boot_snapshot.why_not(1, BOTH) == ""


def test_a_pdo_that_is_gone_is_not_as_it_came_up() -> None:
    boot_snapshot = BootSnapshot()
    boot_snapshot.read(1, BOTH)
    assert boot_snapshot.why_not(1, {TPDO1: FIRST}) == "TPDO2 had a value at boot and can no longer be read"
    assert boot_snapshot.why_not(1, {}) == "TPDO1, TPDO2 had a value at boot and can no longer be read"


def test_the_first_reading_counts_and_not_what_somebody_else_made_of_it() -> None:
    boot_snapshot = BootSnapshot()
    boot_snapshot.read(1, BOTH)
    now = BOTH | {TPDO2: FIRST}
    boot_snapshot.read(1, now)
    assert boot_snapshot.why_not(1, now) == "its PDOs differ from their values at boot"


def test_what_was_written_is_over_with_the_next_boot_up() -> None:
    boot_snapshot = BootSnapshot()
    boot_snapshot.read(1, BOTH)
    boot_snapshot.wrote(1)
    boot_snapshot.read(1, BOTH)
    assert boot_snapshot.why_not(1, BOTH) == "it was written since its last boot-up"
    boot_snapshot.read(2, BOTH)
    assert boot_snapshot.why_not(2, BOTH) == ""


def test_what_is_written_before_anything_was_read_counts_too() -> None:
    boot_snapshot = BootSnapshot()
    boot_snapshot.wrote(1)
    boot_snapshot.read(1, BOTH)
    assert boot_snapshot.why_not(1, BOTH) == "it was written since its last boot-up"
    boot_snapshot.wrote(2)
    assert boot_snapshot.why_not(2, BOTH) == "it was written since its last boot-up"
