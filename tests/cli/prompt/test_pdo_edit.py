"""`pdo edit`: a PDO in an editor (a script that changes the file), in real terminals."""

from __future__ import annotations

import re
from collections.abc import Callable
from pathlib import Path

import pytest

from tests.cli.prompt.conftest import Open
from tests.cli.prompt.terminal import Terminal
from tests.process import dvtcli

Edit = Callable[[str], Terminal]


@pytest.fixture
def editing(open_terminal: Open, tmp_path: Path) -> Edit:
    """Opens a prompt whose editor is a shell script; `$1` is the file, `$2` how often it was called before."""

    def make(script: str) -> Terminal:
        editor = tmp_path / "editor.sh"
        calls = tmp_path / "calls"
        calls.write_text("0", newline="\n")
        editor.write_text(
            f'times=$(cat {calls})\necho $((times + 1)) > {calls}\nset -- "$1" "$times"\n{script}\n', newline="\n"
        )
        environment = {"EDITOR": f"sh {editor}", "VISUAL": f"sh {editor}"}
        terminal = open_terminal("--sim", "gen4", columns=120, rows=40, environment=environment)
        terminal.wait_prompt()
        return terminal

    return make


def test_what_is_saved_is_checked_shown_and_written(editing: Edit) -> None:
    terminal = editing("sed -i 's/^type: 255/type: 1/; $a\\  - 606C' \"$1\"")
    terminal.run("pdo edit tpdo1")
    terminal.wait("TPDO1 set: ")
    terminal.wait_prompt("sim/1 PRE-OP*> ")
    assert "transmission type 1" in terminal.text
    terminal.run("pdo tpdo1")
    terminal.wait("6041:00  Statusword")
    terminal.wait("606C:00  Velocity actual value")


def test_an_unchanged_file_changes_nothing(editing: Edit) -> None:
    terminal = editing('touch "$1"')
    terminal.run("pdo edit tpdo1")
    terminal.wait("TPDO1 is not changed.")
    terminal.wait_prompt()


def test_a_wrong_text_is_said_with_its_line_and_edited_again(editing: Edit, tmp_path: Path) -> None:
    terminal = editing(
        'case $2 in\n0) sed -i "s/^type: 255/typ: 1/" "$1";;\n'
        '1) sed -i "s/^typ: 1/type: 1/; s/6041:00/1018:01/" "$1";;\n'
        '2) sed -i "s,1018:01/16,6041," "$1";;\nesac'
    )
    terminal.run("pdo edit tpdo1")
    terminal.wait("line 7: unknown key 'typ'; did you mean 'type'?")
    terminal.wait("Edit it again? [y/N]")
    terminal.type("y\r")
    terminal.wait("is not mappable")
    terminal.until(lambda: terminal.text.count("Edit it again?") == 2, "the question again")
    terminal.type("y\r")
    terminal.wait("TPDO1 set: 1 write")
    assert (tmp_path / "calls").read_text().strip() == "3"


def test_a_wrong_text_can_be_given_up(editing: Edit) -> None:
    terminal = editing('echo "type: 999" > "$1"')
    terminal.run("pdo edit tpdo1")
    terminal.wait("line 1: 999 is not within 0…255")
    terminal.wait("Edit it again? [y/N]")
    terminal.type("\r")
    terminal.wait("TPDO1 is not changed.")
    terminal.wait_prompt()


@pytest.mark.parametrize(
    ("editor", "said"),
    [
        ("false", "false: Editing failed"),
        ("/no/such/editor", "No such file or directory"),
        ("vi 'x", "$EDITOR: No closing quotation"),
        ("sh -c 'printf \"\\377\" > $0'", "not UTF-8 text"),
    ],
)
def test_an_editor_that_does_not_work_leaves_the_pdo(open_terminal: Open, editor: str, said: str) -> None:
    terminal = open_terminal("--sim", "gen4", columns=120, rows=40, environment={"EDITOR": editor, "VISUAL": editor})
    terminal.wait_prompt()
    terminal.run("pdo edit tpdo1")
    terminal.wait(said)
    terminal.wait_prompt()
    assert "a bug" not in terminal.text


def test_without_a_terminal_it_is_refused() -> None:
    done = dvtcli("--sim", "gen4", "pdo", "edit", "tpdo1")
    assert done.returncode == 6
    assert "no terminal" in done.stderr
    assert dvtcli("--sim", "gen4", "pdo", "edit").returncode == 2
    assert dvtcli("--sim", "gen4", "pdo", "tpdo1", "tpdo2").returncode == 2


def test_what_was_typed_is_kept_where_the_device_does_not_take_it(open_terminal: Open, tmp_path: Path) -> None:
    editor = tmp_path / "editor.sh"
    editor.write_text("sed -i 's/^type: 255/type: 1/' \"$1\"\n", newline="\n")
    environment = {"EDITOR": f"sh {editor}", "VISUAL": f"sh {editor}"}
    words = ("--sim", "gen4", "--fault", "refuse@1=0x08000020")
    terminal = open_terminal(*words, columns=300, rows=40, environment=environment)
    terminal.wait_prompt()
    terminal.run("pdo edit tpdo1")
    terminal.wait("your text is saved as ")
    terminal.wait_prompt()
    kept = re.search(r"saved as (\S+\.yaml)", terminal.text)
    assert kept is not None
    assert "type: 1" in Path(kept[1]).read_text("utf-8")
