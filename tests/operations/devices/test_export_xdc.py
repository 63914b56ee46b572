"""`export x.xdc`: what the node holds, as a DCF of the same node says it."""

from __future__ import annotations

from pathlib import Path

import pytest

from dvtcli.files.device_file import read_device_file
from tests.cli.commands.bench import Bench
from tests.harness.sample import heavy
from tests.operations.devices.test_export_dcf import FAMILIES, odd


@pytest.mark.drawn(3)
@pytest.mark.parametrize("family", FAMILIES)
def test_an_xdc_holds_the_values_of_a_dcf(family: str, tmp_path: Path) -> None:
    with Bench((f"{family}@5",)) as bench:
        assert bench.run("set tpdo1 --timer 70").code in (0, 1)
        as_dcf = bench.run(f"export {tmp_path / 'node.dcf'} --json").document
        as_xdc = bench.run(f"export {tmp_path / 'node.xdc'} --json").document
    assert {key: as_xdc[key] for key in ("node", "eds", "objects")} == {
        key: as_dcf[key] for key in ("node", "eds", "objects")
    }
    assert [one["object"] for one in as_xdc["left_out"]] == [one["object"] for one in as_dcf["left_out"]]
    dcf, xdc = (read_device_file(tmp_path / f"node.{suffix}").dictionary for suffix in ("dcf", "xdc"))
    assert (xdc.info.node_id, xdc.info.commissioning.bit_rate_kbit) == (5, dcf.info.commissioning.bit_rate_kbit)
    for entry in dcf.entries():
        other = xdc.entry(entry.index, entry.sub_index)
        assert other is not None
        assert (other.value is None) is (entry.value is None), entry.object
        assert entry.value is None or other.initial(5) == entry.initial(5), entry.object


@heavy
def test_a_node_made_of_its_xdc_holds_the_same(tmp_path: Path) -> None:
    path = tmp_path / "node.xdc"
    with Bench(("generic@5",)) as bench:
        assert bench.run("set tpdo1 --timer 70").code == 0
        assert bench.run(f"export {path}").code == 0
        assert bench.run(f"verify {path}").code == 0
    with Bench((str(path),)) as bench:
        assert bench.session.node().node_id == 5
        assert bench.run("read 1800:5 --json").document["value"] == 70


def test_what_is_not_read_is_said(tmp_path: Path) -> None:
    with Bench((str(odd(tmp_path)),)) as bench:
        ran = bench.run(f"export {tmp_path / 'node.xdc'}")
        again = bench.run(f"export {tmp_path / 'node.xdc'} --twice")
    assert (ran.code, "note: left out: " in ran.stdout) == (0, True)
    again.failed(6, "overwrite")
