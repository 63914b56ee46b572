"""With --json each exit code but 0 has one error document, the last line, with the whole text of the screen."""

from __future__ import annotations

from collections.abc import Iterator
from importlib import import_module
from pathlib import Path
from pkgutil import iter_modules

import pytest

from dvtcli.operations import results
from dvtcli.operations.results.documents import Answer
from tests.process import documents, run

FILE = "nodes: {drive: {node_id: 1, store: true, tpdo: {1: {event_timer: 20}}}}\n"
#: how it is told apart -> the exit code, options before the command, the command
ENDS = {
    "usage": (2, (), ("mpa", "tpdo1")),
    "a file that is not there": (2, (), ("apply", "none.yaml")),
    "a file that is wrong": (4, (), ("apply", "wrong.yaml")),
    "check": (4, (), ("check", "wrong.yaml")),
    "check of none": (2, (), ("check", "none.yaml")),
    "eds check": (4, (), ("eds", "check", "wrong.eds")),
    "eds add": (4, (), ("eds", "add", "wrong.eds")),
    "a rule": (1, (), ("map", "tpdo1", "1018:1")),
    "an abort": (1, (), ("read", "5FFF", "--force")),
    "plan": (3, (), ("plan", "--exit-code", "net.yaml")),
    "verify": (3, (), ("verify", "net.yaml")),
    "lost by the store": (7, ("--fault", "stores-nothing"), ("apply", "--prove", "net.yaml")),
    "apply --prove": (1, ("--fault", "keeps-ram"), ("apply", "--prove", "net.yaml")),
    "store --prove": (1, ("--fault", "keeps-ram"), ("store", "--prove")),
    "nmt": (1, ("--fault", "ignores-nmt"), ("nmt", "start")),
    "refused and rolled back": (1, ("--fault", "refuse@1=0x06040041"), ("apply", "net.yaml")),
    "silent": (5, ("-n", "9"), ("pdo",)),
    "doctor": (5, ("-n", "9"), ("doctor",)),
    "a report of what cannot be planned": (1, (), ("report", "now.html", "lacks.yaml")),
    "a plan of what a device lacks": (1, (), ("plan", "lacks.yaml")),
}


@pytest.fixture
def folder(tmp_path: Path) -> Path:
    (tmp_path / "net.yaml").write_text(FILE, "utf-8")
    (tmp_path / "wrong.yaml").write_text("nodes: {drive: {node_id: 1, tpdo: {1: {enabled: 'false'}}}}\n", "utf-8")
    (tmp_path / "lacks.yaml").write_text("nodes: {drive: {node_id: 1, tpdo: {77: {event_timer: 20}}}}\n", "utf-8")
    (tmp_path / "wrong.eds").write_text("[DeviceInfo]\n[2000]\nParameterName=x\nDataType=zz\n", "utf-8")
    return tmp_path


@pytest.mark.parametrize("end", ENDS)
def test_each_exit_code_but_0_has_one_error_document_which_comes_last(folder: Path, end: str) -> None:
    code, before, command = ENDS[end]
    argv = ["--sim", "gen4", "--timeout", "0.2", "--yes", *before]
    ran = run([*argv, "--json", *command], cwd=folder)
    errors = [one for one in documents(ran.stdout) if one["schema"] == "dvtcli.error/1"]
    assert (ran.returncode, [one["exit_code"] for one in errors]) == (code, [code]), ran
    assert documents(ran.stdout)[-1] == errors[0]
    assert errors[0]["text"]
    assert errors[0]["message"].startswith(("error: ", "wrong.yaml:1:")), errors[0]


@pytest.mark.parametrize("end", ["a rule", "an abort", "apply --prove", "refused and rolled back"])
def test_its_message_is_what_the_screen_shows(folder: Path, end: str) -> None:
    _, before, command = ENDS[end]
    argv = ["--sim", "gen4", "--timeout", "0.2", "--yes", *before, *command]
    screen = run(argv, cwd=folder).stderr
    message = documents(run([*argv, "--json"], cwd=folder).stdout)[-1]["message"]
    assert message.splitlines()
    assert {*message.splitlines()} <= {*screen.splitlines()}


def test_notes_are_said_beside_documents(folder: Path) -> None:
    argv = ["--sim", "gen4", "--yes", "apply", "--prove", "net.yaml"]
    assert run([*argv[:2], "--json", *argv[2:]], cwd=folder).stderr == run(argv, cwd=folder).stderr


def answers(of: type = Answer) -> Iterator[type]:
    for kind in of.__subclasses__():
        yield kind
        yield from answers(kind)


def test_each_answer_that_may_end_otherwise_than_0_says_why() -> None:
    for module in iter_modules(results.__path__, "dvtcli.operations.results."):
        import_module(module.name)
    found = [kind for kind in answers() if isinstance(getattr(kind, "exit_code", None), property)]
    assert len(found) > 10
    lacking = [
        kind.__name__ for kind in found if not {"failure", "failure_of_line", "failure_of_document"} & {*dir(kind)}
    ]
    assert not lacking
