"""A DBC file of a recording: only what its SDO transfers say, and cantools reads by it what our decoder reads."""

from __future__ import annotations

import tempfile
from collections.abc import Iterator, Sequence
from functools import cache
from pathlib import Path
from typing import Any

import cantools
import pytest
from hypothesis import given
from hypothesis import strategies as st

import dvtcli
from dvtcli.domain.pdo import PdoMappingEntry
from dvtcli.domain.ports import Frame
from dvtcli.errors import UsageError
from dvtcli.files.recordings.recording_file import Recorder
from dvtcli.operations.frames.layouts import live_decoder
from dvtcli.simulator.network.family_file import family_eds
from dvtcli.watch.decoder import Decoder
from dvtcli.watch.sdo_transfers import ReceivedObjects
from tests.cli.commands.bench import Bench, Ran

NODE = 5
Place = tuple[int, int]


def request(*data: int) -> Frame:
    return Frame(0x600 + NODE, bytes(data).ljust(8, b"\0"))


def answer(*data: int) -> Frame:
    return Frame(0x580 + NODE, bytes(data).ljust(8, b"\0"))


BOOT_UP = Frame(0x700 + NODE, b"\0")


def multiplexer(place: Place) -> bytes:
    return place[0].to_bytes(2, "little") + bytes([place[1]])


def uploaded(place: Place, data: bytes) -> list[Frame]:
    return [request(0x40, *multiplexer(place)), answer(0x43 | (4 - len(data)) << 2, *multiplexer(place), *data)]


def downloaded(place: Place, data: bytes) -> list[Frame]:
    command = 0x23 | (4 - len(data)) << 2
    return [request(command, *multiplexer(place), *data), answer(0x60, *multiplexer(place))]


def uploaded_in_segments(place: Place, data: bytes) -> list[Frame]:
    parts = list(pieces(data))
    frames = [request(0x40, *multiplexer(place)), answer(0x41, *multiplexer(place), len(data))]
    for number, (part, last) in enumerate(parts):
        toggle = number % 2 << 4
        frames += [request(0x60 | toggle), answer(toggle | (7 - len(part)) << 1 | last, *part)]
    return frames


def downloaded_in_segments(place: Place, data: bytes) -> list[Frame]:
    frames = [request(0x21, *multiplexer(place), len(data)), answer(0x60, *multiplexer(place))]
    for number, (part, last) in enumerate(pieces(data)):
        toggle = number % 2 << 4
        frames += [request(toggle | (7 - len(part)) << 1 | last, *part), answer(0x20 | toggle)]
    return frames


def pieces(data: bytes) -> Iterator[tuple[bytes, int]]:
    for start in range(0, len(data), 7):
        yield data[start : start + 7], int(start + 7 >= len(data))


WAYS = (uploaded, downloaded, uploaded_in_segments, downloaded_in_segments)


def received(frames: Sequence[Frame]) -> dict[Place, bytes]:
    objects = ReceivedObjects()
    for frame in frames:
        objects.take(frame)
    return dict(objects.values(NODE).values)


def recorded(path: Path, frames: Sequence[Frame]) -> Path:
    with Recorder(path) as recorder:
        for number, frame in enumerate(frames):
            recorder.write(Frame(frame.can_id, frame.data, frame.extended, frame.remote, 1_700_000_000 + number / 1000))
    return path


places = st.tuples(st.integers(0x1A00, 0x1A03), st.integers(0, 8))


@given(st.lists(st.tuples(places, st.binary(min_size=1, max_size=4), st.sampled_from(WAYS))))
def test_the_last_value_that_was_heard_counts_however_it_came(
    transfers: list[tuple[Place, bytes, object]],
) -> None:
    frames = [frame for place, data, way in transfers for frame in way(place, data)]  # type: ignore[operator]
    assert received(frames) == {place: data for place, data, _ in transfers}


@given(places, st.binary(min_size=15, max_size=60), st.booleans(), st.data())
def test_a_value_of_which_a_segment_is_missing_is_not_held(
    place: Place, value: bytes, is_read: bool, data: st.DataObject
) -> None:
    frames = (uploaded_in_segments if is_read else downloaded_in_segments)(place, value)
    missing = data.draw(st.integers(1, len(frames) // 2 - 2))
    del frames[2 * missing : 2 * missing + 2]
    assert received(frames) == {}
    assert received([*downloaded(place, b"\1"), *frames]) == {place: b"\1"}


@given(st.binary(min_size=8, max_size=889), st.integers(1, 126))
def test_pieces_of_a_block_are_no_commands(data: bytes, number: int) -> None:
    before, place = uploaded((0x1A00, 0), b"\1"), (0x1F50, 1)
    segments = [bytes([n % 127 + 1, *data[n * 7 : n * 7 + 7]]) for n in range(number)]
    up = [request(0xA4, *multiplexer(place), 127), answer(0xC6, *multiplexer(place)), request(0xA3),
          *(answer(*one) for one in segments), request(0xA2, number, 127), answer(0xC1), request(0xA1)]  # fmt: skip
    down = [request(0xC6, *multiplexer(place)), answer(0xA4, *multiplexer(place), 127),
            *(request(*one) for one in segments), answer(0xA2, number, 127), request(0xC1), answer(0xA1)]  # fmt: skip
    after = downloaded((0x1A01, 0), b"\2")
    for block in (up, down):
        assert received([*before, *block, *after]) == {(0x1A00, 0): b"\1", (0x1A01, 0): b"\2"}


def test_what_a_node_refused_or_never_answered_is_not_held() -> None:
    place = (0x1A00, 1)
    ask, _ = downloaded(place, b"\1\2\3\4")
    assert received([ask, answer(0x80, *multiplexer(place), 0, 0, 4, 6)]) == {}
    assert received([ask, *uploaded((0x1000, 0), b"\7\0\0\0")]) == {(0x1000, 0): b"\7\0\0\0"}
    assert received([ask, answer(0x60, *multiplexer((0x1A00, 2)))]) == {}
    assert received([ask, answer(0x80, *multiplexer(place)), answer(0x60, *multiplexer(place))]) == {}


def test_a_boot_up_takes_back_what_was_not_stored() -> None:
    one, other = downloaded((0x1A00, 0), b"\1"), downloaded((0x1A00, 0), b"\2")
    store, restore = (downloaded((index, 1), data) for index, data in ((0x1010, b"save"), (0x1011, b"load")))
    assert received([*one, BOOT_UP]) == {}
    assert received([*one, *store, *other, BOOT_UP]) == {(0x1A00, 0): b"\1"}
    assert received([*one, *store, *restore, BOOT_UP]) == {}
    assert received([*one, store[0], answer(0x80, *multiplexer((0x1010, 1))), BOOT_UP]) == {}


class Passed:
    """*frames* of a bus on which two nodes are set up and read, and what decodes them by the nodes themselves."""

    def __init__(self, frames: list[Frame], decoder: Decoder) -> None:
        self.frames = frames
        self.decoder = decoder


@pytest.fixture(scope="module")
def passed() -> Passed:
    frames: list[Frame] = []
    with Bench(("gen4@1", "generic@5")) as bench:
        stop = bench.session.open_network().bus.tap(lambda frame, _ours: frames.append(frame))
        for line in ("map tpdo1 6041 606C --event --timer 50", "pdo", "read 1018", "node 5", "pdo", "read 1018"):
            ran = bench.run(line)
            assert ran.code == 0, ran
        stop()
        return Passed(frames, live_decoder(bench.session, (1, 5)))


def converted(path: Path) -> tuple[str, Ran]:
    """The DBC file that is made of the recording at *path*, and what was said."""
    target = path.with_suffix(".dbc")
    with Bench(()) as bench:
        ran = bench.run(f"eds convert {path} {target} --yes")
    return target.read_text("cp1252") if ran.code == 0 else "", ran


@given(st.binary(min_size=8, max_size=8))
def test_cantools_reads_by_it_what_our_decoder_reads_by_the_nodes(passed: Passed, data: bytes) -> None:
    database = made(tuple(passed.frames))
    layouts = {address: one for address, one in passed.decoder.layouts.items() if one.signals}
    assert {(one.frame_id, one.is_extended_frame) for one in database.messages} == layouts.keys()
    assert len(layouts) > 4
    for (can_id, extended), layout in layouts.items():
        message = database.get_message_by_frame_id(can_id)
        frame = Frame(can_id, data[: message.length], extended)
        ours, theirs = passed.decoder.values(frame), message.decode(frame.data, decode_choices=False)
        for signal in layout.signals:
            (name,) = (one.name for one in message.signals if (one.comment or "").startswith(f"0x{signal.object}"))
            raw = ours[signal.key]
            assert isinstance(raw, int)
            assert float(theirs[name]) == pytest.approx(float(signal.meaning.number(raw)), rel=1e-12)


@cache
def made(frames: tuple[Frame, ...]) -> Any:
    """What cantools reads in the DBC file of *frames*."""
    with tempfile.TemporaryDirectory() as folder:
        text, ran = converted(recorded(Path(folder) / "run.log", frames))
    said = "warning: TPDO1 of node 1 had other settings before: its last setting is used\n"
    assert (ran.code, ran.stderr) == (0, said), ran
    return cantools.database.load_string(text, "dbc")


def test_what_was_set_last_counts_and_that_it_was_otherwise_is_said(passed: Passed, tmp_path: Path) -> None:
    mapping = uploaded((0x1A00, 0), b"\1") + uploaded(
        (0x1A00, 1), PdoMappingEntry(0x2000, 0, 16).raw.to_bytes(4, "little")
    )
    cob_id = uploaded((0x1800, 1), (0x185).to_bytes(4, "little"))
    other = downloaded((0x1A00, 1), PdoMappingEntry(0x2001, 0, 32).raw.to_bytes(4, "little"))
    text, ran = converted(recorded(tmp_path / "run.log", [*mapping, *cob_id, *other]))
    assert "SG_ Object_2001_00 : 0|32@1+" in text
    assert "2000" not in text
    assert "TPDO1 of node 5 had other settings before" in ran.stderr
    assert "node 5 has no EDS" in ran.stderr


def test_a_mapping_that_is_not_all_there_is_refused_with_what_is_missing(tmp_path: Path) -> None:
    cob_id = uploaded((0x1800, 1), (0x185).to_bytes(4, "little"))
    half = [*cob_id, *uploaded((0x1A00, 0), b"\2"), *uploaded((0x1A00, 2), b"\x10\0\0\x20")]
    text, ran = converted(recorded(tmp_path / "run.log", half))
    assert (text, ran.code) == ("", 2)
    assert "TPDO1 of node 5: 1A00:01 was not received" in ran.stderr
    text, ran = converted(recorded(tmp_path / "run.asc", [Frame(0x185, b"12345678")]))
    assert (text, ran.code) == ("", 2)
    assert "does not show the mapping of its PDOs" in ran.stderr
    entry = PdoMappingEntry(0x2000, 0, 16).raw.to_bytes(4, "little")
    whole = [*cob_id, *uploaded((0x1A00, 0), b"\1"), *uploaded((0x1A00, 1), entry)]
    text, ran = converted(recorded(tmp_path / "run.log", [*whole, BOOT_UP]))
    assert (text, ran.code) == ("", 2)
    assert "TPDO1 of node 5: no frame was received after the node's last boot-up" in ran.stderr


def test_nodes_are_chosen_and_one_that_says_nothing_is_named(passed: Passed, tmp_path: Path) -> None:
    path = recorded(tmp_path / "run.log", passed.frames)
    with Bench((), {"node": (5, 9)}) as bench:
        ran = bench.run(f"eds convert {path} {tmp_path / 'run.dbc'}")
    assert ran.code == 0, ran
    assert "1 node, " in ran.stdout
    assert "left out: node 9: no mapping received" in ran.stdout


def test_a_program_gives_the_file_that_has_the_names(tmp_path: Path) -> None:
    entry = PdoMappingEntry(0x606C, 0, 32).raw.to_bytes(4, "little")
    frames = [*uploaded((0x1800, 1), (0x185).to_bytes(4, "little")), *uploaded((0x1A00, 0), b"\1"),
              *uploaded((0x1A00, 1), entry)]  # fmt: skip
    path, target = recorded(tmp_path / "run.log", frames), tmp_path / "run.dbc"
    assert dvtcli.convert(path, target, eds=family_eds("gen4")) == ()
    assert "SG_ Velocity_actual_value : 0|32@1-" in target.read_text("cp1252")
    with pytest.raises(UsageError):
        dvtcli.convert(tmp_path / "none.log", target, yes=True)
