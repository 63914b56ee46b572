"""What a file or a clone may write: never what acts, measures, stores or lets in."""

from __future__ import annotations

from dataclasses import replace

import pytest
from hypothesis import given
from hypothesis import strategies as st

from dvtcli.domain.configuration import Configuration, DeviceTypes, configuration_of
from dvtcli.domain.configuration import NotWritten as Why
from dvtcli.domain.datatypes import U8, U32
from dvtcli.domain.object_dictionary import Access, ObjectDictionary, ObjectType, OdEntry, OdObject
from dvtcli.domain.process_data import is_command
from dvtcli.domain.profile import GENERIC, DeviceProfile, LoginPolicy, VpdoGroup
from dvtcli.files.profiles import load_profile

LOCKED = DeviceProfile(
    login=LoginPolicy((0x5000, 1), (0x5000, 2), (0x5000, 3), 4, 5, ()),
    vpdo={"motor": VpdoGroup(0x3000, ((0x2020, 0x2021),), 0x20FF)},
    configuration=((0x2800, 0x28FF),),
    no_configuration=((0x2810, 0x2810),),
)
EVERYTHING = ((0x0000, 0xFFFF),)


def types(*numbers: int | None, more: int = 0x0002, logical: dict[int, int] | None = None) -> DeviceTypes:
    """What a device says whose 0x1000 has *numbers* in its lower half, and *more* in its upper one."""
    said = [(more << 16 | one).to_bytes(4, "little") for one in numbers if one is not None]
    return DeviceTypes.of(*said, logical={at: one.to_bytes(4, "little") for at, one in (logical or {}).items()})


def entry(index: int, sub_index: int = 0, access: str = "rw", *, mapped: bool | None = None, **more: object) -> OdEntry:
    return OdEntry(index, sub_index, "Object", U32, Access(access), pdo_mapping=mapped, **more)  # type: ignore[arg-type]


MAY_BE_WRITTEN = [
    entry(0x1005), entry(0x1006), entry(0x1014), entry(0x1016, 1), entry(0x1017), entry(0x1029, 1), entry(0x1280, 1),
    entry(0x1400, 1), entry(0x1600, 0), entry(0x1800, 2), entry(0x1A00, 64), entry(0x1F80), entry(0x1F22, 3),
    entry(0x6083), entry(0x6083, mapped=False), entry(0x6065, access="rwr", mapped=True), entry(0x6206, 1),
    entry(0x607D, 1),
]  # fmt: skip
NEVER = [
    (entry(0x1003), Why.ERROR_HISTORY), (entry(0x1010, 1), Why.STORE), (entry(0x1011, 4), Why.STORE),
    (entry(0x1020, 1), Why.STAMP), (entry(0x1F50, 1), Why.PROGRAM), (entry(0x1F5F), Why.PROGRAM),
    (entry(0x1200, 1), Why.SDO_CHANNEL), (entry(0x13FE), Why.SAFETY), (entry(0x1023, 1), Why.REQUEST),
    (entry(0x1F82, 5), Why.REQUEST), (entry(0x1013), Why.REQUEST), (entry(0x100B), Why.NODE_ID),
    (entry(0x6040), Why.COMMAND), (entry(0x60FF), Why.COMMAND), (entry(0x607A), Why.COMMAND),
    (entry(0x6071), Why.COMMAND), (entry(0x6840), Why.COMMAND), (entry(0x60C1, 1), Why.COMMAND),
    (entry(0x6200, 1), Why.OUTPUT), (entry(0x6411, 2), Why.OUTPUT), (entry(0x6220, 1), Why.OUTPUT),
    (entry(0x1017, access="ro"), Why.READ_ONLY), (entry(0x1017, access="const"), Why.READ_ONLY),
    (entry(0x1017, access="wo"), Why.WRITE_ONLY), (entry(0x1017, object_flags=1), Why.FLAGGED),
    (entry(0x1A00, 1, "ro"), Why.READ_ONLY), (entry(0x1A00, 1, object_flags=1), Why.FLAGGED),
    (entry(0x5000, 1), Why.PASSCODE), (entry(0x5000, 2), Why.PASSCODE), (entry(0x5000, 3), Why.PASSCODE),
    (entry(0x2810), Why.BEHAVIOUR),
]  # fmt: skip


@pytest.mark.parametrize("one", MAY_BE_WRITTEN, ids=lambda one: one.object)
def test_configuration_is_written(one: OdEntry) -> None:
    assert Configuration(LOCKED).why_not(one) is None


@pytest.mark.parametrize(("one", "why"), NEVER, ids=lambda one: getattr(one, "object", one))
def test_what_acts_is_never_written_also_where_somebody_names_it(one: OdEntry, why: Why) -> None:
    for known in (Configuration(LOCKED), Configuration(LOCKED, included=EVERYTHING)):
        assert known.why_not(one) is why


@pytest.mark.parametrize(
    ("number", "index", "mapped", "why"),
    [
        (406, 0x6200, None, None),  # the cyclic timer of an encoder is no output
        (406, 0x6200, True, Why.RPDO_MAPPABLE),
        (406, 0x6003, None, Why.PRESET),
        (402, 0x6003, None, None),
        (401, 0x6200, False, Why.OUTPUT),
        (401, 0x6071, False, None),  # which edges of inputs interrupt
        (401, 0x6040, True, Why.COMMAND),
        (402, 0x6200, True, Why.OUTPUT),
        (402, 0x6200, None, Why.OUTPUT),  # nobody says that no RPDO can take it
        (402, 0x6A00, True, Why.OUTPUT),
        (402, 0x6C11, True, Why.OUTPUT),
        (402, 0x6410, False, None),  # the motor's data
        (402, 0x6052, False, Why.COMMAND),
        (404, 0x6200, True, Why.OUTPUT),
        (404, 0x7300, True, Why.OUTPUT),
        (404, 0x7320, False, None),  # a scaling
        (404, 0x6125, None, Why.PRESET),
        (0, 0x6200, False, Why.OUTPUT),  # no device profile: nobody knows
        (None, 0x6040, False, Why.COMMAND),
    ],
)
def test_what_an_index_means_is_said_by_the_device_profile(
    number: int | None, index: int, mapped: bool | None, why: Why | None
) -> None:
    for included in ((), EVERYTHING):
        known = Configuration(GENERIC, types(number), included=included)
        assert known.why_not(entry(index, 1, mapped=mapped)) is why


def test_a_name_tells_an_output_of_a_drive() -> None:
    for name, why in (("Digital outputs 1 to 8", Why.OUTPUT), ("Output current limit", None)):
        one = replace(entry(0x6411, 1, mapped=False), name=name)
        assert Configuration(GENERIC, types(402)).why_not(one) is why


@pytest.mark.parametrize(
    ("kinds", "index", "why"),
    [
        (types(402, 401), 0x6200, Why.OUTPUT),  # the node says another profile than its file
        (types(0, 402), 0x6410, None),  # the file says none
        (types(402, more=0xFFFF), 0x6410, None),
        (types(402, more=0xFFFF), 0x6C10, Why.OUTPUT),  # of another logical device, whose profile nobody tells
        (types(402, more=0xFFFF), 0x7200, Why.OUTPUT),
        (types(402, more=0xFFFF, logical={1: 402, 2: 401}), 0x6C10, None),
        (types(402, more=0xFFFF, logical={1: 402, 2: 401}), 0x7200, Why.OUTPUT),
        (types(406, more=0xFFFF, logical={1: 402}), 0x6840, Why.COMMAND),
        (types(402, more=0xFFFF, logical={1: 406}), 0x6803, Why.PRESET),
    ],
)
def test_each_logical_device_has_its_profile(kinds: DeviceTypes, index: int, why: Why | None) -> None:
    assert Configuration(GENERIC, kinds, included=EVERYTHING).why_not(entry(index, 1, mapped=False)) is why


def test_the_types_of_logical_devices_are_read_in_the_dictionary() -> None:
    def held(index: int, number: int, more: int) -> OdObject:
        kind = OdEntry(index, 0, "Type", U32, Access.RO, default=(more << 16 | number).to_bytes(4, "little"))
        return OdObject(index, "Type", ObjectType.VAR, {0: kind})

    dictionary = ObjectDictionary({0x1000: held(0x1000, 402, 0xFFFF), 0x6FFF: held(0x6FFF, 401, 0)})
    assert configuration_of(dictionary, GENERIC).types == types(402, more=0xFFFF, logical={1: 401})


def test_an_object_of_the_maker_is_written_where_somebody_names_it() -> None:
    plain = entry(0x2000)
    assert Configuration(LOCKED).why_not(plain) is Why.MAKERS
    assert Configuration(LOCKED, included=((0x2000, 0x2000),)).why_not(plain) is None
    assert Configuration(LOCKED, included_objects={(0x2000, 0)}).why_not(plain) is None
    assert Configuration(LOCKED, included_objects={(0x2000, 0)}).why_not(entry(0x2000, 1)) is Why.MAKERS
    assert Configuration(LOCKED, named={(0x2000, 0)}).why_not(plain) is None
    assert Configuration(LOCKED).why_not(entry(0x2801, 3)) is None  # by the family
    assert Configuration(LOCKED).why_not(entry(0x3000, 1)) is None  # a virtual PDO's pin


@pytest.mark.parametrize("one", [entry(0x2000, mapped=True), entry(0x2000, access="rww")], ids=["mapped", "rww"])
def test_what_an_rpdo_can_take_of_the_maker_may_be_a_setting(one: OdEntry) -> None:
    for known in (Configuration(LOCKED), Configuration(LOCKED, named={(0x2000, 0)})):
        assert known.why_not(one) is Why.MAKERS_RPDO
    assert Why.MAKERS_RPDO.may_be_setting
    assert Configuration(LOCKED, included=EVERYTHING).why_not(one) is Why.MAKERS_RPDO, "a range of what nobody knows"
    assert Configuration(LOCKED, included=((0x2000, 0x2000),)).why_not(one) is None
    assert Configuration(LOCKED, included=EVERYTHING, taken={(0x2000, 0)}).why_not(one) is Why.TAKEN


PROCESS_DATA = [
    "Torque set-point", "StatusWord left", "Velocity actual value", "Key switch", "Steer switch inner left",
    "Pump switch 7", "Command argument", "TargetVelocity", "Physical outputs", "Output 3", "Analog output B",
    "Throttle input voltage", "Received PV1", "Drehzahlsollwert", "Jog", "Factory reset", "Speed cmd", "Ctrl word",
    "Speed_Ref", "Target speed (1/min)", "Relay 1", "Throttle", "Brake", "PWM1", "Proportional valve 2", "Lamp left",
    "LED", "Horn", "Duty",
]  # fmt: skip
SETTINGS = [
    "Nominal current", "Output current limit", "Current controller P gain", "Maximum speed in forward direction",
    "Velocity loop max. output", "Home position", "Target reached window", "Output limit", "Measured value filter",
    "Limit switch polarity", "Command timeout", "Switch debounce time", "Sollwertbegrenzung", "Throttle ramp",
    "Brake release delay", "PWM resolution", "Valve current limit", "Kp", "MaxSpeed", "Current time constant",
    "Gear ratio", "Torque constant", "Default duty", "Drehzahlgrenze",
]  # fmt: skip
#: of these no word tells whether they act: they count, and a range does not write them
EITHER = [
    "Variable 7", "", "Operation mode", "Digital output function", "Torque offset", "Steering correction", "Fan",
    "Gear selector", "Direction", "Torque limit command", "Maximum speed set-point", "Limit switch 2", "MaxTorqueCmd",
    "Speed ramp request", "Speed [1/min]", "Drehzahl U/min", "Constant speed", "Speed setting", "PWM period",
]  # fmt: skip


@pytest.mark.parametrize("name", [*PROCESS_DATA, *SETTINGS, *EITHER])
def test_what_a_pdo_can_carry_of_the_maker_is_process_data_by_its_name(name: str) -> None:
    is_process_data = name in PROCESS_DATA
    for access in (Access.RWW, Access.RWR, Access.RW):
        one = OdEntry(0x2000, 0, name, U32, access, pdo_mapping=True)
        whole, alone = ((first, 0x2000) for first in (0x1000, 0x2000))
        assert (Configuration(GENERIC).why_not(one) is Why.NAMED_PROCESS_DATA) is is_process_data
        by_range = Configuration(GENERIC, included=[whole]).why_not(one) is None
        assert by_range is (name in SETTINGS or (access is Access.RWR and not is_process_data))
        assert Configuration(GENERIC, included=[alone]).why_not(one) is None
    assert not Why.NAMED_PROCESS_DATA.may_be_setting
    unmapped = OdEntry(0x2000, 0, name, U32, Access.RW, pdo_mapping=False)
    assert Configuration(GENERIC).why_not(unmapped) in (Why.MAKERS, Why.NAMED_COMMAND)


def test_a_range_takes_no_command_of_a_record_for_a_setting() -> None:
    for record, name, is_written in (
        ("Limits", "Maximum torque", True), ("Commands", "Maximum torque", False), ("RPDO cmd 1", "Ramp", False),
        ("Limits", "Throttle", False), ("Limits", "Speed", False),
    ):  # fmt: skip
        one = OdEntry(0x2000, 1, name, U32, Access.RWW, pdo_mapping=True)
        whole = ObjectDictionary({0x2000: OdObject(0x2000, record, ObjectType.RECORD, {1: one})})
        known = Configuration(GENERIC, included=((0x2000, 0x5FFF),), dictionary=whole)
        assert (known.why_not(one) is None) is is_written


def test_a_range_of_a_profile_writes_settings_of_drives_and_what_its_name_says() -> None:
    output = OdEntry(0x7310, 1, "Output Process Value", U32, Access.RWW, pdo_mapping=True)
    for one, number, is_written in (
        (entry(0x6083, mapped=True), 402, True), (entry(0x6083, mapped=True), 404, False), (output, 404, False),
        (entry(0x6200, mapped=True), 402, False), (replace(output, name="Output limit"), 404, True),
    ):  # fmt: skip
        known = Configuration(GENERIC, types(number), included=((0x6000, 0x9FFF),))
        assert (known.why_not(one) is None) is is_written, f"{one.object} {number}"


def test_what_an_rpdo_can_take_is_written_only_where_somebody_names_it() -> None:
    taken = entry(0x6083, mapped=True)
    assert Configuration(GENERIC).why_not(taken) is Why.RPDO_MAPPABLE
    assert Configuration(GENERIC, included=((0x6083, 0x6083),)).why_not(taken) is None
    assert Configuration(GENERIC, included=EVERYTHING, taken={(0x6083, 0)}).why_not(taken) is Why.TAKEN


@pytest.mark.parametrize(
    ("name", "why"),
    [
        ("Service password", Why.PASSCODE),
        ("Pass code", Why.PASSCODE),
        ("CANopen Node-ID", Why.NODE_ID),
        ("CAN baudrate", Why.NODE_ID),
        ("Bit rate", Why.NODE_ID),
        ("Ramp", None),
    ],
)
def test_names_tell_what_no_standard_does(name: str, why: Why | None) -> None:
    parts = {1: OdEntry(0x2000, 1, "Value", U8), 2: OdEntry(0x2000, 2, "Other", U8)}
    dictionary = ObjectDictionary({0x2000: OdObject(0x2000, name, ObjectType.RECORD, parts)})
    known = configuration_of(dictionary, GENERIC, included=EVERYTHING)
    assert known.why_not(parts[1]) is why


def test_the_device_profile_is_read_in_the_dictionary() -> None:
    kind = OdEntry(0x1000, 0, "Device type", U32, Access.RO, default=bytes([0x96, 0x01, 0x02, 0x00]))
    dictionary = ObjectDictionary({0x1000: OdObject(0x1000, "Device type", ObjectType.VAR, {0: kind})})
    assert configuration_of(dictionary, GENERIC).types == types(406)


def test_a_built_in_family_keeps_its_passcode() -> None:
    login = load_profile("gen4").login
    assert login is not None
    known = Configuration(load_profile("gen4"), included=EVERYTHING)
    assert known.why_not(entry(*login.passcode)) is Why.PASSCODE


entries = st.builds(
    OdEntry,
    st.integers(0, 0xFFFF),
    st.integers(0, 0xFF),
    st.sampled_from(["Object", "Password", "Node-ID", "", "Nominal current", "Speed cmd", "Fan", "Operation mode"]),
    st.just(U32),
    st.sampled_from(Access),
    pdo_mapping=st.sampled_from([None, True, False]),
    object_flags=st.integers(0, 3),
)
known = st.builds(
    Configuration,
    st.sampled_from([GENERIC, LOCKED]),
    st.sampled_from([types(one, more=more) for one in (None, 0, 401, 402, 404, 406, 410) for more in (2, 0xFFFF)]),
    included=st.sampled_from([(), EVERYTHING, ((0x2000, 0x5FFF),)]),
)


@given(entries, known)
def test_what_is_written_can_be_written_and_read_back_and_is_no_process_data_unasked(
    one: OdEntry, known: Configuration
) -> None:
    if known.why_not(one) is not None:
        return
    assert (one.access.writable, one.access.readable, one.object_flags & 1) == (True, True, 0)
    assert one.index not in (0x1003, 0x1010, 0x1011, 0x1020, 0x100B, *range(0x1F50, 0x1F60))
    is_asked = any(low <= one.index <= high for low, high in known.included)
    if one.index >= 0x2000 and not is_asked:
        assert not (one.pdo_mapping and one.access in (Access.RW, Access.RWW))
    if 0x2000 <= one.index < 0x6000 and (one.index, one.index) not in known.included and _is_for_rpdos(one):
        assert one.name == "Nominal current", "a range writes what an RPDO could take only by its name"


def _is_for_rpdos(one: OdEntry) -> bool:
    return (
        bool(one.pdo_mapping) if one.access is Access.RW else one.access is Access.RWW and one.pdo_mapping is not False
    )


COMMANDS = [
    "Factory reset", "Reboot", "Save parameters", "Load defaults", "Start self test", "Calibrate", "Format flash",
    "Jog", "Teach-in", "Homing", "Enable drive", "Unlock", "Enter bootloader", "Brake release", "Restart",
    "Reset errors",
]  # fmt: skip


@pytest.mark.parametrize("name", COMMANDS)
def test_a_command_of_the_maker_is_told_by_its_name_and_named_one_by_one(name: str) -> None:
    entry = OdEntry(0x2100, 1, name, U32, Access.RW, pdo_mapping=False)
    for included in ((), EVERYTHING, ((0x2000, 0x2FFF),)):
        known = Configuration(GENERIC, named={(0x2100, 1)}, included=included)
        assert known.why_not(entry) in (Why.NAMED_COMMAND, Why.PASSCODE)
    asked = Configuration(GENERIC, included=((0x2100, 0x2100),)).why_not(entry)
    assert asked is (Why.PASSCODE if name == "Unlock" else None)


@pytest.mark.parametrize(
    "name",
    ["Homing speed", "Fault reset input", "Reset voltage (V)", "Start delay", "Data format", "Filter enable", "Ramp"],
)
def test_a_setting_is_none(name: str) -> None:
    entry = OdEntry(0x2100, 1, name, U32, Access.RW, pdo_mapping=False)
    assert Configuration(GENERIC, named={(0x2100, 1)}).why_not(entry) is None


@given(entries, known)
def test_naming_objects_lifts_only_what_may_be_lifted(one: OdEntry, known: Configuration) -> None:
    unasked = Configuration(known.profile, known.types).why_not(one)
    asked = Configuration(known.profile, known.types, included=EVERYTHING).why_not(one)
    assert asked in (unasked, None)
    assert unasked is asked or (unasked is not None and unasked.is_lifted_by_include)


def test_a_command_is_told_by_its_index_or_by_its_file() -> None:
    commands = [entry(0x6040), entry(0x6840), entry(0x9FFF - 0x7FF + 0x40), entry(0x607A, mapped=False)]
    commands += [entry(0x6200, 1, mapped=True), entry(0x6A00, 1, mapped=True), entry(0x2000, mapped=True)]
    others = [entry(0x6083, mapped=True), entry(0x6200, 1), entry(0x2000), entry(0x2000, access="ro", mapped=True)]
    others += [entry(0x1017, mapped=True), entry(0xA040, mapped=True)]
    assert [one.object for one in (*commands, *others) if is_command(one.index, one)] == [
        one.object for one in commands
    ]
    assert [is_command(index, None) for index in (0x6040, 0x6200, 0x2000, 0x1017)] == [True, False, False, False]
