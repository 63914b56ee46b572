"""When a signal stops the work at once, when at the next safe point, and when it comes too late."""

from __future__ import annotations

import pytest

from dvtcli.device.cancellation import INTERRUPTED, Cancellation

HANG_UP, TERMINATED = 129, 143


@pytest.fixture
def cancellation() -> Cancellation:
    return Cancellation()


def test_nothing_is_requested_and_nothing_written_at_first(cancellation: Cancellation) -> None:
    assert (cancellation.requested, cancellation.active, cancellation.exit_code) == (False, False, 130)
    assert INTERRUPTED == 130


@pytest.mark.parametrize("insists", [True, False])
def test_where_nothing_is_written_a_signal_stops_at_once(cancellation: Cancellation, insists: bool) -> None:
    assert cancellation.asked(TERMINATED, insists=insists) is True
    assert not cancellation.requested
    assert cancellation.exit_code == TERMINATED


def test_in_a_change_the_first_one_waits_and_a_second_one_stops_only_where_it_insists(
    cancellation: Cancellation,
) -> None:
    with cancellation.deferred():
        assert cancellation.asked(INTERRUPTED, insists=True) is False
        assert cancellation.requested is True
        assert cancellation.asked(HANG_UP, insists=False) is False
        assert cancellation.asked(INTERRUPTED, insists=True) is True
    assert cancellation.asked(INTERRUPTED, insists=False) is True


def test_what_ends_the_program_counts_whatever_came_before_or_comes_after(cancellation: Cancellation) -> None:
    for code, counts in ((INTERRUPTED, INTERRUPTED), (TERMINATED, TERMINATED), (HANG_UP, TERMINATED)):
        cancellation.asked(code, insists=True)
        assert cancellation.exit_code == counts


def test_a_question_in_a_change_is_stopped_at_once(cancellation: Cancellation) -> None:
    with cancellation.deferred():
        with cancellation.released():
            assert not cancellation.active
            assert cancellation.asked(INTERRUPTED, insists=True) is True
        assert cancellation.active
        assert not cancellation.requested
        with cancellation.deferred():
            assert cancellation.active
        assert cancellation.active, "the inner change was part of an outer one"
    assert not cancellation.active


def test_the_way_back_is_not_stopped_by_what_asked_for_it_and_remembers_it(cancellation: Cancellation) -> None:
    with cancellation.deferred():
        cancellation.asked(INTERRUPTED, insists=True)
        with cancellation.rolling_back():
            assert cancellation.active
            assert not cancellation.requested
        assert cancellation.requested
        assert cancellation.asked(INTERRUPTED, insists=True) is True, "it is the second one outside of the way back"


def test_a_signal_on_the_way_back_waits_for_its_end_and_a_second_one_that_insists_tears_it(
    cancellation: Cancellation,
) -> None:
    with cancellation.rolling_back():
        assert cancellation.asked(INTERRUPTED, insists=True) is False
        assert not cancellation.requested, "there is no safe point before the way back's end"
        assert cancellation.asked(INTERRUPTED, insists=False) is False
        assert cancellation.asked(INTERRUPTED, insists=True) is True
    assert cancellation.requested
    cancellation.reset()
    with cancellation.rolling_back():
        assert cancellation.asked(INTERRUPTED, insists=True) is False, "what came on an earlier way back is over"
    with cancellation.deferred():
        cancellation.requested = False
        assert cancellation.asked(INTERRUPTED, insists=True) is False
        assert cancellation.requested


def test_nothing_that_asked_for_nothing_is_requested_after_the_way_back(cancellation: Cancellation) -> None:
    with cancellation.rolling_back():
        pass
    assert (cancellation.requested, cancellation.active) == (False, False)


def test_what_comes_when_a_change_is_complete_waits_for_the_line_s_end(cancellation: Cancellation) -> None:
    cancellation.hold()
    assert cancellation.asked(INTERRUPTED, insists=True) is False
    assert cancellation.requested
    cancellation.release()
    assert not cancellation.active
    cancellation.hold()
    cancellation.reset()
    assert (cancellation.requested, cancellation.active) == (False, False)
