"""Files that a program checks and writes: the same as `eds check`, `export` and `import`, as values."""

from __future__ import annotations

from pathlib import Path

import pytest

import dvtcli
from dvtcli.errors import InputFileError, SafetyRefusal, UsageError
from dvtcli.files.network.read_network import read_network_file
from dvtcli.simulator.network.family_file import family_eds
from tests.harness.sample import heavy

WRONG = "[DeviceInfo]\nVendorNumber=0x1E\n[1000]\nParameterName=Device type\nDataType=0x0007\nDefaultValue=none\n"


@heavy
def test_findings_are_values_and_an_answer_is_true_where_nothing_is_wrong(tmp_path: Path) -> None:
    good, wrong = tmp_path / "good.eds", tmp_path / "wrong.eds"
    good.write_bytes(family_eds("gen4").read_bytes())
    wrong.write_text(WRONG)
    assert dvtcli.check_eds(good, profile="gen4")
    checked = dvtcli.check_eds(tmp_path / "*.eds", rules=["bad-value"])
    assert not checked
    assert [(Path(one.path).name, bool(one)) for one in checked.files] == [("good.eds", True), ("wrong.eds", False)]
    (finding,) = checked.files[1].findings
    assert (finding.line, finding.severity, finding.rule, finding.object) == (6, "error", "bad-value", "1000:00")
    assert dvtcli.check_eds(wrong, without=["bad-value"], rules=["bad-value", "empty-value"])


def test_what_cannot_be_checked_is_an_error_or_among_several_a_finding(tmp_path: Path) -> None:
    broken, missing = tmp_path / "broken.eds", tmp_path / "missing.eds"
    broken.write_bytes(b"\0" * 100)
    with pytest.raises(UsageError, match="No such file"):
        dvtcli.check_eds(missing)
    with pytest.raises(InputFileError):
        dvtcli.check_eds(broken)
    both = dvtcli.check_eds(broken, missing)
    assert [[one.rule for one in file.findings] for file in both.files] == [["unreadable"], ["unreadable"]]
    for wrong in ({"rules": ["nosuch"]}, {"profile": "nosuch"}, {"strict": 1}):
        with pytest.raises(UsageError):
            dvtcli.check_eds(broken, **wrong)  # type: ignore[arg-type]
    with pytest.raises(UsageError, match="which files"):
        dvtcli.check_eds()


def test_the_library_is_filled_and_listed(tmp_path: Path) -> None:
    drive = tmp_path / "drive.eds"
    drive.write_bytes(family_eds("gen4").read_bytes())
    (tmp_path / "broken.eds").write_bytes(b"nothing")
    added = dvtcli.add_eds(tmp_path, "tmcm", dry_run=True)
    assert (bool(added), added.dry_run, len(dvtcli.eds_library())) == (False, True, 0)
    added = dvtcli.add_eds(tmp_path, "tmcm")
    assert [row.outcome for row in added] == ["refused", "added", "added"]
    assert dvtcli.add_eds(drive, vendor=0x360, product=1)
    listed = dvtcli.eds_library()
    assert [(row.vendor_id, row.by_hand, row.name) for row in listed] == [
        (0x1E, False, "drive.eds"), (0x286, False, "tmcm.eds"), (0x360, True, "drive.eds"),
    ]  # fmt: skip
    assert all(Path(row.path).is_file() for row in listed)
    with pytest.raises(InputFileError):
        dvtcli.add_eds(tmp_path / "broken.eds")
    for wrong in ({"vendor": -1, "product": 1}, {"product": 1}, {"dry_run": 1}, {"product": "5"}):
        with pytest.raises(UsageError):
            dvtcli.add_eds(drive, **wrong)  # type: ignore[arg-type]
    with pytest.raises(UsageError, match="which files"):
        dvtcli.add_eds()


@heavy
def test_a_node_and_a_network_are_written_to_files_and_over_them_with_consent_only(tmp_path: Path) -> None:
    file, dcf, press = tmp_path / "drive.yaml", tmp_path / "drive.dcf", tmp_path / "press.yaml"
    with dvtcli.simulate("gen4@1", "tmcm@5") as bus:
        bus.node(5).map("tpdo1", "6041", timer_ms=20)
        assert bus.node(5).export(file) == ()
        assert bus.node(1).export(dcf, twice=True) == ()
        assert bus.import_network(press) == ()
        assert [node.node_id for node in read_network_file(press).nodes] == [1, 5]
        assert not bus.plan(file).document()["changed"]
        before = file.read_bytes()
        for write in (lambda: bus.node(1).export(file), lambda: bus.import_network(file)):
            with pytest.raises(SafetyRefusal):
                write()
        assert file.read_bytes() == before
        assert bus.node(1).export(file, yes=True) == ()
        assert file.read_bytes() != before
        for name, twice in (("drive.txt", False), ("drive.yaml", True)):
            with pytest.raises(UsageError):
                bus.node(1).export(tmp_path / name, twice=twice)
    assert dvtcli.check_eds(dcf, profile="gen4")


@heavy
def test_a_folder_of_files_is_imported_without_asking_a_node(tmp_path: Path) -> None:
    folder, press = tmp_path / "eds", tmp_path / "press.yaml"
    folder.mkdir()
    for family in ("gen4", "tmcm"):
        (folder / f"{family}.eds").write_bytes(family_eds(family).read_bytes())
    with dvtcli.simulate("generic@9") as bus:
        bus.import_network(press, folder)
    assert [node.node_id for node in read_network_file(press).nodes] == [1, 2]


@heavy
def test_all_nodes_go_to_one_file_and_files_to_other_formats(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(tmp_path)
    with dvtcli.simulate("gen4@1", "tmcm@5") as bus:
        assert bus.export("now.dbc", services=["emcy"], everything=True) == ()
        assert "_EMCY:" in Path("now.dbc").read_text("cp1252")
        assert bus.export("nodelist.cpj") == ()
        for wrong in ("x.yaml", "x"):
            with pytest.raises(UsageError, match="unknown format"):
                bus.export(wrong)
        with pytest.raises(UsageError, match="applies to all nodes"):
            bus.node(1).export("x.dbc")
        with pytest.raises(UsageError, match="no such service"):
            bus.export("x.dbc", services=["pdo"])
        with pytest.raises(SafetyRefusal):
            bus.export("now.dbc")
        assert bus.export("now.dbc", yes=True) == ()
        left_out = bus.import_network("line.yaml", "nodelist.cpj")
        assert left_out == (
            "no bit rate in the file: for load and deadlines, `bus.check('line.yaml', bit_rate=500000)`, or, with a "
            "master, master: {baudrate: 500}",
            "nodes 1 and 5: other values of their files left out, all equal to the defaults: apply a file itself "
            "to write its configuration objects",
        )
    about, comments = dvtcli.convert("node5.dcf", "node5.xdc")
    assert about.startswith("FileInfo: Description (")
    assert comments == "2 lines of comment, the first in line 1"
    assert any("of one node" in one for one in dvtcli.convert("node5.dcf", "node5.xdd"))
    assert dvtcli.convert("line.yaml", "node5.cdcf", node=5) == ()
    assert dvtcli.convert("line.yaml", "line.dbc", split_bits=True) == ()
    assert "Statusword_fault" in Path("line.dbc").read_text("cp1252")
    with pytest.raises(UsageError, match=r"split_bits: .*is not a DBC file"):
        dvtcli.convert("node5.dcf", "node5.eds", split_bits=True)
