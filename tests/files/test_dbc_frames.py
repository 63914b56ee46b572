"""Frames that their DBC file does not describe: each signal that is there is read, and nothing is lost of the rest."""

from __future__ import annotations

import math
from pathlib import Path
from random import Random

import cantools.database
import pytest
from hypothesis import given
from hypothesis import strategies as st

from dvtcli.domain.ports import Frame
from dvtcli.errors import InputFileError
from dvtcli.files.dbc import read_dbc
from dvtcli.watch.decoder import Decoder
from dvtcli.watch.seen import FrameStore
from dvtcli.watch.table import all_columns, fill, find_tracks
from tests.cli.commands.bench import Bench
from tests.process import documents
from tests.small_eds import U16, U32, communication, mapping, plain, var

HEAD = 'VERSION ""\n\nBU_: A\n\n'
#: a multiplexor at byte 0, another one at byte 1 that is there only with 0, and a signal that is always there
NESTED = HEAD + (
    'BO_ 400 M: 8 A\n SG_ Mux M : 0|8@1+ (1,0) [0|0] "" A\n SG_ Sub m0M : 8|8@1+ (1,0) [0|0] "" A\n'
    ' SG_ Plain m1 : 8|16@1- (0.5,-3) [0|0] "V" A\n SG_ Deep m3 : 16|16@1+ (1,0) [0|0] "" A\n'
    ' SG_ Motorola : 55|16@0+ (1,0) [0|0] "" A\n\nBO_ 401 N: 8 A\n SG_ Z : 0|8@1+ (1,0) [0|0] "" A\n\n'
    "SG_MUL_VAL_ 400 Sub Mux 0-0;\nSG_MUL_VAL_ 400 Plain Mux 1-1;\nSG_MUL_VAL_ 400 Deep Sub 3-3;\n"
)


def decoder_of(folder: Path, text: str) -> Decoder:
    path = folder / "m.dbc"
    path.write_text(text, "cp1252")
    return Decoder(read_dbc(str(path)))


def expected(data: bytes) -> dict[str, float]:
    """What `NESTED` says of the signals that lie in *data* and that its multiplexors choose."""
    found: dict[str, float] = {}
    if len(data) >= 1:
        found["Mux"] = data[0]
    if data[:1] == b"\0" and len(data) >= 2:
        found["Sub"] = data[1]
        if data[1] == 3 and len(data) >= 4:
            found["Deep"] = int.from_bytes(data[2:4], "little")
    if data[:1] == b"\x01" and len(data) >= 3:
        found["Plain"] = int.from_bytes(data[1:3], "little", signed=True) * 0.5 - 3
    if len(data) >= 8:
        found["Motorola"] = int.from_bytes(data[6:8], "big")
    return found


@pytest.fixture(scope="module")
def nested(tmp_path_factory: pytest.TempPathFactory) -> Decoder:
    return decoder_of(tmp_path_factory.mktemp("dbc"), NESTED)


@given(
    st.builds(
        bytes.__add__,
        st.lists(st.sampled_from([0, 1, 3, 5, 255]), max_size=2).map(bytes),
        st.binary(max_size=10),
    )
)
def test_what_lies_in_a_frame_and_is_chosen_in_it_is_read(nested: Decoder, data: bytes) -> None:
    assert nested.values(Frame(400, data)) == expected(data)


@pytest.mark.parametrize(
    ("signals", "more", "data", "values"),
    [
        # a float of 24 bits: no such number, and its neighbour is one
        (' SG_ F : 0|24@1- (1,0) [0|0] "" A\n SG_ B : 24|8@1+ (1,0) [0|0] "" A\n', "SIG_VALTYPE_ 400 F : 1;\n",
         "0000000700000000", {"B": 7}),
        # a multiplexor that is not a number, and one that is infinite
        (' SG_ F M : 0|32@1- (1,0) [0|0] "" A\n SG_ B m1 : 32|8@1+ (1,0) [0|0] "" A\n'
         ' SG_ C : 40|8@1+ (1,0) [0|0] "" A\n', "SIG_VALTYPE_ 400 F : 1;\n", "0000C07F01090000", {"C": 9}),
        (' SG_ F M : 0|32@1- (1,0) [0|0] "" A\n SG_ B m1 : 32|8@1+ (1,0) [0|0] "" A\n'
         ' SG_ C : 40|8@1+ (1,0) [0|0] "" A\n', "SIG_VALTYPE_ 400 F : 1;\n", "0000807F01090000", {"C": 9}),
        # a factor that makes more of a value than any number holds
        (' SG_ F : 0|32@1+ (1e308,0) [0|0] "" A\n SG_ B : 32|8@1+ (1,0) [0|0] "" A\n', "",
         "0200000005000000", {"B": 5}),
        (' SG_ F : 0|32@1+ (0.5,0) [0|0] "" A\n SG_ B : 32|8@1+ (1,0) [0|0] "" A\n', "", "02", {}),
    ],
)  # fmt: skip
def test_one_signal_that_is_no_number_hides_no_other(
    tmp_path: Path, signals: str, more: str, data: str, values: dict[str, float]
) -> None:
    decoder = decoder_of(tmp_path, f"{HEAD}BO_ 400 M: 8 A\n{signals}\n{more}")
    frame = Frame(400, bytes.fromhex(data), timestamp_s=1.0)
    read = decoder.values(frame)
    assert {name: value for name, value in read.items() if name != "F"} == values
    store = FrameStore(decoder)
    store.take(frame)  # what the monitor counts of it
    tracks = find_tracks(["B"], all_columns(decoder))
    fill(tracks, [frame], decoder)
    assert all(math.isfinite(value) for track in tracks.values() for value in track.values)


RECORDED = ("191#0700000000000000", "190#0007000000000000", "190#0507000000000000", "190#00", "191#0900000000000000")


@pytest.fixture
def recording(tmp_path: Path) -> tuple[Path, Path]:
    (tmp_path / "m.dbc").write_text(NESTED)
    path = tmp_path / "r.log"
    path.write_text("".join(f"(17000000{n:02}.000000) can0 {frame}\n" for n, frame in enumerate(RECORDED)))
    return path, tmp_path / "m.dbc"


def test_a_recording_is_shown_to_its_end(recording: tuple[Path, Path]) -> None:
    path, dbc = recording
    with Bench(()) as bench:
        ran = bench.run(f"decode {path} -d {dbc} --json")
    assert ran.code == 0, ran.stderr
    assert [one["signals"] for one in documents(ran.stdout)] == [
        {"Z": 7}, {"Mux": 0, "Sub": 7, "Motorola": 0}, {"Mux": 5, "Motorola": 0}, {"Mux": 0}, {"Z": 9}
    ]  # fmt: skip


@pytest.mark.parametrize("line", ["decode {} -d {}", "decode {} -d {} --csv", "decode {} -d {} -o x.csv",
                                  "plot {} Mux -d {}", "plot {} Sub Z -d {}"])  # fmt: skip
def test_each_reader_of_a_recording_reads_it_whole(
    recording: tuple[Path, Path], line: str, monkeypatch: pytest.MonkeyPatch, tmp_path: Path
) -> None:
    monkeypatch.chdir(tmp_path)
    with Bench(()) as bench:
        ran = bench.run(line.format(*recording))
    assert ran.code == 0, ran.stderr


@pytest.mark.parametrize("frame", RECORDED)
def test_a_frame_is_explained_as_far_as_it_goes(recording: tuple[Path, Path], frame: str) -> None:
    with Bench(("gen4",)) as bench:
        ran = bench.run(f"explain {frame} -d {recording[1]} --json")
    assert ran.code == 0, ran.stderr


#: the name of each signal, where it lies by the DBC file, and in words
PLACED = {
    "Speed": ("0|16@1-", "bytes 0-1"), "Torque": ("7|16@0-", "bytes 0-1"), "Byte": ("23|8@0+", "byte 2"),
    "Bit": ("29|1@1+", "byte 3 bit 5"), "Flag": ("29|1@0+", "byte 3 bit 5"), "Odd": ("26|11@1+", "bits 26-36"),
    "Twelve": ("35|12@0+", "byte 4 bit 3 to byte 5 bit 0"), "Part": ("38|3@0-", "byte 4 bits 4-6"),
    "Whole": ("7|64@0+", "bytes 0-7"), "Last": ("63|1@1+", "byte 7 bit 7"),
}  # fmt: skip


@pytest.mark.parametrize("data", ["44FFFFFF780088FF", "0123456789ABCDEF", "FFFFFFFFFFFFFFFF", "01234567"])
def test_a_signal_is_explained_with_its_own_place_and_raw_value(data: str, tmp_path: Path) -> None:
    text = HEAD + "".join(
        f'BO_ {number} M{number}: 8 A\n SG_ {name} : {place} (0.5,-3) [0|0] "V" A\n\n'
        for number, (name, (place, _)) in enumerate(PLACED.items(), 400)
    )
    (tmp_path / "m.dbc").write_text(text)
    with Bench(()) as bench:
        for message in cantools.database.load_string(text, "dbc").messages:
            raw = message.decode(bytes.fromhex(data), scaling=False, decode_choices=False, allow_truncated=True)
            ran = bench.run(f"explain {message.frame_id:03X}#{data} -d {tmp_path / 'm.dbc'} --json")
            parts = {part["name"]: part for part in ran.document["parts"] if not part["in_can_id"]}
            assert parts.keys() == raw.keys()
            for name, part in parts.items():
                place, words = PLACED[name]
                start, bits = (int(number) for number in place.partition("@")[0].split("|"))
                assert (part["start_bit"], part["bits"], part["place"]) == (start, bits, words)
                assert part["byte_order"] == ("big" if "@0" in place else "little")
                assert part["raw"] == int(raw[name]) & (1 << bits) - 1
                assert float(part["text"].split()[0]) == pytest.approx(raw[name] * 0.5 - 3)


@pytest.mark.parametrize("split", ["", " --split-bits"])
def test_a_frame_is_explained_by_an_exported_dbc_as_by_the_mapping(split: str, tmp_path: Path) -> None:
    frames = ("181#3706E80300000000", "281#44FFFFFF780088FF")
    with Bench(("gen4@1",)) as bench:
        assert bench.run(f"export {tmp_path / 'a.dbc'}{split}").code == 0
        for frame in frames:
            mapped = bench.run(f"explain {frame} --json").document["parts"]
            found = bench.run(f"explain {frame} -d {tmp_path / 'a.dbc'} --json").document["parts"]
            by_mapping = {(part["start_bit"], part["bits"], part["raw"]) for part in mapped if not part["in_can_id"]}
            assert {(part["start_bit"], part["bits"], part["raw"]) for part in found if not part["in_can_id"]} <= {
                *by_mapping,
                *((bit, 1, int.from_bytes(bytes.fromhex(frame[4:]), "little") >> bit & 1) for bit in range(64)),
            }


#: bits of statuswords and controlwords that have a name in CiA 402-2, 8.4.1 and 8.4.2
STATUS_BITS = {
    0: "ready_to_switch_on", 1: "switched_on", 2: "operation_enabled", 3: "fault", 4: "voltage_enabled",
    5: "no_quick_stop", 6: "switch_on_disabled", 7: "warning", 9: "remote", 10: "target_reached",
    11: "internal_limit_active",
}  # fmt: skip
CONTROL_BITS = {
    0: "switch_on", 1: "enable_voltage", 2: "no_quick_stop", 3: "enable_operation", 7: "fault_reset", 8: "halt"
}  # fmt: skip


def eight_axes() -> str:
    """An EDS of a drive with eight axes: each word four times in a PDO."""
    eds = plain()
    eds.variable(0x1000, var("Device type", U32, 0x20192, "ro"))
    for axis in range(8):
        eds.variable(0x6040 + 0x800 * axis, var(f"Controlword {axis + 1}", U16, 0, "rww", 1))
        eds.variable(0x6041 + 0x800 * axis, var(f"Statusword {axis + 1}", U16, 0, "ro", 1))
    for index, word, base in ((0x1600, 0x6040, 0x200), (0x1A00, 0x6041, 0x180)):
        for number in (0, 1):
            objects = [(word + 0x800 * axis) << 16 | 16 for axis in range(4 * number, 4 * number + 4)]
            eds.record(index + number, f"Mapping {number + 1}", mapping(4, objects))
            can_id = f"$NODEID+0x{base + 0x100 * number:X}"
            eds.record(index - 0x200 + number, f"Communication {number + 1}", communication(can_id))
    return eds.text()


@pytest.mark.parametrize("words", ["export {} --split-bits", "eds convert net.yaml {} --split-bits"])
def test_status_and_controlwords_of_every_axis_are_signals_of_a_bit(words: str, tmp_path: Path) -> None:
    eds, dbc, network = tmp_path / "axes.eds", tmp_path / "axes.dbc", tmp_path / "net.yaml"
    eds.write_text(eight_axes(), "utf-8")
    network.write_text(f"nodes: {{axes: {{node_id: 1, eds: {eds}}}}}\n", "utf-8")
    with Bench((f"{eds}@1",)) as bench:
        ran = bench.run(words.format(dbc).replace("net.yaml", str(network)))
        assert ran.code == 0, ran.stderr
        data = Random(402).randbytes(8)
        explained = bench.run(f"explain 281#{data.hex()} -d {dbc} --json").document["parts"]
    database = cantools.database.load_file(dbc)
    assert {message.frame_id for message in database.messages} == {0x181, 0x201, 0x281, 0x301}
    for can_id, word, bits, first in (
        (0x181, "Statusword", STATUS_BITS, 1), (0x281, "Statusword", STATUS_BITS, 5),
        (0x201, "Controlword", CONTROL_BITS, 1), (0x301, "Controlword", CONTROL_BITS, 5),
    ):  # fmt: skip
        signals = {
            f"{word}_{first + axis}_{bits.get(bit, f'bit_{bit}')}": data[2 * axis + bit // 8] >> bit % 8 & 1
            for axis in range(4) for bit in range(16)
        }  # fmt: skip
        long_names = database.get_message_by_frame_id(can_id).decode(data)
        assert long_names == signals
    assert [part["raw"] for part in explained if not part["in_can_id"]] == [
        int.from_bytes(data, "little") >> bit & 1 for bit in range(64)
    ]


def _any_message(random: Random, number: int) -> str:
    """A message whose signals lie side by side: of any length, order, kind and scale, some chosen by the first one."""
    length = random.choice((1, 3, 8, 8, 8, 64))
    signals, floats, at = "", "", 0
    is_multiplexed = random.random() < 0.5
    while at < 8 * length:
        bits = min(8 if at == 0 else random.choice((1, 3, 8, 12, 16, 32, 64)), 8 * length - at)
        name, is_little = f"S{at}", random.random() < 0.5
        start = at if is_little else 8 * (at // 8) + 7 - at % 8
        if not is_little and at and (at % 8 or bits % 8):  # side by side in one order only
            is_little, start = True, at
        scale, offset = random.choice((("1", "0"), ("0.1", "-40"), ("2", "1"), ("2.0", "0.5"), ("-0.25", "0")))
        mux = ("M" if at == 0 else f"m{random.randrange(3)}") if is_multiplexed else ""
        if at and random.random() < 0.4:
            mux = ""
        if at == 0:
            scale, offset, start, is_little = "1", "0", 0, True
        signed = random.choice("+-") if at else "+"
        signals += f' SG_ {name} {mux} : {start}|{bits}@{int(is_little)}{signed} ({scale},{offset}) [0|0] "V" A\n'
        if at and bits in (16, 32, 64) and random.random() < 0.3:
            floats += f"SIG_VALTYPE_ {number} {name} : {1 if bits < 64 else 2};\n"
        at += bits
    return f"BO_ {number} M{number}: {length} A\n{signals}\n\0{floats}"


def test_values_are_those_that_cantools_decodes(tmp_path: Path) -> None:
    random = Random(31)
    made = [_any_message(random, number).split("\0") for number in range(1, 61)]
    text = HEAD + "".join(message for message, _ in made) + "".join(floats for _, floats in made)
    decoder = decoder_of(tmp_path, text)
    compared = 0
    for message in cantools.database.load_string(text, "dbc").messages:
        for _ in range(20):
            data = bytes([random.randrange(3)]) + random.randbytes(random.randrange(message.length + 2))
            try:
                theirs = message.decode(data, decode_choices=False, allow_truncated=True)
            except (cantools.Error, ValueError):
                continue
            ours = decoder.values(Frame(message.frame_id, data))
            assert ours == pytest.approx(theirs, nan_ok=True), (message, data)
            assert [type(value) for value in ours.values()] == [type(theirs[name]) for name in ours]
            compared += len(ours)
    assert compared > 3000


@pytest.mark.parametrize(
    ("text", "why"),
    [
        (  # 120 bytes, and a list of 4,000,000,000 numbers
            f'{HEAD}BO_ 1 a: 8 A\n SG_ m M : 0|8@1+ (1,0) [0|0] "" A\n SG_ s m0 : 8|8@1+ (1,0) [0|0] "" A\n\n'
            "SG_MUL_VAL_ 1 s m 0-4000000000;\n",
            "takes more than 480 MB",
        ),
        (f'{HEAD}BO_ 1 a: 8 A\n SG_ s : 0|{"9" * 5000}@1+ (1,0) [0|0] "" A\n', "no message has more than 4095 bytes"),
        (f"{HEAD}BO_ {'9' * 5000} a: 8 A\n", "is not a DBC file"),
    ],
    ids=("multiplexed by all numbers", "length", "CAN-ID"),
)
def test_a_short_file_that_says_large_things_is_an_error_of_the_file(tmp_path: Path, text: str, why: str) -> None:
    with pytest.raises(InputFileError) as refused:
        decoder_of(tmp_path, text)
    assert why in f"{refused.value} {refused.value.why}"


@pytest.mark.parametrize("multiplexors", ["1 a b 0-9;\nSG_MUL_VAL_ 1 b a 0-9;", "1 a a 0-9;"])
def test_multiplexors_in_a_circle_choose_nothing(tmp_path: Path, multiplexors: str) -> None:
    text = (
        f'{HEAD}BO_ 1 x: 8 A\n SG_ a m0M : 0|8@1+ (1,0) [0|0] "" A\n SG_ b m0M : 8|8@1+ (1,0) [0|0] "" A\n'
        f' SG_ c : 16|8@1+ (1,0) [0|0] "" A\n\nSG_MUL_VAL_ {multiplexors}\n'
    )
    try:
        decoder = decoder_of(tmp_path, text)
    except InputFileError:
        return  # cantools says so itself
    assert decoder.values(Frame(1, bytes(8))).get("c") == 0


def test_comments_and_names_of_values_move_no_line_and_hide_no_message(tmp_path: Path) -> None:
    """They are left out before the file is read; what only looks like them, in a string or a comment, is not."""
    text = (
        f'{HEAD}BO_ 1 a: 8 A\n SG_ s : 0|8@1+ (1,0) [0|0] "CM_ ;" A\n\nCM_ "one\nBO_ 2 b: 8 A\n\\"";\n// CM_ "\n'
        'VAL_ 1 s 1 "a;b" 0 "c" ;\nBO_ 3 c: 8 A\n SG_ t : 0|8@1+ (2,0) [0|0] "\nVAL_ x" A\n\n'
    )
    decoder = decoder_of(tmp_path, text)
    assert decoder.values(Frame(1, b"\x05")) == {"s": 5}
    assert decoder.values(Frame(3, b"\x05")) == {"t": 10}
    assert not decoder.values(Frame(2, b"\x05"))
    with pytest.raises(InputFileError) as wrong:
        decoder_of(tmp_path, text + "BO_ 4 ?\n")
    assert f"line {text.count(chr(10)) + 1}" in str(wrong.value.why)


@pytest.mark.parametrize("text", ['CM_ "a;', 'VAL_ 1 s 1 "a', "CM_ a\nBO_ 3 c: 8 A\n"])
def test_a_statement_that_does_not_end_is_an_error_of_the_file(tmp_path: Path, text: str) -> None:
    """Nothing behind it is left out without a word."""
    with pytest.raises(InputFileError):
        decoder_of(tmp_path, f"{HEAD}BO_ 1 a: 8 A\n\n{text}")
