"""The vendors' worked examples: each script in a real process, its downloads and what the device holds afterwards."""

from __future__ import annotations

import tomllib
from functools import cache
from itertools import takewhile
from pathlib import Path
from typing import Any

import pytest

from tests.process import SCRIPTS, documents, dvtcli

Document = dict[str, Any]
EXAMPLES: list[Document] = tomllib.loads(Path(__file__).with_name("worked_examples.toml").read_text("utf-8"))["example"]


def examples(key: str) -> pytest.MarkDecorator:
    """Run the test for each example that has *key*."""
    chosen = [number for number, one in enumerate(EXAMPLES) if key in one]
    return pytest.mark.parametrize("number", chosen, ids=lambda number: EXAMPLES[number]["source"])


@cache
def run(number: int) -> list[Document]:
    """The documents of an example's script, then of a `read` for each final object, and of a look at the PDO.

    For `verify --frame` a TPDO is set to every SYNC: nothing happens in a simulated node that would be an event.
    """
    example = EXAMPLES[number]
    lines = [(SCRIPTS / example["script"]).read_text("utf-8")]
    lines += [f"node {example['node']}"] if "node" in example else []
    lines += [f"read {word(index, sub)}" for index, sub, _, _ in example["final"]]
    if "frame_length" in example:
        lines.append(f"set {example['pdo']} --sync 1")
    if "pdo" in example:
        look = " --frame" if example["pdo"].startswith("tpdo") else ""
        lines += [f"pdo {example['pdo']}", f"verify {example['pdo']}{look}"]
    done = dvtcli(*sims(example), "--json", "--yes", stdin="\n".join([*lines, ""]))
    assert done.returncode == 0, done.stdout + done.stderr
    return documents(done.stdout)


def sims(example: Document) -> list[str]:
    return [word for sim in example["sim"] for word in ("--sim", sim)]


def word(index: int, sub_index: int) -> str:
    return f"{index:04X}:{sub_index:02X}"


def wire(value: int, size: int) -> str:
    return value.to_bytes(size, "little").hex(" ").upper()


def steps(number: int) -> list[tuple[str, str]]:
    """The script's own downloads: object and bytes."""
    script = takewhile(lambda document: document["schema"] != "dvtcli.value/1", run(number))
    changes = [document for document in script if document["schema"] == "dvtcli.change/1"]
    return [(step["object"], step["after"]) for change in changes for step in change["steps"]]


@pytest.mark.parametrize("script", sorted({one["script"] for one in EXAMPLES}))
def test_the_script_runs_from_its_file(script: str) -> None:
    example = next(one for one in EXAMPLES if one["script"] == script)
    done = dvtcli(*sims(example), "run", f"scripts/{script}")
    assert done.returncode == 0, done.stderr


@examples("write")
def test_downloads_come_in_the_notes_order(number: int) -> None:
    assert steps(number) == [
        (word(index, sub), wire(value, size)) for index, sub, value, size in EXAMPLES[number]["write"]
    ]


@examples("final")
def test_the_device_holds_the_notes_numbers(number: int) -> None:
    rows = EXAMPLES[number]["final"]
    answers = [document for document in run(number) if document["schema"] == "dvtcli.value/1"][-len(rows) :]
    assert [(one["object"], one["raw"]) for one in answers] == [
        (word(index, sub), wire(value, size)) for index, sub, value, size in rows
    ]


@examples("never")
def test_what_the_device_does_not_have_is_never_written(number: int) -> None:
    touched = {place for place, _ in steps(number)}
    assert touched
    assert not touched & {word(index, sub) for index, sub in EXAMPLES[number]["never"]}


@examples("frame_cob_id")
def test_the_pdo_has_the_notes_can_id(number: int) -> None:
    assert run(number)[-2]["pdos"][0]["cob_id"] == EXAMPLES[number]["frame_cob_id"]


@examples("frame_length")
def test_the_frame_has_the_notes_length(number: int) -> None:
    shown, verified = run(number)[-2:]
    length = EXAMPLES[number]["frame_length"]
    assert (shown["pdos"][0]["bits"] + 7) // 8 == length
    (frame,) = verified["frames"]
    assert frame["data"] is not None
    assert len(bytes.fromhex(frame["data"])) == length


@examples("frame_data")
def test_the_mapping_lays_the_notes_values_out_as_the_notes_bytes(number: int) -> None:
    example = EXAMPLES[number]
    (row,) = run(number)[-2]["pdos"]
    frame = sum(example["frame_values"][entry["object"]] << entry["start_bit"] for entry in row["mapping"])
    assert frame.to_bytes(row["bits"] // 8, "little") == bytes.fromhex(example["frame_data"])


def test_every_script_is_an_example_or_the_main_one() -> None:
    assert {path.name for path in SCRIPTS.iterdir() if path.suffix in (".dvt", ".tcl")} == {
        one["script"] for one in EXAMPLES
    } | {
        "pdo_config.dvt",
        "pdo_config.tcl",
    }
