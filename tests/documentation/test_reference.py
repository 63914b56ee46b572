"""What is generated in the documentation is what the code has."""

from __future__ import annotations

import inspect
import json
import re
from collections import Counter
from pathlib import Path
from typing import Any
from xml.etree import ElementTree

import pytest

import dvtcli
from dvtcli.cli.catalogue import command_names
from dvtcli.operations import results
from dvtcli.operations.user.options import Options
from tests.documentation.pages import BUILT, DOCS, PAGES, built, links_of, text
from tests.documentation.reference import PARTS, REWRITE, names, rewritten
from tests.documentation.reference.documents import RUNS, SENSES, annotated, paths, schemas, sense
from tests.documentation.reference.documents import document as section
from tests.documentation.reference.house import DRAWING, drawing, svg
from tests.house.draw import ROOMS, House
from tests.process import ROOT

generated = pytest.mark.parametrize("page", [page for page in PAGES if any(names(text(page)))])


@generated
def test_what_is_generated_is_what_the_code_has(page: str) -> None:
    assert rewritten(text(page)) == text(page), f"{page} is not what the code has now: {REWRITE}"


@pytest.mark.together
def test_the_drawing_shows_the_imports_that_there_are() -> None:
    assert DRAWING.read_text("utf-8") == drawing(), f"{DRAWING.name} is not what the code has now: {REWRITE}"
    assert f"]({DRAWING.name})" in (DRAWING.parent / "architecture.md").read_text("utf-8")


def test_the_drawing_shows_every_room_and_what_runs_against_the_order(tmp_path: Path) -> None:
    texts = {"domain/pdo.py": "import dvtcli.device.node", "device/node.py": "import dvtcli.domain.pdo"}
    drawn = ElementTree.fromstring(svg(House(tmp_path / "dvtcli", texts)))  # noqa: S314 - our own text
    space = "{http://www.w3.org/2000/svg}"
    assert {text.text for text in drawn.iter(f"{space}text")} >= set(ROOMS)
    assert [path.get("stroke") for path in drawn.iter(f"{space}path")] == ["#78909c", "#c62828"]


def test_the_folders_of_operations_are_those_that_there_are() -> None:
    section = text("docs/reference/source.md").split("## The folders of `operations/`")[1].split("\n## ")[0]
    named = re.findall(r"`(\w+)/`", section)
    there = {path.parent.name for path in (ROOT / "dvtcli" / "operations").glob("*/__init__.py")}
    assert sorted(named) == sorted(there)


def test_every_part_stands_in_one_page() -> None:
    texts = [*map(text, PAGES), *(around.read_text("utf-8") for around in BUILT.values())]
    assert Counter(name for written in texts for name in names(written)) == Counter(PARTS.keys())


def test_every_command_and_option_has_its_place() -> None:
    shown = text("docs/reference/commands.md")
    absent = [name for name in command_names() if f"\n## {name}\n" not in shown]
    assert not absent, f"docs/reference/commands.md lacks {' '.join(absent)}: {REWRITE}"
    keys = text("docs/reference/options-and-settings.md")
    absent = [name for name in Options._fields if f"\n| `{name}` |" not in keys]
    assert not absent, f"docs/reference/options-and-settings.md lacks {' '.join(absent)}: {REWRITE}"


def test_every_schema_has_its_run() -> None:
    where = "tests/documentation/reference/documents.toml"
    without, gone = schemas() - RUNS.keys(), RUNS.keys() - schemas()
    assert not without, f"no command is annotated with the answer of {without}: say in {where} who answers it, by a run"
    assert not gone, f"nothing answers {gone} any more: it goes out of {where}"


@pytest.mark.parametrize("name", command_names())
def test_the_reference_of_a_document_names_the_commands_that_answer_it(name: str) -> None:
    for answer in annotated(name) - {"int", "None", "Facts", "ChangedNodes", "ComparedNodes"}:
        found = re.findall(r'"schema": "(dvtcli\.[a-z-]+/\d+)"', inspect.getsource(getattr(results, answer)))
        assert len(found) == 1, f'the document of {answer} says its schema once: {{"schema": "dvtcli.{name}/1", …}}'
        assert f"`{name}" in RUNS[found[0]]["from"], f"name `{name}` in documents.toml, where {found[0]} comes from"


@pytest.mark.drawn(8)
@pytest.mark.parametrize("schema", RUNS)
def test_every_field_of_a_document_is_described(schema: str) -> None:
    lines = section(schema)
    assert lines[0] == f"## {schema}"
    rows = [line.strip("| ").split(" | ") for line in lines if line.startswith("| `")]
    assert all(len(row) == 3 and row[2].strip() for row in rows)
    assert bool(rows) != ("why_not" in RUNS[schema])
    page = DOCS / "reference" / "json.md"
    assert {path for path, _ in links_of("\n".join(lines), page)} <= {page, *DOCS.rglob("*.md")}


def test_every_name_of_the_python_api_is_described() -> None:
    page = built("python.md")
    described = {*re.findall(r"^###+ (\S+)\n\n(?:```text\n[^`]*```\n\n)?`?\w", page, re.M)}
    names = {f"dvtcli.{name}" for name in dvtcli.__all__ if inspect.isfunction(getattr(dvtcli, name))}
    kinds = {kind.__name__: kind for kind in (dvtcli.Bus, dvtcli.Node, dvtcli.Lss)}
    own = {f"{name}.{member}" for name, kind in kinds.items() for member in dir(kind) if not member.startswith("_")}
    answers = {f"results.{name}" for name in dvtcli.results.__all__}
    assert described >= names | kinds.keys() | own | answers
    for path, _ in links_of(page, DOCS / "reference" / "python.md"):
        assert path.is_file() or path in BUILT, path


def test_no_field_is_explained_that_no_document_has() -> None:
    assert {schema for schema, own in SENSES.items() if isinstance(own, dict)} <= set(RUNS)


def documents() -> list[dict[str, Any]]:
    lines = (ROOT / "tests" / "transcripts" / "json.txt").read_text("utf-8").splitlines()
    lines += [line for page in PAGES for line in text(page).splitlines()]
    return [json.loads(line) for line in lines if line.startswith('{"schema"')]


@pytest.mark.parametrize("document", documents(), ids=lambda document: document["schema"])
def test_documents_of_transcripts_have_the_fields_that_are_listed(document: dict[str, Any]) -> None:
    schema = document["schema"]
    shown = "\n".join(["", *section(schema)])
    finding = "findings[]."
    for path, _ in paths(document):
        if path != "schema" and not path.startswith(finding):
            assert f"\n| `{path}` |" in shown, f"{schema} has {path}"
            assert sense(schema, path)
    listed = {line.split("`")[1] for line in shown.splitlines() if line.startswith("| `")}
    top = {path for path in listed if "." not in path}
    assert top - set(document) <= {"findings", "entries"}
