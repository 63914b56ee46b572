"""The sentence of a hint is true: what its command promises is so once it has run."""

from __future__ import annotations

import re
from pathlib import Path

import pytest

from dvtcli.cli.view.typed_hints import COMMANDS, TypedHints
from dvtcli.domain.hint import Action, Hint
from tests.cli.commands.bench import Bench
from tests.cli.commands.program.hint_promises import FILES, NOT_HERE, PROMISES
from tests.cli.commands.program.test_hints_run import keeps


def test_every_action_that_is_a_command_says_what_it_promises() -> None:
    assert set(PROMISES) | NOT_HERE == set(COMMANDS)
    assert not set(PROMISES) & NOT_HERE


@pytest.mark.drawn(12)
@pytest.mark.parametrize("action", PROMISES, ids=lambda action: action.name)
def test_a_command_does_what_its_action_says(action: Action) -> None:
    promise = PROMISES[action]
    for name, text in FILES.items():
        Path(name).write_text(text, "utf-8")
    with Bench(promise.sim, {"yes": True}) as bench:
        for line in promise.before:
            assert bench.run(line).code == 0, line
        command = TypedHints().text(Hint(action, promise.given))[1:-1]
        keeps(bench, command)
        ran = [bench.run(line) for line in promise.after[:-1]]
        assert not ran or re.search(promise.after[-1], ran[-1].stdout), ran
