"""What is in RAM only: which store or reset takes it, and what forbids a store."""

from __future__ import annotations

import pytest

from dvtcli.device.store.pending import CHANGE, COMMUNICATION, EVERYTHING, REBOOT, VERIFY, Pending

APPLICATION, MAKERS_OWN = 3, 4


@pytest.mark.parametrize(
    ("group", "index", "covered"),
    [
        (EVERYTHING, 0x0000, True), (EVERYTHING, 0x1800, True), (EVERYTHING, 0x2000, True), (EVERYTHING, 0xFFFF, True),
        (COMMUNICATION, 0x0FFF, False), (COMMUNICATION, 0x1000, True), (COMMUNICATION, 0x1FFF, True),
        (COMMUNICATION, 0x2000, False), (APPLICATION, 0x5FFF, False), (APPLICATION, 0x6000, True),
        (APPLICATION, 0x9FFF, True), (APPLICATION, 0xA000, False),
        (MAKERS_OWN, 0x0000, False), (MAKERS_OWN, 0x0001, False), (MAKERS_OWN, 0x2000, False),
    ],
)  # fmt: skip
def test_a_group_covers_its_indices_and_no_others(group: int, index: int, covered: bool) -> None:
    pending = Pending()
    pending.changed("it", index)
    assert pending.covered(group) == (("it",) if covered else ())
    assert pending.forget(group) == (("it",) if covered else ())
    assert pending.unstored == ({} if covered else {"it": index})


def test_a_node_of_which_nothing_was_changed_holds_what_is_stored() -> None:
    pending = Pending()
    assert pending.is_as_stored(0)
    assert not pending.is_as_stored(1)
    assert pending.lost_until == 0
    assert pending.boot_ups is None


def test_what_was_stored_whole_counts_from_then_on() -> None:
    pending = Pending()
    pending.changed("TPDO1", 0x1800)
    pending.changed("0x6060:00", 0x6060)
    assert pending.was_stored(EVERYTHING, 2) == ("TPDO1", "0x6060:00")
    assert pending.is_as_stored(2)
    assert not pending.is_as_stored(1)


def test_after_a_part_was_stored_no_number_of_changes_stands_for_what_is_stored() -> None:
    pending = Pending()
    pending.changed("TPDO1", 0x1800)
    pending.changed("0x6060:00", 0x6060)
    assert pending.was_stored(COMMUNICATION, 2) == ("TPDO1",)
    assert not pending.is_as_stored(0)
    assert not pending.is_as_stored(2)
    assert pending.was_stored(EVERYTHING, 2) == ("0x6060:00",)
    assert pending.is_as_stored(2)


def test_a_part_that_had_nothing_changes_nothing_but_a_maker_s_own_may_have_taken_anything() -> None:
    pending = Pending()
    pending.changed("TPDO1", 0x1800)
    assert pending.was_stored(APPLICATION, 1) == ()
    assert pending.is_as_stored(0)
    assert pending.was_stored(MAKERS_OWN, 1) == ()
    assert not pending.is_as_stored(0)


def suspicious() -> Pending:
    return Pending(suspicions={CHANGE: "a", VERIFY: "b", REBOOT: "c"})


def test_only_a_whole_reset_ends_every_suspicion() -> None:
    pending = suspicious()
    pending.changed("TPDO1", 0x1800)
    pending.changed("0x6060:00", 0x6060)
    assert pending.was_reset(COMMUNICATION, 3) == ("TPDO1",)
    assert pending.boot_ups == 3
    assert pending.suspicions == suspicious().suspicions
    assert pending.was_reset(EVERYTHING, 4) == ("0x6060:00",)
    assert (pending.boot_ups, pending.suspicions) == (4, {})


def test_a_restart_is_one_only_beside_what_was_known_before() -> None:
    pending = Pending()
    pending.changed("TPDO1", 0x1800)
    assert pending.rebooted(1) == (), "seen for the first time"
    assert pending.rebooted(1) == ()
    assert pending.suspicions == {}
    assert pending.rebooted(2) == ("TPDO1",)
    assert pending.suspicions == {REBOOT: "it restarted, and unstored values are lost (TPDO1)"}
    assert pending.rebooted(2) == ()


def test_a_restart_that_took_nothing_is_no_reason_for_anything() -> None:
    pending = Pending(boot_ups=1)
    assert pending.rebooted(2) == ()
    assert pending.suspicions == {}


def test_what_others_left_is_named_before_our_own_and_once() -> None:
    pending = Pending()
    pending.changed("TPDO1", 0x1800)
    pending.changed("TPDO2", 0x1801)
    pending.of_others({"1017:00": 0x1017, "TPDO2": 0x1801})
    assert list(pending.unstored.items()) == [("1017:00", 0x1017), ("TPDO2", 0x1801), ("TPDO1", 0x1800)]


def test_after_its_defaults_were_restored_no_number_of_changes_stands_for_what_it_holds() -> None:
    pending = Pending()
    pending.was_stored(EVERYTHING, 1)
    assert pending.is_as_stored(1)
    pending.was_restored(2)
    assert [pending.is_as_stored(changes) for changes in (0, 1, 2)] == [False] * 3
    assert (pending.stored_at, pending.lost_until) == (0, 2)
