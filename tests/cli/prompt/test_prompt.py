"""The prompt in real terminals: what a person types and sees."""

from __future__ import annotations

import os
import signal
import stat
import sys
from pathlib import Path

import pytest

from tests.cli.prompt.conftest import Open
from tests.cli.prompt.terminal import CTRL_C, CTRL_D, CTRL_R, DOWN, ENTER, ESCAPE, F1, TAB, UP, Terminal
from tests.posix import STOPPING

pytestmark = pytest.mark.drawn(10, "prompt")

MAP = "map tpdo1 6C01:1 606C 6041 --cob-id 0x201 --sync 1"


def test_the_banner_says_what_is_simulated_and_which_keys_help(gen4: Terminal) -> None:
    assert 'simulated node 1 "Gen4" (gen4.eds, 5 TPDO, 5 RPDO)' in gen4.lines[0]
    assert gen4.lines[1] == "No CAN hardware is used."
    assert "?  help" in gen4.text
    gen4.until(lambda: gen4.toolbar.startswith(" SIMULATED │ node 1 Gen4 │ PRE-OP"), "the toolbar")
    gen4.wait("F1 help")
    gen4.type(CTRL_D)
    assert gen4.ended() == 0


def test_how_far_a_slow_first_look_is_does_not_stay_beside_the_prompt(open_terminal: Open) -> None:
    terminal = open_terminal(command=[sys.executable, "-m", "tests.cli.prompt.slow_node", "0.02"])
    terminal.wait_prompt()
    assert b"reading 0x" in terminal.written
    assert "reading 0x" not in terminal.text


def test_mapping_shows_its_steps_and_leaving_asks(gen4: Terminal) -> None:
    gen4.run(MAP)
    gen4.wait_prompt("sim/1 PRE-OP*> ")
    steps = [line for line in gen4.lines if line.endswith(" ok")]
    assert len(steps) == 8
    assert "0x80000181  ->  0x00000201" in steps[-1]
    assert "TPDO1 set: 8 writes" in gen4.text
    gen4.wait("TPDO1 not stored")

    gen4.type(CTRL_D)
    gen4.wait("TPDO1 of node 1 is not stored: leave? [y/N]")
    gen4.type("n\r")
    gen4.wait("note: dvtcli stays open; store stores the changes, undo reverts them")
    gen4.wait_prompt("sim/1 PRE-OP*> ")

    gen4.run("exit")
    gen4.until(lambda: gen4.text.count("leave? [y/N]") == 2, "the question again")
    gen4.type("\r")
    gen4.wait_prompt("sim/1 PRE-OP*> ")

    gen4.type(CTRL_D)
    gen4.until(lambda: gen4.text.count("leave? [y/N]") == 3, "the question again")
    gen4.type(CTRL_D)  # an impatient second one is not an answer, and the prompt comes in a line of its own
    gen4.wait_prompt("sim/1 PRE-OP*> ")
    assert sum(line.rstrip() == "TPDO1 of node 1 is not stored: leave? [y/N]" for line in gen4.lines) == 2

    gen4.type(CTRL_D)
    gen4.until(lambda: gen4.text.count("leave? [y/N]") == 4, "the question again")
    gen4.type("y\r")
    assert gen4.ended() == 0


def test_what_is_stored_is_no_question(gen4: Terminal) -> None:
    gen4.run(MAP)
    gen4.wait_prompt("sim/1 PRE-OP*> ")
    gen4.run("store")
    gen4.wait_prompt("sim/1 PRE-OP> ")
    gen4.run("exit")
    assert gen4.ended() == 0


def test_yes_answers_the_question(open_terminal: Open) -> None:
    terminal = open_terminal("--sim", "gen4", "--yes")
    terminal.wait_prompt()
    terminal.run(MAP)
    terminal.wait_prompt("sim/1 PRE-OP*> ")
    terminal.type(CTRL_D)
    assert terminal.ended() == 0


def test_the_prompt_survives_what_goes_wrong(gen4: Terminal) -> None:
    gen4.run("map tpdo1 1018:1")
    gen4.wait("is not mappable:")
    gen4.wait_prompt()
    gen4.run("read 5FFF")
    gen4.wait("object does not exist")
    gen4.wait_prompt()
    gen4.run("pdo --sim gen4")
    gen4.wait("--sim sets the bus")
    gen4.wait_prompt()
    gen4.run("# only a comment")
    gen4.wait_prompt()
    gen4.run("exit")
    assert gen4.ended() == 0


def test_a_line_that_no_command_takes_ends_with_its_error_and_up_brings_it_back(gen4: Terminal) -> None:
    for line, wrong in [
        ('read "Velocity', "a quote is not closed"),
        ("mpa tpdo1", "unknown command 'mpa'"),
        ("map tpdo1 velocity_actul", "no object is named 'velocity_actul'"),
        ("set tpdo1 --type 999", "999: a transmission type is 0…255"),
    ]:
        gen4.run(line)
        gen4.wait(wrong)
        gen4.wait_prompt()
        gen4.until(lambda: gen4.cursor_line.rstrip() == "sim/1 PRE-OP>", "a new line")
        gen4.type(UP)
        gen4.until(lambda line=line: gen4.cursor_line.rstrip() == f"sim/1 PRE-OP> {line}", "the line again")
        gen4.type(CTRL_C)
        gen4.wait_prompt()
    gen4.run("map --help")
    gen4.wait_prompt()
    assert "Leave the PDO disabled." in gen4.text


def test_commands_typed_after_a_line_with_an_error_are_lines_of_their_own(gen4: Terminal) -> None:
    gen4.run("foo 1")
    gen4.wait("unknown command 'foo'")
    gen4.wait_prompt()
    gen4.run("set tpdo1 --timer 100")
    gen4.wait("TPDO1 set: 1 write")


PASTE_BEGINS, PASTE_ENDS = "\x1b[200~", "\x1b[201~"


def test_pasted_lines_that_were_not_run_are_named(gen4: Terminal) -> None:
    lines = ("set tpdo1 --timer 100", "map tpdo1 1018:1", "verify", "pdo tpdo1")
    gen4.type(PASTE_BEGINS + "\n".join(lines) + PASTE_ENDS)
    gen4.until(lambda: "pdo tpdo1" in gen4.cursor_line, "the pasted lines")
    gen4.type(ENTER)
    gen4.wait("warning: line 2 of 4 ended with exit code 1; 2 lines not run, from `verify` on")


def test_the_wrong_line_of_a_paste_is_numbered_and_none_runs(gen4: Terminal) -> None:
    gen4.type(PASTE_BEGINS + "set tpdo1 --timer 100\nfoo\npdo" + PASTE_ENDS)
    gen4.until(lambda: gen4.cursor_line.rstrip().endswith("pdo"), "the pasted lines")
    gen4.type(ENTER)
    gen4.wait("line 2: unknown command 'foo'")
    assert "TPDO1 set" not in gen4.text
    gen4.type(CTRL_C)


def test_the_syntax_of_the_command_stands_above_the_state(gen4: Terminal) -> None:
    gen4.type("map ")
    syntax = " map PDO OBJECT... [--cob-id ID]"
    gen4.until(lambda: gen4.lines[-2].startswith(syntax) and gen4.lines[-2].endswith("…"), "the syntax")
    gen4.until(lambda: gen4.lines[-2].startswith(syntax) and "PRE-OP" in gen4.toolbar, "the state below it")
    gen4.type("tpdo1 6041 --cob-id auto ")
    gen4.until(lambda: "[--type N]" in gen4.lines[-2] and "--cob-id" not in gen4.lines[-2], "the options that are left")
    gen4.type(CTRL_C)
    gen4.until(lambda: "map PDO" not in gen4.text, "the syntax gone")


def test_a_backslash_continues_the_line(gen4: Terminal) -> None:
    gen4.type("map tpdo1 \\")
    gen4.until(lambda: gen4.cursor_line.endswith("\\"), "the backslash")
    gen4.type(ENTER)
    gen4.until(lambda: gen4.cursor_line == "  ...", "the second line")
    gen4.type("velocity_a")
    gen4.wait("4 of 8 free bytes")
    gen4.type("ctual_value --sync 1")
    gen4.until(lambda: gen4.cursor_line.endswith("--sync 1"), "the whole line")
    gen4.type(ENTER)
    gen4.wait("TPDO1 set: ")


def test_menus_say_what_each_word_is(open_terminal: Open) -> None:
    terminal = open_terminal("--sim", "gen4", columns=120, rows=40)
    terminal.wait_prompt()
    terminal.type(TAB)
    terminal.wait("Clear PDOs: no mapping, and disabled.")
    terminal.type(ESCAPE)
    terminal.type("map ")
    terminal.wait("0x281, event-driven, 0 bits free")
    terminal.type("tpdo1 6C01:1 velocity_a")
    row = terminal.row("606C:00  Velocity actual value", "free bytes")
    assert row.split()[-7:] == ["i32", "ro", "4", "of", "6", "free", "bytes"]
    assert "Target velocity  " not in terminal.text
    terminal.type(TAB)
    terminal.until(lambda: "6C01:1 606C:00" in terminal.cursor_line, "the object's number on the line")
    terminal.type(ENTER)
    terminal.type(" --syn")
    terminal.wait("On every N-th SYNC.")
    line = "sim/1 PRE-OP> map tpdo1 6C01:1 606C:00 --syn"
    terminal.until(lambda: terminal.cursor_line.startswith(line), repr(line))


def test_enter_on_a_menu_entry_takes_it_and_runs_nothing(gen4: Terminal) -> None:
    gen4.type("pd")
    gen4.wait("List a node's PDOs")
    gen4.type(DOWN)
    gen4.until(lambda: gen4.cursor_line == "sim/1 PRE-OP> pdo", "the entry on the line")
    gen4.type(ENTER)
    gen4.until(
        lambda: "List a node's PDOs" not in gen4.text and gen4.cursor_line == "sim/1 PRE-OP> pdo", "the menu gone"
    )
    assert "MAPPED OBJECTS" not in gen4.text
    gen4.type(ENTER)
    gen4.wait("MAPPED OBJECTS")
    gen4.wait_prompt()


def test_a_full_mapping_offers_only_what_fits(open_terminal: Open) -> None:
    terminal = open_terminal("--sim", "gen4", columns=120, rows=40)
    terminal.wait_prompt()
    terminal.type("map tpdo1 606C 606C/16 60")
    terminal.wait("2 of 2 free bytes")
    offered = [line for line in terminal.lines if "free bytes" in line]
    assert all(line.split()[-5] in ("1", "2") for line in offered)


def test_control_c_throws_the_line_away(gen4: Terminal) -> None:
    gen4.type("map tpdo1 6041")
    gen4.until(lambda: gen4.cursor_line.endswith("map tpdo1 6041"), "the line")
    gen4.type(CTRL_C)
    gen4.wait_prompt()
    assert "ok" not in gen4.text.split()


def test_an_interrupt_from_outside_throws_the_line_away(gen4: Terminal) -> None:
    gen4.type("map tpdo1 6041")
    gen4.until(lambda: gen4.cursor_line.endswith("map tpdo1 6041"), "the line")
    gen4.child.kill(signal.SIGINT)
    gen4.wait_prompt()
    gen4.run("pdo")
    gen4.wait("MAPPED OBJECTS")
    gen4.wait_prompt()


@pytest.mark.parametrize("number", STOPPING[1:])
def test_a_termination_ends_the_prompt_without_a_question(gen4: Terminal, number: int) -> None:
    gen4.run(MAP)
    gen4.wait_prompt("sim/1 PRE-OP*> ")
    gen4.child.kill(number)
    assert gen4.ended() == 128 + number
    assert "leave?" not in gen4.text


def test_lines_are_kept_for_the_user_alone(open_terminal: Open, tmp_path: Path) -> None:
    first = open_terminal("--sim", "gen4")
    first.wait_prompt()
    first.run("pdo rpdo2")
    first.wait("RPDO2 of node 1")
    first.wait_prompt()
    first.type(CTRL_D)
    assert first.ended() == 0
    (history,) = tmp_path.glob("dvtcli/**/history")
    if os.name == "posix":  # Windows keeps a user's folder from others
        assert stat.S_IMODE(history.stat().st_mode) == 0o600
        assert stat.S_IMODE(history.parent.stat().st_mode) == 0o700

    second = open_terminal("--sim", "gen4")
    second.wait_prompt()
    second.type(UP)
    second.until(lambda: second.cursor_line == "sim/1 PRE-OP> pdo rpdo2", "the line of the session before")
    second.type(CTRL_C)
    second.wait_prompt()
    second.type(CTRL_R + "RPDO")
    second.until(lambda: "pdo rpdo2" in second.cursor_line, "the line that was searched")


@pytest.mark.parametrize("line", ["login 4 0x4bdf", "logni 4bdf", "login --level 4bdf"])
def test_a_line_that_cannot_be_read_is_kept_for_this_session_only(
    open_terminal: Open, tmp_path: Path, line: str
) -> None:
    """It may have a passcode in any place."""
    terminal = open_terminal("--sim", "gen4")
    terminal.wait_prompt()
    terminal.run(line)
    terminal.wait("hint")
    terminal.wait_prompt()
    terminal.type(UP)
    terminal.until(lambda: terminal.cursor_line == f"sim/1 PRE-OP> {line}", "the line again")
    terminal.type(CTRL_C)
    terminal.wait_prompt()
    terminal.run("pdo rpdo2")
    terminal.wait("RPDO2 of node 1")
    terminal.wait_prompt()
    terminal.type(CTRL_D)
    assert terminal.ended() == 0
    (history,) = tmp_path.glob("dvtcli/**/history")
    kept = history.read_text("utf-8")
    assert ("4bdf" in kept, "+pdo rpdo2" in kept) == (False, True)


def test_history_that_cannot_be_kept_is_said(open_terminal: Open, tmp_path: Path) -> None:
    (tmp_path / "dvtcli").write_text("a file where the folder should be")
    terminal = open_terminal("--sim", "gen4", columns=120)
    terminal.wait("the lines of this session are not saved")
    terminal.wait_prompt()
    terminal.run("pdo")
    terminal.wait("MAPPED OBJECTS")
    terminal.wait_prompt()
    terminal.type(UP)
    terminal.until(lambda: terminal.cursor_line == "sim/1 PRE-OP> pdo", "the line from memory")


def test_help_keeps_the_line(open_terminal: Open) -> None:
    terminal = open_terminal("--sim", "gen4", columns=120, rows=40)
    terminal.wait_prompt()
    terminal.type("map tpdo1 ")
    terminal.until(lambda: terminal.cursor_line == "sim/1 PRE-OP> map tpdo1", "the line")
    terminal.type("?")
    terminal.wait("Map OBJECTs into PDO, in frame order")
    terminal.until(lambda: terminal.cursor_line == "sim/1 PRE-OP> map tpdo1", "the line again")
    terminal.type(CTRL_C)
    terminal.wait_prompt()
    terminal.type(F1)
    terminal.wait("Commands, by task:")
    terminal.wait_prompt()
    terminal.type("set?")
    terminal.wait("Usage: set")
    terminal.until(lambda: terminal.cursor_line == "sim/1 PRE-OP> set", "the word without the question mark")
    terminal.type(" 'a?")
    terminal.until(lambda: terminal.cursor_line == "sim/1 PRE-OP> set 'a?", "a question mark in quotes")


def test_pasted_lines_run_one_by_one_until_one_fails(gen4: Terminal) -> None:
    gen4.type("\x1b[200~read 6041\nread \\\n1018:1\nread 5FFF\npdo\n\x1b[201~")
    gen4.until(lambda: "pdo" in gen4.text, "the pasted lines")
    gen4.type(ENTER)
    gen4.wait("object does not exist")
    gen4.wait_prompt()
    assert "1018:01" in gen4.text
    assert "MAPPED OBJECTS" not in gen4.text


def test_a_dry_run_says_so_and_leaves_nothing_to_store(open_terminal: Open) -> None:
    terminal = open_terminal("--sim", "gen4", "--dry-run", columns=120)
    terminal.wait_prompt("sim/1 PRE-OP DRY-RUN> ")
    terminal.wait("(dry run)")
    terminal.run(MAP)
    terminal.wait_prompt("sim/1 PRE-OP DRY-RUN*> ")
    terminal.type(CTRL_D)
    assert terminal.ended() == 0


def test_no_bus_is_an_error_that_says_what_to_do(open_terminal: Open) -> None:
    terminal = open_terminal("pdo")
    assert terminal.ended() == 5
    assert "no CAN interface is configured" in terminal.text
    assert "--sim" in terminal.text
