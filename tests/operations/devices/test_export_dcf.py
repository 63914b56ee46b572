"""`export x.dcf`: the EDS with what the node holds; what no file can say, or nobody knows, is left out and said."""

from __future__ import annotations

import os
import stat
from pathlib import Path

import canopen
import pytest

from dvtcli.domain.configuration import configuration_of
from dvtcli.files.eds.numbers import same_value
from dvtcli.files.eds.reader import read_eds
from dvtcli.files.profiles import builtin_path
from dvtcli.operations.devices.backup_device import export_dcf
from dvtcli.operations.session.session import Session
from dvtcli.operations.user.options import Options
from dvtcli.operations.user.session_user import NullReporter
from tests.cli.commands.bench import Bench
from tests.small_eds import U8, U16, U32, plain, var

FAMILIES = sorted(path.stem for path in builtin_path("generic").parent.parent.glob("*/*.eds"))
DOMAIN, TEXT = 0xF, 9


@pytest.mark.parametrize("family", FAMILIES)
def test_every_configuration_object_is_in_the_dcf_as_the_node_holds_it(family: str, tmp_path: Path) -> None:
    with Bench((f"{family}@5",)) as bench:
        assert bench.run("set tpdo1 --timer 70").code in (0, 1)
        document = bench.run(f"export {tmp_path / 'node.dcf'} --json").document
        node = bench.session.node()
        eds = node.dictionary
        assert eds is not None
        known = configuration_of(eds, node.profile)
        dcf = read_eds(tmp_path / "node.dcf")
        left_out = {one["object"] for one in document["left_out"]}
        count = 0
        for entry in dcf.dictionary.entries():
            why = known.why_not(entry)
            if why is not None and not why.may_be_setting:
                assert entry.value is None, entry.object
            elif entry.object not in left_out:
                held = node.sdo.upload(entry.index, entry.sub_index)
                assert entry.value is not None, entry.object
                assert same_value(entry.data_type, entry.initial(5), held), entry.object
                count += 1
    assert count == document["objects"]
    assert dcf.node_id == 5
    assert (document["schema"], document["node"], document["eds"]) == ("dvtcli.dcf/1", 5, eds.source)


@pytest.mark.drawn(2)
@pytest.mark.parametrize("family", FAMILIES)
def test_another_reader_finds_the_same_values(family: str, tmp_path: Path) -> None:
    file = tmp_path / "node.dcf"
    with Bench((f"{family}@5",)) as bench:
        assert bench.run(f"backup {file}").code == 0
    theirs = canopen.import_od(str(file))
    count = 0
    for entry in read_eds(file).dictionary.entries():
        if entry.value is not None and entry.data_type is not None:
            variable = theirs.get_variable(entry.index, entry.sub_index)
            assert variable is not None
            assert variable.value == entry.data_type.decode(entry.value), entry.object
            count += 1
    assert count > 20
    assert (theirs.node_id, theirs.bitrate) == (5, 500_000)


def odd(folder: Path) -> Path:
    """A device with an object of each kind that an export has to think of."""
    eds = plain()
    eds.variable(0x2000, var("Ramp", U16, 100))
    eds.variable(0x2001, var("Key", U16, 1, "wo"))
    eds.variable(0x2002, var("Slow", U16, 1, ObjFlags=2))
    eds.variable(0x2003, var("Service password", U16, 1))
    eds.variable(0x2004, var("Title", TEXT, "Lift"))
    eds.variable(0x2005, var("Curve", DOMAIN, "01" * 300))
    eds.variable(0x2006, var("Setpoint", U16, 0, "rww", 1))
    eds.variable(0x2007, var("Nominal current", U32, 4760, "rww", 1))
    eds.variable(0x6040, var("Controlword", U16, 0, "rw", 1))
    eds.record(0x1F51, "Program control", {1: var("Program 1", U8, 1)})
    eds.variable(0x1005, var("COB-ID SYNC", U32, 0x80))
    path = folder / "odd.eds"
    path.write_bytes(eds.text().replace("\n", "\r\n").encode())
    return path


def test_what_acts_is_secret_or_may_not_be_read_is_not_in_it(tmp_path: Path) -> None:
    with Bench((str(odd(tmp_path)),)) as bench:
        document = bench.run(f"export {tmp_path / 'node.dcf'} --json").document
    dictionary = read_eds(tmp_path / "node.dcf").dictionary
    said = {entry.object for entry in dictionary.entries() if entry.value is not None}
    assert {"2000:00", "2004:00", "2005:00", "2007:00", "1005:00", "1800:01"} <= said
    assert not said & {"2001:00", "2002:00", "2003:00", "2006:00", "6040:00", "1F51:01", "1010:01", "1018:01"}
    assert document["left_out"] == [{"object": "2002:00", "why": "not to be read on a scan (ObjFlags, bit 1)"}]
    assert dictionary[0x2005].entries[0].value == b"\x01" * 300  # by blocks, as any other object


def test_a_value_of_an_older_dcf_is_what_the_node_holds_now_or_gone(tmp_path: Path) -> None:
    path = odd(tmp_path)
    text = path.read_bytes().decode()
    for index in ("2000", "2003", "6040"):
        text = text.replace(f"[{index}]\r\n", f"[{index}]\r\nParameterValue=77\r\n")
    older = tmp_path / "older.dcf"
    older.write_bytes(text.encode())
    with Bench((str(path),), {"eds": str(older)}) as bench:
        assert bench.run(f"export {tmp_path / 'node.dcf'}").code == 0
    dictionary = read_eds(tmp_path / "node.dcf").dictionary
    values = {index: dictionary[index].entries[0].value for index in (0x2000, 0x2003, 0x6040)}
    assert values == {0x2000: b"\x64\x00", 0x2003: None, 0x6040: b"\x00\x00"}


def test_without_an_eds_it_says_what_to_do(tmp_path: Path) -> None:
    with Bench(("generic@3",)) as bench:
        node = bench.session.node()
        node.dictionary = None
        ran = bench.run(f"export {tmp_path / 'node.dcf'}")
    assert ran.code == 2
    assert "node 3 has no EDS: its objects are unknown" in ran.stderr
    assert "--eds FILE names the EDS" in ran.stderr
    assert not (tmp_path / "node.dcf").exists()


def test_it_is_overwritten_with_consent_only(tmp_path: Path) -> None:
    file = tmp_path / "node.dcf"
    file.write_text("mine", "utf-8")
    with Bench(("generic",)) as bench:
        assert bench.run(f"export {file}").code == 6
        assert file.read_text("utf-8") == "mine"
        assert bench.run(f"export {file} --yes").code == 0
        assert bench.run(f"export {tmp_path / 'a.yaml'} --twice").code == 2
        assert bench.run(f"export {tmp_path / 'no' / 'a.dcf'}").code == 2
    assert [path.name for path in tmp_path.iterdir()] == ["node.dcf"]


@pytest.mark.skipif(os.name != "posix", reason="Windows has no modes of this kind")
def test_others_may_read_it_unless_somebody_said_otherwise(tmp_path: Path) -> None:
    file = tmp_path / "node.dcf"
    before = os.umask(0o022)
    try:
        with Bench(("generic",)) as bench:
            assert bench.run(f"export {file}").code == 0
            assert stat.S_IMODE(file.stat().st_mode) == 0o644
            file.chmod(0o600)
            assert bench.run(f"export {file} --yes").code == 0
            assert stat.S_IMODE(file.stat().st_mode) == 0o600
    finally:
        os.umask(before)


def test_the_eds_of_another_device_makes_no_dcf_of_this_one(tmp_path: Path) -> None:
    other = builtin_path("tmcm").with_name("tmcm.eds")
    with Bench(("gen4",), {"eds": str(other)}) as bench:
        ran = bench.run(f"export {tmp_path / 'node.dcf'}")
    assert ran.code == 6
    assert not (tmp_path / "node.dcf").exists()


class Follower(NullReporter):
    """Keeps what it is told of progress."""

    def __init__(self) -> None:
        self.said: list[tuple[str, int, int]] = []

    def progress(self, text: str, done: int, total: int) -> None:
        self.said.append((text, done, total))


def test_how_far_it_has_come_is_told() -> None:
    follower = Follower()
    with Session(Options(sim=("generic",)), follower) as session:
        export_dcf(session, "node.dcf")
    told = [(text, done, total) for text, done, total in follower.said if ": reading 0x" in text]
    most = max(total for *_, total in told)
    read = [one for one in told if one[2] == most]  # what an RPDO may change is read again after it
    assert [done for _, done, _ in read] == list(range(most))
    assert " left" in read[-1][0]


@pytest.mark.parametrize("line", ["export {}/node.dcf", "backup {}/node.jsonl", "backup {}/node.dcf"])
def test_a_node_that_restarts_meanwhile_is_read_again(line: str, tmp_path: Path) -> None:
    """The file says what it holds after the restart, not a mixture of before and after."""
    with Bench(("generic",), {"fault": ("reset-after-read@40",)}) as bench:
        assert bench.run("write 1017 700").code == 0
        made = bench.run(line.format(tmp_path))
        assert made.code == 0
        assert "restarted during the reading, which is repeated" in made.stderr
        (file,) = tmp_path.iterdir()
        assert bench.run(f"compare {file}").code == 0
        assert "700" not in bench.run("read 1017").stdout
