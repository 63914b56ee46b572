"""One file a command: named as the command, first line its short help, examples that parse, a row in README."""

from __future__ import annotations

import ast
import re

import click
import pytest

from dvtcli.session import Session
from dvtcli.shell import REGISTRY, command_names, parse, split
from dvtcli.view.output import Output
from tests.house.source import PACKAGE
from tests.process import ROOT

every_command = pytest.mark.parametrize("name", command_names())


def found(name: str) -> click.Command:
    command = REGISTRY.get_command(click.Context(REGISTRY), name)
    assert command is not None
    return command


def examples(name: str) -> list[str]:
    """The lines of the help's example block, without the words that explain them."""
    help_text = found(name).help or ""
    block = help_text.partition("\b\n")[2]
    return [re.split(r"\s{3,}", line.strip())[0] for line in block.splitlines() if line.strip()]


def test_every_file_is_a_command() -> None:
    assert command_names() == sorted(path.stem for path in (PACKAGE / "commands").glob("[!_]*.py"))
    assert REGISTRY.list_commands(click.Context(REGISTRY)) == command_names()


@every_command
def test_it_is_named_as_its_file_and_says_what_its_file_says(name: str) -> None:
    command = found(name)
    assert command.name == name
    docstring = ast.get_docstring(ast.parse((PACKAGE / "commands" / f"{name}.py").read_text("utf-8")))
    assert docstring is not None
    assert command.short_help is not None
    assert command.short_help.strip().splitlines()[0] == docstring.splitlines()[0]
    assert len(docstring.splitlines()[0]) <= 110
    assert docstring.splitlines()[0].endswith(".")


@every_command
def test_every_option_explains_itself(name: str) -> None:
    for option in found(name).params:
        if isinstance(option, click.Option):
            assert option.help, option.name


@every_command
def test_its_examples_parse(name: str) -> None:
    lines = examples(name)
    assert lines, f"help {name} has no example"
    session = Session(Output())
    session.started = True
    for line in lines:
        assert line.startswith(name), line
        with parse(split(line), session) as ctx:
            assert ctx.command.name == name


@every_command
def test_it_has_a_row_in_the_readme(name: str) -> None:
    readme = (ROOT / "README.md").read_text("utf-8")
    rows = [line for line in readme.splitlines() if line.startswith("| `")]
    assert any(re.match(rf"\| `{name}[ `]", row) for row in rows), f"README's table of commands lacks {name}"


def test_the_readme_lists_no_command_that_is_not_there() -> None:
    table = (ROOT / "README.md").read_text("utf-8").partition("\n## Commands\n")[2].partition("\n## ")[0]
    named = re.findall(r"^\| `([a-z]+)", table, re.M)
    assert sorted(set(named)) == command_names()
