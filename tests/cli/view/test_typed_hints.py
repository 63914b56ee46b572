"""Hints as command lines: every action has its words, for a shell with the options of its call, and as a call."""

from __future__ import annotations

import json
import shlex
from collections.abc import Iterator
from pathlib import Path

import pytest

from dvtcli.cli.catalogue import command_names
from dvtcli.cli.view.typed_hints import COMMANDS, OPTIONS, TypedCall, TypedHints, typed
from dvtcli.domain.hint import Action, Hint, as_hint, sentence
from dvtcli.operations.api.called_hints import ARGUMENTS, CALLS, called
from tests.cli.commands.bench import Bench, Ran

SHELL = TypedCall(("-i", "socketcan", "-c", "can 0"), ("-n", "5"), 5, alone=True)


@pytest.mark.parametrize("action", [action for action in Action if action is not Action.GIVE])
def test_every_action_has_words_and_a_call(action: Action) -> None:
    assert (action in COMMANDS) != (action in OPTIONS)
    assert (action in CALLS) != (action in ARGUMENTS)
    if action in COMMANDS and action is not Action.CORRECT:  # which has the command typed
        assert COMMANDS[action].split()[0] in command_names()
    assert "{" not in called(Hint(action))
    assert "{" not in typed(Hint(action))


@pytest.mark.parametrize(
    ("hint", "at_shell", "at_prompt", "in_python"),
    [
        (
            Hint(Action.SHOW_PDOS, {"all": True}, "lists them"),
            "`dvtcli -i socketcan -c 'can 0' -n 5 pdo --all` lists them", "`pdo --all` lists them",
            "`node.pdos()` lists them",
        ),
        (
            Hint(Action.STORE, {"node": (6, 8)}, "finishes"),
            "`dvtcli -i socketcan -c 'can 0' -n 6,8 store` finishes", "`-n 6,8 store` finishes", None,
        ),
        (
            Hint(Action.DISABLE, {"pdo": "tpdo2", "node": 9}, "first"),
            "`dvtcli -i socketcan -c 'can 0' disable 9:tpdo2` first", "`disable 9:tpdo2` first",
            "`bus.node(9).disable('tpdo2')` first",
        ),
        (
            Hint(Action.RESET_NODE, {"node": 5}, "look, then {}") + "wait",
            "look, then `dvtcli -i socketcan -c 'can 0' nmt reset-node 5`; wait", "look, then `nmt reset-node 5`; wait",
            "look, then `bus.node(5).nmt('reset-node')`; wait",
        ),
        (Hint(Action.CHECK_EDS, {"file": "a b.eds"}), "`dvtcli eds check 'a b.eds'`", "`eds check 'a b.eds'`", None),
        (
            Hint(Action.UNDO, {"all": True, "force": True}, "rolls back"),
            "`dvtcli -i socketcan -c 'can 0' -n 5 undo --all --force` rolls back", "`undo --all --force` rolls back",
            "`node.undo(everything=True, force=True)` rolls back",
        ),
        (Hint(Action.GIVE_EDS, why="helps"), "--eds FILE helps", "--eds FILE helps", "eds=FILE helps"),
    ],
)  # fmt: skip
def test_a_hint_is_written_for_who_reads_it(hint: Hint, at_shell: str, at_prompt: str, in_python: str | None) -> None:
    assert TypedHints(lambda: SHELL).text(hint) == at_shell
    assert typed(hint) == at_prompt
    assert in_python is None or called(hint) == in_python


def test_what_compares_with_what_was_set_runs_in_a_program_of_its_own() -> None:
    """Only the prompt knows what was set before; a script's file says it to the next program, too."""
    hint = Hint(Action.VERIFY, {"node": 8}, "see {}")
    bus = "dvtcli -i socketcan -c 'can 0' -n 8"
    assert typed(hint) == "see `-n 8 verify`"
    assert TypedHints(lambda: SHELL).text(hint) == f"see `{bus} pdo`"
    assert TypedHints(lambda: SHELL._replace(script="s.dvt")).text(hint) == f"see `{bus} verify s.dvt`"
    of_a_file = Hint(Action.VERIFY, {"file": "h.dcf"})
    assert TypedHints(lambda: SHELL).text(of_a_file) == "`dvtcli -i socketcan -c 'can 0' -n 5 verify h.dcf`"


def test_the_node_that_a_failure_is_about_is_named_where_another_one_was_selected() -> None:
    hint = Hint(Action.SHOW_PDOS, why="shows it")
    assert TypedHints(lambda: SHELL, 8).text(hint) == "`dvtcli -i socketcan -c 'can 0' -n 8 pdo` shows it"


def test_advice_is_no_command_and_placeholders_are_not_run() -> None:
    hints = TypedHints(lambda: SHELL)
    assert hints.words(as_hint("check its supply")) is None
    assert hints.words(Hint(Action.FIND_OBJECTS, why="searches")) is None
    both = Hint(Action.FIND_OBJECTS, why="searches") + Hint(Action.SHOW_PDOS)
    assert hints.words(both) == ["dvtcli", "-i", "socketcan", "-c", "can 0", "-n", "5", "pdo"]


#: failing lines -> what of a hint they get is run
FAILING = {
    "pdo tpdo9": "pdo --all",
    "map tpdo1 1018:1": "objects --mappable tpdo",
    "map tpdo2 6041 --cob-id 0x181": "disable tpdo1",
    "write 1800:3 20": "set tpdo1 --inhibit 2.0",
    "write 1800:1 0x191": "set tpdo1 --cob-id 0x191",
    "set tpdo9 --timer 5": "pdo --all",
    "restore --prove application": "restore",
}


@pytest.mark.parametrize("line", FAILING)
def test_the_hint_of_what_failed_runs_as_printed(line: str) -> None:
    with Bench(("gen4",), {"yes": True}) as bench:
        failed = bench.run(f"{line} --json")
    assert failed.code in (1, 2, 6), failed
    words = failed.document["next"]
    assert words[:3] == ["dvtcli", "--sim", "gen4"]
    assert shlex.join(words[3:]) == FAILING[line]
    printed = list(commands(failed))
    assert shlex.join(words) in printed
    for command in printed:
        if not {"TEXT", "OBJECT…", "FILE"} & set(shlex.split(command)):
            assert run(command).code in (0, 3), command


def commands(ran: Ran) -> Iterator[str]:
    """The commands between marks in the hints of a failure."""
    for hint in [ran.document["hint"], *(one["hint"] for one in ran.document.get("findings", ()))]:
        yield from (part for part in (hint or "").split("`")[1::2] if part.startswith("dvtcli "))


def run(command: str) -> Ran:
    """What *command* does as a process of its own would, where nothing is left of the one before."""
    words = shlex.split(command)
    assert words[:3] == ["dvtcli", "--sim", "gen4"]
    with Bench(("gen4",), {"yes": True}) as bench:
        return bench.run(shlex.join(words[3:]))


def test_a_hint_at_the_prompt_is_typed_there() -> None:
    with Bench(("gen4",)) as bench:
        bench.session.at_prompt = True
        assert "hint    `pdo --all` lists its PDOs" in bench.run("pdo tpdo9").stderr
        assert json.loads(bench.run("pdo tpdo9 --json").stdout)["next"] == ["pdo", "--all"]


def test_what_comes_next_keeps_the_bus_of_the_call() -> None:
    Path("m.yaml").write_text("nodes: {a: {node_id: 5, tpdo: {1: {event_timer: 50}}}}\n", "utf-8")
    with Bench(("generic@5",)) as bench:
        assert "Next: dvtcli --sim generic@5 apply m.yaml\n" in bench.run("plan m.yaml").stdout
        assert "Compare: dvtcli --sim generic@5 compare h.dcf\n" in bench.run("export h.dcf").stdout
        assert "Compare: dvtcli --sim generic@5 compare b.dcf\n" in bench.run("backup b.dcf").stdout
        assert "hint    --format text | json | jsonl | github | junit" in bench.run("diff m.yaml --format sarif").stderr


@pytest.mark.parametrize("begin", ["", "; ", ", ", " "])
def test_steps_are_joined_by_one_mark(begin: str) -> None:
    hint = Hint(Action.FIND_NODES, why="first {}") + Hint(Action.FIND_NODES, why=f"{begin}then {{}}")
    assert sentence(hint, lambda _step: "it") == f"first it{begin or '; '}then it"
