"""A frame's line of JSON, made of parts that are encoded once, is the JSON of its document."""

from __future__ import annotations

import json
from dataclasses import replace
from fractions import Fraction
from typing import Any

from hypothesis import given
from hypothesis import strategies as st

from dvtcli.cli.view.answers.frame_lines import FrameJson
from dvtcli.domain.datatypes import CanopenTime, Value
from dvtcli.domain.ports import Frame
from dvtcli.domain.scaling import Scaling, State
from dvtcli.operations.frames.explain_frame import frame_seen
from dvtcli.operations.results.frames import FrameSeen
from dvtcli.watch.decoder import Decoder, Layout, Signal
from dvtcli.watch.frame_reader import Reading
from dvtcli.watch.service import service_of

TEXTS = st.sampled_from(["", "V", "°C", 'a"b', "changing", '"changing"', "\x00\n", "m/s ", " ", "{}", "Ω"]) | st.text(
    max_size=5
)
FACTORS = st.fractions(max_denominator=1000).filter(bool)
SCALINGS = st.builds(
    Scaling,
    TEXTS,
    FACTORS | st.just(Fraction(1)),
    st.fractions(max_denominator=16) | st.just(Fraction(0)),
    st.just({}) | st.dictionaries(st.integers(-3, 3), TEXTS, max_size=2),
    st.just(()) | st.lists(st.builds(State, st.integers(0, 7), st.integers(0, 7), TEXTS), max_size=2).map(tuple),
    st.just({}) | st.dictionaries(st.integers(0, 7), TEXTS, max_size=2),
)
VALUES: st.SearchStrategy[Value | None] = st.one_of(
    st.none(),
    st.booleans(),
    st.integers(-(2**63), 2**64 - 1),
    st.integers(-3, 3),
    st.floats(),
    st.binary(max_size=4),
    st.text(max_size=3),
    st.just(CanopenTime(1, 2)),
)
READINGS = st.sampled_from([Reading("pdo"), Reading("pdo", "words", {"node": 1, "name": "é"}), Reading("other", '"')])
TIMES = st.floats(0, 4e9) | st.just(1.9999999)


def as_json(value: Any) -> str:
    return json.dumps(value, separators=(",", ":"))


@st.composite
def layouts(draw: st.DrawFn) -> Layout:
    names = draw(st.lists(TEXTS, min_size=1, max_size=4, unique=True))
    signals = tuple(Signal(name, name, draw(TEXTS), draw(SCALINGS)) for name in names)
    values = [draw(st.lists(VALUES, min_size=len(names), max_size=len(names))) for _ in range(3)]

    def read(data: bytes) -> list[Value | None]:
        return values[data[0] % len(values)]

    service = service_of(draw(st.sampled_from([0x181, 0x201, 0x7FF])), extended=False)
    return Layout(service, signals, read, source=draw(TEXTS), guess=draw(TEXTS))


@given(st.data())
def test_any_frames_are_the_json_of_their_documents(data: st.DataObject) -> None:
    addresses = [(0x181, False), (0x1234567, True)]
    decoder = Decoder({address: data.draw(layouts()) for address in addresses})
    lines = FrameJson(as_json)
    for _ in range(data.draw(st.integers(1, 12))):
        if data.draw(st.integers(0, 5)) == 0:  # the mappings are read again
            decoder = Decoder({address: data.draw(layouts()) for address in addresses})
        can_id, extended = data.draw(st.sampled_from([*addresses, (0x7, False)]))
        frame = Frame(
            can_id,
            data.draw(st.binary(min_size=1, max_size=8)),
            extended,
            remote=data.draw(st.integers(0, 5)) == 0,
            timestamp_s=data.draw(TIMES),
        )
        seen = frame_seen(frame, decoder, data.draw(READINGS)).chosen(data.draw(st.sampled_from(["", "", "v"])))
        assert lines.text(seen) == as_json(seen.document())


def test_each_constant_part_counts() -> None:
    """Of two frames that differ in one field only, each has its own line."""
    meaning = {"a": Scaling("V")}
    first = FrameSeen(Frame(0x181, b"\1"), "pdo", "TPDO1", 1, "tpdo1", {"a": 1}, meaning, objects={"a": "2000:00"})
    others = [
        replace(first, kind="other"),
        replace(first, node=2),
        replace(first, pdo=None),
        replace(first, scalings={"a": Scaling("A")}),
        replace(first, objects={}),
        replace(first, layout_from="file"),
        replace(first, layout_is_guess=True),
        replace(first, reading=Reading("pdo", "x")),
        replace(first, signals={"a": 2.5}),
        replace(first, signals={"a": True}),
        replace(first, frame=Frame(0x181, b"\1", remote=True)),
        replace(first, frame=Frame(0x181, b"\2")),
        replace(first, frame=Frame(0x181, b"\1", timestamp_s=3.0)),
        replace(first, frame=Frame(0x181, b"\1", extended=True)),
    ]
    lines = FrameJson(as_json)
    for seen in (first, *others, first):
        assert lines.text(seen) == as_json(seen.document())
    texts = {lines.text(seen) for seen in (first, *others)}
    assert len(texts) == len(others) + 1


def test_values_that_are_equal_keep_their_own_texts() -> None:
    """0.0 and -0.0 are equal, as 1, 1.0 and True are; each is written as it was received."""
    meaning = {"a": Scaling("V")}
    lines = FrameJson(as_json)
    for value in (0.0, -0.0, 0, False, 1, 1.0, True, float("inf"), float("-inf"), float("nan"), float("nan")):
        seen = FrameSeen(Frame(0x181, b"\1"), "pdo", "TPDO1", 1, "tpdo1", {"a": value}, meaning)
        assert lines.text(seen) == as_json(seen.document())
