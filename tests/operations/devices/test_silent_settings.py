"""A value that differs from the backup is never passed over: it is shown, or the reason why it is not a setting."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any

import pytest
from hypothesis import assume, given, settings
from hypothesis import strategies as st

from dvtcli.domain.configuration import NotWritten
from dvtcli.domain.datatypes import Kind
from dvtcli.domain.object_dictionary import OdEntry
from dvtcli.domain.pdo import Pdo
from dvtcli.domain.ports import SdoTransport
from dvtcli.errors import SdoAborted
from tests.cli.commands.bench import Bench
from tests.harness.sample import heavy
from tests.operations.devices.test_export_dcf import FAMILIES
from tests.small_eds import U16, U32, communication, mapping, plain, var

#: what a standard, a PDO or a name says of an object that is not a setting
NO_SETTING = frozenset(
    {
        NotWritten.COMMAND, NotWritten.TAKEN, NotWritten.OUTPUT, NotWritten.PRESET, NotWritten.STORE, NotWritten.STAMP,
        NotWritten.PROGRAM, NotWritten.SDO_CHANNEL, NotWritten.REQUEST, NotWritten.ERROR_HISTORY, NotWritten.PASSCODE,
        NotWritten.NODE_ID, NotWritten.BEHAVIOUR, NotWritten.NAMED_PROCESS_DATA,
    }
)  # fmt: skip
LIFTED = frozenset(one for one in NotWritten if one.is_lifted_by_include)


@settings(max_examples=max(1, settings().max_examples // 15))
@given(st.data())
def test_what_a_node_holds_otherwise_is_a_difference_or_named(data: st.DataObject) -> None:
    family = data.draw(st.sampled_from(FAMILIES))
    with TemporaryDirectory() as folder:
        is_not_silent(f"{family}@5", Path(folder), data.draw)


def is_not_silent(what: str, folder: Path, draw: Callable[[st.SearchStrategy[Any]], Any]) -> None:
    """Change one object of a simulated node: each command that compares says so, and `--include` writes it."""
    file = folder / f"node.{draw(st.sampled_from(['dcf', 'jsonl', 'xdc']))}"
    with Bench((what,)) as bench:
        node, entry = bench.session.node(), draw(st.sampled_from(_writable(bench)))
        kept = bench.run(f"backup {file} --json").document
        assume(entry.object not in {one["object"] for one in kept["left_out"]} and _changed(node.sdo, entry))
        compared = bench.run(f"compare {file} --json").document
        told = {one["object"]: one["why"] for one in compared["differences"] + compared["apart"]}
        assert entry.object in told
        if compared["equal"]:
            assert told[entry.object] in NO_SETTING
        for line in ("compare", "diff", "verify"):
            assert bench.run(f"{line} {file}").code == (0 if compared["equal"] else 3), line
        left_out = {
            one["object"]: one["why"] for one in bench.run(f"diff {file} --json").document["nodes"][0]["left_out"]
        }
        if left_out.get(entry.object, NotWritten.MAKERS) in LIFTED:
            applied = bench.run(f"apply {file} --include {entry.index:X} --yes")
            assert applied.code == 0, applied.stdout + applied.stderr
            again = bench.run(f"compare {file} --json").document
            assert entry.object not in {one["object"] for one in again["differences"] + again["apart"]}


def _writable(bench: Bench) -> list[OdEntry]:
    """Objects of numbers that can be read and written, and are no PDO's."""
    dictionary = bench.session.node().dictionary
    assert dictionary is not None
    return [
        entry for entry in dictionary.entries()
        if entry.access.readable and entry.access.writable and not entry.object_flags and Pdo.at(entry.index) is None
        and entry.data_type is not None and entry.data_type.kind in (Kind.UNSIGNED, Kind.INTEGER)
    ]  # fmt: skip


def _changed(sdo: SdoTransport, entry: OdEntry) -> bool:
    """Whether the node took another value of *entry*, and kept it."""
    place = entry.index, entry.sub_index
    try:
        held = sdo.upload(*place)
        wanted = bytes([held[0] ^ 1]) + held[1:]
        sdo.download(*place, wanted)
        return sdo.upload(*place) == wanted
    except SdoAborted:
        return False


def drive(folder: Path) -> str:
    """A drive whose maker lets RPDOs take a limit, a gain and a set-point; RPDO1 takes the gain of another loop."""
    eds = plain()
    eds.info = {"VendorNumber": 1, "ProductNumber": 2}
    eds.record(0x1018, "Identity", {n: var(f"Part {n}", U32, n, "ro") for n in range(1, 5)})
    eds.record(0x3001, "Motor data", {1: var("Nominal current", U32, 4760, "rww", 1)})
    eds.record(0x30A0, "Current control", {1: var("P gain", U32, 700, "rww", 1), 2: var("I gain", U32, 70, "rww", 1)})
    eds.variable(0x2022, var("Torque set-point", U16, 0, "rww", 1))
    eds.variable(0x2081, var("Home position", U32, 0, "rwr", 1))
    eds.record(0x1400, "RPDO 1", communication("$NODEID+0x200"))
    eds.record(0x1600, "RPDO 1 mapping", mapping(1, [0x30A0_0220]))
    path = folder / "drive.eds"
    path.write_text(eds.text(), "utf-8")
    return f"{path}@5"


@heavy
@pytest.mark.parametrize("form", ["dcf", "jsonl", "xdc"])
def test_a_limit_that_an_rpdo_could_take_is_a_setting_as_long_as_none_takes_it(form: str, tmp_path: Path) -> None:
    file = tmp_path / f"node.{form}"
    what = drive(tmp_path)
    with Bench((what,)) as bench:
        assert bench.run(f"{'backup' if form == 'jsonl' else 'export'} {file}").code == 0
        for line in ("write 3001:1 1111", "write 30A0:1 42", "write 30A0:2 43", "write 2022 5", "write 2081 6"):
            assert bench.run(line).code == 0, line
        compared = bench.run(f"compare {file} --json")
        told = [one["object"] for one in compared.document["differences"]]
        assert (compared.code, told) == (3, ["2081:00", "3001:01", "30A0:01"])
        for line in ("diff", "verify"):
            ran = bench.run(f"{line} {file}")
            assert (ran.code, "3001:01" in ran.stdout, "30A0:01" in ran.stdout) == (3, True, True), line
        assert "3001:01 (is 1111, expected 4760) is manufacturer-specific" in bench.run(f"diff {file}").stdout
        assert (
            "--include 2081 --include 3001:01 --include 30A0:01 writes such" in bench.run(f"clone {file} --yes").stdout
        )
        node = bench.session.node()
        assert node.sdo.upload(0x3001, 1) == (1111).to_bytes(4, "little")
        assert bench.run(f"clone {file} --include 3001 --include 2000-2FFF --yes").code == 3
        told = [one["object"] for one in bench.run(f"compare {file} --json").document["differences"]]
        assert told == ["30A0:01"]
        assert bench.run(f"clone {file} --include 30A0:1 --yes").code == 0
        assert node.sdo.upload(0x30A0, 2) == (43).to_bytes(4, "little"), "RPDO1 takes it"
        assert node.sdo.upload(0x2022, 0) == (5).to_bytes(2, "little"), "a set-point is written one by one"
        assert (bench.run(f"compare {file}").code, bench.run(f"diff {file}").code) == (0, 0)


def test_a_range_writes_nothing_that_could_act(tmp_path: Path) -> None:
    """Of what an RPDO could take a range writes what is a setting by its name; the rest is named, and counts or not."""
    names = ["Controller gain", "Speed cmd", "Relay 1", "Throttle", "Brake", "Fan", "PWM 1", "Target velocity"]
    eds, file, index = plain(), tmp_path / "node.dcf", 0x2000
    eds.info = {"VendorNumber": 1, "ProductNumber": 2}
    eds.record(0x1018, "Identity", {n: var(f"Part {n}", U32, n, "ro") for n in range(1, 5)})
    for number, name in enumerate(names):
        eds.variable(index + number, var(name, U16, 0, "rww", 1))
    device = tmp_path / "m.eds"
    device.write_text(eds.text(), "utf-8")
    for number, name in enumerate(names):
        eds.variable(index + number, var(name, U16, 0, "rww", 1, ParameterValue=7))
    file.write_text(eds.text(), "utf-8")
    with Bench((f"{device}@5",)) as bench:
        for line, code in (("clone", 3), ("apply", 0)):
            ran = bench.run(f"{line} {file} --include 2000-5FFF --yes")
            sdo = bench.session.node().sdo
            assert [sdo.upload(index + n, 0)[0] for n in range(len(names))] == [7, *[0] * (len(names) - 1)]
            assert (ran.code, "1 setting of node 5 differs" in ran.stdout) == (code, True), ran.stdout + ran.stderr
            assert "is not written: --include 2005 writes it" in ran.stdout
            assert line == "apply" or "2002:00 (is 0, expected 7)," in ran.stdout
        assert bench.run(f"clone {file} --include 2000-5FFF --include 2005 --include 2002 --yes").code == 0
        assert [sdo.upload(index + n, 0)[0] for n in range(len(names))] == [7, 0, 7, 0, 0, 7, 0, 0]


def test_what_changes_by_itself_is_no_setting_where_an_rpdo_could_take_it(tmp_path: Path) -> None:
    file, what = tmp_path / "node.jsonl", drive(tmp_path)
    with Bench((what,)) as bench:
        assert bench.run(f"backup {file}").code == 0
    with Bench((what,), {"signal": ("3001:01=ramp(0,4000000000,60s)",)}) as bench:
        bench.session.node()
        bench.session.wire.sleep(0.1)  # a signal is sampled each 0.01 s
        document = bench.run(f"compare {file} --json").document
        apart = [(one["object"], one["why"]) for one in document["apart"]]
        assert (document["equal"], apart) == (True, [("3001:01", "changes by itself")])
        for line in ("diff", "verify"):
            assert bench.run(f"{line} {file}").code == 0, line


@pytest.mark.parametrize(("faults", "code"), [((), 0), (("stores-nothing",), 1)])
def test_a_proof_compares_what_an_rpdo_could_take_and_none_takes(
    faults: tuple[str, ...], code: int, tmp_path: Path
) -> None:
    with Bench((drive(tmp_path),), {"fault": faults, "yes": True}) as bench:
        for line in ("write 3001:1 1111", "write 30A0:2 43", "write 2022 5"):
            assert bench.run(line).code == 0, line
        proved = bench.run("store --prove")
        assert (proved.code, "3001:01: is 4760, expected 1111" in proved.stdout) == (code, bool(faults)), proved.stdout
        assert "not compared: 0x30A0:02, 0x2022:00, since a command or a target" in proved.stdout


def test_that_only_defaults_are_compared_is_said(tmp_path: Path) -> None:
    file = tmp_path / "empty.dcf"
    with Bench(("generic@5",)) as bench:
        assert bench.run(f"export {file}").code == 0
        lines = file.read_text("utf-8").splitlines(keepends=True)
        file.write_text("".join(one for one in lines if not one.startswith("ParameterValue=")), "utf-8")
        for command in ("compare", "verify"):
            ran = bench.run(f"{command} {file}")
            said = f"note: {file} has no values: its defaults are compared\n"
            assert (ran.code in (0, 3), ran.stderr.count(said)) == (True, 1), ran
