"""Names of files, devices and users can hold terminal commands; none of them reaches a terminal raw."""

from __future__ import annotations

import unicodedata
from pathlib import Path

import pytest

from tests.cli.commands.bench import Bench, Ran
from tests.posix import needs_any_names
from tests.process import ROOT, dvtcli

HOSTILE = "tests/cli/commands/hostile.eds"
ESC = "\x1b[31m\x07\u202e"


def raw(text: str) -> list[str]:
    """Every character of *text* that could steer a terminal, but line ends."""
    return [repr(char) for char in text if unicodedata.category(char) in ("Cc", "Cf", "Cs") and char != "\n"]


def check(ran: Ran) -> None:
    assert raw(ran.stdout) == []
    assert raw(ran.stderr) == []


LINES = [
    "objects",
    "objects channels",
    "pdo",
    "pdo tpdo1",
    "pdo tpdo1 --ascii",
    "read 1008",
    "read 2000:1",
    "read 2000:99",
    "node",
    "scan --wait 10",
    "map tpdo1 2000:1 2000:2",
    "map tpdo1 2000:1/8",
    "map tpdo1 1000",
    "map tpdo1 2000:99",
    "map tpdo1 chanels",
    "map tpdo1 'Device name'",
    "eds show tests/cli/commands/hostile.eds",
    "eds check tests/cli/commands/hostile.eds",
    "verify",
    "undo",
    "help map",
]
TYPED = [
    f"read x{ESC}y",
    f"{ESC}",
    f"map tpdo1 {ESC}",
    f"map {ESC} 6041",
    f"map tpdo1 6041 --cob-id {ESC}",
    f"write 2000:1 {ESC}",
    f"run {ESC}.dvt",
    f"verify {ESC}.dcf",
    f"eds check {ESC}.eds",
    f"save nowhere/{ESC}",
    f"objects {ESC}",
    f"pdo --{ESC}",
    f'read "{ESC}',
    f"require identity vendor={ESC}",
    f"nmt {ESC}",
    f"help {ESC}",
]


@pytest.fixture(scope="module")
def hostile() -> Bench:
    return Bench((HOSTILE,), {"timeout": 0.05})


@pytest.mark.parametrize("line", LINES)
@pytest.mark.parametrize("suffix", ["", " --json"])
def test_names_of_files_and_devices_are_shown_escaped(hostile: Bench, line: str, suffix: str) -> None:
    check(hostile.run(line + suffix))


@pytest.mark.parametrize("line", TYPED, ids=[str(number) for number in range(len(TYPED))])
def test_what_was_typed_is_shown_escaped(hostile: Bench, line: str) -> None:
    ran = hostile.run(line)
    check(ran)
    assert ran.code in (0, 2)


@pytest.mark.parametrize("line", TYPED, ids=[str(number) for number in range(len(TYPED))])
def test_script_lines_are_shown_escaped(hostile: Bench, line: str) -> None:
    check(hostile.script("pdo -q", line))


def test_the_control_characters_are_there_to_be_escaped(hostile: Bench) -> None:
    assert "\\x1b" in hostile.run("objects").stdout
    assert "\\u202e" in hostile.run("eds show tests/cli/commands/hostile.eds").stdout
    assert "na\\x1b[31mme\\x07" in hostile.run("read 1008").stdout


@needs_any_names
def test_a_process_shows_file_names_escaped(tmp_path: Path) -> None:
    script = tmp_path / f"a{ESC}.dvt"
    script.write_text("bogus\n")
    eds = tmp_path / f"b{ESC}.eds"
    eds.write_bytes((ROOT / HOSTILE).read_bytes())
    for words in (
        ["--sim", "gen4", "run", str(script)],
        ["--sim", str(eds), "pdo"],
        ["--sim", str(eds), "read", "2000:99"],
        ["--sim", f"{ESC}@3", "pdo"],
        ["--eds", f"{ESC}.eds", "pdo"],
        ["-n", ESC, "pdo"],
        ["--profile", ESC, "--sim", "gen4", "pdo"],
        ["-i", ESC, "-n", "1", "pdo"],
        ["--timeout", ESC, "pdo"],
        [ESC],
        [f"--{ESC}"],
    ):
        ran = dvtcli(*words)
        assert raw(ran.stdout + ran.stderr) == [], words
        assert ran.returncode != 70, ran.stderr


@needs_any_names
def test_a_bad_settings_file_is_shown_escaped(tmp_path: Path) -> None:
    folder = tmp_path / f"c{ESC}"
    folder.mkdir()
    (folder / "dvtcli.toml").write_text("bogus = 1\n")
    ran = dvtcli("pdo", cwd=folder)
    assert ran.returncode == 4
    assert raw(ran.stderr) == []
