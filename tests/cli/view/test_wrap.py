"""Lines that are wider than the terminal."""

from __future__ import annotations

from hypothesis import given
from hypothesis import strategies as st

from dvtcli.cli.view.lines import Cell, broken, wrapped


def texts(cells: list[Cell], width: int) -> list[str]:
    return ["".join(cell.text for cell in line).rstrip() for line in wrapped(cells, width)]


def test_later_lines_hang_beside_the_label() -> None:
    assert texts([Cell("note: ", "cyan"), Cell("one two three four")], 15) == [
        "note: one two",
        "      three",
        "      four",
    ]
    assert texts([Cell("  hint    ", "dim"), Cell("aaaaaa bbbbb cc")], 24) == ["  hint    aaaaaa bbbbb", "          cc"]
    assert texts([Cell("  hint    ", "dim"), Cell("aa bb cc")], 16) == ["  hint    aa bb", "cc"]
    assert texts([Cell("    one two")], 10) == ["    one", "    two"]


def test_what_fits_stays_as_it_is() -> None:
    assert texts([Cell("a  b   c")], 8) == ["a  b   c"]
    assert texts([Cell("a    b")], 4) == ["a", "b"]
    assert texts([Cell("aaa  b")], 4) == ["aaa", "b"]


@given(st.lists(st.text("ab", min_size=1, max_size=30), min_size=1), st.integers(5, 40))
def test_no_word_is_cut_or_lost_and_only_a_long_word_is_too_wide(words: list[str], width: int) -> None:
    lines = texts([Cell(" ".join(words))], width)
    assert " ".join(lines).split() == words
    assert all(len(line) <= width or line.count(" ") == 0 for line in lines)


def test_a_command_in_back_quotes_is_not_broken_if_it_fits_in_a_line() -> None:
    hint = [Cell("  hint    ", "dim"), Cell("first `map 5:rpdo2 6040`, then (`link 1:tpdo1`).")]
    assert texts(hint, 34) == ["  hint    first", "          `map 5:rpdo2 6040`, then", "          (`link 1:tpdo1`)."]
    assert texts([Cell("see `aaaa bbbb cccc` now")], 10) == ["see `aaaa", "bbbb cccc`", "now"]
    assert broken("first `map 5:rpdo2 6040`, then", 20) == ["first", "`map 5:rpdo2 6040`,", "then"]


@given(st.lists(st.text("ab`", min_size=1, max_size=12), min_size=1), st.integers(5, 40))
def test_back_quotes_lose_no_word(words: list[str], width: int) -> None:
    assert " ".join(texts([Cell(" ".join(words))], width)).split() == words
    assert " ".join(broken(" ".join(words), width)).split() == words


@given(st.lists(st.text("ab", min_size=1, max_size=5), min_size=1, max_size=5), st.text("ab ", max_size=30))
def test_a_command_that_fits_can_be_copied(command: list[str], before: str) -> None:
    quoted = f"`{' '.join(command)}`"
    assert any(quoted in line for line in texts([Cell(f"{before} {quoted} then")], 31))
