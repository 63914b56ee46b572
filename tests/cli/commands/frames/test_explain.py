"""`explain FRAME`: every bit named."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import pytest
from hypothesis import given
from hypothesis import strategies as st

from dvtcli.domain.object_scalings import ObjectScalings
from dvtcli.domain.ports import Frame
from dvtcli.operations.frames.explain_frame import explained
from dvtcli.simulator.network.family_file import family_eds
from dvtcli.watch.decoder import Decoder
from dvtcli.watch.frame_parts import frame_parts
from dvtcli.watch.frame_reader import FrameReader
from dvtcli.watch.known_node import KnownNode
from tests.cli.commands.bench import Bench
from tests.laws.bench import dictionary

_IDS = st.sampled_from([0x000, 0x080, 0x081, 0x100, 0x181, 0x581, 0x601, 0x701, 0x7E4, 0x7E5, 0x7FF]) | st.integers(
    0, 0x7FF
)


@given(_IDS, st.binary(max_size=8), st.booleans())
def test_no_bit_is_left_out(can_id: int, data: bytes, extended: bool) -> None:
    """Every bit of the data and of the CAN-ID lies in a part, whatever the frame is."""
    parts = frame_parts(
        Frame(can_id, data, extended=extended), Decoder(), lambda _node: KnownNode(None, ObjectScalings())
    )
    for in_id, length in ((True, 29 if extended else 11), (False, 8 * len(data))):
        bits = [bit for one in parts if one.in_id is in_id for bit in range(one.start_bit, one.start_bit + one.bits)]
        assert sorted(bits) == list(range(length))
    number = int.from_bytes(data, "little")
    assert all(one.raw == number >> one.start_bit & (1 << one.bits) - 1 for one in parts if not one.in_id)


#: what is wrong with a frame
_WRONG = ("too long", "too short", "more than a day", "reserved: SYNC", "reserved node-ID")


@given(
    st.sampled_from([0x000, 0x080, 0x085, 0x100, 0x605, 0x585, 0x705]),
    st.binary(max_size=8) | st.sampled_from([b"\x10\x23\x01", b"\x80\x05", b"\x80\xc8", b"\x7f\0"]),
    st.sampled_from(["", "gen4"]),
)  # fmt: skip
def test_the_title_and_the_table_of_a_frame_agree(can_id: int, data: bytes, family: str) -> None:
    """Both show what is wrong with a frame, and the same NMT command, state and emergency."""
    node = KnownNode(dictionary(family) if family else None, ObjectScalings())
    shown = explained(Frame(can_id, data), FrameReader(Decoder(), lambda _node: node))
    title, table = shown.reading.text, "\n".join(f"{part.name}: {part.text}" for part in shown.parts)
    if data:
        assert [wrong for wrong in _WRONG if wrong in title] == [wrong for wrong in _WRONG if wrong in table]
    for part in shown.parts:
        is_same = part.name in ("NMT state", "emergency error code") or (can_id == 0 and len(data) > 1)
        if is_same and not part.in_id and part.text != "reserved" and part.start_bit < 16:
            assert part.text in title


def said(frame: str, *, bench: Bench | None = None) -> dict[str, Any]:
    """What each part of *frame* says, by its name."""
    ran = (bench or Bench(())).run(f"explain {frame} --json")
    assert ran.code == 0, ran.stderr
    return {one["name"]: one["text"] or one["raw"] for one in ran.document["parts"]}


@pytest.mark.parametrize(
    ("frame", "name", "text"),
    [
        ("185#10", "function code", "TPDO1 by the pre-defined connection set"),
        ("581#8000180000000206", "abort code", "object does not exist in the object dictionary"),
        ("601#4000180100000000", "client command specifier", "initiate upload"),
        ("601#2B171000E8030000", "data", "1000 ms"),
        ("601#C22018010A000000", "size", "10 bytes"),
        ("081#1081010000000000", "emergency error code", "CAN overrun"),
        ("081#1081110000000000", "error register", "generic, communication"),
        ("000#8105", "command specifier", "reset-node"),
        ("000#8105", "node-ID", "node 5"),
        ("705#00", "NMT state", "boot-up"),
        ("080#07", "counter", "7"),
        ("100#0000000001 00".replace(" ", ""), "days since 1984-01-01", "1984-01-02"),
        ("7E5#11050000", "node-ID", "5"),
        ("7E4#1101000000000000", "error code", "it does not support this node-ID (error code 1)"),
        ("7E5#5100000000800001", "bit checked", "none: who is there"),
    ],
)
def test_a_service_is_said_in_the_standards_words(frame: str, name: str, text: str) -> None:
    assert said(frame)[name] == text


def test_a_pdo_is_read_by_the_nodes_mapping() -> None:
    """TPDO1 of the Gen4 carries the statusword: its bits have names; nothing but uploads is sent."""
    with Bench(("gen4",)) as bench:
        sent: list[Frame] = []
        bench.session.open_network().bus.tap(lambda frame, ours: sent.append(frame) if ours else None)
        found = said("181#3706", bench=bench)
        assert found["Statusword"] == "operation enabled (0x0637)"
        assert found["operation enabled"] == "set"
        assert {frame.can_id for frame in sent} <= {0x601}
        assert 0x181 not in {frame.can_id for frame in sent}


def test_an_sdo_is_named_by_eds_and_by_a_network_file(tmp_path: Path) -> None:
    """The index has its name, with and without the node."""
    eds = family_eds("gen4")
    by_eds = Bench((), {"eds": str(eds)}).run("explain 601#4017100000000000").stdout
    assert "Producer heartbeat time" in by_eds
    network = tmp_path / "press.yaml"
    network.write_text("nodes:\n  drive:\n    node_id: 5\n    profile: gen4\n", "utf-8")
    by_file = Bench(()).run(f"explain 605#4017100000000000 --dbc {network}")
    assert "Producer heartbeat time" in by_file.stdout, by_file.stderr


def test_what_is_no_frame_is_exit_2() -> None:
    ran = Bench(()).run("explain 185##1027")
    assert (ran.code, "CAN FD" in ran.stderr, "185#1027" in ran.stderr) == (2, True, True)


@pytest.mark.parametrize("line", ["explain 189#3700", "decode {log}", "plot {log} statusword"])
def test_eds_takes_a_family_and_says_what_is_no_file(line: str, tmp_path: Path) -> None:
    """A word that is no file is no bug of ours, also where no bus is opened."""
    log = tmp_path / "run.log"
    log.write_text("(1.0) can0 189#3700\n", "ascii")
    missing = Bench((), {"eds": "nothere.eds"}).run(line.format(log=log))
    missing.failed(2, "nothere.eds: No such file")
    family = Bench((), {"eds": "generic"}).run(line.format(log=log))
    assert (family.code, "a bug" in family.stderr) == (0, False)


@pytest.mark.parametrize(
    ("frame", "name", "words"),
    [
        ("000#01", "command specifier", "start; too short: an NMT command has 2 bytes"),
        ("080#F0", "counter", "240"),
        ("080#F1", "counter", "reserved: SYNC counts from 1 to 240 at most"),
        ("080#00", "counter", "reserved: SYNC counts from 1 to 240 at most"),
        ("100#FF5B26050100", "ms since midnight", "23:59:59.999"),
        ("100#005C26050100", "ms since midnight", "more than a day has"),
        ("100#005C26050100", "days since 1984-01-01", "1984-01-02"),
    ],
)
def test_a_value_that_the_standard_does_not_have_is_none(frame: str, name: str, words: str) -> None:
    assert said(frame)[name] == words


def test_a_remote_frame_to_a_heartbeat_is_node_guarding() -> None:
    assert "node guarding request, node 5" in Bench(()).run("explain 705#R").stdout
