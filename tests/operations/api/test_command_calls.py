"""“Python calls” of the documentation: what its tables name there is, and no call is forgotten."""

from __future__ import annotations

import inspect
import re

import click
import pytest

from dvtcli import testing
from dvtcli.cli.catalogue import command_names
from tests.documentation.pages import text
from tests.documentation.reference.calls import CALLS, FORMS, OWNERS, call
from tests.documentation.reference.commands import command

#: calls that are no command's: a program's own affairs
NO_COMMAND = {"bus.close", "bus.dry_run", "dvtcli.connect", "node.canopen", "node.record"}


def section() -> str:
    return text("docs/reference/commands-in-programs.md").partition("## Python calls")[2].partition("\n## ")[0]


@pytest.mark.parametrize("form", CALLS)
def test_a_form_of_a_command_and_its_call_are_there(form: str) -> None:
    name, *further = form.split()
    known = command(name).params
    assert all(there(word, known) for word in further)
    assert exists(CALLS[form])


def there(word: str, known: list[click.Parameter]) -> bool:
    """Whether *word* is an option, or an action, of those *known*."""
    if word.startswith("--"):
        return any(word in one.opts for one in known)
    return any(isinstance(one.type, click.Choice) and word in one.type.choices for one in known)


@pytest.mark.parametrize("form", FORMS)
def test_what_is_written_by_hand_is_there(form: str) -> None:
    name, *further = form.split("`")[1].split()
    assert name in command_names() or form == "`--dry-run`"
    options = [word for word in further if word.startswith("--")]
    assert all(there(word, command(name).params) for word in options)
    named = re.findall(r"((?:node|bus|dvtcli)(?:\.\w+)+)\(", FORMS[form])
    assert named
    assert all(map(exists, named))


def exists(called: str) -> bool:
    owner, _, name = called.rpartition(".")
    return hasattr({**OWNERS, "dvtcli.testing": testing}[owner], name)


def test_every_command_is_told() -> None:
    told = {
        words.split()[0]
        for words in re.findall(r"^\|(.+)\|", section(), re.M)
        for words in re.findall(r"`([^`]+)`", words)
    }
    assert set(command_names()) <= told


def test_no_call_is_forgotten() -> None:
    calls = {
        f"{owner}.{name}"
        for owner, kind in OWNERS.items()
        for name, value in inspect.getmembers(kind, inspect.isfunction)
        if not name.startswith("_")
    }
    told = {call(name) for name in command_names()} | {one for one in calls if f"`{one}(" in section()}
    assert calls - told == NO_COMMAND, "tests/documentation/reference/calls.toml: say which command does it"
