"""Text from devices and files that goes to a terminal."""

from __future__ import annotations

import sys
import unicodedata

from dvtcli.domain.text import safe

UNSAFE = {"Cc", "Cf", "Cs", "Co", "Zl", "Zp"}


def test_every_character_that_could_control_a_terminal_is_escaped_and_no_other() -> None:
    for code in range(sys.maxunicode + 1):
        char = chr(code)
        is_unsafe = unicodedata.category(char) in UNSAFE
        assert (safe(char) != char) is is_unsafe, hex(code)
        assert not is_unsafe or safe(char).isascii()


def test_an_escape_has_the_digits_of_the_character() -> None:
    shown = {"\x1b": r"\x1b", "\xad": r"\xad", "\u202e": r"\u202e", "\ue000": r"\ue000", "\U000e0001": r"\U000e0001"}
    assert {char: safe(char) for char in shown} == shown
