"""What rules about a device section share: that it is there, and has the keys that it must have. Knows no section."""

from __future__ import annotations

from collections.abc import Iterable

from dvtcli.domain.several import join_some
from dvtcli.files.eds.lint.linted_text import Found, LintedText


def no_section(text: LintedText, name: str, lost: str) -> Found:
    """A file without the section *name*, whereby *lost* is not known."""
    if text.section(name.lower()) is None:
        yield 1, f"there is no [{name}]: {lost}"


def missing_keys(text: LintedText, name: str, needed: Iterable[str]) -> Found:
    """A section *name* without some of the keys *needed*: said once, with all of them."""
    section, values = text.section(name.lower()), text.values(name.lower())
    missing = [key for key in needed if key.lower() not in values]
    if section is not None and missing:
        yield section.line, f"[{name}] lacks {join_some(missing)}"
