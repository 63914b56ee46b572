"""Values that were written are read back, whatever the form; what is damaged is said with its line."""

from __future__ import annotations

import csv
import io
from collections.abc import Iterator
from dataclasses import replace
from fractions import Fraction
from pathlib import Path

import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st

from dvtcli.domain.cob_id import CobId
from dvtcli.domain.datatypes import BY_SHORT_NAME, Value
from dvtcli.domain.object_scalings import ObjectRange, ObjectScalings, ScalingRule
from dvtcli.domain.pdo import Pdo, PdoCommunicationParameter, PdoConfig, PdoMappingEntry
from dvtcli.domain.ports import Frame
from dvtcli.domain.scaling import Scaling, parse_scale
from dvtcli.errors import InputFileError, UsageError
from dvtcli.files.values.parquet_values import MOST_COLUMNS, _kind, _schema, cells_array, long_cells
from dvtcli.files.values.text_values import CsvWriter, csv_text
from dvtcli.files.values.value_file import FORMS, WholeFile, read_values, write_file
from dvtcli.files.values.value_rows import Origin, ParquetForm
from dvtcli.operations.frames.decode_recording import find_tracks
from dvtcli.operations.frames.explain_frame import frame_seen
from dvtcli.watch.decoder import Decoder, Layout, Signal, pdo_layouts
from dvtcli.watch.service import Service
from dvtcli.watch.table import Column, SignalRows, all_columns
from tests.files.recordings import BEGIN_S

SCALES = ("1/16 V", "rpm", "0.1 %", "1/32767", "0.01 °")
MEANINGS = ObjectScalings(
    [
        {
            ObjectRange(0x2000 + number, 0x2000 + number): ScalingRule(Scaling(unit, factor))
            for number, (factor, unit) in enumerate(map(parse_scale, SCALES))
        }
    ]
)
OBJECTS = range(0x2000, 0x2000 + len(SCALES) + 1)  # the last one means nothing in particular


def of_parquet(file: str) -> tuple[pytest.MarkDecorator, ...]:
    """What a test of *file* needs if that is a Parquet file."""
    return (pytest.mark.needs("pyarrow"),) if file.endswith(".parquet") else ()


def layouts_of(node_id: int, indices: list[int]) -> Decoder:
    parameter = PdoCommunicationParameter(CobId(0x180 + node_id), 255, None, None, None)
    config = PdoConfig(parameter, tuple(PdoMappingEntry(index, 0, 16) for index in indices))
    return Decoder(pdo_layouts(node_id, {Pdo.parse("tpdo1"): config}, None, MEANINGS))


mappings = st.lists(st.sampled_from(OBJECTS), min_size=1, max_size=4)


@pytest.mark.parametrize("form", [pytest.param(form, marks=of_parquet(form)) for form in sorted(FORMS)])
@settings(max_examples=8, suppress_health_check=[HealthCheck.function_scoped_fixture])
@given(mapping=mappings, datas=st.lists(st.binary(min_size=8, max_size=8), min_size=1, max_size=5))
def test_what_is_written_is_read(tmp_path: Path, form: str, mapping: list[int], datas: list[bytes]) -> None:
    path = tmp_path / f"run{form}"
    rows = SignalRows(layouts_of(5, mapping))
    frames = [Frame(0x185, data, timestamp_s=BEGIN_S + number / 100) for number, data in enumerate(datas)]
    writer = write_file(path, rows, lambda frame: frame_seen(frame, rows.decoder).document())
    for frame in frames:
        writer.write(frame)
    writer.write(Frame(0x186, b"\0"))
    writer.close()
    assert (rows.frames, rows.other) == (len(frames), 1)
    again = SignalRows(layouts_of(5, mapping))
    found = read_values(path)
    assert [one.header for one in found.columns] == [one.header for one in again.columns]
    assert [one.signal.object for one in found.columns] == [one.signal.object for one in again.columns]
    read = list(found.rows)
    assert [cells for _, cells in read] == [again.row(frame) for frame in frames]
    assert [time_s for time_s, _ in read] == pytest.approx([frame.timestamp_s for frame in frames], abs=2e-6)


@given(mappings, mappings)
def test_columns_do_not_change_with_what_other_nodes_map(own: list[int], other: list[int]) -> None:
    alone, both = layouts_of(5, own), layouts_of(5, own)
    both.add(layouts_of(6, other).layouts)
    names = [column.header for column in all_columns(alone).values()]
    assert [column.header for column in all_columns(both).values()][: len(names)] == names
    assert len({column.header for column in all_columns(both).values()}) == len(own) + len(other)


def test_a_filter_chooses_signals() -> None:
    rows = SignalRows(layouts_of(5, [0x2000, 0x2001]), "2001")
    assert [column.header for column in rows.columns] == ["TPDO1 node 5 2001:00 [rpm]"]
    assert rows.row(Frame(0x185, b"\1\0\2\0")) == [2]
    assert SignalRows(layouts_of(5, [0x2000]), "tpdo2").columns == []


def damaged() -> Iterator[tuple[str, bytes, str]]:
    head = b"time,frame,TPDO1 node 5 2001:00 [rpm]\n"
    yield "a.csv", b"x,y\n1,2\n", "begins with no time"
    yield "a.csv", b"", "begins with no time"
    yield "a.csv", head + b"yesterday,TPDO1 node 5,7\n", "is not a time"
    yield "a.csv", head + b"2026-01-01T00:00:00Z,TPDO1 node 5\n", "2 cells, but the header has 3"
    yield "a.csv", head + b"\xff\xfe\n", "not UTF-8"
    yield "a.jsonl", b'{"schema":"dvtcli.frame/1"}\n', "no dvtcli.frame/1 document"
    yield "a.jsonl", b"[1]\n", "no dvtcli.frame/1 document"
    yield "a.parquet", b"PAR1 and no end", "not a complete Parquet file"


@pytest.mark.parametrize(
    ("name", "data", "says"), [pytest.param(*case, marks=of_parquet(case[0])) for case in damaged()]
)
def test_what_is_damaged_is_said(tmp_path: Path, name: str, data: bytes, says: str) -> None:
    (tmp_path / name).write_bytes(data)
    with pytest.raises(InputFileError, match=says):
        list(read_values(tmp_path / name).rows)


def test_what_is_no_json_is_said_with_its_line_and_column(tmp_path: Path) -> None:
    (tmp_path / "a.jsonl").write_bytes(b'\n{"schema": "dvtcli.other/1"}\n{"schema": x}\n')
    with pytest.raises(InputFileError) as wrong:
        list(read_values(tmp_path / "a.jsonl").rows)
    assert (wrong.value.place, wrong.value.why) == (f"{tmp_path / 'a.jsonl'}:3:12", "not JSON: Expecting value")


def test_a_signal_is_found_by_its_object_and_its_name(tmp_path: Path) -> None:
    path = tmp_path / "run.csv"
    path.write_text("time_s,3:606C:00 [rpm],3:5100:01 [V]\n0.0,5,48.0\n", encoding="utf-8")
    columns = dict(enumerate(read_values(path).columns))
    for word, number in (("606C", 0), ("3:5100:01", 1), ("5100:1", 1), ("3:606C:00 [rpm]", 0)):
        assert list(find_tracks([word], columns)) == [number]


@given(st.text(max_size=8), st.sampled_from(["=", "+", "-", "@", "\t", "\r"]))
def test_a_text_of_a_device_is_no_formula(text: str, first: str) -> None:
    """A spreadsheet runs what begins so: `=HYPERLINK(…)` as a device's name."""
    assert csv_text(first + text) == f"'{first}{text}"
    assert csv_text(f"x{text}") == f"x{text}"


_texts = st.text(st.sampled_from("a ,;\"'\n\r\t="), max_size=6)


@given(label=_texts, names=st.lists(_texts, min_size=1, max_size=3, unique=True), values=st.lists(_texts, max_size=3))
def test_any_name_and_text_stays_one_cell(label: str, names: list[str], values: list[str]) -> None:
    held = [*values, *[None] * len(names)][: len(names)]
    signals = tuple(Signal(f"n{name}") for name in names)
    layout = Layout(Service("pdo", f"L{label}"), signals, lambda _data: list(held))
    file = io.StringIO(newline="")
    writer = CsvWriter(file, SignalRows(Decoder({(0x181, False): layout})))
    writer.write(Frame(0x181, b"", timestamp_s=BEGIN_S))
    head, row = csv.reader(io.StringIO(file.getvalue(), newline=""))
    assert head == ["time", "frame", *(f"L{label} n{name}" for name in names)]
    assert row[1:] == [f"L{label}", *(csv_text(value) for value in held)]


@given(st.one_of(st.integers(), st.floats(allow_nan=False)))
def test_a_number_stays_a_number(number: float) -> None:
    assert float(csv_text(number)) == float(number)


@pytest.mark.parametrize("suffix", [".csv", ".jsonl"])
@pytest.mark.parametrize("length", [200_000, 2_000_000])
def test_a_long_cell_or_line_is_damage_of_the_file(tmp_path: Path, suffix: str, length: int) -> None:
    path = tmp_path / f"a{suffix}"
    path.write_text(f'time_s,a [V]\n0,"{"x" * length}"\n' if suffix == ".csv" else "\n{" + "x" * length)
    with pytest.raises(InputFileError) as damaged:
        list(read_values(path).rows)
    assert str(damaged.value.place).startswith(f"{path}:2")


#: a value of each kind: its type's name, its bits, the raw value, and value, raw value and text of the long layout
KINDS = (
    ("i8", -1, -1.0, -1, None),
    ("u8", 255, 255.0, 255, None),
    ("i64", -(1 << 63), -(2.0**63), -(1 << 63), None),
    ("u64", (1 << 63) - 1, 2.0**63, (1 << 63) - 1, None),
    ("u64", 1 << 63, 2.0**63, None, "9223372036854775808"),
    ("u64", (1 << 64) - 1, 2.0**64, None, "18446744073709551615"),
    ("bool", True, 1.0, 1, None),
    ("r32", 0.5, 0.5, None, None),
    ("vs", "=1+1", None, None, "=1+1"),
    ("os", b"\x01\xff", None, None, "01 FF"),
    ("us", "a\ud800", None, None, "a?"),
)


@pytest.mark.parametrize(("name", "raw", "value", "whole", "text"), KINDS)
def test_a_long_row_has_the_number_what_was_sent_and_the_text(
    name: str, raw: Value, value: float | None, whole: int | None, text: str | None
) -> None:
    assert long_cells(signal_of(name), raw) == (value, whole, text)


def test_a_long_row_has_the_unit_s_number_and_the_word() -> None:
    words = replace(signal_of("u16"), meaning=Scaling(values={5: "stopped"}))
    assert long_cells(words, 5) == (5.0, 5, "stopped")
    assert long_cells(words, 6) == (6.0, 6, None)
    scaled = replace(signal_of("i16"), meaning=Scaling("V", Fraction(1, 10)))
    assert long_cells(scaled, -15) == (-1.5, -15, None)
    by_dbc = replace(scaled, object="", meaning=Scaling("V"))
    assert long_cells(by_dbc, 14) == (14.0, None, None)


def signal_of(name: str) -> Signal:
    data_type = BY_SHORT_NAME[name]
    return Signal("x", "x", "2001:00", bits=data_type.bits or 16, data_type=data_type)


@pytest.mark.needs("pyarrow")
def test_types_of_the_wide_layout_follow_from_the_signal(tmp_path: Path) -> None:
    """Whatever the values are: with a unit a double, else signed, so that differences are right."""
    import pyarrow.compute
    import pyarrow.parquet

    rows = SignalRows(layouts_of(5, [0x2001, 0x2005]))  # rpm, and nothing in particular
    path = tmp_path / "a.parquet"
    writer = write_file(path, rows, lambda _: {}, ParquetForm("wide"))
    for number in (5, 3, 65535):
        writer.write(Frame(0x185, 2 * number.to_bytes(2, "little"), timestamp_s=BEGIN_S))
    writer.close()
    table = pyarrow.parquet.read_table(path)
    assert [str(kind) for kind in table.schema.types] == ["timestamp[us, tz=UTC]", "string", "double", "int64"]
    assert pyarrow.compute.pairwise_diff(table.column(3).combine_chunks()).to_pylist() == [None, -2, 65532]
    for name, kind in {"i8": "int64", "u32": "int64", "u56": "int64", "u64": "decimal128(20, 0)", "i64": "int64",
                       "r32": "double", "bool": "bool", "vs": "string"}.items():  # fmt: skip
        column = Column("x", signal_of(name))
        assert str(_schema(pyarrow, {"x": _kind(column)}, Origin()).field("x").type) == kind, name
        scaled = replace(column.signal, meaning=Scaling("V"))
        assert _kind(Column("x", scaled)) == "float64"


@pytest.mark.needs("pyarrow")
@given(st.lists(st.none() | st.integers(-(1 << 63), (1 << 64) - 1), max_size=20))
def test_arrays_hold_what_lists_do(cells: list[int | None]) -> None:
    """As `pyarrow.array` makes them, for each type that is written."""
    import pyarrow

    fitting = [None if cell is None or cell >= 1 << 63 else cell for cell in cells]
    for kind, values in (
        (pyarrow.int64(), fitting),
        (pyarrow.int32(), [None if cell is None else cell % 1000 for cell in cells]),
        (pyarrow.timestamp("us", tz="UTC"), fitting),
        (pyarrow.float64(), [None if cell is None else cell / 7 for cell in cells]),
        (pyarrow.bool_(), [None if cell is None else bool(cell % 2) for cell in cells]),
        (pyarrow.string(), [None if cell is None else "ä" * (cell % 5) for cell in cells]),
        (pyarrow.decimal128(20, 0), cells),
    ):
        made = cells_array(pyarrow, kind, values)
        made.validate(full=True)
        assert made.equals(pyarrow.array(values, kind)), kind


@pytest.mark.needs("pyarrow")
def test_the_wide_layout_has_an_end(tmp_path: Path) -> None:
    rows = SignalRows(layouts_of(5, [0x2000]))
    rows.columns *= MOST_COLUMNS + 1
    with pytest.raises(UsageError, match=f"takes {MOST_COLUMNS} signals, and there are {MOST_COLUMNS + 1}"):
        write_file(tmp_path / "a.parquet", rows, lambda _: {}, ParquetForm("wide"))
    assert not list(tmp_path.iterdir())


@pytest.mark.needs("pyarrow")
@pytest.mark.parametrize("layout", ["long", "wide"])
def test_a_parquet_file_that_is_damaged_anywhere_is_an_input_file_error(tmp_path: Path, layout: str) -> None:
    """Whichever byte is wrong: values, or an error with the file's place; also where only its rows are damaged."""
    path, rows = tmp_path / "a.parquet", SignalRows(layouts_of(5, [0x2000, 0x2005]))
    writer = WholeFile(path, rows, lambda _: {}, ParquetForm(layout))
    for number in range(40):
        writer.write(Frame(0x185, 2 * number.to_bytes(2, "little"), timestamp_s=BEGIN_S + number))
    writer.complete()
    whole, in_rows = path.read_bytes(), 0
    for at in range(4, len(whole), 5):
        for wrong in (whole[at] ^ 0xFF, whole[at] ^ 0x10):
            path.write_bytes(whole[:at] + bytes([wrong]) + whole[at + 1 :])
            damaged, read = None, None
            try:
                read = read_values(path).rows
                assert len(list(read)) <= 2 * 40
            except InputFileError as failed:
                damaged = failed
            in_rows += damaged is not None and read is not None
            assert damaged is None or (damaged.place == str(path) and (damaged.why or "column" in damaged.text))
    assert in_rows > 10


@pytest.mark.needs("pyarrow")
def test_a_parquet_file_of_somebody_else_is_read_or_said(tmp_path: Path) -> None:
    import pyarrow
    import pyarrow.parquet

    path = tmp_path / "a.parquet"
    times = pyarrow.array([BEGIN_S * 1_000_000, None], pyarrow.timestamp("us", tz="UTC"))
    for cells, says in (([[1], [2]], "no plain values"), ([1.0, 2.0], "a row without a time")):
        pyarrow.parquet.write_table(pyarrow.table({"time": times, "a [V]": cells}), path)
        with pytest.raises(InputFileError, match=says):
            list(read_values(path).rows)
