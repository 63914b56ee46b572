"""A frame has one physical value of a signal: in a DBC file (decoded by cantools), in a CSV file and on the monitor."""

from __future__ import annotations

from dataclasses import dataclass
from fractions import Fraction
from pathlib import Path

import pytest
from cantools.database import Database
from cantools.database.can import Message
from cantools.database.can import Signal as DbcSignal
from cantools.database.conversion import BaseConversion
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st

from dvtcli.domain.cob_id import CobId
from dvtcli.domain.datatypes import BY_SHORT_NAME
from dvtcli.domain.mapping import PdoMappingEntry
from dvtcli.domain.meanings import Meaning, Meanings, ObjectRange
from dvtcli.domain.object_dictionary import ObjectDictionary, ObjectType, OdEntry, OdObject
from dvtcli.domain.pdo import Pdo, PdoCommunicationParameter, PdoConfig
from dvtcli.domain.physical import Physical
from dvtcli.domain.ports import Frame
from dvtcli.files.dbc import read_dbc
from dvtcli.files.values.csv_values import csv_text
from dvtcli.operations.frame_answer import frame_seen
from dvtcli.watch.decoder import Decoder, Layout, pdo_layouts
from dvtcli.watch.table import SignalRows

NODE = 5
factors = st.sampled_from(["1", "1/256", "1/16", "0.1", "0.25", "100", "0.001"]).map(Fraction)
offsets = st.sampled_from(["0", "-40", "0.5"]).map(Fraction)


@dataclass(frozen=True)
class Mapped:
    """One object of a mapping."""

    kind: str
    physical: Physical


mapped = st.builds(
    Mapped, st.sampled_from(["u8", "i8", "u16", "i16", "i24"]), st.builds(Physical, st.just("V"), factors, offsets)
)


def decoder_of(objects: list[Mapped]) -> Decoder:
    """Our decoder of a TPDO that maps *objects*, in frame order."""
    kinds = [BY_SHORT_NAME[one.kind] for one in objects]
    entries = [OdEntry(0x2000 + n, 0, f"Signal {n}", kind) for n, kind in enumerate(kinds)]
    dictionary = ObjectDictionary(
        {one.index: OdObject(one.index, one.name, ObjectType.VAR, {0: one}) for one in entries}
    )
    mapping = tuple(PdoMappingEntry(one.index, 0, kind.bits or 0) for one, kind in zip(entries, kinds, strict=True))
    config = PdoConfig(PdoCommunicationParameter(CobId(0x185), 255, None, None, None), mapping)
    rules = {ObjectRange(0x2000 + n, 0x2000 + n): Meaning(one.physical) for n, one in enumerate(objects)}
    return Decoder(pdo_layouts(NODE, {Pdo.parse("tpdo1"): config}, dictionary, Meanings([rules])))


def dbc_of(layout: Layout, path: Path) -> Path:
    """A DBC file of *layout*, with what its signals' meanings say."""
    signals, start = [], 0
    for number, one in enumerate(layout.signals):
        assert one.data_type is not None
        conversion = BaseConversion.factory(float(one.meaning.factor), float(one.meaning.offset))
        signed = one.data_type.short.startswith("i")
        name = f"Signal_{number}"
        signals.append(DbcSignal(name, start, one.bits, is_signed=signed, conversion=conversion, unit=one.meaning.unit))
        start += one.bits
    path.write_text(Database([Message(0x185, "TPDO1", (start + 7) // 8, signals)]).as_dbc_string(), encoding="cp1252")
    return path


@settings(suppress_health_check=[HealthCheck.function_scoped_fixture])
@given(st.lists(mapped, min_size=1, max_size=2), st.binary(min_size=8, max_size=8))
def test_one_frame_has_one_value(tmp_path: Path, objects: list[Mapped], data: bytes) -> None:
    decoder = decoder_of(objects)
    (layout,) = decoder.layouts.values()
    by_dbc = Decoder(read_dbc(str(dbc_of(layout, tmp_path / "bus.dbc"))))
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
