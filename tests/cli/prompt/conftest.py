"""Terminals that are closed whatever a test does."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from pathlib import Path

import pytest

from tests.cli.prompt.terminal import Terminal

Open = Callable[..., Terminal]


@pytest.fixture
def open_terminal(tmp_path: Path) -> Iterator[Open]:
    """Opens terminals whose state folder is the test's own."""
    opened: list[Terminal] = []

    def make(*arguments: str, **options: object) -> Terminal:
        terminal = Terminal(tmp_path, *arguments, **options)  # type: ignore[arg-type]
        opened.append(terminal)
        return terminal

    yield make
    for terminal in opened:
        terminal.close()


@pytest.fixture
def gen4(open_terminal: Open) -> Terminal:
    """The prompt of a simulated node, ready to type at."""
    terminal = open_terminal("--sim", "gen4")
    terminal.wait_prompt()
    return terminal
