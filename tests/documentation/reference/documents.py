"""The JSON documents: every schema with a document that a command really answered, and what its fields mean."""

from __future__ import annotations

import ast
import inspect
import json
import re
import shutil
import signal
import subprocess
import sys
import tempfile
import tomllib
from collections.abc import Iterator
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path
from typing import Any

from dvtcli.cli.catalogue import command_names
from dvtcli.operations import results
from tests.console import workplace
from tests.documentation.reference.commands import examples
from tests.documentation.reference.markdown import cell, code, fenced, table
from tests.documentation.reference.product import family_eds, split
from tests.house.source import PACKAGE, modules
from tests.process import environment, run
from tests.small_recording import ramp
from tests.surroundings import ROOT

HERE = Path(__file__).parent
DECLARED: dict[str, dict[str, Any]] = tomllib.loads((HERE / "documents.toml").read_text("utf-8"))
SENSES: dict[str, Any] = tomllib.loads((HERE / "fields.toml").read_text("utf-8"))
Document = dict[str, Any]
_LONGEST = 60
_OWN_RUN = "where a command's first example does not do, documents.toml has a run of its own"
_SCHEMA = re.compile(r'"schema": "(dvtcli\.[a-z-]+/\d+)"')


def schemas() -> set[str]:
    """Every schema that the product's files name."""
    found: set[str] = set()
    for module in modules():
        found |= set(_SCHEMA.findall(module.text))
        found |= {f"dvtcli.{name}/1" for name in re.findall(r'\bFacts\(\s*"([a-z-]+)"', module.text)}
    return found


def answering() -> dict[str, list[str]]:
    """Every schema with the commands whose function is annotated with the answer that has it."""
    found: dict[str, list[str]] = {}
    for name in command_names():
        for answer in annotated(name):
            source = inspect.getsource(getattr(results, answer)) if hasattr(results, answer) else ""
            for schema in _SCHEMA.findall(source):
                found.setdefault(schema, []).append(name)
    return found


def annotated(name: str) -> set[str]:
    """What the command's function says that it answers: the names in its return annotation."""
    tree = ast.parse((PACKAGE / "cli" / "commands" / f"{name}.py").read_text("utf-8"))
    (function,) = (node for node in tree.body if isinstance(node, ast.FunctionDef) and node.name == "command")
    assert function.returns is not None, f"say in {name}.py what `command` answers: `-> ITS_RESULT`"
    return set(ast.unparse(function.returns).split(" | "))


def runs() -> dict[str, dict[str, Any]]:
    """How each document is shown: as documents.toml declares it, or else by its command's first example."""
    by_example = {
        schema: {"from": " ".join(f"`{name}`" for name in names), "run": [examples(names[0])[0][0]]}
        for schema, names in answering().items() if schema not in DECLARED
    }  # fmt: skip
    return DECLARED | by_example


RUNS = runs()


def every_schema() -> Iterator[str]:
    """Each schema with the commands that answer it."""
    return table(("document", "from"), ((code(schema), how["from"]) for schema, how in RUNS.items()))


def every_document() -> Iterator[str]:
    """A section for each schema, by four runs at a time."""
    with ThreadPoolExecutor(4) as several:
        for section in several.map(document, RUNS):
            yield from ("", *section)


def document(schema: str) -> list[str]:
    """The section of a *schema*: who answers it, an example, its fields."""
    how = RUNS[schema]
    head = [f"## {schema}", "", f"From {how['from']}.", ""]
    if "why_not" in how:
        return [*head, f"No example: {how['why_not']}."]
    answer = example(how)
    assert answer["schema"] == schema, f"{_OWN_RUN}: {how['run']} answers {answer}, not {schema}"
    shown = json.dumps(_shown(answer, how), indent=2, ensure_ascii=False).splitlines()
    fields = table(("field", "is", "means"), _fields(schema, answer))
    return [*head, *fenced("text", _typed(how)), "", *fenced("json", shown), "", *fields]


def _typed(how: Document) -> Iterator[str]:
    """What is typed for an example: one command line, or a process that takes several."""
    line = " ".join(["$ dvtcli", *(f"--sim {sim}" for sim in how.get("sim", ["gen4"])), "--json"])
    if len(how["run"]) == 1:
        yield f"{line} {how['run'][0]}"
    else:
        yield from (f"{line} <<END", *how["run"], "END")


def example(how: Document) -> Document:
    """The document that the last line of a run answers."""
    with tempfile.TemporaryDirectory(prefix="dvtcli-reference-") as made:
        folder = workplace(Path(made))
        shutil.copy(family_eds("gen4"), folder / "drive.eds")
        ramp(folder / "run.log", 2)
        nodes = [word for sim in how.get("sim", ["gen4"]) for word in ("--sim", sim)]
        lines = how["run"]
        words = split(lines[0]) if len(lines) == 1 else []
        argv = [*nodes, "--json", "--yes", *words]
        env = environment() | {"HOME": str(folder)} | how.get("env", {})
        if how.get("until"):
            said = _first_line(argv, folder, env)
        else:
            ran = run(argv, stdin="" if words else "\n".join([*lines, ""]), cwd=folder, env=env)
            assert ran.returncode == how.get("code", 0), f"{_OWN_RUN}: {lines} ended with {ran}"
            said = ran.stdout
    documents: list[Document] = [json.loads(line) for line in said.splitlines()]
    answers = [document for document in documents if document["schema"] != "dvtcli.error/1"] or documents
    return answers[0 if words else -1]


def _first_line(words: list[str], folder: Path, env: dict[str, str]) -> str:
    """The first line that dvtcli prints which only Ctrl-C ends."""
    process = subprocess.Popen(
        [sys.executable, "-m", "dvtcli", *words],
        stdin=subprocess.PIPE, stdout=subprocess.PIPE, stderr=subprocess.DEVNULL, encoding="utf-8", cwd=folder, env=env,
    )  # fmt: skip
    assert process.stdout is not None
    said = process.stdout.readline()
    process.send_signal(signal.SIGINT)
    process.communicate()
    return said


def _shown(document: Document, how: Document) -> Document:
    """*document* with its long parts cut, and what differs from run to run made the same."""
    first, short = how.get("first", {}), how.get("short", [])
    cut = {key: value[: first[key]] if key in first else value for key, value in document.items()}
    cut |= {key: f"{cut[key][:_LONGEST]}…" for key in short}
    same: Document = _same(cut, how.get("same", {}))
    return same


def _same(value: Any, same: Document, key: str = "") -> Any:
    if key in same and value is not None:
        assert isinstance(value, type(same[key])), (key, value)
        return same[key]
    if isinstance(value, dict):
        return {name: _same(inner, same, name) for name, inner in value.items()}
    return [_same(inner, same) for inner in value] if isinstance(value, list) else value


def _fields(schema: str, document: Document) -> Iterator[tuple[str, str, str]]:
    """Each field with its kind and sense, those of inner objects by their path."""
    shown = dict(paths(document))
    for path, value in shown.items():
        if path != "schema":
            yield code(path), kind(value), cell(sense(schema, path))
    for path, text in SENSES.get(schema, {}).items():
        if "." in path and path not in shown:
            yield code(path), "", cell(text)


def paths(document: Document, before: str = "") -> Iterator[tuple[str, Any]]:
    """Every field of a document with its value, inner ones by their path (`steps[].object`)."""
    for key, value in document.items():
        yield before + key, value
        inner = value[0] if isinstance(value, list) and value else value
        by_signal = key == "signals" or (key in ("physical", "objects") and "signals" in document)
        by_signal = by_signal or (key == "fields" and "what" in document)  # as many names as there are services
        if isinstance(inner, dict) and (not by_signal or isinstance(value, list)):
            yield from paths(inner, f"{before}{key}[]." if isinstance(value, list) else f"{before}{key}.")


def sense(schema: str, path: str) -> str:
    """What a field means: by schema and path, else by path, else by its own name."""
    own = SENSES.get(schema, {})
    name = path.rpartition(".")[2]
    for known in (own.get(path), SENSES.get(path), own.get(name), SENSES.get(name), _said_behind(schema, name)):
        if isinstance(known, str):
            return known
    raise LookupError(
        f"what is {path} of {schema}? Say it in the result's file, in a comment `#: ...` above its field, "
        f"or in {HERE.relative_to(ROOT)}/fields.toml"
    )


def _said_behind(schema: str, name: str) -> str | None:
    """What the comment above the field *name* of the answer with *schema* says, in its own file."""
    for module in modules():
        if module.name.startswith("operations/results/") and f'"{schema}"' in module.text:
            found = re.search(rf"((?:^    #: .*\n)+)    {name}: ", module.text, re.M)
            return found and " ".join(line.strip(" #:") for line in found[1].splitlines())
    return None


def kind(value: Any) -> str:
    """What JSON calls a value."""
    if value is None:
        return "null"
    names = {bool: "true/false", int: "number", float: "number", str: "text", list: "list", dict: "object"}
    return names[type(value)]
