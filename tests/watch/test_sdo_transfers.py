"""SDO transfers followed frame by frame: of the product's own client, and drawn ones that lose segments."""

from __future__ import annotations

from collections.abc import Iterator

import pytest
from hypothesis import given
from hypothesis import strategies as st

from dvtcli.domain.ports import Frame
from dvtcli.operations.values.object_values import scalings_of
from dvtcli.watch.decoder import Decoder
from dvtcli.watch.frame_reader import FrameReader
from dvtcli.watch.known_node import KnownNode
from dvtcli.watch.sdo_transfers import MOST_KEPT, SdoStep, SdoTransfers
from tests.cli.commands.bench import Bench

#: a frame of a client, or an answer
Sent = tuple[bool, bytes]
_INDEX, _SUB = 0x2100, 3
_OBJECT = _INDEX.to_bytes(2, "little") + bytes([_SUB])


def followed(frames: Iterator[Sent]) -> list[SdoStep]:
    transfers = SdoTransfers()
    return [transfers.take((1, "SDO"), data, request=request) for request, data in frames]


def in_segments(value: bytes, *, is_write: bool) -> Iterator[Sent]:
    """A transfer in segments as CiA 301, 7.2.4.3.3 to 7.2.4.3.6 draw it."""
    size = len(value).to_bytes(4, "little")
    if is_write:
        yield True, b"\x21" + _OBJECT + size
        yield False, b"\x60" + _OBJECT + bytes(4)
    else:
        yield True, b"\x40" + _OBJECT + bytes(4)
        yield False, b"\x41" + _OBJECT + size
    pieces = [value[at : at + 7] for at in range(0, len(value), 7)] or [b""]
    for number, piece in enumerate(pieces):
        toggle, is_last = (number & 1) << 4, number == len(pieces) - 1
        data = bytes([toggle | (7 - len(piece)) << 1 | is_last]) + piece.ljust(7, b"\0")
        if is_write:
            yield True, data
            yield False, bytes([0x20 | toggle]) + bytes(7)
        else:
            yield True, bytes([0x60 | toggle]) + bytes(7)
            yield False, data


def by_blocks(value: bytes, block: int, lost: Iterator[int], *, is_write: bool) -> Iterator[Sent]:
    """A transfer by blocks of *block* segments; the receiver takes *lost* fewer than were sent, block by block."""
    size = len(value).to_bytes(4, "little")
    if is_write:
        yield True, b"\xc6" + _OBJECT + size
        yield False, b"\xa4" + _OBJECT + bytes([block, 0, 0, 0])
    else:
        yield True, b"\xa4" + _OBJECT + bytes([block, 0, 0, 0])
        yield False, b"\xc6" + _OBJECT + size
        yield True, b"\xa3" + bytes(7)
    pieces, at = [value[at : at + 7].ljust(7, b"\0") for at in range(0, len(value), 7)], 0
    while at < len(pieces):
        sent = pieces[at : at + block]
        for number, piece in enumerate(sent, 1):
            is_last = at + number == len(pieces)
            yield is_write, bytes([number | (0x80 if is_last else 0)]) + piece
        taken = max(0, len(sent) - next(lost, 0))
        yield not is_write, bytes([0xA2, taken, block]) + bytes(5)
        at += taken
    unused = -len(value) % 7
    yield is_write, bytes([0xC1 | unused << 2]) + bytes(7)
    yield not is_write, b"\xa1" + bytes(7)


@given(st.binary(min_size=1, max_size=300), st.booleans())
def test_segments_become_the_value(value: bytes, is_write: bool) -> None:
    *steps, last = followed(in_segments(value, is_write=is_write))
    assert (last.step, last.is_write, last.object, last.data, last.size) == (
        "done",
        is_write,
        "2100:03",
        value,
        len(value),
    )
    assert {step.object for step in steps} == {"2100:03"}
    assert "done" not in {step.step for step in steps}


@given(st.binary(min_size=1, max_size=900), st.integers(1, 127), st.lists(st.integers(0, 5), max_size=8), st.booleans())
def test_blocks_become_the_value_though_segments_are_lost(
    value: bytes, block: int, lost: list[int], is_write: bool
) -> None:
    *steps, last = followed(by_blocks(value, block, iter(lost), is_write=is_write))
    assert (last.step, last.is_write, last.object, last.data) == ("done", is_write, "2100:03", value)
    assert "unknown" not in {step.step for step in steps}


def without_size(frames: list[Sent]) -> list[Sent]:
    """*frames* of a transfer that does not announce its size."""
    bits = {0x21: 1, 0x41: 1, 0xC6: 2}
    return [
        (request, bytes([data[0] & ~bits[data[0]]]) + data[1:4] + bytes(4) if number < 2 and data[0] in bits else data)
        for number, (request, data) in enumerate(frames)
    ]


@given(
    st.binary(min_size=15, max_size=300), st.booleans(), st.booleans(), st.booleans(), st.integers(1, 20),
    st.booleans(), st.data(),
)  # fmt: skip
def test_a_value_is_said_only_if_all_its_segments_were_recorded(
    value: bytes, is_write: bool, is_by_blocks: bool, is_repeated: bool, block: int, has_size: bool, data: st.DataObject
) -> None:
    """Of a transfer of which one frame is lost, or recorded twice, no other value is said than was sent."""
    frames = [*by_blocks(value, block, iter(()), is_write=is_write)] if is_by_blocks else [
        *in_segments(value, is_write=is_write)]  # fmt: skip
    frames = frames if has_size else without_size(frames)
    number = data.draw(st.integers(2, len(frames) - 1))
    frames[number : number + 1] = [frames[number]] * 2 if is_repeated else []
    for step in followed(iter(frames)):
        if step.step == "done":
            assert (step.data, step.size) == (value, len(value))


def test_missing_segments_are_counted() -> None:
    frames = [*in_segments(bytes(range(21)), is_write=False)]
    *_, last = followed(iter(frames[:4] + frames[6:]))
    assert (last.step, last.data, last.position, last.size) == ("incomplete", b"", 14, 21)
    assert last.object == "2100:03"


@pytest.mark.parametrize(("lost", "has_size", "says"), [
    (slice(4, 6), True, "incomplete: 14 of 21 bytes"), (slice(4, 6), False, "incomplete: 14 bytes"),
    (slice(0, 0), True, ""),
])  # fmt: skip
def test_a_transfer_without_its_value_says_so(lost: slice, has_size: bool, says: str) -> None:
    frames = [*in_segments(bytes(range(1, 22)), is_write=False)]
    frames = frames if has_size else without_size(frames)
    del frames[lost]
    reader = FrameReader(Decoder(), lambda _node_id: KnownNode(None, scalings_of(None, None)))
    *_, last = [reader.read(Frame(0x601 if request else 0x581, data)) for request, data in frames]
    if says:
        assert last.text == f"read 2100:03: {says}"
        assert (last.facts["step"], "value" in last.facts) == ("incomplete", False)
    else:
        assert (last.facts["step"], last.facts["bytes"]) == ("done", 21)


@given(st.integers(800, 889), st.integers(1, 100), st.booleans())
def test_segments_of_a_block_whose_beginning_is_missing_are_unknown(size: int, first: int, is_write: bool) -> None:
    """Only the first frame of the recording may look like another one."""
    value = bytes(number % 251 for number in range(size))
    segments = [frame for frame in by_blocks(value, 127, iter(()), is_write=is_write) if frame[0] == is_write][1:-1]
    _, *steps = followed(iter(segments[first:]))
    assert {step.step for step in steps} == {"unknown"}


@given(st.lists(st.tuples(st.booleans(), st.binary(max_size=9)), max_size=30))
def test_any_bytes_are_followed(frames: list[Sent]) -> None:
    """What is no transfer of the standard ends in no error; nothing that was not sent is done."""
    for step in followed(iter(frames)):
        assert len(step.data) <= MOST_KEPT
        assert step.step != "done" or step.place is not None


def test_an_abort_ends_the_transfer() -> None:
    frames = [*in_segments(bytes(20), is_write=True)][:3]
    steps = followed(iter([*frames, (False, b"\x80" + _OBJECT + b"\x00\x00\x02\x06"), (True, bytes(8))]))
    assert [(step.step, step.is_write, step.code) for step in steps[3:]] == [
        ("abort", True, 0x06020000),
        ("unknown", None, 0),
    ]


def test_the_products_own_transfers_are_followed() -> None:
    """What the session reads of a simulated node is what its frames say."""
    transfers, done = SdoTransfers(), dict[str, bytes]()

    def take(frame: Frame, _sent: bool) -> None:
        if frame.can_id in (0x601, 0x581):
            step = transfers.take((1, "SDO"), frame.data, request=frame.can_id == 0x601)
            assert step.step != "unknown"
            if step.step == "done":
                done[step.object] = step.data

    with Bench(("gen4",)) as bench:
        bench.session.open_network().bus.tap(take)
        node = bench.session.node(1)
        read = {place: node.sdo.upload(*place) for place in ((0x1008, 0), (0x1018, 1), (0x1017, 0))}
        assert bench.run("write 1017 1000").code == 0
    assert {place: done[f"{place[0]:04X}:{place[1]:02X}"] for place in [(0x1008, 0), (0x1018, 1)]} == {
        place: data for place, data in read.items() if place != (0x1017, 0)
    }
    assert done["1017:00"] == (1000).to_bytes(2, "little")
