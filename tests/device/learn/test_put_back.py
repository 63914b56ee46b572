"""What `learn` wrote is put back, and what the device altered beside it, whatever ends it."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path

import pytest

from dvtcli.device.read_pdos import present_pdos, read_pdo
from dvtcli.domain.pdo import Pdo, PdoConfig
from dvtcli.domain.store import Stamp
from dvtcli.files.eds.reader import read_eds
from dvtcli.simulator.device.strict_device import StrictDevice
from dvtcli.simulator.network.family_file import load_family
from tests.cli.commands.bench import Bench
from tests.cli.commands.bus import device
from tests.device.learn.virtual import VirtualWire
from tests.harness.sample import heavy
from tests.small_eds import U8, communication, plain, var

#: With its 5th download the node alters TPDO1, which is not asked.
ALTERS = "alters@5=1800:05:0x0777"


def held(bench: Bench) -> Mapping[Pdo, PdoConfig]:
    node = bench.session.node(1)
    return {pdo: read_pdo(node.sdo, pdo) for pdo in present_pdos(node.sdo, node.dictionary)}


@heavy
@pytest.mark.parametrize("fault", ["", "lose-response@30", "reset@30", "refuse@40=0x08000021"])
def test_what_is_altered_beside_is_put_back_however_it_ends(fault: str) -> None:
    faults = (ALTERS, fault) if fault else (ALTERS,)
    wire = VirtualWire(device("generic"), faults=faults)
    with wire.bench() as bench:
        before = held(bench)
        ran = bench.run("learn --yes --json")
        assert (ran.code == 0) is (not fault or fault.startswith("refuse")), ran
        assert held(bench) == before, ran


def test_the_journal_has_every_pdo_before_the_first_write() -> None:
    """Whoever is killed while the device alters a PDO that is not asked has it put back by `recover`, too."""
    wire = VirtualWire(device("generic"), faults=(ALTERS, "silent@30"))
    with wire.bench() as bench:
        labels = {pdo.label for pdo in held(bench)}
        ran = bench.run("learn --yes --json")
        assert ran.document["state"] == "left_changed", ran
        guard = bench.session.node(1).guard
        assert guard is not None
        journal = guard.interrupted_journal()
        assert journal is not None
        assert labels <= {change.label for change in journal.plan.changes}


def test_what_no_pdo_is_compared_by_is_not_written(tmp_path: Path) -> None:
    """Sub-index 06 of an RPDO, which CiA 301 reserves and files of real devices have."""
    eds = plain()
    for index in (0x1400, 0x1401):
        sub6 = var("SYNC start value", U8, 0)
        off = f"$NODEID+0x{0x80000200 + 0x100 * (index - 0x1400):X}"
        eds.record(index, "Communication", communication(off, sub6=sub6))
    path = tmp_path / "reserved.eds"
    path.write_text(eds.text())
    node = StrictDevice(read_eds(path).dictionary, load_family("generic"), 1)
    wire = VirtualWire(node)
    with wire.bench({"eds": str(path)}) as bench:
        before = values(node)
        ran = bench.run("learn --yes --json")
        assert ran.code == 0, ran
        assert [values(node)[place] for place in before] == list(before.values())


def values(node: StrictDevice) -> Mapping[tuple[int, int], bytes]:
    """All that its PDOs' objects hold, also behind the counts."""
    indices = (index for index in node.dictionary if 0x1400 <= index < 0x1C00)
    return {(index, sub): node.value(index, sub) for index in indices for sub in node.dictionary[index].entries}


@heavy
@pytest.mark.parametrize("stamp", [Stamp.of("a file"), Stamp(15_000, 1)], ids=["ours", "another's"])
def test_a_stamp_that_the_device_clears_meanwhile_is_put_back(stamp: Stamp) -> None:
    wire = VirtualWire(one := device("generic"))
    for sub_index in (1, 2):
        one.set_value(0x1020, sub_index, stamp.data(sub_index))
    with wire.bench() as bench:
        ran = bench.run("learn --yes --json")
    assert ran.code == 0, ran
    assert any(frame.data[:4] == b"\x23\x20\x10\x01" for frame in wire.frames()), "it had been cleared"
    assert [one.value(0x1020, sub_index) for sub_index in (1, 2)] == [stamp.data(1), stamp.data(2)]
