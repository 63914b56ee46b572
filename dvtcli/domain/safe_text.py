"""Escape text from devices and files for a terminal or a page; markup is not escaped."""

from __future__ import annotations

import unicodedata

#: Cc control, Cf format (bidirectional overrides), Cs surrogates, Co private use, Zl/Zp line separators.
_UNSAFE = frozenset({"Cc", "Cf", "Cs", "Co", "Zl", "Zp"})


def safe(text: str) -> str:
    r"""*text* with every character that could control a terminal escaped as `\x1b`, `\u202e`, …."""
    if text.isascii() and text.isprintable():
        return text
    return "".join(_escaped(char) if unicodedata.category(char) in _UNSAFE else char for char in text)


def _escaped(char: str) -> str:
    code = ord(char)
    return f"\\x{code:02x}" if code < 0x100 else f"\\u{code:04x}" if code < 0x10000 else f"\\U{code:08x}"
