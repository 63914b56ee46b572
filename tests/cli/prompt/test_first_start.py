"""Nothing is configured: what is found is offered at a terminal, kept if wanted, and never asked without one."""

from __future__ import annotations

import tomllib
from pathlib import Path

from tests.cli.prompt.conftest import Open
from tests.cli.prompt.terminal import CTRL_C, CTRL_D, Terminal
from tests.process import dvtcli


def answer(terminal: Terminal, question: str, typed: str) -> None:
    terminal.wait(question)
    terminal.type(f"{typed}\r")


def simulated(terminal: Terminal) -> str:
    """The number of the simulated node in the list."""
    terminal.wait("Use which?")
    (row,) = [line for line in terminal.lines if "simulated" in line]
    return row.split()[0]


def test_the_simulated_node_is_chosen_and_kept(open_terminal: Open, tmp_path: Path) -> None:
    terminal = open_terminal()
    terminal.wait("No CAN interface is configured")
    number = simulated(terminal)
    answer(terminal, "Use which?", "99")
    terminal.wait("please")
    terminal.until(lambda: terminal.text.count("Use which?") == 2, "the question again")
    terminal.type(f"{number}\r")
    answer(terminal, "Save as default in dvtcli.toml? [y/N]", "help")
    terminal.wait("y and Enter is yes")
    terminal.until(lambda: terminal.text.count("Save as default in dvtcli.toml? [y/N]") == 2, "the question again")
    terminal.type("y\r")
    terminal.wait_prompt()
    terminal.type(CTRL_D)
    assert terminal.ended() == 0
    assert tomllib.loads((tmp_path / "dvtcli.toml").read_text()) == {"sim": ["generic"]}

    again = open_terminal()
    again.wait_prompt()
    assert "No CAN interface" not in again.text


def test_no_is_the_answer_to_saving(open_terminal: Open, tmp_path: Path) -> None:
    terminal = open_terminal()
    answer(terminal, "Use which?", simulated(terminal))
    answer(terminal, "Save as default in dvtcli.toml? [y/N]", "")
    terminal.wait_prompt()
    assert not (tmp_path / "dvtcli.toml").exists()


def test_a_choice_that_cannot_be_kept_is_used_all_the_same(open_terminal: Open, tmp_path: Path) -> None:
    terminal = open_terminal()
    answer(terminal, "Use which?", simulated(terminal))
    terminal.wait("Save as default in dvtcli.toml?")
    (tmp_path / "dvtcli.toml").mkdir()
    answer(terminal, "Save as default in dvtcli.toml? [y/N]", "y")
    terminal.wait("warning: dvtcli.toml: not saved:")
    terminal.wait_prompt()


def test_settings_that_are_broken_are_said_before_anything_is_asked(open_terminal: Open, tmp_path: Path) -> None:
    (tmp_path / "dvtcli.toml").write_text("sim = [\n")
    terminal = open_terminal(columns=250)
    assert terminal.ended() == 4
    assert "not valid TOML" in terminal.text
    assert (tmp_path / "dvtcli.toml").read_text() == "sim = [\n"


def test_control_c_and_control_d_leave_without_anything(open_terminal: Open, tmp_path: Path) -> None:
    terminal = open_terminal()
    terminal.wait("Use which?")
    terminal.type(CTRL_C)
    assert terminal.ended() == 130

    terminal = open_terminal()
    terminal.wait("Use which?")
    terminal.type(CTRL_D)
    assert terminal.ended() == 5
    assert "no CAN interface is configured" in terminal.text
    assert not (tmp_path / "dvtcli.toml").exists()


def test_a_configured_bus_asks_nothing(open_terminal: Open) -> None:
    terminal = open_terminal(environment={"CAN_INTERFACE": "virtual", "CAN_CHANNEL": "first-start"})
    terminal.wait("virtual:first-start")
    terminal.wait_prompt("first-start> ")
    assert "Use which?" not in terminal.text


def test_without_a_terminal_nobody_is_asked(tmp_path: Path) -> None:
    done = dvtcli("-n", "1", "pdo", cwd=tmp_path)
    assert done.returncode == 5
    assert "no CAN interface is configured" in done.stderr
    assert "Use which?" not in done.stderr


def test_a_named_bus_is_called_by_its_name(open_terminal: Open, tmp_path: Path) -> None:
    (tmp_path / "dvtcli.toml").write_text('[bus.bench]\nsim = "gen4"\n')
    terminal = open_terminal("--bus", "bench", columns=200, rows=60)
    terminal.wait_prompt("bench/1 PRE-OP> ")
    terminal.run("doctor")
    terminal.row("opened, chosen by [bus.bench]")
