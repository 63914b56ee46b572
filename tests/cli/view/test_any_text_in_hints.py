"""Whatever a path, a name or an argument is made of, a hint prints it as it is, and its command takes it as that."""

from __future__ import annotations

import ast
import shlex
from pathlib import Path

import pytest
from hypothesis import given
from hypothesis import strategies as st

from dvtcli.cli.lexer import split
from dvtcli.cli.view.typed_hints import TypedCall, TypedHints
from dvtcli.domain.hint import Action, Hint, as_hint, verbatim
from dvtcli.operations.api.called_hints import called
from tests.cli.commands.bench import Bench
from tests.cli.commands.program.test_hints_run import commands

ANY = st.text(st.sampled_from(list("ab {}'\"$%-=\\`#~*&;()…ü9")), min_size=1, max_size=12)


@given(ANY)
def test_text_from_outside_stands_as_it_is_beside_the_action(text: str) -> None:
    said = [
        Hint(Action.TRUST, why=f"{verbatim(text)}: {{}} first"),
        Hint(Action.TRUST, why=f"from {verbatim(text)}|"),
        Hint(Action.TRUST, why=f"{verbatim(text)}: {{}}"),
        Hint(Action.TRUST, why=f"look at {verbatim(text)}|").after(as_hint(text)),
    ]
    assert [str(hint) for hint in said] == [
        f"{text}: trust the settings file first",
        f"trust the settings file from {text}|",
        f"{text}: trust the settings file",
        f"{text}; then trust the settings file look at {text}|",
    ]


@given(ANY)
def test_a_command_takes_the_argument_that_it_prints(text: str) -> None:
    bus = TypedCall(("-c", text), alone=True)
    hint = Hint(Action.CHECK, {"file": text})
    file = f"./{text}" if text.startswith("-") else text
    assert shlex.split(TypedHints(lambda: bus).text(hint)[1:-1]) == ["dvtcli", "check", file]
    assert split(TypedHints().text(hint)[1:-1]) == ["check", file]
    read = shlex.split(TypedHints(lambda: bus).text(Hint(Action.READ, {"object": text}))[1:-1])
    behind = [text] if not text.startswith("-") or text[1:2].isdigit() else ["--", text]
    assert read == ["dvtcli", "-c", text, "read", *behind]
    assert shlex.split(TypedHints(lambda: bus).text(Hint(Action.GIVE_EDS, {"file": text}))) == ["--eds", text]


@given(ANY)
def test_a_call_has_the_argument_that_it_is_given(text: str) -> None:
    call = ast.parse(called(Hint(Action.WRITE, {"object": text, "value": text}))[1:-1], mode="eval").body
    assert isinstance(call, ast.Call)
    assert [ast.literal_eval(argument) for argument in call.args] == [text, text]


@pytest.mark.parametrize("name", ["{}.yaml", "{file} a.yaml", "-m.yaml", "it's $5%.yaml", '"a" b.yaml'])
def test_what_a_plan_says_comes_next_runs_for_a_file_of_any_name(name: str) -> None:
    Path(name).write_text("nodes: {a: {node_id: 5, tpdo: {1: {event_timer: 50}}}}\n", "utf-8")
    with Bench(("generic@5",), {"yes": True}) as bench:
        planned = bench.run(shlex.join(["plan", "--", name]))
        (printed,) = commands(planned)
        again = bench.run(printed.removeprefix("dvtcli --sim generic@5 "))
    assert again.code == 0, again
    assert "1 SDO write" in again.stdout + again.stderr
