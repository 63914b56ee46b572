"""The tour: printed without a terminal, guided at one, and left at any time."""

from __future__ import annotations

from dvtcli.cli.commands.tour import STEPS
from tests.cli.prompt.conftest import Open, open_terminal  # noqa: F401 - the fixture
from tests.cli.prompt.terminal import CTRL_C, CTRL_D, ENTER
from tests.process import dvtcli


def test_without_a_terminal_every_step_is_printed_and_run() -> None:
    done = dvtcli("tour", merge=True)
    assert done.returncode == 0, done.stdout
    assert done.stdout.count("tour> ") == len(STEPS)
    for shown in (
        "TPDO1 set: ",
        "is not mappable",
        "Nothing was sent.",
        "proved: after the reset",
        "TPDO1 rolled back",
    ):
        assert shown in done.stdout
    assert "That was the tour." in done.stdout


def test_texts_fit_a_small_terminal() -> None:
    for step in STEPS:
        assert max(map(len, [*step.text.splitlines(), f"  Enter runs:  {step.line}"])) <= 80
        assert len(step.text.splitlines()) <= 4


def test_enter_takes_every_step(open_terminal: Open) -> None:  # noqa: F811
    terminal = open_terminal("tour")
    for number in range(1, len(STEPS) + 1):
        terminal.wait(f"{number}/{len(STEPS)}  ")
        terminal.until(lambda: terminal.cursor_line == "tour>", "the tour's prompt")
        terminal.type(ENTER)
    terminal.wait("That was the tour.")
    assert terminal.ended() == 0


def test_own_lines_run_and_the_step_stays(open_terminal: Open) -> None:  # noqa: F811
    terminal = open_terminal("tour")
    terminal.until(lambda: terminal.cursor_line == "tour>", "the tour's prompt")
    terminal.run("read 1018:1")
    terminal.wait("Vendor-ID")
    terminal.until(lambda: terminal.cursor_line == "tour>", "the tour's prompt")
    assert "2/9" not in terminal.text
    terminal.run("bogus")
    terminal.wait("unknown command 'bogus'")
    terminal.until(lambda: terminal.cursor_line == "tour>", "the tour's prompt")
    terminal.run("pdo")
    terminal.wait("2/9")
    terminal.until(lambda: terminal.cursor_line == "tour>", "the tour's prompt")
    terminal.run("exit")
    assert terminal.ended() == 0


def test_control_c_and_control_d_leave(open_terminal: Open) -> None:  # noqa: F811
    for key in (CTRL_C, CTRL_D):
        terminal = open_terminal("tour")
        terminal.until(lambda shown=terminal: shown.cursor_line == "tour>", "the tour's prompt")
        terminal.type(key)
        assert terminal.ended() == 0
