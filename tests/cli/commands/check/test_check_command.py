"""`check`: everything that is wrong in network files at once, as a person and as a program reads it."""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path

import pytest

from tests.cli.commands.bench import Bench

WRONG = """\
nodes:
  drive:
    node_id: 1
    tpdo:
      1:
        event_timer: 100
        inhibt_time: 10
      600: {}
"""


@pytest.fixture
def bench() -> Iterator[Bench]:
    with Bench(()) as bench:
        yield bench


def test_every_error_has_its_line_and_a_caret(bench: Bench, tmp_path: Path) -> None:
    file = tmp_path / "press.yaml"
    file.write_text(WRONG, "utf-8")
    ran = bench.run(f"check {file}")
    assert (ran.code, ran.stdout) == (4, "")
    assert ran.stderr.splitlines() == [
        f"{file}:7:9: error: unknown key 'inhibt_time' in TPDO1 of node drive, did you mean 'inhibit_time'?",
        "    6 |         event_timer: 100",
        "    7 |         inhibt_time: 10",
        "      |         ^^^^^^^^^^^",
        f"{file}:8:7: error: '600' is not a PDO number: 1…512",
        "    7 |         inhibt_time: 10",
        "    8 |       600: {}",
        "      |       ^^^",
        "2 errors. Further errors may show once these are corrected.",
    ]


def test_what_is_wrong_with_one_file_keeps_no_other_from_being_checked(bench: Bench, tmp_path: Path) -> None:
    texts = {"a": WRONG, "b": "a: {node_id: 1}\n", "c": "a: {node_id: 0}\n"}
    for name, text in texts.items():
        (tmp_path / f"{name}.yaml").write_text(text, "utf-8")
    (tmp_path / "e.yaml").write_bytes(b"\xff")
    files = " ".join(str(tmp_path / f"{name}.yaml") for name in "abcde")
    ran = bench.run(f"check {files} --json")
    found = {
        Path(one["file"]).stem: [(each["line"], each["column"], each["rule"]) for each in one["findings"]]
        for one in ran.document["files"]
    }
    assert ran.code == 4
    assert found["a"] == [(7, 9, "network-file"), (8, 7, "network-file")]
    assert found["b"] == [(1, 1, "asked-nothing")]
    assert [found["c"], found["d"], found["e"]] == [
        [(1, 14, "network-file")], [(1, None, "network-file")], [(1, None, "network-file")],
    ]  # fmt: skip
    text = bench.run(f"check {files}")
    assert text.stderr == ""
    assert "      |         ^^^^^^^^^^^\n" in text.stdout
    assert f"{tmp_path / 'b.yaml'}: 1 node, 0 PDOs; 1 warning, 1 note\n" in text.stdout
    assert f"{tmp_path / 'e.yaml'}: not checked; 1 error\n" in text.stdout


def test_a_file_that_is_not_there_is_in_the_formats_for_ci(bench: Bench, tmp_path: Path) -> None:
    (tmp_path / "a.yaml").write_text("a: {node_id: 1}\n", "utf-8")
    for others in ("", f"{tmp_path / 'a.yaml'} "):
        ran = bench.run(f"check {others}none.yaml --format github")
        assert ran.code == 2
        assert "::error file=none.yaml,line=1,title=network-file::No such file or directory" in ran.stdout
    assert 'failures="1"' in bench.run("check none.yaml --format junit").stdout
    assert bench.run("check none.yaml --format sarif").code == 2


def test_a_long_line_is_shown_around_its_caret(bench: Bench, tmp_path: Path) -> None:
    file = tmp_path / "press.yaml"
    file.write_text(f'a: {{node_id: 1, x: "{"ä" * 200}", \t prune: 1}}\n', "utf-8")
    lines = bench.run(f"check {file}").stderr.splitlines()
    assert len(lines[1]) <= 100
    assert lines[1][lines[2].index("^")] == "1"


def silent_nodes(count: int) -> str:
    """A network of *count* nodes without heartbeat, each with an RPDO that no node sends."""
    return "nodes:\n" + "".join(
        f"  n{node_id}:\n    node_id: {node_id}\n    dcf: generic\n    heartbeat_producer: 0\n"
        f"    rpdo: {{1: {{cob_id: 0x{0x200 + node_id:X}, enabled: true}}}}\n"
        for node_id in range(1, count + 1)
    )


@pytest.mark.parametrize(("count", "shown"), [(2, 2), (3, 1), (9, 1)])
def test_findings_of_one_cause_are_one_line(bench: Bench, tmp_path: Path, count: int, shown: int) -> None:
    file = tmp_path / "net.yaml"
    file.write_text(silent_nodes(count), "utf-8")
    lines = bench.run(f"check {file}").stdout.splitlines()
    for rule in ("no-error-control", "rpdo-without-producer"):
        found = [line for line in lines if line.endswith(f"[{rule}]")]
        others = "2, 3" if count == 3 else f"2-{count}"
        if rule == "rpdo-without-producer":
            others += f" ({'0x202, 0x203' if count == 3 else f'0x202-0x20{count}'})"
        assert (len(found), [line for line in found if f"({count} times: also nodes {others}; line " in line]) == (
            shown, found if shown == 1 else [],
        )  # fmt: skip
        alone = bench.run(f"check {file} --rule {rule}").stdout.splitlines()
        assert sum(line.endswith(f"[{rule}]") for line in alone) == count
        (report,) = bench.run(f"check {file} --json").document["files"]
        assert sum(each["rule"] == rule for each in report["findings"]) == count
    assert lines[-1].endswith("; --rule NAME alone lists each finding of that rule") == (shown == 1)


@pytest.mark.parametrize(("count", "shown"), [(2, 2), (3, 1), (4, 1)])
def test_plan_and_apply_show_findings_of_one_cause_in_one_line(tmp_path: Path, count: int, shown: int) -> None:
    file = tmp_path / "net.yaml"
    nodes = "{{node_id: {0}, dcf: generic, heartbeat_producer: 0, rpdo: {{1: {{cob_id: 0x20{0}}}}}}}"
    names = "".join(f"n{node_id}: {nodes.format(node_id)}\n" for node_id in range(1, count + 1))
    file.write_text(names, "utf-8")
    with Bench(tuple(f"generic@{node_id}" for node_id in range(1, count + 1)), {"yes": True}) as bench:
        for command in ("plan", "apply"):
            ran = bench.run(f"{command} {file}")
            lines = [line for line in ran.stderr.splitlines() + ran.stdout.splitlines() if "no node of the net" in line]
            assert (ran.code, len(lines)) == (0, shown), ran
            if shown == 1:
                others = ", ".join(map(str, range(2, count + 1)))
                assert lines[0].endswith(f"transmits 0x201 ({count} times: also line {others})")
        document = bench.run(f"plan {file} --json").document
    found = [one["rule"] for node in document["nodes"] for one in node["findings"]]
    assert found.count("rpdo-without-producer") == count


def test_a_warning_about_a_whole_pdo_shows_its_line(bench: Bench, tmp_path: Path) -> None:
    file = tmp_path / "net.yaml"
    file.write_text(silent_nodes(1), "utf-8")
    lines = bench.run(f"check {file} --rule rpdo-without-producer").stdout.splitlines()
    assert lines[0].startswith(f"{file}:6:12: warning: node 1 RPDO1: ")
    assert lines[2:4] == ["    6 |     rpdo: {1: {cob_id: 0x201, enabled: true}}", "      |            ^"]


@pytest.mark.parametrize(("count", "excerpts"), [(5, 5), (6, 1)])
def test_each_error_has_its_line_and_only_the_first_of_many_its_excerpt(
    bench: Bench, tmp_path: Path, count: int, excerpts: int
) -> None:
    file = tmp_path / "net.yaml"
    file.write_text(
        "nodes:\n" + "".join(
            f"  n{node_id}: {{node_id: {node_id}, dcf: generic, tpdo: {{1: {{mapping: [5FF{node_id}:00]}}}}}}\n"
            for node_id in range(1, count + 1)
        ), "utf-8",
    )  # fmt: skip
    ran = bench.run(f"check {file}")
    errors = [line for line in ran.stdout.splitlines() if ": error: " in line]
    assert (ran.code, len(errors)) == (4, count), ran
    for node_id, line in enumerate(errors, 1):
        assert line.startswith(f"{file}:{node_id + 1}:")
        assert f"node {node_id}" in line
        assert f"5FF{node_id}" in line
    (rule,) = {line.rpartition("[")[2].removesuffix("]") for line in errors}
    assert sum(line.endswith("^^^^^^^") for line in ran.stdout.splitlines()) == excerpts
    alone = bench.run(f"check {file} --rule {rule}").stdout.splitlines()
    assert sum(line.endswith("^^^^^^^") for line in alone) == count


def test_the_worst_findings_come_first(bench: Bench, tmp_path: Path) -> None:
    file = tmp_path / "net.yaml"
    file.write_text(
        "driver: x\n" + silent_nodes(3).replace("{cob_id: 0x202", "{mapping: [9999:00], cob_id: 0x202"), "utf-8"
    )
    lines = bench.run(f"check {file}").stdout.splitlines()
    kinds = [kind for line in lines for kind in ("error", "warning", "note") if f": {kind}: " in line]
    assert set(kinds) == {"error", "warning", "note"}
    assert kinds == sorted(kinds, key=["error", "warning", "note"].index)


def test_no_file_and_no_text_are_said(bench: Bench, tmp_path: Path) -> None:
    assert bench.run(f"check {tmp_path / 'none.yaml'}").code == 2
    (tmp_path / "x.yaml").write_bytes(b"\xff")
    ran = bench.run(f"check {tmp_path / 'x.yaml'}")
    ran.failed(4, "not UTF-8")


def test_what_a_file_holds_is_said_with_its_notes(bench: Bench, tmp_path: Path) -> None:
    file = tmp_path / "bus.yml"
    heartbeats = "heartbeat_producer: 1000, driver: x"
    file.write_text(f"a: {{node_id: 1, {heartbeats}}}\nb: {{node_id: 2, {heartbeats}}}\n", "utf-8")
    ran = bench.run(f"check {file}")
    assert ran.code == 0
    assert ran.stdout.splitlines() == [
        f"{file}:1:43: note: driver is ignored: a key of another tool (2 times)",
        f"{file}:1:1: note: nodes 1 and 2: no EDS, so rules that need an EDS were skipped; `dcf:` next to node_id "
        f"names an EDS",
        f"{file}: note: unknown bit rate: load and deadlines were not checked; add master: {{baudrate: …}} (kbit/s) "
        "[unknown-bit-rate]",
        f"{file}: 2 nodes, 0 PDOs; 4 notes",
    ]
