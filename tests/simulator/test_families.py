"""The families: identities, legal factory states, and the behaviours that only some of them have."""

from __future__ import annotations

import pytest

from dvtcli.domain.nmt import NmtCommand, NmtState
from dvtcli.domain.pdo import is_mpdo
from dvtcli.domain.ports import Frame
from dvtcli.errors import InputFileError, SdoAborted
from dvtcli.files.profiles import builtin_names, load_profile
from dvtcli.operations.session.simulated_nodes import read_dictionary
from dvtcli.simulator.device.family import GENERIC, Family
from dvtcli.simulator.device.strict_device import StrictDevice
from dvtcli.simulator.network.family_file import FAMILY_KEYS, family_eds, family_names, load_family, read_family
from dvtcli.simulator.network.in_process_bus import simulate
from tests.simulator.bench import Aborted, Client, booted

SAVE, LOAD = 0x65766173, 0x64616F6C
FAMILIES = ["espac", "gen4", "generic", "roboteq", "tmcm"]
SEVCON = pytest.mark.parametrize("family", ["gen4", "espac"])


def refused(client: Client, index: int, sub_index: int, value: int, size: int) -> tuple[int, int]:
    """Abort code and extended error of a download that must be refused."""
    with pytest.raises(Aborted) as caught:
        client.write(index, sub_index, value, size)
    return caught.value.code, client.number(0x5310)


def test_family_names() -> None:
    assert set(FAMILIES) <= set(family_names())


def test_unknown_family() -> None:
    with pytest.raises(KeyError):
        load_family("nonsense")
    with pytest.raises(KeyError):
        family_eds("nonsense")


@pytest.mark.parametrize(
    ("line", "complaint"),
    [
        ("granularty = 8", "granularty: unknown key"),
        ("granularity = 0", "granularity: 0 is not within 1..64"),
        ("extended_ids = 1", "extended_ids: must be true or false, not 1"),
        ('rtr_bit = { tpdo = "set" }', "rtr_bit: the key 'rpdo' is missing"),
        ("state_object = [0x5110, 0]", "state_object: must be an object such as '6C01:01', not [20752, 0]"),
        ("needs_store = [0x1FFF, 0x1200]", "needs_store: [8191, 4608] is not a range: the first is above the last"),
        ('tpdo_access = ["ro", "row"]', "tpdo_access: must be ro, wo, rw, rwr, rww or const, not 'row'"),
        ("reasons = { x = 17 }", "reasons.x: the key must be a number"),
        ("reasons = { 0x100000000 = 17 }", "reasons.0x100000000: the key is not within 0..4294967295"),
        ('plant = "cia401"', "plant: must be cia402, not 'cia401'"),
        ('boot_state = "ON"', "boot_state: must be INITIALISING, STOPPED, OPERATIONAL or PRE_OPERATIONAL, not 'ON'"),
        ('like = "gen5"', "like: unknown family 'gen5'"),
        ("[login]\nindex = 0x5000", "login: the key 'level' is missing"),
        ("[[pins]]\nselector = 0", "pins.selector: 0 is not within 1..65535"),
    ],
)
def test_a_wrong_value_names_its_line_and_its_key(line: str, complaint: str) -> None:
    with pytest.raises(InputFileError) as caught:
        read_family("x", f'title = "X"\n{line}\n', "x/simulated.toml")
    assert caught.value.text == complaint
    assert caught.value.place in ("x/simulated.toml:2", "x/simulated.toml:3")


def test_a_key_of_a_family_that_is_like_another_replaces_that_one_s() -> None:
    like = read_family("x", 'like = "gen4"\ntitle = "X"\nreasons = { 0x06040041 = 3 }\n', "x/simulated.toml")
    assert like == load_family("gen4")._replace(name="x", title="X", reasons={0x0604_0041: 3})


def test_every_field_of_a_family_can_be_written_and_no_other() -> None:
    assert set(FAMILY_KEYS) == set(Family._fields) - {"name"}


def test_generic_default_behaves_as_the_standard_says() -> None:
    assert GENERIC.name == "generic"
    assert GENERIC.boot_state is NmtState.PRE_OPERATIONAL


@pytest.mark.parametrize("family", family_names())
@pytest.mark.parametrize("node_id", [1, 127])
def test_factory_state_is_legal_under_the_device_s_own_rules(family: str, node_id: int) -> None:
    """Take every PDO apart and put its factory state back, step by step: the device must take all of it."""
    client = Client.on(booted(family, node_id))
    if family == "gen4-locked":
        log_in(client, 1, 0x4444)
    pdos = [index for index in client.server.device.dictionary if 0x1400 <= index < 0x1600 or 0x1800 <= index < 0x1A00]
    assert pdos
    for communication in pdos:
        mapping = communication + 0x200
        cob_id, count = client.number(communication, 1), client.number(mapping, 0)
        rows = [client.number(mapping, sub) for sub in range(1, 1 if is_mpdo(count) else count + 1)]
        client.write(communication, 1, cob_id | 1 << 31, 4)
        client.write(communication, 2, client.number(communication, 2), 1)
        client.write(mapping, 0, 0, 1)
        for sub, raw in enumerate(rows, 1):
            client.write(mapping, sub, raw, 4)
        client.write(mapping, 0, count, 1)
        client.write(communication, 1, cob_id, 4)
        assert cob_id >> 31 or count, "a valid PDO maps something"


@pytest.mark.parametrize("family", family_names())
def test_factory_values_fit_their_types_and_limits(family: str) -> None:
    device = booted(family)
    for entry in device.dictionary.entries():
        assert entry.data_type is not None
        assert entry.name
        assert len(device.value(entry.index, entry.sub_index)) == (entry.data_type.size or len(entry.default or b""))
        if entry.low is not None and entry.high is not None:
            assert entry.low <= entry.high
            value = entry.data_type.decode(device.value(entry.index, entry.sub_index))
            if isinstance(value, int):
                assert entry.low <= value <= entry.high, entry.object


@pytest.mark.parametrize("family", family_names())
def test_valid_pdos_of_a_family_have_can_ids_of_their_own(family: str) -> None:
    device = booted(family)
    raw = [
        int.from_bytes(device.value(index, 1), "little")
        for index in device.dictionary
        if index >> 8 in (0x14, 0x15, 0x18, 0x19)
    ]
    valid = [each & 0x1FFFFFFF for each in raw if not each >> 31]
    assert len(valid) == len(set(valid)) > 0


@pytest.mark.parametrize("family", family_names())
def test_a_new_node_shows_life(family: str) -> None:
    device = booted(family)
    assert device.services.poll(0.0) == [Frame(0x701, b"\x7f")]
    assert device.services.next_poll_s() == 0.5


@pytest.mark.parametrize(
    ("family", "vendor_id", "rpdos", "tpdos"),
    [
        ("generic", 0, 4, 4),
        ("gen4", 0x1E, 5, 5),
        ("espac", 0x1E, 9, 9),
        ("tmcm", 0x286, 4, 4),
        ("roboteq", 0x469, 4, 4),
    ],
)
def test_identity_and_pdo_counts(family: str, vendor_id: int, rpdos: int, tpdos: int) -> None:
    device = booted(family)
    assert int.from_bytes(device.value(0x1018, 1), "little") == vendor_id == device.dictionary.info.vendor_id
    assert sum(0x1400 <= index < 0x1600 for index in device.dictionary) == rpdos == device.dictionary.info.rpdo_count
    assert sum(0x1800 <= index < 0x1A00 for index in device.dictionary) == tpdos == device.dictionary.info.tpdo_count


@pytest.mark.parametrize(
    ("family", "index", "sub_index", "raw"),
    [
        ("tmcm", 0x1402, 1, 0x40000401),
        ("tmcm", 0x1800, 1, 0x40000181),
        ("roboteq", 0x1800, 1, 0x40000181),
        ("roboteq", 0x1402, 1, 0x401),
        ("roboteq", 0x1602, 1, 0x20050D20),
        ("roboteq", 0x1602, 2, 0x20050E20),
        ("roboteq", 0x1603, 1, 0x20050F20),
        ("roboteq", 0x1603, 2, 0x20051020),
        ("gen4", 0x1800, 1, 0x181),
        ("gen4", 0x5000, 1, 4),
        ("gen4", 0x5800, 0, 0),
        ("generic", 0x6041, 0, 0x0250),
    ],
)
def test_factory_values(family: str, index: int, sub_index: int, raw: int) -> None:
    assert Client.on(booted(family)).number(index, sub_index) == raw


@SEVCON
@pytest.mark.parametrize(
    ("index", "sub_index", "value", "size"),
    [(0x1800, 1, 0x80000181, 4), (0x1A02, 0, 0, 1), (0x1010, 1, SAVE, 4), (0x1011, 1, LOAD, 4), (0x3000, 0, 0, 1)],
)
def test_writes_outside_pre_operational_answer_reason_4(
    family: str, index: int, sub_index: int, value: int, size: int
) -> None:
    device = booted(family)
    client = Client.on(device)
    device.nmt(NmtCommand.START)
    assert refused(client, index, sub_index, value, size) == (0x08000000, 4)
    device.nmt(NmtCommand.ENTER_PRE_OPERATIONAL)
    client.write(index, sub_index, value, size)


@SEVCON
def test_wrong_signature_answers_reason_17(family: str) -> None:
    assert refused(Client.on(booted(family)), 0x1010, 1, 1, 4) == (0x08000000, 17)


def test_other_refusals_leave_the_reason_alone() -> None:
    assert refused(Client.on(booted("gen4")), 0x1A02, 1, 0x5FFF0010, 4) == (0x06020000, 0)


def log_in(client: Client, user_id: int, passcode: int) -> int:
    client.write(0x5000, 3, user_id, 2)
    client.write(0x5000, 2, passcode, 2)
    return client.number(0x5000, 1)


@pytest.mark.parametrize(
    ("index", "sub_index", "value", "size"),
    [(0x1801, 1, 0x80000281, 4), (0x1010, 1, SAVE, 4), (0x2800, 0, 1, 1), (0x3000, 1, 0x2021, 2)],
)
def test_login(index: int, sub_index: int, value: int, size: int) -> None:
    client = Client.on(booted("gen4"))
    assert log_in(client, 0, 0) == 0
    assert refused(client, index, sub_index, value, size) == (0x08000000, 8)
    assert client.number(0x1801, 1) == 0x281
    assert log_in(client, 1, 0x3333) == 3
    assert refused(client, index, sub_index, value, size) == (0x08000000, 8)
    assert log_in(client, 1, 0x4444) == 4
    client.write(index, sub_index, value, size)


def test_wrong_passcode_answers_reason_9_and_logs_out() -> None:
    client = Client.on(booted("gen4"))
    assert refused(client, 0x5000, 2, 0x1234, 2) == (0x08000000, 9)
    assert client.number(0x5000, 1) == 0


def test_a_passcode_without_a_user_id_is_refused() -> None:
    client = Client.on(booted("gen4"))
    client.write(0x5000, 3, 0, 2)
    assert refused(client, 0x5000, 2, 0x4444, 2) == (0x08000000, 9)


def test_forced_state_moves_a_master_only() -> None:
    device = booted("gen4")
    client = Client.on(device)
    client.write(0x2800, 0, 0, 1)
    assert client.read(0x5110) == b"\x7f"
    client.write(0x5800, 0, 1, 1)
    client.write(0x2800, 0, 0, 1)
    assert client.read(0x5110) == b"\x05"
    device.nmt(NmtCommand.ENTER_PRE_OPERATIONAL)
    assert device.state is NmtState.OPERATIONAL
    client.write(0x2800, 0, 1, 1)
    assert client.read(0x5110) == b"\x7f"


def test_only_pdo_settings_need_a_store() -> None:
    device = booted("gen4")
    client = Client.on(device)
    client.write(0x3300, 1, 0x2129, 2)
    client.write(0x1006, 0, 10000, 4)
    client.write(0x1801, 5, 10, 2)
    device.nmt(NmtCommand.RESET_NODE)
    assert client.number(0x3300, 1) == 0x2129
    assert client.number(0x1006) == 10000
    assert client.number(0x1801, 5) == 50


@SEVCON
def test_virtual_digital_and_analogue_inputs(family: str) -> None:
    device = booted(family)
    assert [device.value(index)[0] for index in (0x2121, 0x2122, 0x2123, 0x2124)] == [1, 0, 1, 0]
    assert device.value(0x2220) == device.value(0x6C01, 1)
    device.set_value(0x6800, 1, b"\x0a")
    assert [device.value(index)[0] for index in (0x2121, 0x2122, 0x2123, 0x2124)] == [0, 1, 0, 1]
    client = Client.on(device)
    client.write(0x3300, 0, 10, 1)
    client.write(0x3300, 10, 0x2130, 2)
    device.set_value(0x6800, 2, b"\x02")
    assert device.value(0x2130) == b"\x01"


@SEVCON
def test_virtual_outputs(family: str) -> None:
    device = booted(family)
    client = Client.on(device)
    client.write(0x3100, 0, 3, 1)
    client.write(0x3100, 3, 0x2320, 2)
    device.set_value(0x2320, 0, b"\x01")
    assert device.value(0x6200, 1) == b"\x04"
    device.set_value(0x2400, 0, b"\x00\x0c")
    assert device.value(0x6C11, 1) == b"\x00\x0c"


@SEVCON
def test_virtual_motor_copies_both_ways(family: str) -> None:
    device = booted(family)
    device.set_value(0x2020, 3, (-700).to_bytes(4, "little", signed=True))
    device.set_value(0x606C, 0, (-690).to_bytes(4, "little", signed=True))
    assert device.value(0x60FF) == device.value(0x2020, 3)
    assert device.value(0x2020, 4) == device.value(0x606C)
    assert device.value(0x2020, 2) == device.value(0x6041)


def test_a_virtual_pdo_names_an_object_that_exists_or_none() -> None:
    client = Client.on(booted("gen4"))
    assert refused(client, 0x3300, 1, 0x21FE, 2) == (0x08000000, 12)
    client.write(0x3300, 1, 0x21FF, 2)


def test_any_eds_works_with_the_generic_family() -> None:
    device = StrictDevice(booted("tmcm").dictionary, GENERIC, 3)
    device.boot_up()
    assert Client.on(device).number(0x1800, 1) == 0x40000183


def test_no_family_that_comes_with_dvtcli_is_learnt() -> None:
    """A learnt family shares its evidence with its profile: it is no second opinion on the rules."""
    assert not [name for name in family_names() if load_family(name).learnt]
    assert not [name for name in builtin_names() if load_profile(name).learnt]


@pytest.mark.parametrize("family", family_names())
def test_what_is_read_at_once_is_what_frames_carry(family: str) -> None:
    """Every object of its file, and those that it does not have, with the abort codes."""
    dictionary = read_dictionary(family_eds(family))
    places = [(index, sub) for index, each in dictionary.items() for sub in (*each.entries, max(each.entries) + 1)]
    bus = simulate([StrictDevice(dictionary, load_family(family), 5)])

    def held(index: int, sub_index: int) -> bytes | tuple[int, ...]:
        try:
            return bus.sdo(5).upload(index, sub_index)
        except SdoAborted as aborted:
            return aborted.index, aborted.sub_index, aborted.code, aborted.node or 0

    try:
        by_frames = {place: held(*place) for place in [*places, (0x5FFF, 0), (0x1000, 0xFF)]}
        frames: list[Frame] = []
        bus.tap(lambda frame, sent: frames.append(frame) if sent else None)
        bus.read_at_once()
        assert {place: held(*place) for place in by_frames} == by_frames
        assert frames == []
    finally:
        bus.close()
