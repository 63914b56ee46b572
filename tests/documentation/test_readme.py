"""README is short, opens with two commands that are run, and names everything that dvtcli does."""

from __future__ import annotations

import re

from dvtcli.cli.catalogue import command_names
from tests.documentation.pages import CONSOLE, text
from tests.documentation.reference import REWRITE
from tests.documentation.reference.screens import PICTURED

README = "README.md"
MOST_BYTES = 8_192


def test_it_is_short() -> None:
    assert len(text(README).encode()) <= MOST_BYTES


def test_it_opens_with_two_commands_of_one_line() -> None:
    lines = re.findall(r"^```sh\n([^\n]*)\n```$", text(README), re.M)[:2]
    assert all(line.startswith("python3 -m venv .venv && .venv/bin/pip install -q ") for line in lines)
    assert lines[0].endswith(".venv/bin/dvtcli --sim gen4 run scripts/pdo_config.dvt")
    assert lines[1].endswith(".venv/bin/pytest")
    assert text(README).index(lines[1]) < 1200


def test_it_shows_a_screen_and_sessions() -> None:
    assert PICTURED.search(text(README))
    assert len(CONSOLE.findall(text(README))) >= 3


def test_its_table_names_every_command_and_no_other() -> None:
    table = text(README).partition("\n## What it does\n")[2].partition("\n## ")[0]
    rows = [line.split("|") for line in table.splitlines() if line.startswith("| ")][1:]
    named = [name for row in rows for name in re.findall(r"`([a-z]+)`", row[2])]
    assert sorted(named) == command_names(), REWRITE
