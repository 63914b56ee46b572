"""Keys become the text of a line: edited as typed, without keys that are no letters, and never with its last Enter."""

from __future__ import annotations

import pytest
from hypothesis import given
from hypothesis import strategies as st

from dvtcli.cli.view.streams import as_lines, thrown_away


@pytest.mark.parametrize(
    ("keys", "lines"),
    [
        ("map tpdo1 606C\r", "map tpdo1 606C"),
        ("pdo\ncle", "pdo\ncle"),
        ("pdp\x7fo\n\n", "pdo"),
        ("wrong\x15pdo", "pdo"),
        ("\x1b[A\x1b[Bpdo\x1bOP\x1b[12;40R", "pdo"),
        ("\x1b[200~pdo\x1b[201~", "pdo"),
        ("read\t6041", "read 6041"),
        ("\x04\x00\x1b", ""),
        ("", ""),
    ],
)
def test_keys_make_lines(keys: str, lines: str) -> None:
    assert as_lines(keys) == lines


@given(st.text())
def test_what_stands_on_a_line_can_be_printed_and_does_not_end_it(keys: str) -> None:
    lines = as_lines(keys)
    assert not lines.endswith("\n")
    assert all(char == "\n" or char.isprintable() for char in lines)


def test_what_is_thrown_away_is_counted() -> None:
    assert thrown_away("y\r") == "2 characters typed in between were discarded"
    assert thrown_away("\x1b[12;40R") is None
