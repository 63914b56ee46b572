"""docs/reference/limits.md denies nothing that dvtcli has: no command, and no kind of file that it reads or writes."""

from __future__ import annotations

import re

import pytest

from dvtcli.cli.catalogue import command_names
from tests.surroundings import ROOT

_DENIED = re.compile(r"\b(?:no|not|without)\b[^.;:]*?`(\w[\w-]*)", re.IGNORECASE)
_FILES = re.compile(r"\b(?:XDD|XDC|DCF|DBC|network files?)\b[^.;:]*\b(?:is not|are not|only)\b", re.IGNORECASE)


def stale(page: str) -> list[str]:
    """What *page* denies although it is there."""
    text = " ".join(page.split())
    commands = [name for name in _DENIED.findall(text) if name in command_names()]
    return [*commands, *_FILES.findall(text)]


def test_nothing_is_denied_that_is_there() -> None:
    assert stale((ROOT / "docs/reference/limits.md").read_text("utf-8")) == []


@pytest.mark.parametrize(
    "line",
    [
        "No `trace`, and CAN FD is not shown.",
        "EDS and DCF are read; XDD is not.",
        "`export` writes network files only.",
    ],
)
def test_what_is_denied_wrongly_is_found(line: str) -> None:
    assert stale(line)
