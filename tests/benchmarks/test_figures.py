"""Two runs of benchmarks compared: a change is told from noise by the middle halves of the ratios."""

from __future__ import annotations

import json
from pathlib import Path

from tests.benchmarks.figures import Figure, as_json, comparison, figures_in, page, verdict


def figure(*own: float, most: float | None = None) -> Figure:
    return Figure("reading", "ms", own, "other", [10.0] * len(own), most=most)


def test_a_change_is_what_lies_beyond_the_spread_of_both() -> None:
    before = figure(20, 21, 22, 23, 24)
    assert verdict(before, figure(20, 21, 22, 23, 24)) == "equal"
    assert verdict(before, figure(22, 23, 24, 25, 26)) == "noise"
    assert verdict(before, figure(30, 31, 32, 33, 34)) == "higher"
    assert verdict(before, figure(10, 11, 12, 13, 14)) == "lower"


def test_a_goal_is_about_the_median() -> None:
    assert not figure(10, 11, 90, most=1.1).is_missed
    assert figure(10, 12, 12, most=1.1).is_missed


def test_a_run_is_read_as_it_was_written(tmp_path: Path) -> None:
    file = tmp_path / "run.json"
    file.write_text(as_json([figure(20, 21, 22)]), "utf-8")
    read = figures_in(file)
    assert read["reading"].ratios == figure(20, 21, 22).ratios
    lines = list(comparison(read, read | {"counting": Figure("counting", "", [0], "other", [8])}))
    assert [line.split()[-1] for line in lines[1:]] == ["equal", "after"]


def test_a_run_is_a_table_of_a_page_with_what_was_met() -> None:
    runs = [json.loads(as_json([figure(20, 21, 22, most=most)])) for most in (2.1, 2.0)]
    _, _, met, missed = page(runs)
    assert met == "| reading | 21 ms | 10 ms other | 2.10 | 2.05 .. 2.15 | <= 2.1 | met |"
    assert missed == "| reading | 21 ms | 10 ms other | 2.10 | 2.05 .. 2.15 | <= 2 | missed |"
