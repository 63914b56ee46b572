"""Where the state folder cannot be read nobody knows what is kept in it, and nothing says that there is nothing."""

from __future__ import annotations

import pytest

from dvtcli.files.user_folders import user_folder
from tests.cli.commands.bench import Bench, beside
from tests.cli.commands.bus import device


@pytest.fixture
def blocked() -> str:
    """A file in the place of the state folder."""
    folder = user_folder("state")
    folder.parent.mkdir(parents=True, exist_ok=True)
    folder.write_text("")
    return str(folder)


@pytest.mark.parametrize(
    "line", ["recover", "recover --finish", "recover --accept", "recover --discard", "recover --dry-run", "undo"]
)
@pytest.mark.parametrize("selected", [None, 1])
def test_without_its_state_folder_nothing_is_said_to_be_kept(blocked: str, line: str, selected: int | None) -> None:
    with Bench((), {"yes": True, "node": selected}, beside([device("generic")])) as bench:
        ran = bench.run(line)
    assert ran.code == 6
    assert f"{blocked} is not used: it is a file, not a folder" in ran.stderr
    assert ("unknown whether" in ran.stderr) is (line != "undo" or selected is None)
    assert "nothing to" not in ran.stdout + ran.stderr


def test_trace_last_says_that_what_is_kept_cannot_be_read(blocked: str) -> None:
    ran = Bench().run("trace last")
    assert ran.code == 2
    assert f"{blocked} is not used" in ran.stderr
    assert "no exchange" not in ran.stderr
