"""Completion in real shells: sourced as a user sources it, Tab pressed, and no bus opened."""

from __future__ import annotations

import os
import shutil
import subprocess
import sys
import unicodedata
from pathlib import Path

import pytest

from dvtcli.simulator.network.family_file import family_eds
from tests.cli.prompt.terminal import CTRL_C, TAB, Terminal
from tests.harness.sample import heavy
from tests.posix import needs_shell
from tests.process import PATIENCE_S, ROOT, documents, dvtcli, environment, run


def completed(folder: Path, words: list[str], **variables: str) -> list[str]:
    """What dvtcli offers for the last of *words*, as it is asked by a shell."""
    asked = {
        "COMP_WORDS": " ".join(["dvtcli", *words]),
        "COMP_CWORD": str(len(words)),
        "_DVTCLI_COMPLETE": "bash_complete",
    }
    done = run([], cwd=folder, env=environment() | asked | variables)
    assert (done.returncode, done.stderr) == (0, "")
    return [line.partition(",")[2] for line in done.stdout.splitlines() if line]


def test_commands_options_pdos_and_words(tmp_path: Path) -> None:
    assert "map" in completed(tmp_path, ["ma"])
    assert "--cob-id" in completed(tmp_path, ["map", "--c"])
    assert completed(tmp_path, ["pdo", "rpdo1"]) == ["rpdo1"]
    assert "auto" in completed(tmp_path, ["set", "tpdo1", "--cob-id", "a"])


def test_objects_come_from_what_the_line_names(tmp_path: Path) -> None:
    """No interface is configured here: opening a bus would fail."""
    assert completed(tmp_path, ["--sim", "gen4", "map", "tpdo1", "606C"]) == ["606C:00"]
    assert completed(tmp_path, ["read", "--sim", "gen4", "606C"]) == ["606C:00"]
    assert completed(tmp_path, ["--eds", str(family_eds("gen4")), "read", "606C"]) == ["606C:00"]
    assert "606C:00" in completed(tmp_path, ["--sim", "gen4", "read", "velocity_a"])
    (tmp_path / "dvtcli.toml").write_text('sim = "gen4"\n')
    assert completed(tmp_path, ["read", "606C"]) == ["606C:00"]


def test_what_is_wrong_on_the_line_offers_nothing(tmp_path: Path) -> None:
    assert completed(tmp_path, ["--sim", "nosuch", "read", "60"]) == []
    assert completed(tmp_path, ["--eds", "nosuch.eds", "read", "60"]) == []
    assert completed(tmp_path, ["-i", "socketcan", "-n", "5", "read", "60"]) == []


def test_each_shell_has_its_script() -> None:
    for shell, word in (("bash", "COMP_WORDS"), ("zsh", "compdef"), ("fish", "complete"), ("powershell", "Register")):
        done = dvtcli("--json", "completion", shell)
        if done.returncode == 0:
            (document,) = documents(done.stdout)
            assert word in document["script"]
        else:  # a click that is older than its PowerShell
            assert (shell, done.returncode) == ("powershell", 2)
            assert "pip install -U click" in done.stdout
    assert dvtcli("completion", "tcsh").returncode == 2


@pytest.fixture
def program(tmp_path: Path) -> Path:
    """A `dvtcli` that a shell finds in its PATH."""
    script = tmp_path / "dvtcli"
    script.write_text(f'#!/bin/sh\nexec "{sys.executable}" -m dvtcli "$@"\n')
    script.chmod(0o755)
    return script


def shell(program: Path, words: list[str], start: str) -> Terminal:
    folder = program.parent
    variables = {"PATH": f"{folder}{os.pathsep}{os.environ['PATH']}", "PYTHONPATH": str(ROOT), "INPUTRC": "/dev/null"}
    terminal = Terminal(folder, command=words, environment=variables, columns=100)
    terminal.type(f"{start}\r")
    return terminal


@heavy
@needs_shell
@pytest.mark.skipif(shutil.which("bash") is None, reason="no bash")
def test_tab_in_a_real_bash(program: Path) -> None:
    start = "PS1='rea''dy> '; bind 'set enable-bracketed-paste off'; eval \"$(dvtcli completion bash)\""
    terminal = shell(program, ["bash", "--norc", "--noprofile"], start)
    try:
        terminal.until(lambda: terminal.cursor_line == "ready>", "the shell's prompt")
        for typed, shown in (
            ("dvtcli recov", "ready> dvtcli recover"),
            ("dvtcli --sim gen4 read 606C", "ready> dvtcli --sim gen4 read 606C:00"),
            ("dvtcli --sim gen4 read 606C:", "ready> dvtcli --sim gen4 read 606C:00"),
            ("dvtcli map --cob", "ready> dvtcli map --cob-id"),
        ):
            terminal.type(typed)
            terminal.until(lambda typed=typed: terminal.cursor_line.endswith(typed), typed)
            terminal.type(TAB)
            terminal.until(lambda shown=shown: terminal.cursor_line == shown, shown)
            terminal.type(CTRL_C)
            terminal.until(lambda: terminal.cursor_line == "ready>", "an empty line")
    finally:
        terminal.close()


def completed_by_fish(program: Path, line: str) -> str:
    """What fish offers for *line*."""
    environ = environment() | {"PATH": f"{program.parent}{os.pathsep}{os.environ['PATH']}"}
    words = ["fish", "-c", f"dvtcli completion fish | source; complete -C '{line}'"]
    return subprocess.run(
        words, capture_output=True, encoding="utf-8", env=environ, timeout=PATIENCE_S, check=True
    ).stdout


@pytest.mark.skipif(shutil.which("fish") is None, reason="no fish")
def test_fish_completes(program: Path) -> None:
    assert completed_by_fish(program, "dvtcli --sim gen4 read 606C").startswith("606C:00\tVelocity actual value")


_FISH = ["fish", "--no-config"], "dvtcli completion fish | source; echo re'ady'"
_ZSH = ["zsh", "-f"], "autoload -U compinit; compinit -u -D; eval \"$(dvtcli completion zsh)\"; echo re'ady'"


@heavy
@needs_shell
@pytest.mark.parametrize(("words", "start", "described"), [(*_FISH, "(Statusword"), (*_ZSH, "-- Statusword")])
def test_tab_in_a_real_shell_shows_names_with_the_usual_objects_first(
    program: Path, words: list[str], start: str, described: str
) -> None:
    if shutil.which(words[0]) is None:
        pytest.skip(f"no {words[0]}")
    terminal = shell(program, words, start)
    try:
        terminal.wait("ready")
        terminal.type("dvtcli --sim gen4 map tpdo1 60" + TAB)
        terminal.wait("6041:00", described)
        offered = terminal.text.partition("map tpdo1 60")[2]
        assert offered.index("6041:00") < offered.index("6040:00") < offered.index("606C:00") < offered.index("6071:00")
    finally:
        terminal.close()


@heavy
@needs_shell
@pytest.mark.skipif(shutil.which("zsh") is None, reason="no zsh")
def test_zsh_lists_what_is_found_by_a_part_of_its_name_and_keeps_the_part(program: Path) -> None:
    terminal = shell(program, *_ZSH)
    try:
        terminal.wait("ready")
        terminal.type("dvtcli --sim gen4 read veloc" + TAB)
        terminal.wait("606B:00", "-- Velocity demand value")
        assert terminal.cursor_line.endswith(" read veloc")
    finally:
        terminal.close()


@pytest.mark.skipif(shutil.which("fish") is None, reason="no fish")
def test_fish_shows_a_description_to_its_end(program: Path) -> None:
    assert completed_by_fish(program, "dvtcli set tpdo1 --cob") == "--cob-id\tCAN-ID with 0x, `auto` or `keep`.\n"


@pytest.mark.skipif(shutil.which("zsh") is None, reason="no zsh")
def test_zsh_takes_the_script(program: Path) -> None:
    environ = environment() | {"PATH": f"{program.parent}{os.pathsep}{os.environ['PATH']}"}
    line = 'autoload -U compinit; compinit -u; eval "$(dvtcli completion zsh)"; print $_comps[dvtcli]'
    done = subprocess.run(
        ["zsh", "-f", "-c", line], capture_output=True, encoding="utf-8", env=environ, timeout=PATIENCE_S, check=True
    )
    assert done.stdout.strip() == "_dvtcli_completion"


@pytest.mark.parametrize("shell", ["bash", "zsh", "fish", "powershell"])
@pytest.mark.parametrize("words", ["read ", "map tpdo1 ", "read na", "objects "])
def test_names_of_strangers_files_steer_no_shell(shell: str, words: str) -> None:
    """A shell prints what it is given: a name in an EDS could set its title, or draw a link."""
    typed = f"dvtcli --sim tests/cli/commands/hostile.eds {words}"
    asked = {
        "COMP_WORDS": typed, "COMP_CWORD": "4" if words.startswith("read ") else str(len(typed.split(" ")) - 1),
        "_DVTCLI_COMPLETE": f"{shell}_complete",
    }  # fmt: skip
    done = run([], cwd=ROOT, env=environment() | asked)
    if shell == "powershell" and not done.stdout:
        pytest.skip("this click knows no PowerShell")
    assert done.stderr == ""
    assert [char for char in done.stdout if unicodedata.category(char) in ("Cc", "Cf") and char not in "\n\t"] == []
