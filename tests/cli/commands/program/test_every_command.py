"""A command explains its options, has examples that parse, and says what it answers."""

from __future__ import annotations

import ast
import re

import click
import pytest

from dvtcli.cli.catalogue import command_names
from dvtcli.cli.command import DvtCommand
from dvtcli.cli.conversation import Conversation
from dvtcli.cli.lexer import split
from dvtcli.cli.parse_line import parse
from dvtcli.cli.registry import REGISTRY
from dvtcli.cli.view.output import Output
from dvtcli.operations import results
from tests.documentation.reference.documents import annotated
from tests.house.source import PACKAGE

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
    assert command_names() == sorted(path.stem for path in (PACKAGE / "cli" / "commands").glob("[!_]*.py"))
    assert REGISTRY.list_commands(click.Context(REGISTRY)) == command_names()


@every_command
def test_every_option_explains_itself(name: str) -> None:
    for option in found(name).params:
        if isinstance(option, click.Option):
            assert option.help, f"say in {name}.py what {option.name} means: help=…"


@every_command
def test_its_examples_parse(name: str) -> None:
    lines = examples(name)
    assert lines, f"help {name} has no example: a block behind \\b in the docstring of `command`, a line each"
    session = Conversation(Output())
    session.started = True
    for line in lines:
        assert line.startswith(name), line
        with parse(split(line), session) as ctx:
            assert ctx.command.name == name


def test_a_command_says_what_it_does_to_nodes() -> None:
    """Scripts judge by it what can be taken back: one that does not say it cannot be made."""
    with pytest.raises(TypeError, match="effect"):
        DvtCommand("silent")


@every_command
def test_it_says_what_it_answers(name: str) -> None:
    """A result of `dvtcli.operations.results`, an exit code, or nothing where it shows things as they come."""
    for answer in annotated(name) - {"int", "None"}:
        found = getattr(results, answer, None)
        assert isinstance(found, type), f"{name}.py answers {answer}: declare that in a file of operations/results/"


def test_type_checkers_know_every_file_of_answers() -> None:
    home = PACKAGE / "operations" / "results"
    tree = ast.parse((home / "__init__.py").read_text("utf-8"))
    known = {node.module for node in ast.walk(tree) if isinstance(node, ast.ImportFrom)}
    modules = {f"dvtcli.operations.results.{file.stem}" for file in home.glob("[a-z]*.py")}
    assert modules <= known, "operations/results/__init__.py must import these below TYPE_CHECKING"
