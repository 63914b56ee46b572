"""A frame has one physical value of a signal: in a DBC file (decoded by cantools), in a CSV file and on the monitor."""

from __future__ import annotations

from dataclasses import dataclass
from fractions import Fraction
from pathlib import Path

import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st

from dvtcli.domain.cob_id import CobId
from dvtcli.domain.datatypes import BY_SHORT_NAME
from dvtcli.domain.network.network_state import NetworkState, NodeState
from dvtcli.domain.object_dictionary import ObjectDictionary, ObjectType, OdEntry, OdObject
from dvtcli.domain.object_scalings import ObjectRange, ObjectScalings, ScalingRule
from dvtcli.domain.pdo import Pdo, PdoCommunicationParameter, PdoConfig, PdoMappingEntry
from dvtcli.domain.ports import Frame
from dvtcli.domain.scaling import Scaling
from dvtcli.files.dbc import dbc_bytes, read_dbc
from dvtcli.files.values.text_values import csv_text
from dvtcli.operations.exchange.export_dbc import network_messages
from dvtcli.operations.frames.explain_frame import frame_seen
from dvtcli.watch.decoder import Decoder, pdo_layouts
from dvtcli.watch.table import SignalRows

NODE = 5
factors = st.sampled_from(["1", "1/256", "1/16", "0.1", "0.25", "100", "0.001"]).map(Fraction)
offsets = st.sampled_from(["0", "-40", "0.5"]).map(Fraction)


@dataclass(frozen=True)
class Mapped:
    """One object of a mapping."""

    kind: str
    physical: Scaling


mapped = st.builds(
    Mapped, st.sampled_from(["u8", "i8", "u16", "i16", "i24"]), st.builds(Scaling, st.just("V"), factors, offsets)
)


def node_of(objects: list[Mapped]) -> tuple[NodeState, ObjectScalings]:
    """A node with a TPDO that maps *objects*, in frame order, and what they mean."""
    kinds = [BY_SHORT_NAME[one.kind] for one in objects]
    entries = [OdEntry(0x2000 + n, 0, f"Signal {n}", kind) for n, kind in enumerate(kinds)]
    dictionary = ObjectDictionary(
        {one.index: OdObject(one.index, one.name, ObjectType.VAR, {0: one}) for one in entries}
    )
    mapping = tuple(PdoMappingEntry(one.index, 0, kind.bits or 0) for one, kind in zip(entries, kinds, strict=True))
    config = PdoConfig(PdoCommunicationParameter(CobId(0x185), 255, None, None, None), mapping)
    rules = {ObjectRange(0x2000 + n, 0x2000 + n): ScalingRule(one.physical) for n, one in enumerate(objects)}
    return NodeState(NODE, "drive", {Pdo.parse("tpdo1"): config}, {}, dictionary), ObjectScalings([rules])


@settings(suppress_health_check=[HealthCheck.function_scoped_fixture])
@given(st.lists(mapped, min_size=1, max_size=2), st.binary(min_size=8, max_size=8))
def test_one_frame_has_one_value(tmp_path: Path, objects: list[Mapped], data: bytes) -> None:
    node, scalings = node_of(objects)
    decoder = Decoder(pdo_layouts(NODE, node.pdos, node.dictionary, scalings))
    (layout,) = decoder.layouts.values()
    written = network_messages(NetworkState((node,)), {NODE: scalings})
    path = tmp_path / "bus.dbc"
    path.write_bytes(dbc_bytes(written.nodes, written.messages))
    by_dbc = Decoder(read_dbc(str(path)))
    frame = Frame(0x185, data)
    rows = SignalRows(decoder)
    cells = rows.row(frame)
    assert cells is not None
    document = frame_seen(frame, decoder).document()
    values = zip(layout.signals, cells, by_dbc.values(frame).values(), strict=True)
    for number, (signal, cell, of_dbc) in enumerate(values):
        raw = decoder.values(frame)[signal.key]
        assert isinstance(of_dbc, int | float)
        assert isinstance(raw, int)
        assert float(csv_text(cell)) == pytest.approx(float(of_dbc), rel=1e-12, abs=1e-12)
        assert document["physical"][signal.key]["value"] == cell
        assert document["signals"][signal.key] == raw
        shown = signal.meaning.text(raw)  # what the monitor's line says
        assert signal.meaning.to_raw(shown) == raw == objects[number].physical.to_raw(shown)
        assert float(shown.split()[0]) == pytest.approx(float(of_dbc), abs=float(signal.meaning.factor) / 2)
