"""README is true: its screens are what commands print, its tables are what the code has.

`pytest tests/house --update-transcripts` rewrites its screens.
"""

from __future__ import annotations

import ast
import json
import re
from pathlib import Path
from typing import Any

import click
import pytest

from dvtcli.shell import REGISTRY, parse, split
from dvtcli.simulator.family import family_names
from tests.console import commands, compare, rewritten, run, workplace
from tests.house.source import PACKAGE, modules
from tests.process import ROOT, SCRIPTS

README = ROOT / "README.md"
TEXT = README.read_text("utf-8")
BLOCK = re.compile(r"^```console\n(.*?)^```$", re.M | re.S)
#: a golden screen of a terminal, by its file under tests/
SCREEN = re.compile(r"^<!-- screen: (\S+) -->\n```text\n(.*?)^```$", re.M | re.S)
TRANSCRIPTS = ROOT / "tests" / "transcripts"


def section(title: str) -> str:
    """A section's text, its subsections included."""
    head = re.search(rf"^(#+) {re.escape(title)}$", TEXT, re.M)
    assert head is not None, title
    rest = TEXT[head.end() :]
    following = re.search(rf"^#{{2,{len(head[1])}}} ", rest, re.M)
    return rest[: following.start()] if following else rest


def first_column(title: str) -> list[str]:
    """The cells of a section's first column, without header and rule, back-quotes kept."""
    return [line.split("|")[1].strip() for line in section(title).splitlines() if re.match(r"\| `", line)]


def test_screens_are_what_commands_print(tmp_path: Path, request: pytest.FixtureRequest) -> None:
    folder = workplace(tmp_path)
    blocks = [block.splitlines() for block in BLOCK.findall(TEXT)]
    assert len(blocks) >= 5
    if request.config.getoption("--update-transcripts"):
        fresh = iter(["\n".join(["```console", *rewritten(block, folder), "```"]) for block in blocks])
        README.write_text(BLOCK.sub(lambda _: next(fresh), README.read_text("utf-8")), encoding="utf-8")
        return
    for block in blocks:
        compare(block, folder)


def screen(name: str) -> str:
    """A golden screen without its empty rows; the tests beside it play it in a real terminal."""
    rows = (ROOT / "tests" / name).read_text("utf-8").strip("\n").splitlines()
    return "".join(f"{row}\n" for row in rows if row)


def test_pictures_of_terminals_are_the_golden_screens(request: pytest.FixtureRequest) -> None:
    if request.config.getoption("--update-transcripts"):
        whole = README.read_text("utf-8")
        fresh = SCREEN.sub(lambda old: f"<!-- screen: {old[1]} -->\n```text\n{screen(old[1])}```", whole)
        README.write_text(fresh, encoding="utf-8")
        return
    shown = dict(SCREEN.findall(TEXT))
    assert {Path(name).stem.rpartition("_")[0] for name in shown} >= {"menu", "toolbar", "tour", "table"}
    for name, text in shown.items():
        assert text == screen(name), name


def test_screens_fit_a_page() -> None:
    for block in BLOCK.findall(TEXT):
        for line in block.splitlines():
            assert len(line) <= 140 or line.startswith("{"), line


def test_it_opens_with_two_commands_of_one_line() -> None:
    lines = re.findall(r"^```sh\n([^\n]*)\n```$", TEXT, re.M)[:2]
    assert all(line.startswith("python3 -m venv .venv && .venv/bin/pip install -q ") for line in lines)
    assert lines[0].endswith(".venv/bin/dvtcli --sim gen4 run scripts/pdo_config.dvt")
    assert lines[1].endswith(".venv/bin/pytest")
    assert TEXT.index(lines[1]) < 1200


def test_the_examples_of_commands_parse() -> None:
    from dvtcli.session import Session
    from dvtcli.view.output import Output

    session = Session(Output())
    session.started = True
    rows = [
        line for line in section("Commands").splitlines() if re.match(r"\| `[a-z]+", line) and line.count(" | ") >= 2
    ]
    examples = [re.findall(r"`([^`]*)` \|$", row) for row in rows]
    found = [
        example[0]
        for example in examples
        if example and example[0].split()[0] in REGISTRY.list_commands(click.Context(REGISTRY))
    ]
    assert len(found) >= 20
    for line in found:
        with parse(split(line), session):
            pass


def test_every_option_is_listed() -> None:
    listed = set(re.findall(r"(?<![\w-])(--?[a-z][a-z-]*)", section("Options")))
    for option in REGISTRY.params:
        assert isinstance(option, click.Option)
        if not option.hidden and option.name != "version":
            assert set(option.opts) <= listed, option.opts


def test_every_rule_is_listed_with_its_abort_code() -> None:
    from dvtcli.domain.abort import Abort

    rows = dict(re.findall(r"^\| `([a-z-]+)` \|.*\| ([^|]*?) ?\|$", section("What it refuses"), re.M))
    codes: dict[str, set[str]] = {}
    for call in (node for module in modules() for node in ast.walk(module.tree) if isinstance(node, ast.Call)):
        if ast.unparse(call.func) in ("error", "warning", "note", "Finding") and call.args:
            rule = call.args[0].value if isinstance(call.args[0], ast.Constant) else None
            if isinstance(rule, str) and re.fullmatch("[a-z-]+", rule):
                named = re.findall(r"Abort\.([A-Z_]+)", " ".join(map(ast.unparse, call.args)))
                codes.setdefault(rule, set()).update(f"0x{Abort[name]:08X}" for name in named)
    assert set(rows) == set(codes)
    for rule, found in codes.items():
        assert found <= set(rows[rule].split(", ")), (rule, found)


def test_exit_codes_are_those_of_the_errors() -> None:
    import inspect

    from dvtcli import errors

    used = {kind.exit_code for _, kind in inspect.getmembers(errors, inspect.isclass) if issubclass(kind, Exception)}
    listed = {int(code) for code in re.findall(r"^\| (\d+)", section("Exit codes"), re.M)}
    assert used <= listed


def documents() -> list[dict[str, Any]]:
    lines = (TRANSCRIPTS / "json.txt").read_text("utf-8").splitlines() + TEXT.splitlines()
    return [json.loads(line) for line in lines if line.startswith('{"schema"')]


@pytest.mark.parametrize("document", documents(), ids=lambda document: document["schema"])
def test_documents_have_the_fields_that_are_listed(document: dict[str, Any]) -> None:
    (row,) = [line for line in section("JSON").splitlines() if line.startswith(f"| `{document['schema']}`")]
    listed = re.findall(r"`([a-z_]+)`", re.sub(r"\((?:[^()]|\([^()]*\))*\)", "", row.split("|")[3]))
    optional = {"findings"}
    assert set(document) - {"schema"} <= set(listed)
    assert set(listed) - set(document) <= optional
    inner = {
        key
        for value in document.values()
        if isinstance(value, list)
        for one in value
        if isinstance(one, dict)
        for key in one
    }
    assert inner <= set(re.findall(r"`([a-z_]+)`", row)) | {"rule", "severity", "place", "text", "abort", "hint"}


def test_every_schema_is_listed() -> None:
    results = "".join(path.read_text("utf-8") for path in (PACKAGE / "results").glob("*.py"))
    for schema in set(re.findall(r'"(dvtcli\.[a-z-]+/1)"', results)):
        assert f"`{schema}`" in section("JSON"), schema
    for command in (PACKAGE / "commands").glob("*.py"):
        for name in re.findall(r'\bFacts\(\s*"([a-z-]+)"', command.read_text("utf-8")):
            assert f"`dvtcli.{name}/1`" in section("JSON"), name


def test_scripts_and_families_are_listed() -> None:
    assert {cell.strip("`") for cell in first_column("Scripts")} == {path.name for path in SCRIPTS.iterdir()}
    families = set(re.findall(r"`([\w-]+)`", " ".join(first_column("Simulated devices"))))
    assert families == set(family_names())
    for line in section("Scripts").splitlines():
        if line.startswith("| `"):
            name, _, how = (cell.strip(" `") for cell in line.strip("|").split("|"))
            assert f"dvtcli {how} run scripts/{name}" in (SCRIPTS / name).read_text("utf-8"), name


def test_every_room_is_described() -> None:
    rooms = {path.name for path in PACKAGE.iterdir() if path.is_dir() and path.name != "__pycache__"}
    assert {cell.strip("`/") for cell in first_column("Architecture")} == rooms


def test_sessions_can_be_read() -> None:
    for block in BLOCK.findall(TEXT):
        assert commands(block.splitlines())
    assert callable(run)


def test_every_reason_for_a_refusal_is_told() -> None:
    (row,) = re.findall(r"^\| 6 \|.*$", section("Exit codes"), re.M)
    for reason in ("another device", "nobody can answer", "another dvtcli", "recover"):
        assert reason in row
