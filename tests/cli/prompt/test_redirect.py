"""Results that leave the screen: into files, programs and the pager, in real terminals."""

from __future__ import annotations

from pathlib import Path

import pytest

from tests.cli.prompt.conftest import Open
from tests.cli.prompt.terminal import CTRL_C, CTRL_D, Terminal
from tests.posix import needs_shell

pytestmark = pytest.mark.drawn(6, "redirect")


def test_results_go_into_files(gen4: Terminal, tmp_path: Path) -> None:
    gen4.run("read 6041 > out.txt")
    gen4.wait_prompt()
    gen4.run("read 606C >> out.txt")
    gen4.wait_prompt()
    first, bits, second = (tmp_path / "out.txt").read_text("utf-8").splitlines()
    assert "Statusword" in first
    assert bits.lstrip().startswith("voltage enabled,"), "the names of the bits that are set"
    assert "Velocity actual value" in second
    assert "0x6041:00" not in gen4.text
    gen4.run("read 6041 > no/such/folder")
    gen4.wait("No such file or directory")
    gen4.wait_prompt()
    gen4.run("read 6041")
    gen4.wait("0x6041:00")


@needs_shell
def test_results_go_through_programs(gen4: Terminal) -> None:
    gen4.run("pdo --all | grep -c '^  [TR]PDO'")
    gen4.until(lambda: "10" in [line.strip() for line in gen4.lines], "the number of PDOs")
    gen4.wait_prompt()
    gen4.run("objects | head -n 1")
    gen4.wait_prompt()
    assert any(line.startswith("  OBJECT ") for line in gen4.lines)
    gen4.run("read 6041")
    gen4.wait("0x6041:00")
    gen4.wait_prompt()
    gen4.type(CTRL_D)
    assert gen4.ended() == 0


@pytest.mark.skipif(not Path("/dev/full").exists(), reason="no device that is always full")
@needs_shell
def test_what_takes_no_results_is_said_and_the_prompt_stays(open_terminal: Open) -> None:
    terminal = open_terminal("--sim", "gen4", environment={"SHELL": "/no/such/shell"})
    terminal.wait_prompt()
    terminal.run("objects > /dev/full")
    terminal.wait("error: the results cannot be written: No space left on device")
    terminal.wait_prompt()
    terminal.run("read 6041 | cat")
    terminal.wait("error: /no/such/shell cannot be started: No such file or directory")
    terminal.wait_prompt()
    terminal.run("read 6041")
    terminal.wait("0x6041:00")
    terminal.wait_prompt()
    terminal.type(CTRL_D)
    assert terminal.ended() == 0


def test_no_shell_starts_no_program(open_terminal: Open, tmp_path: Path) -> None:
    terminal = open_terminal("--sim", "gen4", "--no-shell")
    terminal.wait_prompt()
    terminal.run("read 6041 | tee out.txt")
    terminal.wait("`|` is off")
    assert not (tmp_path / "out.txt").exists()


def test_scripts_have_no_pipes(gen4: Terminal, tmp_path: Path) -> None:
    (tmp_path / "a.dvt").write_text("read 6041 > out.txt\n")
    gen4.run("run a.dvt")
    gen4.wait("no object is named '>'")
    assert not (tmp_path / "out.txt").exists()


@pytest.mark.parametrize(("columns", "rows"), [(80, 24), (120, 40)])
def test_what_is_more_than_a_screen_is_paged(open_terminal: Open, columns: int, rows: int) -> None:
    terminal = open_terminal("--sim", "gen4", columns=columns, rows=rows, environment={"PAGER": "less"})
    terminal.wait_prompt()
    terminal.run("objects")
    terminal.until(lambda: terminal.lines[-1] == ":" and "OBJECT " in terminal.text, "the pager")
    terminal.type("q")
    terminal.wait_prompt()
    terminal.run("read 6041")
    terminal.wait("Statusword")


@pytest.mark.parametrize("pager", ["cat", "", "less '", "/no/such/pager", "false"])
def test_without_a_pager_that_works_all_is_shown(open_terminal: Open, pager: str) -> None:
    terminal = open_terminal("--sim", "gen4", environment={"PAGER": pager})
    terminal.wait_prompt()
    terminal.run("objects")
    terminal.wait("objects of gen4.eds")
    terminal.wait_prompt()


def test_aliases_are_commands_of_ones_own(open_terminal: Open, tmp_path: Path) -> None:
    (tmp_path / "dvtcli.toml").write_text('[aliases]\nsw = "read 6041"\nm1 = "map tpdo1"\n')
    terminal = open_terminal("--sim", "gen4", rows=40)  # all of `help` without a pager
    terminal.wait_prompt()
    terminal.type("s")
    terminal.wait("alias of: read 6041")
    terminal.type("w \r")
    terminal.wait("0x6041:00")
    terminal.wait_prompt()
    terminal.type("m1 velocity_a")
    terminal.wait("4 of 8 free bytes")
    terminal.until(lambda: terminal.lines[-2].startswith(" map PDO"), "the syntax")
    terminal.type("ctual_value\r")
    terminal.wait("TPDO1 set: ")
    terminal.wait_prompt("sim/1 PRE-OP*> ")
    terminal.type("m1 ?")
    terminal.wait("Leave the PDO disabled.")
    terminal.until(lambda: terminal.cursor_line.startswith("sim/1 PRE-OP*> m1"), "the line again")
    terminal.type(CTRL_C)
    terminal.wait_prompt("sim/1 PRE-OP*> ")
    terminal.run("help")
    terminal.wait("Aliases, at the prompt:")
    terminal.wait_prompt("sim/1 PRE-OP*> ")
    terminal.run("help sw")
    terminal.wait("sw  at the prompt, an alias of: read 6041")


def test_an_alias_hides_no_command(open_terminal: Open, tmp_path: Path) -> None:
    file = tmp_path / "dvtcli.toml"
    file.write_text('[aliases]\nmap = "pdo"\n')
    terminal = open_terminal("--sim", "gen4", environment={"DVTCLI_CONFIG": str(file)})
    assert terminal.ended() == 2
    assert "the alias 'map' is a command already" in " ".join(terminal.text.split()), "a long path wraps"
