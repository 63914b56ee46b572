"""Recordings of different devices are one table, which the programs of the documentation read whole."""

from __future__ import annotations

import csv
import json
import random
import re
import subprocess
import sys
from collections.abc import Iterator
from datetime import datetime
from hashlib import sha256
from pathlib import Path
from typing import Any

import pytest

from dvtcli.domain.ports import Frame
from dvtcli.files.recordings.recording_file import Recorder
from dvtcli.files.values.value_file import read_values
from tests.benchmarks.bench_values import peak_mb, recording
from tests.cli.commands.bench import Bench
from tests.files.recordings import BEGIN_S
from tests.process import PATIENCE_S, ROOT, dvtcli

pytestmark = [pytest.mark.needs("pyarrow"), pytest.mark.drawn(4, "recordings of a fleet")]

#: three devices, each with other PDOs
FLEET = {"press-1": "gen4@1", "press-2": "tmcm@3", "press-3": "roboteq@1"}
PAGE = ROOT / "docs" / "how-to" / "query-recordings.md"
#: a value as the CSV has it: who recorded it, when (µs), by which signal
Value = tuple[str, int, str, float]
COUNT = 40


def recorded(path: Path, pdos: list[dict[str, Any]]) -> None:
    """A recording of the TPDOs in *pdos* that are on, with any values."""
    drawn = random.Random(path.name)
    on = [pdo for pdo in pdos if pdo["pdo"].startswith("tpdo") and pdo["enabled"] and pdo["mapping"]]
    assert on
    with Recorder(path) as recorder:
        for number in range(COUNT):
            pdo = on[number % len(on)]
            recorder.write(
                Frame(pdo["cob_id"], drawn.randbytes((pdo["bits"] + 7) // 8), timestamp_s=BEGIN_S + number / 100)
            )


@pytest.fixture(scope="module")
def fleet(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A folder with `recordings`, and beside them each recording's CSV and its wide file."""
    folder = tmp_path_factory.mktemp("fleet")
    (folder / "recordings").mkdir()
    for source, node in FLEET.items():
        log = folder / f"{source}.log"
        with Bench((node,)) as bench:
            recorded(log, json.loads(bench.run("pdo --all --json").stdout)["pdos"])
            for target in (f"{source}.csv", f"recordings/{source}.parquet", f"{source}.parquet --layout wide"):
                words = f"--source {source}" if target.endswith(".parquet") else ""
                assert bench.run(f"decode {log} -o {folder}/{target} {words}").code == 0
    return folder


def of_csv(folder: Path) -> Iterator[Value]:
    """Each number of each CSV."""
    for source in FLEET:
        with (folder / f"{source}.csv").open(encoding="utf-8", newline="") as file:
            for row in csv.DictReader(file):
                time_us = round(datetime.fromisoformat(row.pop("time")).timestamp() * 1_000_000)
                title = row.pop("frame")
                for head, cell in row.items():
                    if cell:
                        number = float({"True": "1", "False": "0"}.get(cell, cell))
                        yield source, time_us, re.sub(r" \[.*\]$", "", head.removeprefix(f"{title} ")), number


def blocks(heading: str) -> list[str]:
    """The programs under *heading* of the page."""
    section = PAGE.read_text("utf-8").split(f"\n## {heading}\n")[1].split("\n## ")[0]
    return re.findall(r"^```py\n(.*?)^```$", section, re.M | re.S)


def ran(code: str, folder: Path, shown: str) -> list[list[Any]]:
    """What is *shown* of `table`, a DataFrame, when *code* has run in *folder*."""
    code += f"\nimport json\nprint('table', json.dumps({shown}))\n"
    done = subprocess.run(
        [sys.executable, "-c", code], cwd=folder, capture_output=True, encoding="utf-8", timeout=PATIENCE_S, check=False
    )
    assert done.returncode == 0, done.stderr
    found: list[list[Any]] = json.loads(
        done.stdout.rpartition("\ntable ")[2] if "\ntable " in done.stdout else done.stdout[6:]
    )
    return found


@pytest.mark.parametrize(
    "heading",
    [
        pytest.param("DuckDB", marks=pytest.mark.needs("duckdb")),
        pytest.param("pandas and pyarrow", marks=pytest.mark.needs("pandas")),
        pytest.param("Dask", marks=pytest.mark.needs("dask")),
    ],
)
def test_one_query_returns_every_value(fleet: Path, heading: str) -> None:
    (code,) = blocks(heading)
    shown = "[[row.source, row.time.timestamp(), row.object, row.name, row.value] for row in table.itertuples()]"
    rows = ran(code, fleet, shown)
    found = sorted(
        (source, round(time_s * 1_000_000), name if name.startswith(place) else f"{place} {name}", value)
        for source, time_s, place, name, value in rows
    )
    assert found == sorted(of_csv(fleet))
    assert {source for source, *_ in found} == set(FLEET)
    assert len(found) > COUNT * len(FLEET)


@pytest.mark.needs("duckdb")
def test_the_metadata_says_which_device_and_which_dvtcli(fleet: Path) -> None:
    from dvtcli import __version__

    (code,) = blocks("Which device, which file, which dvtcli")
    rows = ran(code, fleet, "table.values.tolist()")
    facts: dict[str, dict[str, str]] = {}
    for file, key, value in rows:
        facts.setdefault(Path(file).stem, {})[key] = value
    assert set(facts) == set(FLEET)
    for source, told in facts.items():
        assert (told["dvtcli.source"], told["dvtcli.layout"], told["dvtcli.version"]) == (source, "long", __version__)
        (node,) = json.loads(told["dvtcli.nodes"])
        assert node["node"] == int(FLEET[source].partition("@")[2])
        assert all(isinstance(node[name], int) for name in ("vendor", "product", "revision"))


def test_spark_reads_each_column_as_it_is_written(fleet: Path) -> None:
    """Spark reads signed whole numbers, doubles, texts and decimals, and UTC times of µs; all schemas are the same."""
    import pyarrow.parquet

    schemas = [pyarrow.parquet.ParquetFile(path).schema for path in sorted((fleet / "recordings").iterdir())]
    assert len(schemas) == len(FLEET)
    assert all(schema.equals(schemas[0]) for schema in schemas)
    wide = [pyarrow.parquet.ParquetFile(fleet / f"{source}.parquet").schema for source in FLEET]
    for schema in [schemas[0], *wide]:
        for column in map(schema.column, range(len(schema.names))):
            kind = json.loads(column.logical_type.to_json())
            match column.physical_type:
                case "DOUBLE" | "BOOLEAN" | "INT32":
                    assert kind["Type"] == "None"
                case "INT64" if column.name == "time":
                    assert (kind["Type"], kind["isAdjustedToUTC"], kind["timeUnit"]) == (
                        "Timestamp",
                        True,
                        "microseconds",
                    )
                case "INT64":
                    assert kind["Type"] == "None"
                case "BYTE_ARRAY":
                    assert kind["Type"] == "String"
                case other:
                    assert (other, kind["Type"]) == ("FIXED_LEN_BYTE_ARRAY", "Decimal")
    assert {row.compression for row in _chunks(fleet)} <= {"SNAPPY"}


def _chunks(folder: Path) -> Iterator[Any]:
    import pyarrow.parquet

    for path in folder.rglob("*.parquet"):
        told = pyarrow.parquet.ParquetFile(path).metadata
        for group in range(told.num_row_groups):
            yield from (told.row_group(group).column(number) for number in range(told.num_columns))


@pytest.mark.parametrize("source", list(FLEET))
def test_both_layouts_are_read_back(fleet: Path, source: str) -> None:
    """`plot` takes either; the long one has no column for a signal without a value."""
    wide, long = (read_values(fleet / folder / f"{source}.parquet") for folder in (".", "recordings"))
    names = [column.header for column in long.columns]
    assert set(names) <= {column.header for column in wide.columns}
    at = [[column.header for column in wide.columns].index(name) for name in names]
    rows = [(time_s, [cells[number] for number in at]) for time_s, cells in wide.rows]
    assert [row for row in rows if set(row[1]) != {None}] == list(long.rows)
    assert len(rows) == COUNT


def test_a_layout_is_of_parquet_alone(fleet: Path, tmp_path: Path) -> None:
    log = str(fleet / "press-1.log")
    for words in (["--layout", "long"], ["--source", "x"]):
        done = dvtcli("decode", log, "--eds", "gen4", "-o", str(tmp_path / "a.csv"), *words)
        assert (done.returncode, "only for a .parquet file" in done.stderr) == (2, True)
        assert dvtcli("decode", log, "--eds", "gen4", *words).returncode == 2
        assert dvtcli("log", str(tmp_path / "a.log"), "--sim", "gen4", *words).returncode == 2
    assert not list(tmp_path.iterdir())


@pytest.mark.long
@pytest.mark.drawn(1)
@pytest.mark.skipif(sys.platform != "linux", reason="the most memory of a process is read from /proc")
@pytest.mark.parametrize(("layout", "signals"), [("long", 8), ("long", 800), ("wide", 144)])
def test_a_conversion_takes_little_memory(tmp_path: Path, layout: str, signals: int) -> None:
    """However many signals there are; `python -m tests.benchmarks.bench_values` takes a million frames."""
    assert peak_mb(tmp_path, recording(tmp_path, 30_000, signals), ".parquet", layout) <= 150


def test_nodes_are_who_the_network_file_says(tmp_path: Path) -> None:
    """The serial number is in each row; the file's hash, the bit rate and the whole identity are in the metadata."""
    import pyarrow.parquet

    network, log = tmp_path / "press.yaml", tmp_path / "run.log"
    network.write_text(
        "nodes:\n  drive:\n    node_id: 1\n    profile: gen4\n    identity: {vendor: 0x1E, serial: 4711}\n"
        "    tpdo: {1: {enabled: true}, 2: {enabled: true}}\n", "utf-8"
    )  # fmt: skip
    log.write_text("(1.0) can0 281#44FFFFFF780088FF\n(2.0) can1 281#44FFFFFF780088FF\n(3.0) can1 181#3706\n", "ascii")
    done = dvtcli("-b", "250000", "decode", str(log), "-d", str(network), "-o", str(tmp_path / "a.parquet"))
    assert done.returncode == 0, done.stderr
    table = pyarrow.parquet.read_table(tmp_path / "a.parquet")
    rows = table.to_pylist()
    assert {(row["source"], row["node"], row["serial"]) for row in rows} == {("run.log", 1, 4711)}
    assert [row["bus"] for row in rows] == ["can0"] * 3 + ["can1"] * 4
    assert {row["object"]: (row["value"], row["raw"], row["unit"]) for row in rows[:3]} == {
        "606C:00": (-188.0, -188, "rpm"), "6077:00": (12.0, 120, "%"), "5100:02": (-7.5, -120, "A"),
    }  # fmt: skip
    assert (rows[-1]["value"], rows[-1]["raw"], rows[-1]["text"]) == (0x637, 0x637, "operation enabled")
    told = {key.decode(): value.decode() for key, value in table.schema.metadata.items()}
    assert told["dvtcli.network_file"] == "press.yaml"
    assert told["dvtcli.network_file_sha256"] == sha256(network.read_bytes()).hexdigest()
    assert told["dvtcli.bitrate"] == "250000"
    identity = {"node": 1, "vendor": 0x1E, "product": None, "revision": None, "serial": 4711}
    assert json.loads(told["dvtcli.nodes"]) == [identity]


def test_nodes_are_who_the_recording_says(tmp_path: Path) -> None:
    """Where its SDO transfers carry the identity, as a master reads it at the start."""
    import pyarrow.parquet

    frames = (
        "585#4318100467120000", "585#431810011E000000",
        "585#4300180185010000", "585#4F001A0001000000", "585#43001A0110004160", "185#3712",
    )  # fmt: skip
    log = tmp_path / "run.log"
    log.write_text("".join(f"({number}.0) can0 {frame}\n" for number, frame in enumerate(frames)), "ascii")
    done = dvtcli("decode", str(log), "-o", str(tmp_path / "a.parquet"))
    assert done.returncode == 0, done.stderr
    (row,) = [row for row in pyarrow.parquet.read_table(tmp_path / "a.parquet").to_pylist() if row["pdo"] == "tpdo1"]
    assert (row["node"], row["serial"], row["pdo"], row["object"], row["raw"]) == (
        5,
        0x1267,
        "tpdo1",
        "6041:00",
        0x1237,
    )


def test_nodes_are_who_they_say_themselves(tmp_path: Path) -> None:
    """`log` asks them; no text is made safe for a spreadsheet."""
    import pyarrow.parquet

    path = tmp_path / "run.parquet"
    done = dvtcli("--sim", "gen4", stdin=f"nmt start\nlog {path} --decode --duration 0.3 --source =press\n")
    assert done.returncode == 0, done.stderr
    table = pyarrow.parquet.read_table(path)
    (node,) = json.loads(table.schema.metadata[b"dvtcli.nodes"])
    assert {(row["serial"], row["source"]) for row in table.to_pylist()} == {(node["serial"], "=press")}
    assert node["vendor"] == 0x1E
