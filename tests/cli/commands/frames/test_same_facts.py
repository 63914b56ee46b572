"""One recording says the same whichever way it is read: decode, --json, CSV, Parquet, and the monitor in a pipe."""

from __future__ import annotations

import csv
import io
import json
from pathlib import Path
from typing import Any

import pytest
from hypothesis import HealthCheck, example, given, settings
from hypothesis import strategies as st

from dvtcli.domain.typed_frame import READ_KINDS, frame_text, typed_frame
from dvtcli.operations.frames.watch_bus import stream, watching
from tests.cli.commands.bench import Bench
from tests.watch.test_sdo_transfers import by_blocks, in_segments

BEGIN_S = 1_700_000_000
_values = st.binary(min_size=1, max_size=30)


#: simulated nodes: TPDO2 of node 1, MPDOs of node 2 (SAM sent and taken, DAM taken), SRDOs of node 3
NODES = ("gen4@1", "mpdo@2", "safety@3")
_MPDOS, _SRDOS, _HEARTBEATS = (0x182, 0x202, 0x302), (0x101, 0x102, 0x103, 0x104), (0x701, 0x702, 0x703)
#: COB-IDs of a second SDO server of node 5, as a transfer tells them
_SECOND_SERVER = (0x5A1, 0x5A2)


def _hexed(can_id: int, data: bytes) -> str:
    return f"{can_id:03X}#{data.hex().upper()}"


def _mpdo(can_id: int, node: int, place: int, value: bytes) -> str:
    return _hexed(can_id, bytes([node]) + place.to_bytes(3, "little") + value)


def _second_server(value: bytes) -> list[str]:
    """Node 5 tells the COB-IDs of its second server, through which an object is read and a write is aborted."""
    told = [
        frame
        for sub_index, cob_id in enumerate(_SECOND_SERVER, 1)
        for frame in (
            _hexed(0x605, bytes([0x40, 0x01, 0x12, sub_index, 0, 0, 0, 0])),
            _hexed(0x585, bytes([0x43, 0x01, 0x12, sub_index]) + cob_id.to_bytes(4, "little")),
        )
    ]
    used = [
        _hexed(_SECOND_SERVER[not request], data)
        for request, data in (*in_segments(value, is_write=False), (False, bytes.fromhex("8000210300000206")))
    ]
    return [*told, *used]


def _transfer(frames: Any) -> list[str]:
    return [_hexed(0x605 if request else 0x585, data) for request, data in frames]


#: frames of a node that is not there, 5, and PDOs of the simulated nodes: nobody answers any of them
single = st.one_of(
    st.builds(lambda data: _hexed(0x281, data), st.binary(min_size=8, max_size=8)),
    st.builds(lambda command: _hexed(0x000, bytes([command, 5])), st.sampled_from([1, 2, 0x80, 0x81, 0x82, 0x33])),
    st.builds(lambda data: _hexed(0x085, data), st.binary(min_size=2, max_size=8)),
    st.builds(lambda state: _hexed(0x705, bytes([state])), st.sampled_from([0, 4, 5, 0x7F, 0x85, 9])),
    st.builds(lambda data: _hexed(0x100, data), st.binary(min_size=4, max_size=6)),
    st.builds(lambda data: _hexed(0x585, data), st.binary(min_size=8, max_size=8)),
    st.builds(lambda data: _hexed(0x605, data), st.binary(min_size=6, max_size=8)),
    st.builds(lambda data: _hexed(0x7E4, data), st.binary(min_size=8, max_size=8)),
    st.builds(
        lambda command, data: _hexed(0x7E5, bytes([command]) + data),
        st.sampled_from([0x40, 0x41, 0x42, 0x61]), st.binary(min_size=7, max_size=7),
    ),
    st.builds(
        lambda can_id, data: f"{can_id:08X}#{data.hex().upper()}", st.integers(0, 0x1FFFFFFF), st.binary(max_size=8)
    ),
    st.builds(
        _mpdo, st.sampled_from(_MPDOS), st.sampled_from([0x01, 0x02, 0x09, 0x80, 0x82, 0x85]),
        st.sampled_from([0x012000, 0x012001, 0x012100, 0x056000]), st.binary(min_size=4, max_size=4),
    ),
    st.builds(_hexed, st.sampled_from(_SRDOS), st.binary(min_size=1, max_size=2)),
    st.sampled_from(["080#", "080#07", "705#R", "6FF#10"]),
)  # fmt: skip
frames_of_a_bus = st.lists(
    st.one_of(
        single.map(lambda frame: [frame]),
        st.builds(lambda value, way: _transfer(in_segments(value, is_write=way)), _values, st.booleans()),
        st.builds(lambda value, way: _transfer(by_blocks(value, 4, iter(()), is_write=way)), _values, st.booleans()),
        st.builds(_second_server, _values),
    ),
    min_size=1, max_size=6,
).map(lambda parts: [frame for part in parts for frame in part])  # fmt: skip


#: each kind of frames, and each way of a transfer
EVERY_KIND = [
    "000#8105", "705#00", "705#05", "705#R", "705#85", "080#07", "100#80EE3602B33B", "085#2030810000000000",
    "7E5#4000000000000000", "281#0102030405060708", "18FF0102#0102",
    _mpdo(0x182, 2, 0x012000, b"\x05\0\0\0"), _mpdo(0x302, 0x82, 0x012100, b"\x05\0\0\0"), "101#05", "102#FA",
    "605#2F60600008000000", "585#8060600030000906", *_second_server(b"firmware 4"),
    *_transfer(in_segments(b"firmware 4", is_write=True)),
    *_transfer(by_blocks(b"firmware 4", 4, iter(()), is_write=False)),
]  # fmt: skip


def facts(document: dict[str, Any]) -> tuple[Any, ...]:
    """What a document says, but when."""
    return tuple(document[key] for key in ("cob_id", "data", "what", "text", "fields", "signals", "node"))


def monitored(bench: Bench, frames: list[str], only: frozenset[str] = frozenset()) -> list[dict[str, Any]]:
    """What the monitor in a pipe gives of *frames*, put on the bus meanwhile."""
    found: list[dict[str, Any]] = []
    with watching(bench.session, (1, 2, 3)) as watched:
        for frame in frames:
            sent = typed_frame(frame)
            bench.session.wire.send(sent)
        stream(watched, lambda seen: found.extend(each.document() for each in seen), duration_s=0.12, only=only)
    return [document for document in found if document["cob_id"] not in _HEARTBEATS]


@settings(max_examples=12, deadline=None, suppress_health_check=[HealthCheck.function_scoped_fixture])
@given(frames=frames_of_a_bus)
@example(frames=EVERY_KIND)
def test_a_recording_says_the_same_every_way(tmp_path: Path, frames: list[str]) -> None:
    pytest.importorskip("pyarrow")
    import pyarrow.parquet

    log, table = tmp_path / "run.log", tmp_path / "run.parquet"
    log.write_text("".join(f"({BEGIN_S + n}.000000) can0 {frame}\n" for n, frame in enumerate(frames)), "ascii")
    with Bench(NODES, in_real_time=True) as bench:
        documents = [json.loads(line) for line in bench.run(f"decode {log} --json").stdout.splitlines()]
        lines = bench.run(f"decode {log}").stdout.splitlines()
        rows = list(csv.reader(io.StringIO(bench.run(f"decode {log} --csv").stdout)))[1:]
        assert bench.run(f"decode {log} -o {table} --yes").code == 0
        live = monitored(bench, frames)
    assert [frame_text(typed_frame(frame)) for frame in frames] == [
        f"{one['cob_id']:0{8 if one['extended'] else 3}X}#{'R' if one['remote'] else one['data'].replace(' ', '')}"
        for one in documents
    ]
    if frames is EVERY_KIND:
        assert {one["what"] for one in documents} == set(READ_KINDS)
        assert {"SRDO1", "SDO2 answer"} <= {line.split("  ")[2].partition(" node")[0].rstrip() for line in lines}
    assert [facts(one) for one in live] == [facts(one) for one in documents]
    for line, document in zip(lines, documents, strict=True):
        assert line.endswith(document["text"])
        assert all(f"{name}=" in line for name in document["signals"])
    told = [one for one in documents if one["text"] or one["signals"]]
    assert [row[0] for row in rows] == [one["time"] for one in told]
    for row, document in zip(rows, told, strict=True):
        assert row[1].endswith(f": {document['text']}" if document["text"] else "TPDO2 node 1")
        assert len([cell for cell in row[2:] if cell]) == len(document["signals"])
    in_words = [row for row in pyarrow.parquet.read_table(table).to_pylist() if row["name"] in READ_KINDS]
    assert [(row["text"], row["name"], row["object"], row["node"]) for row in in_words] == [
        (one["text"], one["what"], one["fields"].get("object") or None, one["node"]) for one in told if one["text"]
    ]


@pytest.mark.parametrize(
    ("only", "kept"),
    [
        ("emcy", ["085#2030810000000000"]),
        ("sdo-abort,nmt", ["000#8005", "585#8060600030000906"]),
        ("sdo", ["605#2F60600008000000", "585#8060600030000906"]),
        ("heartbeat", ["705#00", "705#05"]),
        ("boot-up", ["705#00"]),
        ("pdo", ["281#0000000000000000"]),
    ],
)
def test_only_thins_out_every_way(only: str, kept: list[str], tmp_path: Path) -> None:
    frames = [
        "000#8005", "605#2F60600008000000", "585#8060600030000906", "085#2030810000000000", "705#00", "705#05",
        "281#0000000000000000",
    ]  # fmt: skip
    log, jsonl = tmp_path / "run.log", tmp_path / "run.jsonl"
    log.write_text("".join(f"({BEGIN_S + n}.000000) can0 {frame}\n" for n, frame in enumerate(frames)), "ascii")
    with Bench(("gen4",), in_real_time=True) as bench:
        found = [json.loads(line) for line in bench.run(f"decode {log} --json --only {only}").stdout.splitlines()]
        rows = bench.run(f"decode {log} --csv --only {only}").stdout.splitlines()[1:]
        assert bench.run(f"decode {log} -o {jsonl} --only {only}").code == 0
        live = [facts(one) for one in monitored(bench, frames, frozenset(only.split(",")))]
    assert live == [facts(one) for one in found]
    assert [f"{one['cob_id']:03X}#{one['data'].replace(' ', '')}" for one in found] == kept
    assert len(rows) == len(kept)
    assert [facts(json.loads(line)) for line in jsonl.read_text("utf-8").splitlines()] == [facts(one) for one in found]


def test_a_kind_that_there_is_not_is_a_usage_error() -> None:
    ran = Bench(()).run("decode run.log --only pdos")
    ran.failed(2, "'pdos' is not a kind of frames; the kinds are pdo, mpdo")


def test_log_thins_out_values_and_refuses_to_do_so_with_frames(tmp_path: Path) -> None:
    """What it would not do is not taken in silence: a .log has all frames."""
    path = tmp_path / "run.jsonl"
    with Bench(("gen4",), in_real_time=True) as bench:
        for line in ("write 1017 20", "set tpdo1 --timer 20", "nmt start 1"):
            assert bench.run(line).code == 0
        kinds = {}
        for words in ("", " --only heartbeat"):
            assert bench.run(f"log {path} --decode --duration 0.3 --yes{words}").code == 0
            kinds[words] = {json.loads(line)["what"] for line in path.read_text("utf-8").splitlines()}
        refused = bench.run(f"log {tmp_path / 'run.log'} --only heartbeat")
    assert kinds == {"": {"pdo", "heartbeat"}, " --only heartbeat": {"heartbeat"}}
    assert (refused.code, "--only: only with --decode" in refused.stderr) == (2, True)
    assert not (tmp_path / "run.log").exists()
