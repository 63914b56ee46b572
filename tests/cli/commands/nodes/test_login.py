"""Logging in: right, wrong, with nobody to ask; and that a passcode is nowhere but on the wire."""

from __future__ import annotations

import subprocess
from pathlib import Path

import pytest

from tests import process
from tests.cli.commands.bench import Bench
from tests.cli.prompt.terminal import CTRL_C, CTRL_D, ENTER, Terminal
from tests.process import documents, environment
from tests.surroundings import homes, kept_in

LOCKED = "gen4-locked"
#: the simulated family's passcodes for levels 4 and 2, and one that it does not know
RIGHT, LOWER, WRONG = "0x4444", "0x2222", "48879"


def run(folder: Path, *words: str, stdin: str = "", **more: str) -> subprocess.CompletedProcess[str]:
    """Run dvtcli in *folder*, all of its own files in it too, with *more* environment."""
    own = homes(folder) | {"TMPDIR": str(folder)}
    return process.run(["--sim", LOCKED, *words], stdin=stdin, cwd=folder, env=environment() | own | more)


def files_with(folder: Path, *secrets: bytes) -> list[str]:
    """Names of the files below *folder* that hold one of *secrets*."""
    paths = [path for path in folder.rglob("*") if path.is_file()]
    return [str(path) for path in paths if any(secret in path.read_bytes() for secret in secrets)]


def test_a_locked_device_is_refused_before_any_write_and_says_how_to_go_on() -> None:
    with Bench((LOCKED,)) as bench:
        ran = bench.run("map tpdo1 606C --json")
        assert ran.code == 1
        assert ran.document["state"] == "unchanged"
        assert ran.document["object"] == "5000:01"
        assert ran.document["abort"] == "0x08000000"
        assert ran.document["hint"] == "`dvtcli --sim gen4-locked login 4`"
        assert "the access level is too low: it is 0, and this needs 4" in ran.document["text"]
        assert bench.run("store").code == 1
        assert bench.run("write 1017 500").code == 0  # no PDO: any level may


def test_force_lets_the_device_decide_and_shows_its_reason() -> None:
    with Bench((LOCKED,)) as bench:
        ran = bench.run("map tpdo1 606C --force --json")
        assert ran.code == 1
        assert ran.document["why"] == "the device says 8 at 0x5310:00: the access level is too low"
        assert ran.document["state"] == "rolled_back"
        assert bench.run("store --force --json").document["why"].startswith("the device says 8")


def test_login_unlocks_and_logging_out_locks(tmp_path: Path) -> None:
    lines = "login\nmap tpdo1 606C\nstore\nlogin 0\nmap tpdo1 6041\n"
    ran = run(tmp_path, "--json", stdin=lines, DVTCLI_PASSCODE=RIGHT)
    login, change, store, logout, error = documents(ran.stdout)
    assert login == {"schema": "dvtcli.login/1", "node": 1, "level": 4, "wanted": 4, "dry_run": False}
    assert change["verified"]
    assert store["stored"]
    assert (logout["level"], logout["wanted"]) == (0, 0)
    assert error["hint"] == "`dvtcli --sim gen4-locked login 4`"
    assert ran.returncode == 1


def test_a_wrong_passcode_is_one_error_with_the_device_s_reason(tmp_path: Path) -> None:
    ran = run(tmp_path, "login", DVTCLI_PASSCODE=WRONG)
    assert ran.returncode == 1
    assert ran.stderr.count("error:") == 1
    assert "node 1 was not logged in at level 4: it is at level 0" in ran.stderr
    assert "the device says 9 at 0x5310:00: the login failed" in ran.stderr
    assert "no setting was written, only the user ID and a passcode" in ran.stderr
    assert "nothing was written" not in ran.stderr


@pytest.mark.parametrize("passcode", ["", "nonsense"])
def test_without_a_passcode_not_even_the_user_id_is_written(tmp_path: Path, passcode: str) -> None:
    ran = run(tmp_path, "login", "-v", DVTCLI_PASSCODE=passcode)
    assert ran.returncode in (2, 6)
    assert "0x5000:01" in ran.stderr, "reads are shown"
    assert "<-" not in ran.stderr


def test_a_passcode_of_a_lower_level_is_no_success(tmp_path: Path) -> None:
    ran = run(tmp_path, "login", DVTCLI_PASSCODE=LOWER)
    assert ran.returncode == 1
    assert "it is at level 2" in ran.stderr
    assert run(tmp_path, "login", "2", DVTCLI_PASSCODE=LOWER).returncode == 0


@pytest.mark.parametrize("words", [("login", "6"), ("login", "-1"), ("login", "x"), ("login", "4", "--user", "0")])
def test_levels_and_users_that_are_none(tmp_path: Path, words: tuple[str, ...]) -> None:
    assert run(tmp_path, *words, DVTCLI_PASSCODE=RIGHT).returncode == 2


@pytest.mark.parametrize("passcode", ["0", "70000", "-5", "wxyz99"])
def test_what_is_no_passcode_is_not_repeated(tmp_path: Path, passcode: str) -> None:
    ran = run(tmp_path, "login", DVTCLI_PASSCODE=passcode)
    assert ran.returncode == 2
    assert "DVTCLI_PASSCODE in the environment: a passcode is a number 1…65535, decimal or 0x…" in ran.stderr
    assert "dvtcli.toml" not in ran.stderr
    assert "wxyz99" not in ran.stderr


def test_nobody_to_ask_names_both_ways(tmp_path: Path) -> None:
    for ran in (run(tmp_path, "login"), run(tmp_path, stdin="login\n")):
        assert ran.returncode == 6
        assert "DVTCLI_PASSCODE" in ran.stderr
        assert "`passcode` in your config.toml" in ran.stderr


@pytest.mark.parametrize("value", [RIGHT, '"0x4444"', "17476"])
def test_the_passcode_may_stand_in_the_users_settings_and_in_no_projects(tmp_path: Path, value: str) -> None:
    (tmp_path / "dvtcli.toml").write_text(f"passcode = {value}\n")
    ran = run(tmp_path, "login")
    assert (ran.returncode, "dvtcli.toml: passcode: never taken from a project's file" in ran.stderr) == (6, True)
    kept_in(tmp_path).mkdir(mode=0o700, parents=True, exist_ok=True)
    (tmp_path / "dvtcli.toml").rename(kept_in(tmp_path) / "config.toml")
    assert run(tmp_path, "login").returncode == 0


def test_where_no_login_is_needed_none_is_asked_for(tmp_path: Path) -> None:
    with Bench(("gen4",)) as bench:
        assert bench.run("login --json").document["level"] == 4
        bench.run("save " + str(tmp_path / "s.dvt"))
        assert not (tmp_path / "s.dvt").exists()
    with Bench(("tmcm",)) as bench:
        ran = bench.run("login")
        assert ran.code == 1
        assert "has no login" in ran.stderr


def test_a_dry_run_needs_no_passcode_and_sends_none(tmp_path: Path) -> None:
    ran = run(tmp_path, "--dry-run", "-v", stdin="login 5\nmap tpdo1 606C\n")
    assert ran.returncode == 0
    assert "0x5000:02 <-" not in ran.stderr
    assert "<-" not in ran.stderr


def test_the_passcode_is_in_no_file_and_on_no_screen(tmp_path: Path) -> None:
    """-vv, -v, results, a saved script, and whatever a process leaves on disk."""
    lines = "login -vv\nmap tpdo1 606C -v\nlogin 0 -v\nlogin -v\nsave mine.dvt\n"
    ran = run(tmp_path, stdin=lines, DVTCLI_PASSCODE="21845")  # 0x5555, level 5
    assert ran.returncode == 0
    shown = ran.stdout + ran.stderr
    assert "** ** ** **" in shown
    assert "0x5000:02 <- (not shown)" in shown
    assert not [secret for secret in ("21845", "5555", "55 55") if secret in shown.lower()]
    script = (tmp_path / "mine.dvt").read_text()
    assert "\nlogin 4\n" in script
    assert not files_with(tmp_path, b"21845", b"5555", b"55 55", b"\x55\x55")


@pytest.mark.parametrize(("typed", "said"), [("17476", "is at access level 4"), (WRONG, "was not logged in")])
def test_at_a_terminal_the_passcode_is_asked_for_without_echo(tmp_path: Path, typed: str, said: str) -> None:
    terminal = Terminal(tmp_path, "--sim", LOCKED)
    try:
        terminal.wait_prompt()
        terminal.run("login -vv")
        terminal.wait("passcode of node 1 for level 4:")
        terminal.type(typed + ENTER)
        terminal.wait(said)
        terminal.wait_prompt()
        terminal.type(CTRL_D)
        assert terminal.ended() == 0
        assert typed.encode() not in terminal.written
        assert b"44 44" not in terminal.written
        assert b"EF BE" not in terminal.written
    finally:
        terminal.close()
    assert list(tmp_path.glob("dvtcli/**/history"))
    assert not files_with(tmp_path, typed.encode())


def test_an_answer_may_be_refused(tmp_path: Path) -> None:
    terminal = Terminal(tmp_path, "--sim", LOCKED)
    try:
        terminal.wait_prompt()
        terminal.run("login")
        terminal.wait("passcode of node 1")
        terminal.type(CTRL_D)
        terminal.wait("no passcode was given")
        terminal.wait_prompt()
        assert any(line.startswith("error: not logged in") for line in terminal.lines)
        terminal.run("login 5")
        terminal.wait("for level 5:")
        terminal.type(CTRL_C)
        terminal.wait_prompt()
    finally:
        terminal.close()


def test_a_reset_logs_out(tmp_path: Path) -> None:
    ran = run(tmp_path, "--json", stdin="login\nnmt reset-node\nread 5000:1\n", DVTCLI_PASSCODE=RIGHT)
    assert [documents(ran.stdout)[number]["schema"] for number in (0, 1)] == ["dvtcli.login/1", "dvtcli.nmt/1"]
    assert documents(ran.stdout)[2]["value"] == 0


@pytest.mark.parametrize(
    "line", ["write 5000:2 17476", "write 0x5000:02 0x4444 --force", "write 5000:2 17476 --as u16"]
)
def test_a_raw_write_of_a_passcode_is_refused(line: str) -> None:
    with Bench((LOCKED,)) as bench:
        ran = bench.run(f"{line} --json")
        assert (ran.code, ran.document["hint"]) == (6, "`dvtcli --sim gen4-locked login` asks for it without echo")
        assert bench.run("read 5000:1 --json").document["value"] == 0


def test_a_line_with_a_passcode_is_not_kept(tmp_path: Path) -> None:
    terminal = Terminal(tmp_path, "--sim", LOCKED)
    try:
        terminal.wait_prompt()
        terminal.run("write 0x5000:02 17476")
        terminal.wait("must not be on a command line")
        terminal.wait_prompt()
        terminal.run("read 5000:1")
        terminal.wait("Access level indication")
        terminal.wait_prompt()
    finally:
        terminal.close()
    assert files_with(tmp_path, b"read 5000:1")
    assert not files_with(tmp_path, b"17476")
