"""A frame of a link is its producer's, with all that this sends, whoever of its consumers is known first."""

from __future__ import annotations

from itertools import permutations
from pathlib import Path

import pytest

from dvtcli.domain.cob_id import CobId
from dvtcli.domain.object_scalings import ObjectScalings
from dvtcli.domain.pdo import Pdo, PdoCommunicationParameter, PdoConfig, PdoMappingEntry
from dvtcli.watch.decoder import Decoder, pdo_layouts
from tests.cli.commands.bench import Bench

LINE = """\
motor:
  node_id: 1
  dcf: gen4
  rpdo: {3: {cob_id: 0x185, enabled: true, mapping: [throttle_input_voltage, dummy/8]}}
pedals:
  node_id: 5
  dcf: generic
  tpdo: {1: {cob_id: 0x185, enabled: true, mapping: ["6401:01", "6000:01"]}}
"""
FRAME = "(0.000000) can0 185#D00703\n"


@pytest.fixture(autouse=True)
def _ground(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(tmp_path)
    Path("line.yaml").write_text(LINE, "utf-8")
    Path("run.log").write_text(FRAME, "utf-8")


def test_a_network_file_names_a_linked_frame_by_its_producer() -> None:
    with Bench(()) as offline:
        decoded = offline.run("decode run.log -d line.yaml").stdout
        assert ("TPDO1 node 5" in decoded, "RPDO3" in decoded) == (True, False)
        columns = offline.run("decode run.log -d line.yaml --csv").stdout.splitlines()[0]
        assert ("6401:01" in columns, "6000:01" in columns, "RPDO3" in columns) == (True, True, False)
        assert "TPDO1 node 5" in offline.run("decode run.log -d line.yaml --filter 6000:01").stdout


def test_what_nodes_hold_names_it_so_too() -> None:
    with Bench(("gen4@1", "generic@5")) as bench:
        assert bench.run("apply line.yaml --yes").code == 0
        for nodes in ("1,5", "5,1"):
            decoded = bench.run(f"decode run.log --nodes {nodes}").stdout
            assert ("TPDO1 node 5" in decoded, "RPDO3" in decoded) == (True, False), nodes
        assert "RPDO3 node 1" in bench.run("decode run.log --nodes 1").stdout


def test_a_producer_is_known_whatever_the_order() -> None:
    cob = PdoCommunicationParameter(CobId(0x185))
    taken, sent = (PdoConfig(cob, (PdoMappingEntry(0x2000, part, 8),)) for part in (1, 2))
    known = [
        pdo_layouts(node_id, {Pdo.parse(pdo): config}, None, ObjectScalings())
        for node_id, pdo, config in ((1, "rpdo3", taken), (5, "tpdo1", sent), (7, "rpdo1", taken))
    ]
    for order in permutations(known):
        decoder = Decoder()
        for layouts in order:
            decoder.add(layouts)
        (layout,) = decoder.layouts.values()
        assert (layout.service.label, layout.service.node) == ("TPDO1", 5)
        assert [signal.object for signal in layout.signals] == ["2000:02"]
