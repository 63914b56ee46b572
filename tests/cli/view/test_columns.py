"""Screens are measured in columns of a terminal, which is not the number of characters."""

from __future__ import annotations

import pytest
from hypothesis import given
from hypothesis import strategies as st
from wcwidth import wcswidth

from dvtcli.cli.view.lines import Table, clipped, columns, squeezed


@pytest.mark.parametrize(
    ("text", "width"),
    [("", 0), ("statusword", 10), ("…→─█°µ", 6), ("電圧", 4), ("e\u0301", 1), ("\u200b", 0), ("ｽﾃｰﾀｽ", 5), ("🛑", 2)],
)
def test_a_text_takes_the_columns_that_a_terminal_gives_it(text: str, width: int) -> None:
    assert columns(text) == width


@given(st.text(st.characters(blacklist_categories=("Cc", "Cs", "Cf"))))
def test_it_is_what_wcwidth_says_sign_by_sign(text: str) -> None:
    assert columns(text) == sum(max(0, wcswidth(sign)) for sign in text)


@given(st.text(), st.integers(1, 20))
def test_what_is_clipped_fits(text: str, width: int) -> None:
    assert columns(clipped(text, width)) <= max(width, 1)
    assert columns(text) > width or clipped(text, width) == text


@given(st.text(), st.integers(1, 20))
def test_what_is_squeezed_fits_and_keeps_both_ends(text: str, width: int) -> None:
    said = squeezed(text, width)
    begin, _, end = said.rpartition("…")
    assert columns(said) <= width
    if columns(text) <= width:
        assert said == text
    else:
        assert text.startswith(begin)
        assert text.endswith(end)


def test_a_long_name_is_known_by_its_ends() -> None:
    assert squeezed("maxon_epos4-50-15-node1.dcf", 18) == "maxon_ep…node1.dcf"


def test_columns_of_a_table_stand_below_each_other() -> None:
    table = Table(("name", "type"))
    table.add("電圧", "u16")
    table.add("current", "i16")
    lines = ["".join(cell.text for cell in line) for line in table.lines()]
    assert [columns(line[: line.index(word)]) for line, word in zip(lines[1:], ("u16", "i16"), strict=True)] == [11, 11]


@given(st.lists(st.text("abc電 ", min_size=1, max_size=30), min_size=1, max_size=4), st.integers(30, 60))
def test_a_last_column_that_wraps_loses_no_word(reasons: list[str], width: int) -> None:
    table = Table(("COB-ID", "BECAUSE"), shrink=1, wraps=True)
    for reason in reasons:
        table.add("0x189", reason.replace("  ", " "))
    lines = ["".join(cell.text for cell in line) for line in table.lines(width)]
    assert all(columns(line) <= width or "…" in line for line in lines)
    words = " ".join(lines[1:]).replace("0x189", "").split()
    if not any("…" in line for line in lines):
        assert words == " ".join(reasons).split()
    assert [line.startswith("  0x189") for line in lines[1:]].count(True) == len(reasons)


def test_columns_give_way_in_turn() -> None:
    for width, seen in (
        (80, ["a" * 30, "b" * 30]),
        (60, ["a" * 22 + "…", "b" * 30]),
        (40, ["a" * 7 + "…", "b" * 24 + "…"]),
    ):
        table = Table(shrink=(0, 2))
        table.add("a" * 30, "-", "b" * 30)
        (line,) = ("".join(cell.text for cell in line) for line in table.lines(width))
        assert [part for part in line.split() if part != "-"] == seen, width
