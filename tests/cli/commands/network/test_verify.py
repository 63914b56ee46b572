"""`verify` is 0 only where something was compared and was equal; it looks at every node that is concerned."""

from __future__ import annotations

from pathlib import Path

import pytest

from dvtcli.simulator.network.family_file import family_eds
from tests.cli.commands.bench import Bench
from tests.harness.sample import heavy
from tests.small_eds import plain

TWO = ("generic@1", "generic@3")


@pytest.mark.parametrize("line", ["verify", "verify --frame --yes", "verify --json"])
def test_nothing_to_compare_is_a_usage_error(line: str) -> None:
    with Bench() as bench:
        ran = bench.run(line)
        assert ran.code == 2
        assert '"equal"' not in ran.stdout
        assert "nothing to compare" in ran.stderr + ran.stdout


def test_an_unwritten_undone_change_leaves_nothing_of_a_file_without_pdos(tmp_path: Path) -> None:
    (tmp_path / "none.eds").write_text(
        "[DeviceInfo]\nVendorName=x\n[MandatoryObjects]\nSupportedObjects=1\n1=0x1000\n"
        "[1000]\nParameterName=Device type\nObjectType=0x7\nDataType=0x0007\nAccessType=ro\nPDOMapping=0\n"
    )
    (tmp_path / "none.dvt").write_text("# dvtcli script 1\npdo\nnmt preop\nstore\n")
    with Bench() as bench:
        for name in ("none.eds", "none.dvt"):
            ran = bench.run(f"verify {tmp_path / name}")
            assert ran.code == 2, ran.stdout
            assert "nothing to compare" in ran.stderr


def test_no_frame_is_not_equal_to_a_frame() -> None:
    with Bench(("generic",)) as bench:
        assert bench.run("map tpdo1 6041 --type 253 --rtr").code == 0
        ran = bench.run("verify tpdo1 --frame --yes --json")
        (frame,) = ran.document["frames"]
        assert frame["data"] is None, "it is sent on a remote frame only"
        assert ran.document["equal"] is True
        assert ran.code == 1


@pytest.mark.parametrize("line", ["map rpdo1 6040", "map tpdo1 6041 --off"])
def test_a_frame_was_asked_for_and_no_pdo_could_send_one(line: str) -> None:
    with Bench(("generic",)) as bench:
        assert bench.run(line).code == 0
        ran = bench.run("verify --frame --yes")
        assert ran.code == 1
        assert "no enabled TPDO" in ran.stdout


def test_every_node_of_the_session_is_looked_at() -> None:
    with Bench(TWO) as bench:
        assert bench.run("map 3:tpdo1 6041").code == 0
        one = bench.run("verify --json")
        assert one.code == 0
        assert (one.document["node"], one.document["pdos"], one.document["equal"]) == (3, 1, True)
        assert bench.run("set 1:tpdo2 --timer 30").code == 0
        assert bench.run("nmt reset-node 3").code == 0
        assert bench.run("map 3:tpdo2 6041 --cob-id 0x6A0").code == 0
        both = bench.run("verify --json")
        assert both.code == 0, "the session's last word for 3:tpdo1 is what it was already"
        assert bench.run("map 3:tpdo1 6041 606C").code == 0
        assert bench.run("nmt reset-node 3").code == 0
        both = bench.run("verify --json")
        assert both.code == 3
        document = both.document
        assert document["schema"] == "dvtcli.verify/1"
        assert (document["node"], document["pdos"], document["equal"]) == (None, 3, False)
        assert {(row["node"], row["pdo"]) for row in document["differences"]} == {(3, "tpdo1"), (3, "tpdo2")}
        assert [(one["node"], one["equal"]) for one in document["nodes"]] == [(1, True), (3, False)]
        text = bench.run("verify")
        assert "TPDO1 of node 3" in text.stdout
        assert bench.run("verify tpdo2").code == 0
        assert bench.run("verify 3:tpdo2").code == 3


def test_a_pdo_that_was_not_set_is_a_usage_error_that_names_the_node() -> None:
    with Bench(TWO) as bench:
        assert bench.run("map 3:tpdo1 6041 606C").code == 0
        ran = bench.run("verify tpdo1")
        assert ran.code == 2
        assert "TPDO1 of node 1" in ran.stderr


def test_single_objects_are_compared_too() -> None:
    with Bench(("generic",)) as bench:
        assert bench.run("write 1017 100").code == 0
        assert bench.run("verify --json").document.items() >= {"pdos": 0, "objects": 1, "equal": True}.items()
        assert bench.run("nmt reset-node").code == 0
        ran = bench.run("verify --json")
        assert ran.code == 3
        assert [row["object"] for row in ran.document["differences"]] == ["1017:00"]


@heavy
def test_a_script_is_compared_by_what_it_would_leave(tmp_path: Path) -> None:
    script = tmp_path / "press.dvt"
    script.write_text(
        "# dvtcli script 1\nnode 3\nmap tpdo1 6041 --cob-id 0x6A0\nstore\nmap tpdo1 6041 606C --cob-id 0x6A1 --sync 2\n"
        "map tpdo2 6041 --cob-id 0x6A0\nwrite 1017 250\ndisable tpdo3\n"
    )
    with Bench(TWO) as bench:
        before = bench.session.node(3).pdos()
        fresh = bench.run(f"verify {script} --json")
        assert fresh.code == 3
        assert fresh.document["node"] == 3
        assert bench.session.node(3).pdos() == before, "comparing writes nothing"
        assert bench.session.record.lines == []
        assert bench.session.node_id() == 1, "the script's own `node` selects for the script only"
        assert bench.run(f"run {script}").code == 0
        done = bench.run(f"verify {script} --json")
        assert done.code == 0, done.stdout
        assert done.document.items() >= {"equal": True, "pdos": 3, "objects": 1}.items()
        assert bench.run("set 3:tpdo2 --timer 77").code == 0
        assert bench.run(f"verify {script}").code == 0, "the script says nothing of an event timer"
        assert bench.run("set 3:tpdo1 --sync 3").code == 0
        ran = bench.run(f"verify {script}")
        assert ran.code == 3
        assert "transmission type is 3, expected 2" in ran.stdout
        assert bench.run(f"verify 3:tpdo2 {script}").code == 0


def test_a_script_that_cannot_run_is_said_with_its_line(tmp_path: Path) -> None:
    script = tmp_path / "wrong.dvt"
    with Bench() as bench:
        for text, code in (("map tpdo1 bogus_name\n", 2), ("map tpdo1 1018:1\n", 1), ("nmt preop\n\nmapp tpdo1\n", 2)):
            script.write_text(text)
            ran = bench.run(f"verify {script}")
            ran.failed(code, f"{script}:{text.count(chr(10))}")
        script.write_text("require identity vendor=0x77\nmap tpdo1 6041\n")
        assert bench.run(f"verify {script}").code == 6
        (tmp_path / "x.tcl").write_text("map")
        assert bench.run(f"verify {tmp_path / 'x.tcl'}").code == 2


def test_a_script_under_any_name_is_known_by_its_first_line(tmp_path: Path) -> None:
    script = tmp_path / "press.txt"
    script.write_text("# dvtcli script 1\nset tpdo2 --timer 44\n")
    with Bench(("generic",)) as bench:
        assert bench.run(f"verify {script}").code == 3
        assert bench.run(f"run {script}").code == 0
        assert bench.run(f"verify {script}").code == 0
        assert bench.run(f"verify tpdo1 {script}").code == 2, "it says nothing of TPDO1"


def test_a_script_is_compared_with_the_twin_in_a_dry_run(tmp_path: Path) -> None:
    script = tmp_path / "press.dvt"
    script.write_text("set tpdo2 --timer 44\n")
    with Bench(("generic",), {"dry_run": True}) as bench:
        assert bench.run(f"verify {script}").code == 3
        assert bench.run(f"run {script}").code == 0
        assert bench.run(f"verify {script}").code == 0


def test_a_file_is_compared_as_before() -> None:
    with Bench() as bench:
        ran = bench.run(f"verify {family_eds('gen4')} --json")
        assert ran.code == 0
        assert ran.document["pdos"] > 5
        assert bench.run("map tpdo1 606C").code == 0
        assert bench.run(f"verify tpdo2 {family_eds('gen4')}").code == 0
        assert bench.run(f"verify {family_eds('gen4')}").code == 3


@heavy
@pytest.mark.parametrize(
    "lines",
    [
        ("set tpdo1 --timer 111", "set tpdo1 --timer 222", "undo"),
        ("set tpdo1 --timer 111", "set tpdo1 --timer 222", "set tpdo2 --timer 5", "undo", "undo"),
        ("set tpdo1 --timer 111", "exit", "set tpdo1 --timer 333"),
        ("set tpdo1 --timer 111", "set tpdo1 --timer 222 --dry-run"),
        ("set tpdo1 --timer 111", "run INNER", "set tpdo3 --timer 7"),
        ("set tpdo1 --timer 111", "source INNER", "set tpdo3 --timer 7"),
        ("set tpdo1 --timer 111", "run INNER --dry-run"),
    ],
)
def test_a_script_is_compared_by_what_stays_at_its_end(tmp_path: Path, lines: tuple[str, ...]) -> None:
    script, inner = tmp_path / "press.dvt", tmp_path / "inner.dvt"
    inner.write_text("set tpdo2 --timer 9\nexit\nset tpdo2 --timer 10\n")
    script.write_text("\n".join(lines).replace("INNER", str(inner)))
    with Bench(("generic",)) as bench:
        assert bench.run(f"verify {script}").code == 3
        assert bench.run(f"run {script}").code == 0
        ran = bench.run(f"verify {script} --json")
        assert (ran.code, ran.document["equal"]) == (0, True), ran.stdout
        assert bench.run("set tpdo1 --timer 222").code == 0
        assert bench.run(f"verify tpdo1 {script}").code == 3, "it does not end with what it took back or never set"


@pytest.mark.parametrize(
    "line", ["restore", "recover", "nmt reset-node", "nmt reset-comm", "write 1011:1 0x64616F6C", "run INNER"]
)
def test_a_script_that_brings_back_what_the_device_keeps_cannot_be_compared(tmp_path: Path, line: str) -> None:
    script, inner = tmp_path / "press.dvt", tmp_path / "inner.dvt"
    inner.write_text("nmt reset-node all\n")
    script.write_text(f"set tpdo1 --timer 5\n{line}\n".replace("INNER", str(inner)))
    with Bench(("generic",)) as bench:
        assert bench.run("set tpdo1 --timer 5").code == 0
        ran = bench.run(f"verify {script}")
        assert ran.code == 2, ran.stdout
        assert f"{script}:2" in ran.stderr
        assert "is not known before it runs" in ran.stderr


def test_an_undo_of_what_was_before_the_script_cannot_be_compared(tmp_path: Path) -> None:
    script = tmp_path / "press.dvt"
    script.write_text("undo\nset tpdo1 --timer 5\n")
    with Bench(("generic",)) as bench:
        assert bench.run("set tpdo1 --timer 5").code == 0
        ran = bench.run(f"verify {script}")
        assert ran.code == 2, ran.stdout
        assert f"{script}:1" in ran.stderr


def test_undo_all_in_a_script_that_is_compared_is_about_the_script(tmp_path: Path) -> None:
    script = tmp_path / "press.dvt"
    script.write_text("set tpdo2 --timer 5\nundo --all\nset tpdo1 --timer 6\n")
    with Bench(("generic",), {"dry_run": True}) as bench:
        assert bench.run("set tpdo2 --timer 4").code == 0
        ran = bench.run(f"verify tpdo2 {script} --json")
        assert (ran.code, ran.document["equal"]) == (0, True), ran.stdout
        assert bench.run(f"verify tpdo1 {script}").code == 3


@pytest.mark.parametrize(
    ("lines", "compared", "unsaid"),
    [
        (("set tpdo2 --timer 0",), 1, 6),
        (("enable tpdo2",), 1, 6),
        (("set tpdo2 --timer 0", "set tpdo2 --timer 0 --inhibit 0"), 2, 5),
        (("map tpdo2 6041 6064",), 3, 4),  # its entries, and that it is enabled
        (("map tpdo2 6041 6064 --cob-id 0x281 --event --timer 0 --inhibit 0",), 6, 1),
        (("clear tpdo2",), 1, 4),
        (("set tpdo2 --timer 0", "set tpdo1 --timer 0"), 2, 11),
    ],
)
def test_what_a_script_does_not_say_is_not_called_equal_to_it(
    tmp_path: Path, lines: tuple[str, ...], compared: int, unsaid: int
) -> None:
    script = tmp_path / "press.dvt"
    script.write_text("\n".join(lines))
    with Bench(("generic",)) as bench:
        assert bench.run(f"run {script}").code == 0
        document = bench.run(f"verify {script} --json").document
        assert (document["equal"], document["parameters"], document["unsaid"]) == (True, compared, unsaid)
        text = bench.run(f"verify {script}").stdout
        assert f"has no value for {unsaid} more parameter" in text
        whole = bench.run("verify --json").document
        assert (whole["parameters"], whole["unsaid"]) == (compared + unsaid, 0), "the session read all of them back"


def test_half_a_pdo_in_a_file_is_compared_by_half(tmp_path: Path) -> None:
    eds = plain()
    del eds.objects[0x1801]
    path = tmp_path / "half.eds"
    path.write_text(eds.text())
    with Bench((str(path),)) as bench:
        document = bench.run(f"verify tpdo2 {path} --json").document
        assert (document["equal"], document["parameters"], document["unsaid"]) == (True, 0, 5), document
