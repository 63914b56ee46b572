"""DBC files that we write: cantools reads in them what our own decoder reads in the frames, whatever is mapped."""

from __future__ import annotations

import re
from dataclasses import replace
from fractions import Fraction
from pathlib import Path

import cantools
import pytest
from hypothesis import given
from hypothesis import strategies as st

from dvtcli.domain.cob_id import CobId
from dvtcli.domain.datatypes import BY_SHORT_NAME
from dvtcli.domain.network.network_state import NetworkState, NodeState
from dvtcli.domain.object_dictionary import ObjectDictionary, ObjectType, OdEntry, OdObject
from dvtcli.domain.object_scalings import ObjectRange, ObjectScalings, ScalingRule
from dvtcli.domain.pdo import Pdo, PdoCommunicationParameter, PdoConfig, PdoMappingEntry
from dvtcli.domain.ports import Frame
from dvtcli.domain.scaling import Scaling
from dvtcli.files.dbc import LONGEST_NAME, DbcMessage, DbcSignal, Names, dbc_bytes, decimal
from dvtcli.operations.exchange.export_dbc import SERVICES, DbcOptions, NetworkMessages, network_messages
from dvtcli.watch.decoder import Decoder, pdo_layouts

TPDO1, RPDO1 = Pdo.parse("tpdo1"), Pdo.parse("rpdo1")
ODD = 'Gr\u00f6\u00dfe "\\" \u03bc;\n BO_ 1 x: 8 y'
KINDS = [kind for kind in BY_SHORT_NAME.values() if kind.limits is not None or kind.short in ("r32", "r64")]


def config(mapping: tuple[PdoMappingEntry, ...], can_id: int = 0x185, *, extended: bool = False) -> PdoConfig:
    cob_id = CobId(can_id, True, True, extended)
    return PdoConfig(PdoCommunicationParameter(cob_id, 255, None, 20, None), mapping)


def described(*entries: OdEntry) -> ObjectDictionary:
    return ObjectDictionary({one.index: OdObject(one.index, one.name, ObjectType.VAR, {0: one}) for one in entries})


def bytes_of(found: NetworkMessages) -> bytes:
    return dbc_bytes(found.nodes, found.messages)


@st.composite
def nodes(draw: st.DrawFn) -> tuple[NodeState, ObjectScalings]:
    """A node with one TPDO of any objects that fit into a frame, dummies among them."""
    left, mapping, entries, rules = 64, [], [], {}
    for number in range(draw(st.sampled_from([1, 3, 8, 64]))):
        kind = draw(st.sampled_from(KINDS))
        whole = kind.bits or 0
        bits = whole if kind.limits is None else draw(st.integers(1, whole))
        if bits > left:
            continue
        left -= bits
        if draw(st.integers(0, 4)) == 0:
            mapping.append(PdoMappingEntry(kind.code if kind.code <= 7 else 5, 0, bits))
            continue
        index = 0x2000 + number
        factor = draw(st.sampled_from(["1", "1/256", "0.1", "-0.25", "1/3", "1000"]))
        offset = draw(st.sampled_from(["0", "-40", "0.5"]))
        physical = Scaling(draw(st.sampled_from(["", "V", "\u00b0C", ODD])), Fraction(factor), Fraction(offset))
        words = draw(st.dictionaries(st.integers(-3, 3), st.text(max_size=8), max_size=3))
        rules[ObjectRange(index, index)] = ScalingRule(Scaling(physical.unit, physical.factor, physical.offset, words))
        mapping.append(PdoMappingEntry(index, 0, bits))
        known = draw(st.integers(0, 9)) > 0
        name = draw(st.sampled_from([f"Signal {number}", "Speed", ODD, "VERSION", "7", "\u901f\u5ea6", "long " * 12]))
        entries.append(OdEntry(index, 0, name, kind if known else None, low=-1 if known else None))
    sent = config(tuple(mapping), draw(st.sampled_from([0x185, 0x1FFF_FFF0])), extended=True)
    return NodeState(
        5, draw(st.sampled_from(["drive", ODD, ""])), {TPDO1: sent}, {}, described(*entries)
    ), ObjectScalings([rules])


@given(nodes(), st.binary(min_size=8, max_size=8))
def test_cantools_reads_what_our_decoder_reads(made: tuple[NodeState, ObjectScalings], data: bytes) -> None:
    node, scalings = made
    written = bytes_of(network_messages(NetworkState((node,)), {5: scalings}))
    assert written == bytes_of(network_messages(NetworkState((node,)), {5: scalings}))
    (message,) = cantools.database.load_string(written.decode("cp1252"), "dbc").messages
    cob_id = node.pdos[TPDO1].communication.cob_id
    assert (message.frame_id, message.is_extended_frame, message.cycle_time) == (cob_id.can_id, True, 20)
    decoder = Decoder(pdo_layouts(5, node.pdos, node.dictionary, scalings))
    frame = Frame(cob_id.can_id, data[: message.length], extended=True)
    ours = decoder.values(frame)
    theirs = message.decode(frame.data, decode_choices=False)
    signals = decoder.layout(frame).signals
    assert len(ours) == len(theirs) == len(signals)
    for signal, one in zip(signals, message.signals, strict=True):
        raw = ours[signal.key]
        assert isinstance(raw, int | float)
        off = 1e-12 * float(abs(raw * float(signal.meaning.factor)) + abs(signal.meaning.offset))
        exact = float(signal.meaning.number(raw))
        assert float(theirs[one.name]) == pytest.approx(exact, rel=1e-12, abs=off, nan_ok=True)
        assert one.comment is not None
        assert one.comment.startswith(f"0x{signal.object}")


@given(st.lists(st.text(max_size=50) | st.sampled_from(["a" * 40, "A" * 40, "BO_", "Vector__XXX", "a_2"])))
def test_names_are_legal_and_differ(texts: list[str]) -> None:
    names = Names()
    found = [names.new(text, "signal") for text in texts]
    assert len({name.casefold() for name in found}) == len(found)
    assert all(re.fullmatch(rf"[A-Za-z_]\w{{0,{LONGEST_NAME - 1}}}", name, re.ASCII) for name in found)


@given(st.fractions(max_denominator=10**6) | st.integers(-(10**30), 10**30).map(Fraction))
def test_a_decimal_is_the_nearest_double_at_least(number: Fraction) -> None:
    assert float(decimal(number)) == float(number)
    assert decimal(Fraction(1, 256)) == "0.00390625"


def test_a_message_of_64_bits() -> None:
    kind = BY_SHORT_NAME["bool"]
    entries = [OdEntry(0x2000 + n, 0, f"Bit {n}", kind) for n in range(64)]
    sent = config(tuple(PdoMappingEntry(one.index, 0, 1) for one in entries))
    node = NodeState(5, "io", {TPDO1: sent}, {}, described(*entries))
    text = bytes_of(network_messages(NetworkState((node,)), {5: ObjectScalings()})).decode("cp1252")
    decoded = cantools.database.load_string(text, "dbc").decode_message(0x185, bytes(range(8)))
    assert [decoded[f"Bit_{n}"] for n in range(64)] == [n // 8 >> n % 8 & 1 for n in range(64)]


def test_limits_are_scaled_and_never_an_offset() -> None:
    kind = BY_SHORT_NAME["i16"]
    entry = OdEntry(0x2000, 0, "Torque", kind, low=-1500, high=1000)
    rules = {ObjectRange(0x2000, 0x2000): ScalingRule(Scaling("Nm", Fraction(-1, 10), Fraction(5)))}
    node = NodeState(5, "", {TPDO1: config((PdoMappingEntry(0x2000, 0, 16),))}, {}, described(entry), title="Drive")
    text = bytes_of(network_messages(NetworkState((node,)), {5: ObjectScalings([rules])})).decode()
    assert ' SG_ Torque : 0|16@1- (-0.1,5) [-95|155] "Nm" Vector__XXX\r\n' in text
    assert "BO_ 389 Drive_n5_TPDO1: 2 Drive_n5\r\n" in text


BITS = {0: "ready", 3: "fault", 5: "ready", 9: ODD}


@given(st.integers(0, 20), st.sampled_from(["u16", "i16", "u32"]), st.binary(min_size=8, max_size=8))
def test_the_bits_of_a_word_are_its_value(before: int, short: str, data: bytes) -> None:
    kind = BY_SHORT_NAME[short]
    entry = OdEntry(0x2000, 0, "Status", kind)
    rules = {ObjectRange(0x2000, 0x2000): ScalingRule(Scaling(bits=BITS))}
    gap = (PdoMappingEntry(5, 0, before),) if before else ()
    sent = config((*gap, PdoMappingEntry(0x2000, 0, kind.bits or 0)))
    node = NodeState(5, "io", {TPDO1: sent}, {}, described(entry))
    found = network_messages(NetworkState((node,)), {5: ObjectScalings([rules])}, DbcOptions(split_bits=True))
    (message,) = cantools.database.load_string(bytes_of(found).decode("cp1252"), "dbc").messages
    decoded = message.decode(data[: message.length])
    assert {"Status_ready", "Status_fault", "Status_ready_2", "Status_bit_1"} <= decoded.keys()
    raw = sum(decoded[one.name] << one.start - before for one in message.signals)
    ours = Decoder(pdo_layouts(5, node.pdos, node.dictionary, ObjectScalings([rules]))).values(Frame(0x185, data))
    assert raw == next(iter(ours.values())) % (1 << (kind.bits or 0))


def test_a_name_that_is_cut_stands_there_whole_beside_it() -> None:
    kind = BY_SHORT_NAME["u8"]
    names = ["Temperature of the power stage, left", "Temperature of the power stage, right", "Speed"]
    entries = [OdEntry(0x2000 + n, 0, name, kind) for n, name in enumerate([*names, names[0]])]
    sent = config(tuple(PdoMappingEntry(one.index, 0, 8) for one in entries))
    found = network_messages(
        NetworkState((NodeState(5, "io", {TPDO1: sent}, {}, described(*entries)),)), {5: ObjectScalings()}
    )
    assert [len(one.name) for one in found.messages[0].signals] == [32, 32, 5, 32]
    (message,) = cantools.database.load_string(bytes_of(found).decode("cp1252"), "dbc").messages
    assert [one.name for one in message.signals] == [
        "Temperature_of_the_power_stage_left", "Temperature_of_the_power_stage_right", "Speed",
        "Temperature_of_the_power_stage_left_2",
    ]  # fmt: skip


def test_pdos_that_are_off_are_in_it_where_that_is_wanted() -> None:
    kind = BY_SHORT_NAME["u16"]
    entries = [OdEntry(0x2000 + n, 0, f"S{n}", kind) for n in range(2)]
    one, other = (config((PdoMappingEntry(entry.index, 0, 16),)) for entry in entries)
    off = PdoConfig(replace(other.communication, cob_id=CobId(0x185, valid=False)), other.mapping)
    nowhere = PdoConfig(replace(other.communication, cob_id=CobId(0, valid=False)), other.mapping)
    empty = PdoConfig(nowhere.communication, ())
    alone = PdoConfig(replace(other.communication, cob_id=CobId(0x285, valid=False)), other.mapping)
    pdos = dict(zip(map(Pdo.parse, ("tpdo1", "tpdo2", "tpdo3", "tpdo4", "rpdo1")), (off, one, nowhere, alone, empty),
                    strict=True))  # fmt: skip
    state = NetworkState((NodeState(5, "io", pdos, {}, described(*entries)),))
    assert [one.name for one in network_messages(state, {5: ObjectScalings()}).messages] == ["io_TPDO2"]
    found = network_messages(state, {5: ObjectScalings()}, DbcOptions(everything=True))
    assert [(one.name, one.comment) for one in found.messages] == [
        ("io_TPDO2", "TPDO2 of node 5, TPDO1 of node 5 (off)"), ("io_TPDO4", "TPDO4 of node 5 (off)"),
    ]  # fmt: skip
    assert found.left_out == [
        "TPDO3 of node 5: it is off and has no CAN-ID", "TPDO1 of node 5: TPDO2 of node 5 has the same CAN-ID 0x185",
    ]  # fmt: skip


def test_who_hears_a_frame_receives_what_it_maps() -> None:
    kind = BY_SHORT_NAME["u16"]
    entries = [OdEntry(0x2000 + n, 0, f"S{n}", kind) for n in range(2)]
    both = tuple(PdoMappingEntry(one.index, 0, 16) for one in entries)
    dummy = PdoMappingEntry(6, 0, 16)
    sender = NodeState(1, "a", {TPDO1: config(both), RPDO1: config((dummy, both[1]), 0x300)}, {}, described(*entries))
    hearer = NodeState(2, "b", {RPDO1: config((dummy, both[1]))}, {}, described(*entries))
    also = NodeState(3, "c", {RPDO1: config((both[0],), 0x300), TPDO1: config(both)}, {}, described(*entries))
    found = network_messages(NetworkState((sender, hearer, also)), dict.fromkeys((1, 2, 3), ObjectScalings()))
    by_id = {one.can_id: one for one in found.messages}
    assert [(one.name, one.receivers) for one in by_id[0x185].signals] == [("S0", ()), ("S1", ("b",))]
    assert [(one.name, one.start, one.receivers) for one in by_id[0x300].signals] == [
        ("S0", 0, ("c",)),
        ("S1", 16, ("a",)),
    ]
    assert found.left_out == ["TPDO1 of node 3: TPDO1 of node 1 has the same CAN-ID 0x185"]


def test_a_pdo_that_no_frame_holds_is_left_out(tmp_path: Path) -> None:
    mapping = tuple(PdoMappingEntry(0x2000, 0, 64) for _ in range(2))
    found = network_messages(NetworkState((NodeState(5, "", {TPDO1: config(mapping)}),)), {5: ObjectScalings()})
    assert (found.messages, len(found.left_out)) == ([], 1)


def test_texts_of_a_device_stay_texts() -> None:
    message = DbcMessage(1, False, "m", 1, signals=(DbcSignal("s", 0, 8, unit=ODD, comment=ODD, values={0: ODD}),))
    (read,) = cantools.database.load_string(dbc_bytes({"n": ODD}, [message]).decode("cp1252"), "dbc").messages
    assert [one.name for one in read.signals] == ["s"]
    assert read.signals[0].comment == "Gr\u00f6\u00dfe '/' \u00b5; BO_ 1 x: 8 y" == read.signals[0].unit


def test_other_services_have_the_ids_and_times_of_the_nodes() -> None:
    numbers = {
        (0x1014, 0): 0x91,
        (0x1017, 0): 500,
        (0x1005, 0): 0x4000_0081,
        (0x1006, 0): 10_000,
        (0x1016, 1): 0x2_0300,
    }
    state = NetworkState((NodeState(1, "a", {}, numbers), NodeState(2, "b", {TPDO1: config((), 0x701)}, {})))
    found = network_messages(state, dict.fromkeys((1, 2), ObjectScalings()), DbcOptions(SERVICES))
    read = cantools.database.load_string(bytes_of(found).decode("cp1252"), "dbc")
    assert found.left_out == ["a_Heartbeat: a PDO has the same CAN-ID 0x701"]
    assert {one.frame_id for one in read.messages} == {0, 0x81, 0x91, 0x701, 0x702, 0x601, 0x602, 0x581, 0x582}
    assert read.get_message_by_name("SYNC").cycle_time == 10
    assert read.get_message_by_name("b_Heartbeat").signals[0].receivers == ["a"]
    assert str(read.decode_message(0x702, b"\x05")["State"]) == "operational"
    assert read.decode_message(0x91, bytes.fromhex("1032010203040506"))["Error_code"] == 0x3210
