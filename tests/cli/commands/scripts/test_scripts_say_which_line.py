"""A line of a script that fails without an error of its own is named, and nothing is said to stay that may not."""

from __future__ import annotations

import pytest

from dvtcli.simulator.network.family_file import family_eds
from tests.cli.commands.bench import Bench

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
