"""What a program asks of a bus and its nodes is what the commands answer: SYNC, objects, identity, a script."""

from __future__ import annotations

from pathlib import Path

import pytest

import dvtcli
from dvtcli import errors
from dvtcli.results import SyncCheck
from tests.cli.commands.bench import Bench
from tests.harness.sample import heavy


def test_who_produces_sync_is_what_the_command_says() -> None:
    with Bench() as bench:
        ran = bench.run("sync --check --json")
    with dvtcli.simulate("gen4") as bus:
        checked = bus.check_sync()
        assert isinstance(checked, SyncCheck)
        said, typed = checked.document(), ran.document
        [found], [line] = said["findings"], typed["findings"]
        assert found.pop("hint").startswith("`bus.node(1).write('1005', 0x40000080)` makes node 1 the producer")
        assert line.pop("hint").startswith("`dvtcli --sim gen4 write 1005 0x40000080` makes node 1 the producer")
        assert (found.pop("next"), line.pop("next")[3:]) == (None, ["write", "1005", "0x40000080"])
        assert said == typed
        assert not checked
        assert [(one.node, one.can_id, one.produces) for one in checked.nodes] == [(1, 0x080, False)]


def test_a_node_that_produces_sync_is_seen() -> None:
    with dvtcli.simulate("generic@3", "generic@5") as bus:
        bus.node(5).write(0x1006, 20_000)
        bus.node(5).write(0x1005, 0x4000_0080)
        bus.node(5).nmt("start")
        checked = bus.check_sync(3, 5)
        assert checked
        assert checked.heard > 1
        assert {one.node: one.produces for one in checked.nodes} == {3: False, 5: True}
        assert not checked.findings
        with pytest.raises(errors.UsageError, match="node_ids=128"):
            bus.check_sync(128)


def test_objects_are_those_of_the_command() -> None:
    with Bench() as bench:
        ran = bench.run("objects velocity --mappable tpdo --json")
    with dvtcli.simulate("gen4") as bus:
        listing = bus.node().objects("velocity", mappable="tpdo")
        assert listing.document() == ran.document
        assert len(listing) == len(list(listing)) > 0
        assert "606C:00" in [row.object for row in listing]
        assert len(bus.node().objects()) == listing.total
        with pytest.raises(errors.UsageError, match="mappable='both'"):
            bus.node().objects(mappable="both")  # type: ignore[arg-type]
        with pytest.raises(errors.UsageError, match="text=5"):
            bus.node().objects(5)  # type: ignore[arg-type]


def test_another_device_is_refused_before_anything_is_done_to_it() -> None:
    with dvtcli.simulate("gen4") as bus:
        node = bus.node()
        held = node.identity()
        assert held.vendor_id is not None
        node.require(vendor_id=held.vendor_id, product_code=held.product_code)
        with pytest.raises(errors.SafetyRefusal) as refused:
            node.require(vendor_id=held.vendor_id, serial=0x999)
        assert "this program wants 0x00000999" in refused.value.text
        assert (refused.value.place, refused.value.state) == ("1018:04", "unchanged")
        for wrong in ({}, {"vendor_id": -1}, {"vendor_id": True}, {"serial": 1 << 32}):
            with pytest.raises(errors.UsageError):
                node.require(**wrong)


@heavy
def test_a_node_as_a_script_brings_another_one_to_the_same(tmp_path: Path) -> None:
    with dvtcli.simulate("gen4") as bus:
        node = bus.node()
        node.map("tpdo2", "statusword", cob_id=0x2A1, event=True, timer_ms=50)
        held, text = node.pdos(), node.script()
    assert text.startswith("# dvtcli script 1\nrequire identity vendor=0x0000001E")
    (tmp_path / "node.dvt").write_text(text, encoding="utf-8")
    with Bench() as bench:
        assert bench.run(f"run {tmp_path / 'node.dvt'}").code == 0
        assert bench.run("pdo --all --json").document["pdos"] == held.document()["pdos"]
