"""Help is short, complete and true: what it shows as typed is run on a simulated node."""

from __future__ import annotations

import shutil
import subprocess
from importlib import import_module

import pytest

from dvtcli.cli.catalogue import TASKS, command_names, fill_rows, summary, task_sections
from dvtcli.cli.commands.help import TOPICS, overview, topic
from dvtcli.cli.view.typed_hints import typed
from dvtcli.domain.abort import abort_text, code_of
from dvtcli.domain.abort_causes import USUAL_CAUSES
from dvtcli.domain.network.check.network_rules import NETWORK_RULES
from dvtcli.files.device_lint import EVERY_RULE
from dvtcli.operations.network.check_networks import FILE_RULES
from dvtcli.watch.recording_checks.recording_rules import RECORDING_RULES, UNREADABLE
from tests.cli.commands.bench import Bench
from tests.documentation.reference.rules import declared
from tests.process import dvtcli

every_topic = pytest.mark.parametrize("name", TOPICS)


def test_help_without_a_name_fits_a_small_screen_and_names_every_command() -> None:
    lines = overview()
    assert len(lines) < 24
    assert max(map(len, lines)) <= 80
    shown = {word for line in lines[1 : lines.index("")] for word in line.split()}
    assert set(command_names()) <= shown


def test_the_programs_help_fits_a_screen_and_leads_to_the_rest() -> None:
    lines = dvtcli("--help").stdout.splitlines()
    assert len(lines) <= 24, "put the new command under a task whose row has room, or shorten a row"
    assert max(map(len, lines)) <= 80
    assert set(command_names()) <= {word for line in lines for word in line.split()}
    assert any("dvtcli help --all" in line for line in lines)


def test_a_task_of_many_commands_takes_more_lines() -> None:
    names = [f"command{number}" for number in range(20)]
    rows = fill_rows(names, 60)
    assert [name for row in rows for name in row.split()] == names
    assert max(map(len, rows)) <= 60
    assert fill_rows(["x" * 70, "y"], 60) == ["x" * 70, "y"]


@pytest.mark.parametrize("name", command_names())
def test_every_command_says_in_short_what_the_table_says(name: str) -> None:
    command = import_module(f"dvtcli.cli.commands.{name}").command
    assert command.name == name
    assert command.short_help.splitlines()[0] == summary(name)


def test_every_command_is_shown_by_its_task() -> None:
    groups = {task: [name for name, _ in rows] for task, rows in task_sections()}
    assert tuple(groups) == TASKS
    assert sorted(name for group in groups.values() for name in group) == command_names()


def test_no_topic_hides_behind_a_command() -> None:
    assert not set(TOPICS) & set(command_names())


@every_topic
def test_a_topic_fits_the_terminal_and_says_what_it_is_about(name: str) -> None:
    lines = topic(name).splitlines()
    assert len(lines[0]) <= 65
    assert max(map(len, lines)) <= 100


@every_topic
def test_lines_that_a_topic_shows_run_one_after_another(name: str) -> None:
    typed = [line.strip()[2:] for line in topic(name).splitlines() if line.strip().startswith("> ")]
    with Bench() as bench:
        for line in typed:
            ran = bench.run(line)
            assert ran.code == 0, f"{line}: {ran.stderr}"


@pytest.mark.parametrize("name", [*command_names(), *TOPICS])
def test_help_shows_each(name: str) -> None:
    with Bench() as bench:
        assert bench.run(f"help {name}").code == 0


def squeezed(text: str) -> str:
    """*text* without the blanks and ends of lines where it was wrapped."""
    return "".join(text.split())


def test_help_explains_every_abort_code_and_every_rule() -> None:
    with Bench() as bench:
        for code, cause in USUAL_CAUSES.items():
            shown = [bench.run(f"help {name}").stdout for name in (f"0x{code:08X}", f"{code:08x}")]
            assert abort_text(code) in shown[0]
            assert squeezed(typed(cause)) in squeezed(shown[0])
            assert shown[0] == shown[1]
        for rule in (*declared(), *FILE_RULES, *NETWORK_RULES, *RECORDING_RULES, UNREADABLE, *EVERY_RULE):
            ran = bench.run(f"help {rule.name}")
            assert (ran.code, squeezed(rule.sense) in squeezed(ran.stdout)) == (0, True), rule.name


def test_the_causes_are_those_of_the_standards_codes() -> None:
    assert all(code_of(f"0x{code:08X}") == code for code in USUAL_CAUSES)
    assert len(USUAL_CAUSES) == 31  # CiA 301, table 22


def test_help_of_a_rule_names_its_kinds_and_the_code_a_device_would_answer() -> None:
    with Bench() as bench:
        shown = bench.run("help pdo-length").stdout
        assert "error of a change (`map`, `set`, `write`" in shown
        assert "error of `eds check`" in shown
        assert "0x06040042: number and length of the mapped objects" in shown
        assert "dummy-length" in bench.run("help 0x06040041").stdout


def test_an_abort_code_taken_for_a_frame_leads_to_its_help() -> None:
    with Bench() as bench:
        assert "is also an SDO abort code: object cannot be mapped" in bench.run("explain 0x06040041").stderr
        assert "`help 0x06040041` explains it" in bench.run("explain 0x06040041").stderr
        assert bench.run("explain 06040041#11").stderr == bench.run("explain 0x06040099").stderr == ""


def test_an_unknown_name_gets_the_nearest_command_or_topic() -> None:
    with Bench() as bench:
        for wrong, near in (("mapp", "map"), ("writin", "writing")):
            ran = bench.run(f"help {wrong}")
            assert ran.code == 2
            assert f"did you mean '{near}'?" in ran.stderr


def test_the_long_list_says_what_each_command_does() -> None:
    with Bench() as bench:
        ran = bench.run("help --all")
        assert "Map objects into a PDO" in ran.stdout
        assert "--bus-kwargs" in ran.stdout


def test_the_manual_page_names_everything() -> None:
    with Bench() as bench:
        page = bench.run("help --man").stdout
    for name in command_names():
        assert f"\n.SS {name}" in page
    assert r"\-\-bus\-kwargs" in page


@pytest.mark.skipif(shutil.which("groff") is None, reason="no groff")
def test_groff_understands_the_manual_page() -> None:
    page = dvtcli("help", "--man").stdout
    done = subprocess.run(
        ["groff", "-man", "-Tutf8", "-ww", "-P-c"], input=page, capture_output=True, encoding="utf-8", check=True
    )
    assert done.stderr == ""
    assert "dvtcli - configure the PDOs of CANopen devices" in done.stdout
    assert "map tpdo1 6C01:1 606C 6041 --cob-id 0x201 --sync 1" in done.stdout
