"""A line of a script that fails without an error of its own is named, and nothing is said to stay that may not."""

from __future__ import annotations

import json
import re
from pathlib import Path
from xml.etree import ElementTree as ET

import pytest

from dvtcli.cli.scripts.script_parse import MOST_FAULTS
from dvtcli.simulator.network.family_file import family_eds
from tests.cli.commands.bench import Bench
from tests.process import dvtcli

EDS = str(family_eds("generic"))


def rows(stderr: str) -> dict[str, str]:
    words = (line.strip().partition(" ") for line in stderr.splitlines() if line.startswith("  "))
    return {name: text.strip() for name, _, text in words}


def test_a_verify_that_differs_says_its_line() -> None:
    with Bench(("generic",)) as bench:
        ran = bench.script("set tpdo1 --timer 20", f"verify tpdo1 {EDS}", "pdo")
        assert ran.code == 3
        assert f"test.dvt:2: error: TPDO1 differs from {EDS}" in ran.stderr
        assert (
            rows(ran.stderr)["state"]
            == "read back, nothing was written; the changes of test.dvt:1 stay, read back equal"
        )
        assert "COB-ID" not in ran.stdout, "it ends there"


def test_one_over_several_nodes_says_of_which() -> None:
    with Bench(("generic@1", "generic@3")) as bench:
        lines = ["set 1:tpdo1 --timer 20", "set 3:tpdo1 --timer 20"]
        assert bench.script(*lines).code == 0
        bench.session.node(3).sdo.download(0x1800, 5, b"\0\0")
        ran = bench.script("verify")
        assert ran.code == 3
        assert "test.dvt:1: error: TPDO1 of node 3 differs from this session's changes" in ran.stderr


def test_a_frame_that_does_not_come_says_its_line() -> None:
    with Bench(("generic",), {"yes": True}) as bench:
        ran = bench.script("set tpdo1 --sync 240", "disable tpdo1", "verify tpdo1 --frame")
        assert ran.code == 1
        assert "test.dvt:3: error: no frame was received" in ran.stderr


def test_at_a_prompt_and_in_documents_nothing_is_said_twice() -> None:
    with Bench(("generic",)) as bench:
        assert bench.run("set tpdo1 --timer 20").code == 0
        ran = bench.run(f"verify tpdo1 {EDS}")
        assert (ran.code, ran.stderr) == (3, "")
        ran = bench.script(f"verify tpdo1 {EDS} --json")
        assert (ran.code, ran.stderr) == (3, "")
        assert [(one["schema"], one.get("at")) for one in ran.documents] == [
            ("dvtcli.verify/1", None),
            ("dvtcli.error/1", "test.dvt:1"),
        ]


@pytest.mark.parametrize("lines", [["set tpdo1 --timer 20"], ["set tpdo1 --timer 20", "store"]])
def test_after_a_restore_that_did_not_all_it_should_no_change_is_said_to_stay(lines: list[str]) -> None:
    """The node came up with what was read: some of that is the default, some is not."""
    with Bench(("generic",), {"yes": True, "fault": ("restores-nothing",)}) as bench:
        assert bench.script("set tpdo2 --timer 30", "store").code == 0
        ran = bench.script(*lines, "restore --prove")
        assert ran.code == 1
        assert "node 1 acknowledged the restore and does not hold its defaults" in ran.stderr
        assert "test.dvt:1" not in rows(ran.stderr)["state"]


@pytest.mark.parametrize("form", ["", "--json"])
def test_what_earlier_lines_set_is_read_behind_the_failure(form: str) -> None:
    """A later line altered it with what it wrote; what cannot be read again is not said to be so."""
    lines = ("set tpdo1 --timer 20", "write 1017 55", "map tpdo1 6041 5FFF")
    for fault, differs in (("", []), ("alters@2=1800:5:0x55", ["TPDO1 of node 1 event timer is 85, expected 20"])):
        with Bench(("generic",), {"format": "json" if form else "text", "fault": (fault,) if fault else ()}) as bench:
            ran = bench.script(*lines)
        assert ran.code == 1
        if form:
            assert (ran.documents[-1]["stays"], ran.documents[-1]["stays_differing"]) == (
                ["test.dvt:1", "test.dvt:2"],
                differs,
            )
        else:
            said = f", and differ from the set values: {differs[0]}" if differs else ", read back equal"
            assert f"the changes of test.dvt:1, test.dvt:2 stay{said}" in ran.stderr
    with Bench(("generic",)) as bench:
        ran = bench.script("set tpdo1 --timer 20", "write 6040 6", "map tpdo1 6041 5FFF")
    assert "the changes of test.dvt:1, test.dvt:2 stay; " in ran.stderr, "a controlword may change"


BAD = (
    "mapp tpdo1 6041\n"
    "set tpdo1 --timer 99999999\n"
    "set tpdo1 –-timer 5\n"  # the dash of a word processor
    "map tpdo1 606C\n"
    'map tpdo1 "6041\n'
    "run nested.dvt\n"
    "pdo\n"
)
PLACES = ["bad.dvt:1", "bad.dvt:2", "bad.dvt:3", "bad.dvt:5", "nested.dvt:2", "nested.dvt:3"]


@pytest.fixture
def bad(tmp_path: Path) -> Path:
    (tmp_path / "bad.dvt").write_text(BAD, "utf-8")
    (tmp_path / "nested.dvt").write_text("pdo\nmapp\npdoo\n")
    return tmp_path


def test_every_line_that_cannot_be_read_is_named_at_once_with_its_hint(bad: Path) -> None:
    done = dvtcli("--sim", "gen4", "run", "bad.dvt", cwd=bad)
    assert (done.returncode, done.stdout) == (2, "")
    errors = [line for line in done.stderr.splitlines() if line.startswith("error: ")]
    assert [line.split(": ")[1] for line in errors] == PLACES
    assert done.stderr.endswith("6 lines with errors; no line ran.\n")
    assert "did you mean `set tpdo1 --timer 5`?" in done.stderr


def test_a_document_has_the_first_error_and_the_others_beside_it(bad: Path) -> None:
    done = dvtcli("--sim", "gen4", "--json", "run", "bad.dvt", cwd=bad)
    document = json.loads(done.stdout)
    assert document["file"] == PLACES[0]
    assert [text.split(": ")[0] for text in document["also"]] == PLACES[1:]


def test_reports_for_ci_have_every_line_of_a_script_that_cannot_be_read(bad: Path) -> None:
    github = dvtcli("--sim", "gen4", "run", "bad.dvt", "--format", "github", cwd=bad).stdout
    marked = re.findall(r"^::error file=(.+),line=(\d+),title=\w+::", github, re.MULTILINE)
    assert [":".join(place) for place in marked] == PLACES
    assert github.endswith("9 lines, 6 failed, 3 not reached\n")
    junit = ET.fromstring(dvtcli("--sim", "gen4", "run", "bad.dvt", "--format", "junit", cwd=bad).stdout)  # noqa: S314
    failed = [case for case in junit.iter("testcase") if case.find("failure") is not None]
    assert [f"{case.get('file')}:{case.get('line')}" for case in failed] == PLACES
    assert len(list(junit.iter("skipped"))) == 3


def test_a_gateway_script_names_every_wrong_line(tmp_path: Path) -> None:
    (tmp_path / "a.309").write_text("1 w 0x1017 0 u16 100\n1 w\n[2] 1 q 0x1017 0 u16\n")
    done = dvtcli("--sim", "gen4@1", "run", "a.309", cwd=tmp_path)
    assert done.returncode == 2
    assert [place in done.stderr for place in ("a.309:1:", "a.309:2:", "a.309:3:")] == [False, True, True]


def test_so_many_errors_that_the_rest_is_not_read() -> None:
    with Bench(("generic",)) as bench:
        ran = bench.script(*["nonsense"] * (MOST_FAULTS + 5))
        assert (ran.code, ran.stderr.count("error: ")) == (2, MOST_FAULTS)


def test_a_script_of_a_line_with_an_error_is_not_missed_too() -> None:
    """`save` with an error would have written it."""
    with Bench(("generic",)) as bench:
        ran = bench.script("save now.dvt --nonsense", "run now.dvt")
        assert (ran.code, ran.stderr.count("error: ")) == (2, 1)
