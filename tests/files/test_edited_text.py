"""A DCF that is edited in place: blanks stay as they were, however many there are."""

from __future__ import annotations

import pytest

from dvtcli.files.eds.ini import EditedText


@pytest.mark.parametrize(
    ("line", "is_text", "changed"),
    [
        ("a=1", False, "a=7"),
        ("a = 1 ; why", False, "a = 7 ; why"),
        ("a = x ; y", True, "a = 7"),
        ("a=  ", False, "a=  7"),
        ("a=", True, "a=7"),
        ("a=\t;c", False, "a=\t7;c"),
    ],
)
def test_blanks_and_comments_stay(line: str, is_text: bool, changed: str) -> None:
    text = EditedText(f"{line}\n".encode())
    text.set_value(1, "7", is_text=is_text)
    assert text.to_bytes().decode() == f"{changed}\n"


def test_a_line_of_blanks_costs_no_more_than_another() -> None:
    """The search for its key was cubic in them."""
    text = EditedText(b"[x]\n a = 1\n" + b" " * 200_000 + b"!\nb=" + b" " * 200_000 + b"!\n")
    text.insert_key(3, "c", "2")
    text.insert_key(2, "d", "3")
    text.set_value(4, "5")
    assert b"\n d = 3\n" in text.to_bytes()
