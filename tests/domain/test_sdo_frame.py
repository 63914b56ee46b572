"""Where a frame carries the value of an object that is to be shown nowhere, in every form that an SDO transfer has."""

from __future__ import annotations

from binascii import crc_hqx
from collections.abc import Callable, Iterator
from dataclasses import dataclass

import pytest
from hypothesis import given
from hypothesis import strategies as st

from dvtcli.domain.ports import Frame
from dvtcli.domain.sdo_frame import SdoValues

SECRET, OTHER = (0x5000, 2), (0x1F50, 1)
REQUEST, ANSWER = 0x601, 0x581


@dataclass(frozen=True)
class Said:
    """One frame of a transfer; from *first* on it is value."""

    can_id: int
    data: bytes
    first: int | None = None


def multiplexer(place: tuple[int, int]) -> bytes:
    return place[0].to_bytes(2, "little") + bytes(place[1:])


def padded(data: bytes, to: int = 8) -> bytes:
    return data.ljust(to, b"\0")


def expedited_write(place: tuple[int, int], value: bytes) -> Iterator[Said]:
    part = value[:4]
    yield Said(REQUEST, bytes([0x23 | (4 - len(part)) << 2]) + multiplexer(place) + padded(part, 4), 4)
    yield Said(ANSWER, padded(bytes([0x60]) + multiplexer(place)))


def short_write(place: tuple[int, int], value: bytes) -> Iterator[Said]:
    """As somebody types it who leaves the rest of the eight bytes out."""
    yield Said(REQUEST, bytes([0x22]) + multiplexer(place) + value[:4], 4)
    yield Said(ANSWER, bytes([0x80]) + multiplexer(place) + bytes.fromhex("00000805"))


def echoed_write(place: tuple[int, int], value: bytes) -> Iterator[Said]:
    """A device that repeats in reserved bytes what it took."""
    part = padded(value[:4], 4)
    yield Said(REQUEST, bytes([0x22]) + multiplexer(place) + part, 4)
    yield Said(ANSWER, bytes([0x60]) + multiplexer(place) + part, 4 if any(part) else None)


def expedited_read(place: tuple[int, int], value: bytes) -> Iterator[Said]:
    part = value[:4]
    yield Said(REQUEST, padded(bytes([0x40]) + multiplexer(place)))
    yield Said(ANSWER, bytes([0x43 | (4 - len(part)) << 2]) + multiplexer(place) + padded(part, 4), 4)


def segments(value: bytes) -> Iterator[bytes]:
    for number, start in enumerate(range(0, max(len(value), 1), 7)):
        part = value[start : start + 7]
        yield bytes([(number & 1) << 4 | (7 - len(part)) << 1 | (start + 7 >= len(value))]) + padded(part, 7)


def segmented_write(place: tuple[int, int], value: bytes) -> Iterator[Said]:
    yield Said(REQUEST, bytes([0x21]) + multiplexer(place) + len(value).to_bytes(4, "little"), 4)
    yield Said(ANSWER, padded(bytes([0x60]) + multiplexer(place)))
    for data in segments(value):
        yield Said(REQUEST, data, 1)
        yield Said(ANSWER, padded(bytes([0x20 | data[0] & 0x10])))


def segmented_read(place: tuple[int, int], value: bytes) -> Iterator[Said]:
    yield Said(REQUEST, padded(bytes([0x40]) + multiplexer(place)))
    yield Said(ANSWER, bytes([0x41]) + multiplexer(place) + len(value).to_bytes(4, "little"), 4)
    for data in segments(value):
        yield Said(REQUEST, padded(bytes([0x60 | data[0] & 0x10])))
        yield Said(ANSWER, data, 1)


def in_blocks(value: bytes, size: int) -> Iterator[tuple[bytes, bool]]:
    parts = [value[start : start + 7] for start in range(0, max(len(value), 1), 7)]
    for number, part in enumerate(parts):
        is_last = number == len(parts) - 1
        yield bytes([number % size + 1 | is_last << 7]) + padded(part, 7), is_last or number % size == size - 1


def block_end(value: bytes) -> bytes:
    return padded(bytes([0xC1 | (-len(value) % 7) << 2]) + crc_hqx(value, 0).to_bytes(2, "little"))


def block_write(place: tuple[int, int], value: bytes, size: int = 127) -> Iterator[Said]:
    yield Said(REQUEST, bytes([0xC6]) + multiplexer(place) + len(value).to_bytes(4, "little"), 4)
    yield Said(ANSWER, padded(bytes([0xA4]) + multiplexer(place) + bytes([size])))
    for data, ends in in_blocks(value, size):
        yield Said(REQUEST, data, 1)
        if ends:
            yield Said(ANSWER, padded(bytes([0xA2, data[0] & 0x7F, size])))
    yield Said(REQUEST, block_end(value), 1)
    yield Said(ANSWER, padded(bytes([0xA1])))


def small_block_write(place: tuple[int, int], value: bytes) -> Iterator[Said]:
    return block_write(place, value, 3)


def block_read(place: tuple[int, int], value: bytes) -> Iterator[Said]:
    yield Said(REQUEST, padded(bytes([0xA4]) + multiplexer(place) + bytes([127])))
    yield Said(ANSWER, bytes([0xC6]) + multiplexer(place) + len(value).to_bytes(4, "little"), 4)
    yield Said(REQUEST, padded(bytes([0xA3])))
    for data, ends in in_blocks(value, 127):
        yield Said(ANSWER, data, 1)
        if ends:
            yield Said(REQUEST, padded(bytes([0xA2, data[0] & 0x7F, 127])))
    yield Said(ANSWER, block_end(value), 1)
    yield Said(REQUEST, padded(bytes([0xA1])))


Form = Callable[[tuple[int, int], bytes], Iterator[Said]]
FORMS: tuple[Form, ...] = (
    expedited_write, short_write, echoed_write, expedited_read, segmented_write, segmented_read, block_write,
    small_block_write, block_read,
)  # fmt: skip
ABORTS = (Said(REQUEST, bytes.fromhex("8000500200000405")), Said(ANSWER, bytes.fromhex("8000500200000006")))


@st.composite
def transfers(draw: st.DrawFn, place: tuple[int, int]) -> list[Said]:
    """A transfer of *place*: whole, broken off with an abort by either side, or with a frame twice or missing."""
    form = draw(st.sampled_from(FORMS))
    said = list(form(place, draw(st.binary(min_size=1, max_size=1200))))
    what = draw(st.sampled_from(("whole", "aborted", "aborted and gone on", "twice", "one missing")))
    if what == "whole":
        return said
    at = draw(st.integers(1, len(said)))
    if what == "twice":
        return [*said[:at], said[at - 1], *said[at:]]
    if what == "one missing":
        return said[:2] + [one for number, one in enumerate(said) if number >= 2 and number != at]
    left = said[at:] if what == "aborted and gone on" else []
    return [*said[:at], draw(st.sampled_from(ABORTS)), *left]


def told(frames: list[Said], *, unknown: bool = True) -> list[tuple[bytes, bool]]:
    follow = SdoValues({SECRET}, unknown=unknown)
    return [(frame.data, hidden) for frame, hidden in (follow.without(Frame(one.can_id, one.data)) for one in frames)]


@given(st.lists(st.sampled_from((SECRET, OTHER)).flatmap(lambda place: st.tuples(st.just(place), transfers(place)))))
def test_no_byte_of_the_value_is_left_in_any_form_of_a_transfer(done: list[tuple[tuple[int, int], list[Said]]]) -> None:
    said = [(place, one) for place, frames in done for one in frames]
    for unknown in (True, False):
        for (place, one), (data, hidden) in zip(said, told([one for _, one in said], unknown=unknown), strict=True):
            if place == SECRET and one.first is not None and len(one.data) > one.first:
                assert hidden, one
                assert data == one.data[: one.first] + bytes(len(one.data) - one.first)
                assert len(data) == len(one.data)


@pytest.mark.parametrize("ends", [Said(ANSWER, padded(b"\xa1")), *ABORTS])
@pytest.mark.parametrize("form", [block_write, segmented_write, expedited_write])
def test_what_begins_behind_a_block_that_is_over_is_no_segment_of_it(form: Form, ends: Said) -> None:
    """Also where its command is the number that the next segment would have had."""
    (begins, *rest) = form(SECRET, b"\x11\x22\x33")
    before = list(block_write(SECRET, bytes(range(1, 201)) * 5))[: 2 + (begins.data[0] & 0x7F) - 1]
    frames = [*before, ends, begins, *rest]
    (data, hidden) = told(frames)[len(before) + 1]
    assert (data, hidden) == (begins.data[:4] + bytes(4), True)


@given(st.data())
def test_nothing_of_a_segment_is_left_whose_beginning_nobody_saw(data: st.DataObject) -> None:
    said = list(data.draw(st.sampled_from((segmented_write, segmented_read)))(SECRET, data.draw(st.binary(min_size=1))))
    cut = said[data.draw(st.integers(2, len(said))) :]
    for one, (shown, _) in zip(cut, told(cut), strict=True):
        assert one.first is None or shown[one.first :] == bytes(8 - one.first)


@pytest.mark.parametrize("form", FORMS, ids=lambda form: str(form.__name__))
@given(value=st.binary(min_size=1, max_size=300), secret=st.binary(min_size=1, max_size=300))
def test_values_of_other_objects_are_shown_behind_it_as_before(form: Form, value: bytes, secret: bytes) -> None:
    before = [one for kind in FORMS for one in kind(SECRET, secret)]
    for unknown in (True, False):
        said = list(form(OTHER, value))
        assert told(said, unknown=unknown) == [(one.data, False) for one in said]
        behind = told([*before, *said], unknown=unknown)[len(before) :]
        assert behind == [(one.data, False) for one in said]


@pytest.mark.parametrize(
    "frame",
    [
        Frame(0x181, bytes.fromhex("2B00500244440000")),
        Frame(0x600, bytes.fromhex("2B00500244440000")),
        Frame(0x601, bytes.fromhex("2B00500244440000"), extended=True),
        Frame(0x601, b"", remote=True, dlc=8),
        Frame(0x601, b""),
        Frame(0x601, bytes.fromhex("2B005002")),
    ],
)
def test_what_is_no_sdo_or_carries_nothing_is_left_as_it_is(frame: Frame) -> None:
    assert SdoValues({SECRET}, unknown=True).without(frame) == (frame, False)


def test_what_an_abort_repeats_of_a_part_is_not_told_and_its_code_is() -> None:
    """A server that knows of no transfer takes a segment for a request, and its data for the object's address."""
    part = Said(REQUEST, bytes.fromhex("0B44440000000000"))
    abort = Said(ANSWER, bytes.fromhex("8044440001000405"))
    assert told([part, abort])[1] == (bytes.fromhex("8000000001000405"), True)
    assert told([*list(segmented_write(SECRET, b"DD"))[:2], part, part, part, abort])[-1][1]
    assert told([*list(segmented_write(OTHER, b"DD"))[:2], part, abort])[-1] == (abort.data, False)


def test_an_abort_is_told_as_it_is() -> None:
    said = [*list(segmented_write(SECRET, b"1234567890"))[:3], *ABORTS]
    assert [hidden for _, hidden in told(said)][-2:] == [False, False]


def test_a_beginning_that_is_said_twice_is_shown_as_it_is_once() -> None:
    for said in (list(block_write(SECRET, b"DDDD")), list(block_read(SECRET, b"DDDD"))[1:]):
        shown = [data for data, _ in told([said[0], *said])]
        assert shown[0] == shown[1] == said[0].data[:4] + bytes(4)
        assert not any(b"D" in data for data in shown)
