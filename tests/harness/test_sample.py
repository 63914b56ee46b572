"""A lot that draws some of a test's cases leaves the others to `--cases rest`, and none to nobody."""

from __future__ import annotations

from math import ceil

import pytest
from hypothesis import given
from hypothesis import strategies as some

from tests.harness.costs import heavy_tests, is_there, takes_much
from tests.harness.sample import CASES, LESS, left_out, mark_many, mark_quick, share_of


@pytest.fixture
def items(request: pytest.FixtureRequest) -> list[pytest.Item]:
    """All tests of this file, whatever the lot has drawn of them."""
    module = request.node.getparent(pytest.Module)
    assert module is not None
    return [item for item in module.collect() if isinstance(item, pytest.Item)]


@pytest.mark.drawn(3)
@pytest.mark.parametrize("number", range(12))
def test_one_of_twelve(number: int) -> None:
    assert number in range(12)


def test_what_the_lot_leaves_out_is_the_rest(items: list[pytest.Item], pytestconfig: pytest.Config) -> None:
    cases = {item for item in items if item.name.startswith("test_one_of_twelve")}
    by_lot, by_rest = (left_out(items, pytestconfig, wanted) for wanted in ("lot", "rest"))
    by_lot, by_rest = by_lot & cases, by_rest & cases
    assert (len(by_lot), len(by_rest)) == (9, 3)
    assert by_lot | by_rest == cases
    assert left_out(items, pytestconfig, "all") == set()


@pytest.mark.parametrize("share", [1, 3, 100])
def test_more_is_the_lot_and_a_share_of_the_rest(
    items: list[pytest.Item], pytestconfig: pytest.Config, share: int, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(pytestconfig.option, "share", share)
    mark_many(items, frozenset())
    by_lot, by_rest, by_more = (left_out(items, pytestconfig, wanted) for wanted in ("lot", "rest", "more"))
    assert by_lot
    assert by_more == by_lot & by_rest


@pytest.mark.parametrize("number", range(CASES + 4))
def test_one_of_many(number: int) -> None:
    assert number in range(CASES + 4)


@pytest.mark.parametrize("number", range(CASES))
def test_one_of_few(number: int) -> None:
    assert number in range(CASES)


@pytest.mark.parametrize("number", range(CASES + 1))
@given(some.integers())
def test_one_of_many_laws(number: int, any_number: int) -> None:
    assert any_number in range(any_number, any_number + 1 + number)


def test_of_many_cases_a_lot_is_taken_that_nobody_asked_for(
    items: list[pytest.Item], pytestconfig: pytest.Config
) -> None:
    mark_many(items, frozenset())
    by_lot, by_rest = (left_out(items, pytestconfig, wanted) for wanted in ("lot", "rest"))
    names = ("test_one_of_many", "test_one_of_few", "test_one_of_many_laws", "test_one_of_twelve")
    left = {
        name: [sum(item.name.startswith(f"{name}[") for item in out) for out in (by_lot, by_rest)] for name in names
    }
    assert left == {
        "test_one_of_many": [4, CASES],
        "test_one_of_few": [0, 0],
        "test_one_of_many_laws": [0, 0],
        "test_one_of_twelve": [9, 3],  # as its own mark says
    }
    marked = [item for item in items if item.get_closest_marker("drawn") and item.name.startswith("test_one_of_many[")]
    assert len(marked) == CASES + 4  # `-m drawn --cases rest` finds them


def test_the_first_of_a_file_that_is_not_long_is_quick(items: list[pytest.Item]) -> None:
    """In whatever order they come; a law of Hypothesis is none, nor what is counted."""
    mark_quick(items[::-1])
    assert [item.name for item in items if item.get_closest_marker("quick")] == ["test_one_of_twelve[0]"]


@pytest.mark.drawn(1, "alike")
@pytest.mark.parametrize("number", range(2))
def test_one_of_those_alike(number: int) -> None:
    assert number in range(2)


@pytest.mark.drawn(1, "alike")
def test_another_one_of_those_alike() -> None: ...


def test_tests_of_one_name_are_one_lot(items: list[pytest.Item], pytestconfig: pytest.Config) -> None:
    alike = {item for item in items if "those_alike" in item.name}
    assert len(alike) == 3
    by_lot, by_rest = (alike & left_out(items, pytestconfig, wanted) for wanted in ("lot", "rest"))
    assert (len(by_lot), len(by_rest)) == (2, 1)
    assert by_lot | by_rest == alike


def test_the_order_of_the_cases_changes_nothing(items: list[pytest.Item], pytestconfig: pytest.Config) -> None:
    assert left_out(items, pytestconfig, "lot") == left_out(items[::-1], pytestconfig, "lot")


def test_a_run_that_names_a_folder_takes_all(pytestconfig: pytest.Config) -> None:
    named = bool(pytestconfig.option.file_or_dir or pytestconfig.option.keyword) and not hasattr(
        pytestconfig, "workerinput"
    )
    assert pytestconfig.getoption("cases") in (("all",) if named else ("lot", "rest", "more", "all"))


@pytest.mark.counted
@pytest.mark.parametrize("number", range(7))
def test_one_that_is_counted(number: int) -> None:
    assert number in range(7)


def test_of_what_takes_much_a_sixth_is_drawn_of_what_would_be_and_at_least_one(
    items: list[pytest.Item], pytestconfig: pytest.Config
) -> None:
    names = ("test_one_of_twelve", "test_one_of_many", "test_one_of_few", "test_one_that_is_counted")
    much = [
        item.nodeid.partition("[")[0]
        for item in items
        if item.name.startswith((*names, "test_what", "test_of", "test_a_run"))
    ]
    mark_many(items, frozenset(much))
    by_lot, by_rest = (set(items) - left_out(items, pytestconfig, wanted) for wanted in ("lot", "rest"))
    taken = {name: [sum(item.name.startswith(f"{name}[") for item in of) for of in (by_lot, by_rest)] for name in names}
    assert taken == {
        "test_one_of_twelve": [1, 11],
        "test_one_of_many": [1, CASES + 3],
        "test_one_of_few": [1, CASES - 1],
        "test_one_that_is_counted": [ceil(7 / LESS), 7],  # more are counted then
    }
    alone = {item for item in items if item.nodeid in much}
    assert len(alone) > LESS
    assert (len(alone & by_lot), len(alone & by_rest)) == (
        ceil(len(alone) / LESS),
        len(alone) - ceil(len(alone) / LESS),
    )
    laws = {item for item in items if "laws" in item.name and "[" in item.name}
    assert laws <= by_lot & by_rest


def test_of_the_rest_one_case_in_so_many_runs_on_average(pytestconfig: pytest.Config) -> None:
    """Also of tests that leave out fewer cases than that."""
    shares = [share_of(3, 4, pytestconfig, f"test {number}") for number in range(400)]
    assert set(shares) == {0, 1}
    assert sum(shares) == pytest.approx(300, abs=60)  # 7 standard deviations
    assert {share_of(number, 1, pytestconfig, "a test") - number for number in range(9)} == {0}


def test_what_is_gone_takes_nothing() -> None:
    assert is_there("tests/harness/test_sample.py::test_what_is_gone_takes_nothing")
    assert not is_there("tests/harness/test_sample.py::test_what_is_gone")
    assert not is_there("tests/harness/test_samples.py::test_what_is_gone_takes_nothing")


def test_what_is_much_depends_on_how_many_cases_there_are() -> None:
    assert takes_much("t::one", {"t::one": 0.2})
    assert not takes_much("t::one", {"t::one": 0.19})
    assert takes_much("t::one", {"t::one[1]": 0.15, "t::one[2]": 0.05})
    assert not takes_much("t::one", {"t::one[1]": 0.15, "t::one[2]": 0.04})


def test_the_list_of_heavy_tests_names_tests_that_are_there() -> None:
    """An empty or stale list makes a whole run half as long again: `python -m tests.harness.costs FOLDER --write`."""
    gone = [test for test in heavy_tests() if not is_there(test)]
    assert len(heavy_tests()) > 500
    assert gone == []
