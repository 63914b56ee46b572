"""What `import` writes of a node is the record of it: whatever of its services is set otherwise later, `diff` finds."""

from __future__ import annotations

from contextlib import suppress
from pathlib import Path

import pytest

from dvtcli.errors import SdoAborted
from dvtcli.files.network.read_network import read_network_file
from tests.cli.commands.bench import Bench
from tests.harness.sample import heavy

#: what somebody could write: of each object its size in bytes, and which bits of it become others
SERVICES = {
    (0x1005, 0): (4, 1), (0x1006, 0): (4, 0x4000), (0x100C, 0): (2, 0x40), (0x1012, 0): (4, 0x8000_0000),
    (0x1014, 0): (4, 0x8000_0000), (0x1015, 0): (2, 0x10), (0x1016, 1): (4, 0x0009_0400), (0x1017, 0): (2, 0x400),
    (0x1019, 0): (1, 0x10),
}  # fmt: skip
LEAST = {"generic": 5, "gen4": 3, "tmcm": 3, "canopennode": 3}


@pytest.mark.parametrize("family", LEAST)
def test_each_service_that_is_changed_later_differs(family: str, tmp_path: Path) -> None:
    file, taken = tmp_path / "net.yaml", set[str]()
    with Bench((f"{family}@9",), {"yes": True}) as bench:
        assert bench.run(f"import {file}").code == 0
        sdo = bench.session.node(9).sdo
        for (index, sub_index), (size, bits) in SERVICES.items():
            with suppress(SdoAborted):  # the family has no such object, or takes no such value
                held = int.from_bytes(sdo.upload(index, sub_index), "little")
                sdo.download(index, sub_index, (held ^ bits).to_bytes(size, "little"))
                taken.add(f"{index:04X}:{sub_index:02X}")
        ran = bench.run(f"diff {file} --json")
        assert ran.code == 3
        (node,) = ran.document["nodes"]
        assert {one["object"] for one in node["objects"]} == taken
    assert len(taken) >= LEAST[family]


@heavy
def test_apply_puts_the_record_back(tmp_path: Path) -> None:
    file = tmp_path / "net.yaml"
    with Bench(("generic@9",), {"yes": True}) as bench:
        assert bench.run(f"import {file}").code == 0
        sdo = bench.session.node(9).sdo
        for index, sub_index, data in ((0x1014, 0, "890000 80"), (0x1006, 0, "10270000"), (0x1016, 1, "00040900")):
            sdo.download(index, sub_index, bytes.fromhex(data))
        assert bench.run(f"diff {file}").code == 3
        assert bench.run(f"apply {file}").code == 0
        assert sdo.upload(0x1014, 0) == bytes.fromhex("89000000")
        assert sdo.upload(0x1016, 1) == bytes(4)
        assert bench.run(f"diff {file}").code == 0


def test_who_is_watched_has_a_key_and_the_other_entries_are_values(tmp_path: Path) -> None:
    file = tmp_path / "net.yaml"
    with Bench(("generic@9",), {"yes": True}) as bench:
        bench.session.node(9).sdo.download(0x1016, 1, bytes.fromhex("F4010500"))
        assert bench.run(f"import {file}").code == 0
        assert bench.run(f"plan {file} --exit-code").code == 0
    (node,) = read_network_file(file).nodes
    assert [(one.producer, one.time_ms) for one in node.watches] == [(5, 500)]
    assert "1016:01" not in {one.object.text for one in node.values}


@heavy
def test_emcy_s_default_follows_the_node_id_and_another_node_s_is_told(tmp_path: Path) -> None:
    file = tmp_path / "net.yaml"
    with Bench(("generic@9",)) as bench:
        assert bench.run(f"import {file}").code == 0
        assert bench.run(f"plan {file} --exit-code").code == 0
    text = file.read_text("utf-8")
    assert 'object: 1014:00, value: "$NODEID+0x80"' in text
    file.write_text(text.replace("node_id: 9", "node_id: 10"), "utf-8")
    told = "0x089 is the default COB-ID of EMCY of node 9"
    with Bench(("generic@10",), {"yes": True}) as bench:
        ran = bench.run(f"plan {file}")
        assert ("0x1014" in ran.stdout, told in ran.stdout + ran.stderr) == (False, False)
        file.write_text("x:\n  node_id: 10\n  sdo: [{object: 1014:00, value: 0x89}]\n", "utf-8")
        for word in ("plan", "apply"):
            ran = bench.run(f"{word} {file}")
            assert (ran.code, told in ran.stdout + ran.stderr) == (0, True), ran
        file.write_text("x:\n  node_id: 10\n  sdo: [{object: 1014:00, value: $NODEID+many}]\n", "utf-8")
        assert bench.run(f"plan {file}").code == 4
