"""`apply`, `plan`, `diff`, `verify` of a file about one device, and `clone`: what differs, nothing that may not be."""

from __future__ import annotations

import re
from collections.abc import Callable
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from dvtcli.domain.configuration import configuration_of
from dvtcli.domain.datatypes import Kind
from dvtcli.domain.object_dictionary import OdEntry
from dvtcli.domain.pdo import Pdo
from dvtcli.files.profiles import builtin_path
from tests.cli.commands.bench import Bench, Ran
from tests.operations.devices.test_export_dcf import FAMILIES, odd
from tests.small_eds import U16, U32, communication, plain, var

pytestmark = pytest.mark.drawn(6, "apply file")

CHANGES = ("set tpdo1 --timer 70", "write 1017 700")


def made(folder: Path, family: str, form: str, *lines: str) -> Path:
    """A file of this *form* of a node that *lines* changed."""
    file = folder / f"node.{form}"
    with Bench((f"{family}@5",)) as bench:
        for line in lines:
            assert bench.run(line).code in (0, 1), line
        assert bench.run(f"{'export' if form == 'dcf' else 'backup'} {file}").code == 0
    return file


@pytest.mark.parametrize("form", ["dcf", "jsonl"])
@pytest.mark.parametrize("family", FAMILIES)
def test_a_fresh_node_becomes_what_the_file_says(family: str, form: str, tmp_path: Path) -> None:
    file = made(tmp_path, family, form, *CHANGES)
    with Bench((f"{family}@5",)) as bench:
        differs = bench.run(f"diff {file} --json").document["changed"]
        assert bench.run(f"verify {file}").code == (3 if differs else 0)
        applied = bench.run(f"apply {file} --yes --json")
        assert (applied.code, applied.document["changed"]) == (0, differs), applied.stderr
        again = bench.run(f"apply {file} --yes --json")
        assert (again.code, again.document["writes"]) == (0, 0)
        assert bench.run(f"diff {file}").code == 0
        assert bench.run(f"verify {file}").code == 0
        assert bench.run(f"compare {file}").code == 0


def test_another_product_is_refused_and_another_revision_asked_about(tmp_path: Path) -> None:
    file = made(tmp_path, "generic", "dcf", *CHANGES)
    text = file.read_text("utf-8")
    for line in ("apply", "plan", "verify", "clone"):
        with Bench(("gen4@5",)) as bench:
            ran = bench.run(f"{line} {file}{' --yes' if line in ('apply', 'clone') else ''}")
            assert (ran.code, "has product 0x0705302D, not 0x00000301" in ran.stderr) == (6, True), line
    file.write_text(re.sub(r"(?m)^RevisionNumber=.*", "RevisionNumber=0x77", text), "utf-8")
    with Bench(("generic@5",)) as bench:
        asked = bench.run(f"apply {file}")
        assert asked.code == 6
        assert "and " + str(file) + " is of 0x00000077; apply" in asked.stderr
        assert bench.run("read 1017 --json").document["value"] == 500
        assert bench.run(f"plan {file} -o {tmp_path / 'plan.json'}").code == 0
        assert "is of 0x00000077" in bench.run(f"apply {tmp_path / 'plan.json'}").stderr
        assert bench.run(f"apply {file} --yes").code == 0
        assert bench.run("read 1017 --json").document["value"] == 700
    file.write_text(re.sub(r"(?m)^ProductNumber=.*", "ProductNumber=0", text), "utf-8")
    with Bench(("generic@5",)) as bench:
        ran = bench.run(f"clone {file} --yes")
        ran.failed(6, "does not name its product")
        assert "does not name its product" in bench.run(f"apply {file}").stderr


def test_a_file_without_a_value_says_nothing_of_a_device(tmp_path: Path) -> None:
    file = made(tmp_path, "generic", "dcf", *CHANGES)
    text = file.read_text("utf-8")
    file.write_text(re.sub(r"(?m)^ParameterValue=.*\n", "", text), "utf-8")
    with Bench(("generic@5",)) as bench:
        for line in (f"diff {file}", f"plan {file}", f"apply {file} --yes", f"clone {file} --yes"):
            ran = bench.run(line)
            ran.failed(2, "has no values for a device")
        (tmp_path / "node.eds").write_text(text, "utf-8")
        said = " ".join(bench.run(f"diff {tmp_path / 'node.eds'}").stderr.split())
        assert "loads the device's own defaults" in said
    (tmp_path / "node.jsonl").write_text(made(tmp_path, "generic", "jsonl").read_text("utf-8").splitlines()[0] + "\n")
    with Bench(("generic@5",)) as bench:
        assert bench.run(f"diff {tmp_path / 'node.jsonl'}").code in (2, 4)


def test_a_drive_whose_power_stage_is_on_is_not_configured(tmp_path: Path) -> None:
    file = made(tmp_path, "generic", "dcf", *CHANGES)
    with Bench(("generic@5",)) as bench:
        assert bench.run(f"plan {file} -o {tmp_path / 'plan.json'}").code == 0
        for controlword in (6, 7, 15):
            assert bench.run(f"write 6040 {controlword}").code == 0
        node = bench.session.node()
        for line in (f"plan {file}", f"diff {file}"):
            ran = bench.run(line)
            assert "node 5: the power stage is on: operation enabled (0x6041 is 0x" in ran.stderr
            assert "apply refuses to write" in ran.stderr
            (document,) = bench.run(f"{line} --json").document["nodes"]
            said = [(one["rule"], one["severity"], one["place"]) for one in document["findings"]]
            assert said == [("power-stage-on", "warning", "0x6041:00")]
        for one in (file, tmp_path / "plan.json"):
            ran = bench.run(f"apply {one} --yes")
            ran.failed(6, "the power stage of node 5 is on: operation enabled")
        assert node.sdo.upload(0x1017, 0) == (500).to_bytes(2, "little")
        assert bench.run("write 6040 6").code == 0
        assert "power stage" not in bench.run(f"plan {file}").stderr
        assert bench.run(f"apply {file} --yes").code == 0
        for controlword in (6, 7, 15):
            assert bench.run(f"write 6040 {controlword}").code == 0
        assert "power stage" not in bench.run(f"plan {file}").stderr, "nothing is to be written"


def test_a_simulated_drive_that_is_on_by_its_file_is_not_configured_either(tmp_path: Path) -> None:
    file = made(tmp_path, "generic", "dcf", *CHANGES)
    eds = tmp_path / "on.eds"
    text = builtin_path("generic").with_name("generic.eds").read_text("utf-8")
    eds.write_text(text.replace("DefaultValue=0x0250", "DefaultValue=0x1237"), "utf-8")
    with Bench((f"{eds}@5",)) as bench:
        for line in ("apply", "clone"):
            ran = bench.run(f"{line} {file} --yes")
            ran.failed(6, "the power stage of node 5 is on: operation enabled")
        assert bench.run("read 1017 --json").document["value"] == 500


@pytest.mark.parametrize("form", ["dcf", "jsonl"])
@pytest.mark.parametrize(
    ("family", "outputs"),
    [
        ("generic", ("6200:01", "6411:01", "6411:02")), ("gen4", ("6200:01", "6C11:01")), ("espac", ("6200:01",)),
        ("loader", ("6200:01",)), ("canopennode", ("6200:01", "6411:01")),
    ],
)  # fmt: skip
def test_outputs_are_written_by_no_file_whatever_profile_the_device_has(
    family: str, outputs: tuple[str, ...], form: str, tmp_path: Path
) -> None:
    file = made(tmp_path, family, form, *(f"write {one} 1" for one in outputs), "write 1017 710")
    text = file.read_text("utf-8")
    for one in outputs if form == "dcf" else ():
        section = f"[{one[:4]}sub{int(one[5:], 16):X}]\n"
        assert section in text
        text = text.replace(section, f"{section}ParameterValue=1\n")
    file.write_text(text, "utf-8")
    names = " ".join(f"--include {one} --include {one[:4]}" for one in outputs)
    with Bench((f"{family}@5",)) as bench:

        def held() -> list[int]:
            return [bench.run(f"read {one} --json").document["value"] for one in outputs]

        before = held()
        assert "--include 6" not in bench.run(f"diff {file}").stdout, "nobody is told to name an output"
        ran = bench.run(f"apply {file} {names} --force --yes")
        assert (ran.code, "it is an output" in ran.stderr or "process data" in ran.stderr) == (0, True), ran
        cloned = bench.run(f"clone {file} {names} --include 6000-9FFF --yes")
        assert cloned.code == 0 or "does not name its product" in cloned.stderr
        assert bench.run("read 1017 --json").document["value"] == 710
        assert held() == before


def test_what_is_no_configuration_is_left_and_told(tmp_path: Path) -> None:
    eds = odd(tmp_path)
    file = tmp_path / "node.jsonl"
    with Bench((str(eds),)) as bench:
        for line in ("write 2000 111", "write 2004 Crane", "write 6040 1", "write 2006 5", "write 1017 900"):
            assert bench.run(line).code == 0, line
        assert bench.run(f"backup {file}").code == 0
    with Bench((str(eds),)) as bench:
        node = bench.session.node()
        done = bench.run(f"apply {file} --yes --json").document
        out = {one["object"]: one["why"] for one in done["nodes"][0]["left_out"]}
        assert out["6040:00"] == "is a command or a target"
        assert out["2000:00"] == "is manufacturer-specific, and no profile defines it as configuration"
        assert [one["object"] for one in done["nodes"][0]["objects"]] == ["1017:00"]
        assert node.sdo.upload(0x6040, 0) == bytes(2)
        shown = bench.run(f"plan {file} --include 2000").stdout
        assert "0x2000:00" in shown
        assert "0x2004:00" not in shown
        assert "differs, not written: 2004:00 (is 'Lift', expected 'Crane') is manufacturer-specific" in shown
        last = f"2 settings of node 1 differ from {file} and are not written: --include 2000 --include 2004 writes such"
        for line, code in ((f"diff {file}", 3), (f"plan {file} --exit-code", 3), (f"apply {file} --yes", 0)):
            ran = bench.run(line)
            assert (ran.code, last in ran.stdout, "No difference" in ran.stdout) == (code, True, False), line
        assert "Every node has the part of the file that is written already" in bench.run(f"apply {file} --yes").stdout
        verified = bench.run(f"verify {file}")
        assert (verified.code, "2000:00  is 100, expected 111" in verified.stdout) == (3, True)
        assert bench.run(f"plan {file} -o {tmp_path / 'plan.json'}").code == 0
        assert last in bench.run(f"apply {tmp_path / 'plan.json'} --yes").stdout
        document = bench.run(f"diff {file} --json").document
        assert (document["changed"], document["remaining"]) == (False, 2)
        maker = next(one for one in document["nodes"][0]["left_out"] if one["object"] == "2000:00")
        assert (maker["remains"], maker["before"], maker["after"]) == (True, "64 00", "6F 00")
        cloned = bench.run(f"apply {file} --include 2000 --include 2000-2005 --yes --json").document
        assert [one["object"] for one in cloned["nodes"][0]["objects"]] == ["2000:00", "2004:00"]
        assert node.sdo.upload(0x2006, 0) == bytes(2), "a set point, which an RPDO can take"
        clean = bench.run(f"diff {file}")
        assert (clean.code, "has the part of the file that is written" in clean.stdout) == (0, True)
        assert re.search(rf"not written, and may differ: dvtcli .*compare {re.escape(str(file))} --all", clean.stdout)
        assert (
            "2006:00 (is 0, expected 5) is manufacturer-specific, and by its name a command, a target" in clean.stdout
        )
        shown = bench.run(f"compare {file} --all")
        assert (
            shown.code,
            "2006:00 is manufacturer-specific, and by its name a command, a target" in shown.stdout,
        ) == (0, True)
        assert bench.run(f"apply {file} --include 2000-2FFF --yes --json").document["writes"] == 0
        assert bench.run(f"apply {file} --include 2006 --yes --json").document["writes"] == 1
        assert node.sdo.upload(0x2006, 0) == b"\5\0"


def test_clone_takes_the_makers_objects_that_no_pdo_can_map(tmp_path: Path) -> None:
    file = tmp_path / "node.dcf"
    with Bench(("generic@5",)) as bench:
        known = {e.object: e for e in _settable(bench)}
        place, entry = next((p, e) for p, e in known.items() if p.startswith("2") and not e.pdo_mapping)
        value = 1 if bench.session.node().sdo.upload(entry.index, entry.sub_index)[:1] != b"\1" else 2
        assert bench.run(f"write {place} {value}").code == 0
        assert bench.run(f"export {file}").code == 0
    with Bench(("generic@7",)) as bench:
        asked = bench.run(f"clone {file}")
        asked.failed(6, f"clone {file}: 1 write to node 7?")
        assert f"0x{place}" in asked.stdout
        assert bench.run(f"apply {file} --yes --json").document["writes"] == 0
        assert bench.run(f"clone {file} --dry-run").code == 0
        assert bench.run(f"clone {file} --yes --json").document["writes"] == 1
        assert bench.run(f"clone {file} --yes --json").document["writes"] == 0
        assert bench.run(f"compare {file}").code == 0


def test_a_command_by_its_name_is_written_only_where_it_is_named_itself(tmp_path: Path) -> None:
    eds, file = plain(), tmp_path / "node.dcf"
    for index, name in ((0x2000, "Ramp"), (0x2001, "Factory reset"), (0x2002, "Homing")):
        eds.variable(index, var(name, U16, 0))
    (tmp_path / "plain.eds").write_text(eds.text(), encoding="utf-8")
    with Bench((f"{tmp_path / 'plain.eds'}@5",)) as bench:
        for index in (2000, 2001, 2002):
            assert bench.run(f"write {index} 7").code == 0
        assert bench.run(f"export {file}").code == 0
    with Bench((f"{tmp_path / 'plain.eds'}@5",)) as bench:
        cloned = bench.run(f"apply {file} --include 2000-2FFF --include 2002 --yes")
        assert cloned.code == 0, cloned.stderr
        sdo = bench.session.node().sdo
        assert [sdo.upload(index, 0)[0] for index in (0x2000, 0x2001, 0x2002)] == [7, 0, 7]
        assert "2001:00 (is 0, expected 7) is manufacturer-specific, and by its name a command" in cloned.stdout
        assert "1 setting of node 5 differs" in cloned.stdout.splitlines()[-1]
        assert (bench.run(f"diff {file}").code, bench.run(f"compare {file}").code) == (3, 3)


def of_a_record(folder: Path, form: str = "dcf") -> tuple[str, Path]:
    """A node with a record of the maker of which an RPDO could take each part, and a file that says other values."""
    eds, file = plain(), folder / f"node.{form}"
    eds.record(0x3001, "Motor", {n: var(f"Part {n}", U16, 0, "rww", 1) for n in (1, 2)})
    eds.variable(0x6040, var("Controlword", U16, 0, "rww", 1))
    eds.info |= {"VendorNumber": 0x301, "ProductNumber": 0x302}
    eds.record(0x1018, "Identity", {n: var(f"Part {n}", U32, 0x300 + n, "ro") for n in (1, 2)})
    (folder / "plain.eds").write_text(eds.text(), encoding="utf-8")
    what = f"{folder / 'plain.eds'}@5"
    with Bench((what,)) as bench:
        for line in ("write 3001:1 7", "write 3001:2 8", f"{'export' if form == 'dcf' else 'backup'} {file}"):
            assert bench.run(line).code == 0, line
    return what, file


def test_a_sub_index_behind_include_names_that_one_alone(tmp_path: Path) -> None:
    what, file = of_a_record(tmp_path)
    for line, code in (("clone {} --yes", 3), ("apply {} --yes", 0), ("plan {}", 0), ("diff {}", 3)):
        with Bench((what,)) as bench:
            ran = bench.run(f"{line.format(file)} --include 3001:1")
            assert ran.code == code, ran
            assert "0x3001:01" in ran.stdout
            assert "differs, not written: 3001:02 (is 0, expected 8)" in ran.stdout
            assert f"{file} and is not written: --include 3001:02 writes it" in ran.stdout, "what is left, and no more"
            written = "--yes" in line
            held = [bench.session.node().sdo.upload(0x3001, part)[0] for part in (1, 2)]
            assert held == ([7, 0] if written else [0, 0]), line
    with Bench((what,)) as bench:
        assert "are not written: --include 3001 writes such" in bench.run(f"diff {file}").stdout
        assert bench.run(f"clone {file} --include 3001:2 --include 3001:1 --yes").code == 0
        assert bench.run(f"compare {file}").code == 0


def test_an_include_that_names_nothing_of_the_file_is_told(tmp_path: Path) -> None:
    what, file = of_a_record(tmp_path, "jsonl")
    with Bench((what,)) as bench:
        for word in ("30FF", "3001:9", "3001:0A"):
            for line in ("clone", "apply", "plan", "diff"):
                ran = bench.run(f"{line} {file} --include 3001 --include {word}")
                ran.failed(2, f"--include {word}: matches no value of {file}")
        assert bench.session.node().sdo.upload(0x3001, 1) == bytes(2)
        for word, said in (
            ("6040", "it is not written nevertheless: it is a command or a target"),
            ("1018:1", "it is not written nevertheless: it is read-only"),
            ("1017", "it is written without it"),
            ("4000-4FFF", f"matches nothing in {file}"),
        ):
            ran = bench.run(f"plan {file} --include {word}")
            assert (ran.code, f"--include {word}" in ran.stderr, said in ran.stderr) == (0, True, True), ran
        assert "--include" not in bench.run(f"plan {file} --include 3001 --include 1000-9FFF").stderr


def test_a_clone_that_is_not_the_same_is_not_done(tmp_path: Path) -> None:
    eds, file, script = plain(), tmp_path / "node.dcf", tmp_path / "clone.dvt"
    for index, name in ((0x2000, "Ramp"), (0x2001, "Factory reset")):
        eds.variable(index, var(name, U16, 0))
    eds.info |= {"VendorNumber": 0x301, "ProductNumber": 0x302}
    eds.record(0x1018, "Identity", {n: var(f"Part {n}", U32, 0x300 + n, "ro") for n in (1, 2)})
    (tmp_path / "plain.eds").write_text(eds.text(), encoding="utf-8")
    with Bench((f"{tmp_path / 'plain.eds'}@5",)) as bench:
        assert [bench.run(f"write {index} 7").code for index in (2000, 2001)] == [0, 0]
        assert bench.run(f"export {file}").code == 0
    last = f"1 setting of node 5 differs from {file} and is not written: --include 2001 writes it"
    with Bench((f"{tmp_path / 'plain.eds'}@5",)) as bench:
        assert bench.run(f"clone {file} --dry-run").code == 3
        for writes in (1, 0):  # the second finds all of it written
            assert bench.run(f"clone {file} --dry-run --json").document["writes"] == writes
            cloned = bench.run(f"clone {file} --yes")
            assert (cloned.code, last in cloned.stdout.splitlines()[-1]) == (3, True)
            assert bench.run("read 2000 --json").document["value"] == 7
        script.write_text(f"clone {file} --yes\nwrite 2000 8\n", encoding="utf-8")
        ran = bench.run(f"run {script}")
        assert (ran.code, bench.run("read 2000 --json").document["value"]) == (3, 7)
        assert f"clone.dvt:1: error: 2001:00 of node 5 differs from {file}" in ran.stderr
        for line, place in (("diff", "2001:00 of node 5"), ("compare", "2001:00")):
            script.write_text(f"read 2000\n{line} {file}\nwrite 2000 8\n", encoding="utf-8")
            ran = bench.run(f"run {script}")
            assert ran.code == 3
            assert f"clone.dvt:2: error: {place} differs from {file}" in ran.stderr
        assert bench.run(f"apply {file} --yes").code == 0, "apply writes what it may"
        assert bench.run(f"clone {file} --include 2001 --yes").code == 0
        assert bench.run(f"compare {file}").code == 0


def test_what_keeps_a_setting_is_said_alike_and_is_so(tmp_path: Path) -> None:
    eds, file = tmp_path / "own.eds", tmp_path / "node.jsonl"
    eds.write_bytes(builtin_path("gen4").with_name("gen4.eds").read_bytes())
    with Bench((f"{eds}@5",)) as bench:
        assert bench.run(f"backup {file}").code == 0
        assert "The device stores it on its own" in bench.run("write 1017 701").stdout
        assert bench.run("nmt reset-node --yes").code == 0
        assert bench.run("read 1017 --json").document["value"] == 701
        applied = bench.run(f"apply {file} --yes")
        assert "Stored by node 5 on its own, `undo --all` reverts it." in applied.stdout, applied.stderr
        assert "In RAM only" in bench.run("set tpdo1 --timer 70").stdout
        assert bench.run("write 1017 702").code == 0
        applied = bench.run(f"apply {file} --yes")
        assert "In RAM only on node 5: `store` keeps it" in applied.stdout, "of TPDO1"
        assert "Stored by node 5 on its own: 1017:00." in applied.stdout


def test_an_empty_enabled_pdo_of_a_file_hinders_nothing_else(tmp_path: Path) -> None:
    eds, file = plain(), tmp_path / "node.dcf"
    eds.record(0x1801, "Communication 2", communication("$NODEID+0x280"))
    (tmp_path / "plain.eds").write_text(eds.text(), encoding="utf-8")
    with Bench((f"{tmp_path / 'plain.eds'}@5",)) as bench:
        assert bench.run("write 1017 700").code == 0
        assert bench.run(f"export {file}").code == 0
        assert bench.run(f"diff {file}").code == 0
    with Bench((f"{tmp_path / 'plain.eds'}@7",)) as bench:
        bench.session.node().sdo.download(0x1801, 1, (0x80000287).to_bytes(4, "little"))
        differs = bench.run(f"diff {file}")
        assert (differs.code, "0x1017:00" in differs.stdout) == (3, True), differs.stderr
        assert "differs, not written: TPDO2 is enabled without mapped objects in the file" in differs.stdout
        applied = bench.run(f"apply {file} --yes")
        assert (applied.code, "1 setting of node 7 differs" in applied.stdout.splitlines()[-1]) == (0, True)
        assert bench.session.node().sdo.upload(0x1017, 0) == (700).to_bytes(2, "little")
        assert bench.run(f"verify {file}").code == 3


def _settable(bench: Bench) -> list[OdEntry]:
    """Objects of numbers that are configuration, or the maker's, and no PDO's."""
    node = bench.session.node()
    dictionary = node.dictionary
    assert dictionary is not None
    known = configuration_of(dictionary, node.profile, [(0x2000, 0x5FFF)])
    return [
        entry for entry in dictionary.entries()
        if known.why_not(entry) is None and Pdo.at(entry.index) is None and entry.data_type is not None
        and entry.data_type.kind in (Kind.UNSIGNED, Kind.INTEGER)
    ]  # fmt: skip


EVERYTHING = "--include 1000-9FFF"


@settings(max_examples=max(2, settings().max_examples // 10))
@given(st.data())
def test_the_file_of_a_node_makes_a_fresh_one_equal(data: st.DataObject) -> None:
    family = data.draw(st.sampled_from(FAMILIES))
    with TemporaryDirectory() as folder:
        makes_equal(f"{family}@5", Path(folder), data.draw)


def makes_equal(what: str, folder: Path, draw: Callable[[st.SearchStrategy[Any]], Any]) -> int:
    """Change a simulated node at random, write its file to a fresh one, see that both are equal; how many changes."""
    file, taken = folder / f"node.{draw(st.sampled_from(['dcf', 'jsonl']))}", 0
    with Bench((what,)) as bench:
        for line in draw(st.lists(_lines(bench), max_size=6)):
            taken += bench.run(line).code == 0
        assert bench.run(f"backup {file}").code == 0
        held = bench.run(f"diff {file}")
        assert held.code == 0, held.stdout + held.stderr
    with Bench((what,)) as bench:
        applied, line = run_or_force(bench, f"apply {file} {EVERYTHING} --yes")
        assert applied.code == 0, applied.stdout + applied.stderr
        compared = bench.run(f"compare {file} --json").document
        assert compared["differences"] == []
        assert bench.run(f"{line} --json").document["writes"] == 0
    return taken


def run_or_force(bench: Bench, line: str) -> tuple[Ran, str]:
    """Run *line*, forced if the rules refuse what the device takes: return its result and the line that was run."""
    ran = bench.run(line)
    if ran.code == 1:
        assert re.search(r"\n  rule +[a-z-]+ at 0x", ran.stderr), ran.stderr
        assert "unchanged: nothing was written; --force " in ran.stderr
        line += " --force"
        ran = bench.run(line)
    return ran, line


def _lines(bench: Bench) -> st.SearchStrategy[str]:
    """Lines that change a PDO or a value; the device may refuse them."""
    node = bench.session.node()
    pdos = [str(pdo) for pdo in node.present()] or ["tpdo1"]
    mappable = [e.object for e in node.dictionary.entries() if e.pdo_mapping] if node.dictionary else []
    pdo = st.sampled_from(pdos)
    lines = [
        st.builds("disable {}".format, pdo),
        st.builds("set {} --timer {}".format, pdo, st.integers(0, 500)),
        st.builds("set {} --sync {} --inhibit {}".format, pdo, st.integers(1, 240), st.integers(0, 100)),
        st.builds("set {} --cob-id 0x{:X}".format, pdo, st.integers(0x181, 0x57F)),
    ]
    if mappable:
        chosen = st.lists(st.sampled_from(mappable), min_size=1, max_size=4)
        lines.append(st.builds(lambda one, entries: f"map {one} {' '.join(entries)}", pdo, chosen))
    if settable := _settable(bench):
        lines.append(st.builds("write {} {}".format, st.sampled_from([e.object for e in settable]), st.integers(0, 99)))
    return st.one_of(lines)


@pytest.mark.parametrize("fault", ["refuse@4=0x08000000", "reset@4", "lose-response@3"])
def test_a_fault_takes_everything_back(fault: str, tmp_path: Path) -> None:
    file = made(tmp_path, "generic", "dcf", "map tpdo1 606C 6041", "write 1017 700")
    with Bench(("generic@5",), {"fault": (fault,)}) as bench:
        node = bench.session.node()
        before = [node.sdo.upload(*place) for place in ((0x1800, 1), (0x1A00, 0), (0x1A00, 1), (0x1017, 0))]
        ran = bench.run(f"apply {file} --yes")
        assert ran.code in (1, 5), ran.stderr
        assert "rolled back" in ran.stderr
        assert before == [node.sdo.upload(*place) for place in ((0x1800, 1), (0x1A00, 0), (0x1A00, 1), (0x1017, 0))]


def test_a_dcf_that_is_cut_short_is_no_file_of_fewer_settings(tmp_path: Path) -> None:
    """Its own lists name what is missing; nothing is compared, or written, by the part that is left."""
    file = made(tmp_path, "generic", "dcf")
    whole = file.read_text("utf-8")
    file.write_text(whole[: whole.rindex("\n[1A00]")], "utf-8")
    with Bench(("generic@5",)) as bench:
        for line in ("compare", "diff", "plan", "verify", "apply --yes", "clone --yes"):
            ran = bench.run(f"{line} {file}")
            assert (ran.code, "is cut short" in ran.stderr) == (4, True), (line, ran.stderr)


def test_a_number_is_written_alike_by_diff_compare_and_verify(tmp_path: Path) -> None:
    eds, file = plain(), tmp_path / "node.jsonl"
    eds.variable(0x2001, var("Maximum speed", U32, 1300))
    eds.variable(0x1006, var("Communication cycle period", U32, 0))
    eds.variable(0x1014, var("COB-ID EMCY", U32, "$NODEID+0x80"))
    (tmp_path / "plain.eds").write_text(eds.text(), encoding="utf-8")
    with Bench((f"{tmp_path / 'plain.eds'}@5",)) as bench:
        assert bench.run(f"backup {file}").code == 0
        for line in ("write 2001 50000", "write 1014 0x80000085"):
            assert bench.run(line).code == 0, line
        diff, compared, verified = (bench.run(f"{line} {file}").stdout for line in ("diff", "compare", "verify"))
        assert "2001:00 (is 50000, expected 1300)" in diff
        assert re.search(r"2001:00  Maximum speed +1300 +50000", compared)
        assert "0x1014:00  is 0x80000085, expected 0x00000085" in diff
        assert re.search(r"1014:00  COB-ID EMCY +0x00000085 +0x80000085", compared)
        assert "2001:00  is 50000, expected 1300, but apply does not write it" in verified
        assert "1014:00  is 0x80000085, expected 0x00000085" in verified
    with Bench(("generic@5",)) as bench:
        assert bench.run(f"backup {tmp_path / 'generic.jsonl'}").code == 0
        assert bench.run("write 1017 900").code == 0
        verified = bench.run(f"verify {tmp_path / 'generic.jsonl'}").stdout
        assert "1017:00  is 900 ms, expected 500 ms" in verified
