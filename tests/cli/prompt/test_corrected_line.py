"""A line that cannot be read comes back as the nearest line that can; it runs by Enter alone, at a prompt."""

from __future__ import annotations

import time
from collections.abc import Iterator
from pathlib import Path

import pytest

from dvtcli.cli.conversation import Conversation
from dvtcli.cli.corrected_line import corrected
from dvtcli.cli.lexer import split
from dvtcli.cli.parse_line import parse
from dvtcli.cli.prompt.full_line import _SEEN_S
from dvtcli.cli.view.output import Output
from dvtcli.domain.hint import Action, Hint
from tests.cli.commands.bench import Bench
from tests.cli.prompt.conftest import Open
from tests.cli.prompt.terminal import CTRL_C, ENTER, Terminal
from tests.process import dvtcli


@pytest.fixture
def session() -> Iterator[Conversation]:
    session = Conversation(Output())
    session.start({"sim": ("gen4",)})
    session.started = True
    session.node()
    yield session
    session.close()


@pytest.mark.parametrize(
    ("typed", "line"),
    [
        ("set tpdo1 timer 100", "set tpdo1 --timer 100"),
        ("set tpdo1 timer=100", "set tpdo1 --timer 100"),
        ("set tpdo1 -timer 100", "set tpdo1 --timer 100"),
        ("set tpdo1 --tmer 100", "set tpdo1 --timer 100"),
        ("set tpdo1 cobid 0x201", "set tpdo1 --cob-id 0x201"),
        ("set tpdo1 --event 100", "set tpdo1 --timer 100"),
        ("nmt strat", "nmt start"),
        ("nmt reset-nod", "nmt reset-node"),
        ("set tpdo1 --cob-id 201", "set tpdo1 --cob-id 0x201"),
        ("map 6041 tpdo1", "map tpdo1 6041"),
        ("map 6041 606C tpdo1 sync 1", "map tpdo1 6041 606C --sync 1"),
        ("map tpd1 6041", "map tpdo1 6041"),
        ("map tdpo1 6041", "map tpdo1 6041"),
        ("map tpdo_1 6041", "map tpdo1 6041"),
        ("map tpdo 1 6041", "map tpdo1 6041"),
        ("map rpd12 60FF", "map rpdo12 60FF"),
        ("pdo 1:tpd1", "pdo 1:tpdo1"),
        ("tpd1", "tpdo1"),
        ("tpdo1 6041", "map tpdo1 6041"),
        ("tpdo1 timer 100", "set tpdo1 --timer 100"),
        ("mpa tpdo1 6041", "map tpdo1 6041"),
        ("mpa 6041 tpd1", "map tpdo1 6041"),
        ("map tpdo1 statuswrd", "map tpdo1 statusword"),
        ("map tpdo1 velocity actual value", "map tpdo1 velocity_actual_value"),
        ("SDO_RNX 1 0x6041 0", "sdo_rnx 1 0x6041 0"),
    ],
)
def test_a_near_line_is_found_and_can_be_read(session: Conversation, typed: str, line: str) -> None:
    found = corrected(split(typed), session)
    assert found == split(line)
    parse(found, session).close()


@pytest.mark.parametrize(
    "typed",
    [
        "map pdo1 6041",  # of either direction
        "map tpdo1 6041 --cob-id 385",  # decimal or hexadecimal
        "foo",
        "y",
        "xyzzy tpdo1 6041",
        "map tpdo1 nothing_like_it",
        "set tpdo1 --timer soon",
        "map tpdo1 6041 --help",
        "dvtcli -n 9 store",  # another node than the one that is selected
        "map tpdo1 6041",  # nothing is wrong
        "dvtcli map tpdo1 6041",
    ],
)
def test_nothing_is_guessed_where_two_things_may_be_meant(session: Conversation, typed: str) -> None:
    assert corrected(split(typed), session) is None


def test_a_file_that_exists_is_not_offered(
    session: Conversation, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.chdir(tmp_path)
    assert corrected(["save"], session) == ["save", "session.dvt"]
    Path("session.dvt").touch()
    assert corrected(["save", "--all"], session) == ["save", "session-2.dvt", "--all"]


def test_the_corrected_line_stands_at_the_prompt_and_enter_runs_it(gen4: Terminal) -> None:
    gen4.run("set tpdo1 timer 100")
    gen4.until(lambda: gen4.cursor_line == "sim/1 PRE-OP> set tpdo1 --timer 100", "the corrected line")
    gen4.wait("arguments (timer 100): corrected, Enter runs the line")
    time.sleep(2 * _SEEN_S)
    gen4.type(ENTER)
    gen4.wait("TPDO1 set: 1 write")
    gen4.wait_prompt("sim/1 PRE-OP*> ")
    gen4.run("mpa 6041")
    gen4.wait("unknown command 'mpa'")
    gen4.wait_prompt("sim/1 PRE-OP*> ")  # map needs a PDO: nothing is near that can be read


def test_a_corrected_line_keeps_its_destination_and_can_be_thrown_away(gen4: Terminal, tmp_path: Path) -> None:
    gen4.run("pdo tpd1 > seen.txt")
    gen4.until(lambda: gen4.cursor_line == "sim/1 PRE-OP> pdo tpdo1 > seen.txt", "the corrected line")
    gen4.type(CTRL_C)
    gen4.wait_prompt()
    assert not (tmp_path / "seen.txt").exists()


def test_enters_that_come_together_run_no_line_that_nobody_saw(gen4: Terminal) -> None:
    gen4.type(f"set tpdo1 timer 100{ENTER}{ENTER}{ENTER}")
    gen4.until(lambda: gen4.cursor_line == "sim/1 PRE-OP> set tpdo1 --timer 100", "the corrected line")
    assert "TPDO1 set" not in gen4.text
    gen4.type(CTRL_C)
    gen4.wait_prompt()


def test_a_second_enter_of_habit_runs_no_line_that_nobody_saw(gen4: Terminal) -> None:
    gen4.type(f"set tpdo1 timer 100{ENTER}")
    time.sleep(_SEEN_S / 3)
    gen4.type(ENTER)
    gen4.type(" ")
    gen4.until(lambda: gen4.cursor_line.rstrip() == "sim/1 PRE-OP> set tpdo1 --timer 100", "the corrected line still")
    assert "TPDO1 set" not in gen4.text
    gen4.type(CTRL_C)
    gen4.wait_prompt()


@pytest.mark.parametrize("typed", ["undo yes", "yundo yes", "restore all forse", "map tpdo1 6041 forced"])
def test_no_correction_answers_a_question_or_lifts_a_rule(session: Conversation, typed: str) -> None:
    found = corrected(split(typed), session)
    assert found is None or not {"--yes", "--force"} & set(found)


@pytest.mark.parametrize("typed", ["set tpdo1 --event 99999", "map tpdo1 6041 --event 99999"])
def test_an_event_timer_out_of_range_is_hinted_at_with_its_range(typed: str) -> None:
    with Bench() as bench:
        ran = bench.run(typed)
        ran.failed(
            2, "hint    --event has no value; --timer MS sets the event timer: 99999 ms is not within 0…65535 ms\n"
        )


@pytest.mark.parametrize(
    "typed",
    [
        "read 1000 --event 5",
        "map tpdo1 nosuch --event 100",
        "map tpdo1 6041 --event 100 --bogus",
        "set tpdo9x --event 9",
    ],
)
def test_another_error_of_the_line_keeps_its_hint(typed: str) -> None:
    with Bench() as bench:
        ran = bench.run(typed)
        assert (ran.code, "--event has no value" in ran.stderr) == (2, False), ran.stderr


def test_no_correction_names_a_port_that_there_is_not(session: Conversation) -> None:
    assert corrected(["gateway", "--port", "29536"], session) == ["gateway", "--listen", "127.0.0.1:29536"]
    assert corrected(["gateway", "--port", "99999"], session) is None


def test_a_passcode_is_in_no_correction(tmp_path: Path) -> None:
    (tmp_path / "p.dvt").write_text("wrte 5000:2 4711\n")
    done = dvtcli("--sim", "gen4", "--json", "run", str(tmp_path / "p.dvt"))
    assert (done.returncode, "4711" in done.stdout + done.stderr) == (2, False), done


@pytest.mark.parametrize("line", ["dvtcli -n 1 set tpdo1 --timer 123", "dvtcli --sim gen4@1 set tpdo1 --timer 51"])
def test_a_line_of_a_shell_in_a_script_names_no_bus_and_no_node(tmp_path: Path, line: str) -> None:
    """A script is parsed before its lines select nodes."""
    (tmp_path / "a.dvt").write_text(f"node 2\n{line}\n")
    done = dvtcli("--sim", "gen4@1", "--sim", "gen4@2", "-n", "1", "run", str(tmp_path / "a.dvt"))
    assert (done.returncode, "remove the part before the command" in done.stderr) == (2, True), done


def test_a_line_of_a_shell_runs_at_the_prompt_if_bus_and_node_are_the_same(open_terminal: Open) -> None:
    terminal = open_terminal("--sim", "gen4@5")
    terminal.wait_prompt("sim/5 PRE-OP> ")
    terminal.run("dvtcli --sim gen4@5 -n 5 read 1018:1")
    terminal.wait("0x0000001E")
    terminal.run("dvtcli -n 9 store")
    terminal.wait("this session runs on --sim gen4@5 -n 5; -n 9 is an option for the start")


@pytest.mark.parametrize("line", ["$ dvtcli --sim gen4 -n 1 read 1018:1", "$ dvtcli read 1018:1", "$ read 1018:1"])
def test_a_line_copied_with_the_shells_prompt_runs(line: str) -> None:
    with Bench() as bench:
        ran = bench.run(line)
        assert (ran.code, "0x0000001E" in ran.stdout) == (0, True), ran


@pytest.mark.parametrize("words", ["-i socketcan -c can0", "--sim tmcm", "-n 9"])
def test_a_line_of_a_shell_about_something_else_says_what_this_session_runs_on(words: str) -> None:
    with Bench() as bench:
        ran = bench.run(f"$ dvtcli {words} store")
        first = " ".join(words.split()[:2])
        assert ran.code == 2
        assert f"this session runs on --sim gen4 -n 1; {first} is an option for the start of dvtcli: " in ran.stderr


@pytest.mark.parametrize("line", ["$", "$ dvtcli", "dvtcli"])
def test_a_line_without_a_command_is_refused(line: str) -> None:
    with Bench() as bench:
        ran = bench.script(line)
        ran.failed(2, "enter a command")


@pytest.mark.parametrize(
    "written", ["set tpdo1 timer 100", "mpa 6041 tpdo1", "SDO_RNX 1 0x6041 0", "map tpdo1 statuswrd"]
)
def test_a_script_and_a_call_get_a_hint_that_runs_and_run_nothing(written: str) -> None:
    bench = Bench()
    before = bench.run("pdo tpdo1 --json").documents
    ran = bench.script(written)
    assert ran.code == 2
    hint = next(row for row in ran.stderr.splitlines() if "did you mean `" in row)
    assert bench.run("pdo tpdo1 --json").documents == before
    assert bench.script(hint.partition("`")[2].partition("`")[0]).code == 0


def test_a_programs_next_step_is_the_corrected_line() -> None:
    ran = Bench(options={"format": "json"}).run("mpa 6041 tpdo1")
    assert ran.code == 2
    assert ran.documents[0]["next"] == ["dvtcli", "--sim", "gen4", "map", "tpdo1", "6041"]
    assert Hint(Action.CORRECT, {"words": ("map",)}).words() == "write the line in a valid form"
