"""EDS and DCF files with oddities that are planted in them, the same ones for the same seed; every one is our own.

An oddity is a thing that real files have; each takes a device that is right and a random generator, and bends it.
"""

from __future__ import annotations

import random
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path

from tests.small_eds import INPUTS, OUTPUTS, U8, U16, U32, Eds, Keys, Section, communication, mapping, plain, var

Oddity = Callable[[Eds, random.Random], None]
#: Communication and mapping parameters, default CAN-ID, mapped object, and how it is accessed.
_TPDO = (0x1800, 0x1A00, 0x180, INPUTS, "ro")
_RPDO = (0x1400, 0x1600, 0x200, OUTPUTS, "rww")
BOOLEAN, I8, I16, I32, U64, TEXT, DOMAIN = 1, 2, 3, 4, 0x1B, 9, 0xF


@dataclass(frozen=True)
class OddFile:
    """One generated file: its name, what was planted, and its text."""

    name: str
    planted: tuple[str, ...]
    text: str

    def write(self, folder: Path) -> Path:
        path = folder / self.name
        path.write_bytes(self.text.encode())
        return path


def odd_files(count: int, seed: int = 0) -> list[OddFile]:
    """The first *count* files of *seed*; each oddity is planted alone once, later files have up to four of them."""
    return [_odd_file(number, seed) for number in range(count)]


def _odd_file(number: int, seed: int) -> OddFile:
    rng = random.Random(f"{seed} {number}")
    names = list(ODDITIES)
    planted = [names[number]] if number < len(names) else rng.sample(names, rng.randint(1, 4))
    eds = _device(rng)
    for name in planted:
        ODDITIES[name](eds, rng)
    suffix = "dcf" if any(section.name == "DeviceComissioning" for section in eds.more) else "eds"
    ending = "\r\n" if rng.random() < 0.5 else "\n"
    return OddFile(f"odd-{seed}-{number:04}.{suffix}", tuple(planted), eds.text().replace("\n", ending))


def _device(rng: random.Random) -> Eds:
    """A device that is right: one to six PDOs each way, most of them off."""
    eds = plain(rng.choice((2, 4, 8)))
    for base, index, default, objects, _ in (_TPDO, _RPDO):
        for number in range(2, rng.randint(2, 6)):
            word = f"$NODEID+0x{0x80000000 + default + 0x100 * (number % 4):X}"
            eds.record(base + number, f"Communication {number + 1}", communication(word))
            count = rng.randint(0, 2)
            words = [objects << 16 | n << 8 | 8 for n in range(1, count + 1)]
            eds.record(index + number, f"Mapping {number + 1}", mapping(count, [*words, *[0] * (8 - count)]))
    eds.variable(0x6041, var("Statusword", U16, 0, "ro", 1))
    eds.variable(0x6040, var("Controlword", U16, 0, "rww", 1))
    eds.variable(0x2000, var("Wide", U32, 0, "ro", 1))
    return eds


def _side(rng: random.Random) -> tuple[int, int, int, int, str]:
    return rng.choice((_TPDO, _RPDO))


def _one(eds: Eds, rng: random.Random) -> tuple[int, int, int, int]:
    """Communication and mapping index, default CAN-ID and mapped object of one PDO of the file."""
    base, index, default, objects, _ = _side(rng)
    numbers = [n for n in range(8) if base + n in eds.objects and index + n in eds.objects]
    number = rng.choice(numbers or [0])
    return base + number, index + number, default + 0x100 * (number % 4), objects


def _keys(eds: Eds, index: int, sub_index: int) -> Keys:
    """The keys of one sub-index; of a place that an oddity before took away, some that nobody sees."""
    return eds.objects.get(index, ("", {}))[1].get(sub_index, {})


def _mapped(eds: Eds, rng: random.Random, count: object, words: list[object], **more: str) -> None:
    _, index, _, _ = _one(eds, rng)
    eds.record(index, "Mapping", mapping(count, words, **more))


def _enabled(eds: Eds, rng: random.Random, can_id: int | None = None) -> tuple[int, int, int]:
    """One PDO that is enabled, with its mapping index and mapped object."""
    base, index, default, objects = _one(eds, rng)
    _keys(eds, base, 1)["DefaultValue"] = f"$NODEID+0x{default:X}" if can_id is None else f"0x{can_id:X}"
    return base, index, objects


def count_above_entries(eds: Eds, rng: random.Random) -> None:
    _, index, objects = _enabled(eds, rng)
    words = [objects << 16 | n << 8 | 8 for n in range(1, rng.randint(2, 5))]
    eds.record(index, "Mapping", mapping(rng.choice((len(words) + 1, 9, 64)), words))


def impossible_count(eds: Eds, rng: random.Random) -> None:
    _, index, objects = _enabled(eds, rng)
    eds.record(index, "Mapping", mapping(rng.randint(65, 253), [objects << 16 | 0x0108, 0]))


def multiplexed(eds: Eds, rng: random.Random) -> None:
    _mapped(eds, rng, rng.choice((0xFE, 0xFF)), [0, 0])


def no_mapping_parameter(eds: Eds, rng: random.Random) -> None:
    _, index, _ = _enabled(eds, rng)
    eds.objects.pop(index, None)


def no_communication_parameter(eds: Eds, rng: random.Random) -> None:
    base, _, _, _ = _one(eds, rng)
    eds.objects.pop(base, None)


def no_cob_id(eds: Eds, rng: random.Random) -> None:
    base, _, _, _ = _one(eds, rng)
    if base in eds.objects:
        eds.objects[base][1].pop(1, None)


def only_cob_id(eds: Eds, rng: random.Random) -> None:
    base, _, _, _ = _one(eds, rng)
    for sub_index in (2, 3, 5):
        if base in eds.objects:
            eds.objects[base][1].pop(sub_index, None)


def no_count(eds: Eds, rng: random.Random) -> None:
    _, index, _, _ = _one(eds, rng)
    if index in eds.objects:
        eds.objects[index][1].pop(0, None)


def count_only(eds: Eds, rng: random.Random) -> None:
    _mapped(eds, rng, 0, [])


def gap_in_the_entries(eds: Eds, rng: random.Random) -> None:
    _, index, _, objects = _one(eds, rng)
    eds.record(index, "Mapping", mapping(1, [objects << 16 | 0x0108, 0, 0, 0, 0]))
    del eds.objects[index][1][rng.randint(2, 4)]


def missing_cob_id_default(eds: Eds, rng: random.Random) -> None:
    base, _, _, _ = _one(eds, rng)
    _keys(eds, base, 1).pop("DefaultValue", None)


def unusable_cob_id_default(eds: Eds, rng: random.Random) -> None:
    base, _, _, _ = _one(eds, rng)
    _keys(eds, base, 1)["DefaultValue"] = rng.choice(("", "0", "0x0", "none", "0x123456789AB", "$NODEID+"))


def restricted_cob_id(eds: Eds, rng: random.Random) -> None:
    _enabled(eds, rng, rng.choice((0x001, 0x07F, 0x101, 0x180, 0x581, 0x601, 0x6E0, 0x701, 0x7FF)))


def cob_id_beyond_11_bits(eds: Eds, rng: random.Random) -> None:
    _enabled(eds, rng, rng.choice((0x800, 0x1234, 0x1FFFFFFF)))


def extended_cob_id(eds: Eds, rng: random.Random) -> None:
    _enabled(eds, rng, 0x20000000 | rng.randint(0x800, 0x1FFFFFFF))


def two_of_one_cob_id(eds: Eds, rng: random.Random) -> None:
    for _ in range(2):
        _enabled(eds, rng, 0x3A5)


def cob_id_of_a_service(eds: Eds, rng: random.Random) -> None:
    _enabled(eds, rng, rng.choice((0x080, 0x081, 0x085, 0x100)))


def no_rtr(eds: Eds, rng: random.Random) -> None:
    base, _, default, _ = _one(eds, rng)
    _keys(eds, base, 1)["DefaultValue"] = f"$NODEID+0x{0x40000000 + default:X}"


def read_only_cob_id(eds: Eds, rng: random.Random) -> None:
    base, _, _, _ = _one(eds, rng)
    _keys(eds, base, 1)["AccessType"] = rng.choice(("ro", "const"))


def write_only_cob_id(eds: Eds, rng: random.Random) -> None:
    base, _, _, _ = _one(eds, rng)
    _keys(eds, base, 1)["AccessType"] = "wo"


def narrow_cob_id(eds: Eds, rng: random.Random) -> None:
    base, _, default, _ = _one(eds, rng)
    _keys(eds, base, 1).update(DataType=U16, DefaultValue=f"$NODEID+0x{default:X}")


def signed_cob_id(eds: Eds, rng: random.Random) -> None:
    base, _, _, _ = _one(eds, rng)
    _keys(eds, base, 1)["DataType"] = I32


def cob_id_limits(eds: Eds, rng: random.Random) -> None:
    base, _, _, _ = _one(eds, rng)
    high = rng.choice((0x7FF, 0x7FFFFFFF, 0x9FFFFFFF, 0xFFFFFFFF))
    _keys(eds, base, 1).update(LowLimit=rng.choice((0, 1, 0x181)), HighLimit=high)


def odd_width(eds: Eds, rng: random.Random) -> None:
    base, _, _, _ = _one(eds, rng)
    sub_index = rng.choice((2, 3, 5))
    _keys(eds, base, sub_index)["DataType"] = rng.choice([U8, U16, U32, I8, I16])


def read_only_parameter(eds: Eds, rng: random.Random) -> None:
    base, _, _, _ = _one(eds, rng)
    _keys(eds, base, rng.choice((2, 3, 5)))["AccessType"] = rng.choice(("ro", "const", "wo"))


def parameter_limits(eds: Eds, rng: random.Random) -> None:
    base, _, _, _ = _one(eds, rng)
    sub_index, high = rng.choice(((2, 0xFE), (3, 0x7FFF), (5, 10), (5, 0), (2, 1)))
    low = rng.choice((0, 0, 1))
    _keys(eds, base, sub_index).update(LowLimit=low, HighLimit=high)


def default_outside_limits(eds: Eds, rng: random.Random) -> None:
    base, _, _, _ = _one(eds, rng)
    _keys(eds, base, rng.choice((3, 5))).update(DefaultValue=0xFFFF, HighLimit=0x7FFF)


def odd_type(eds: Eds, rng: random.Random) -> None:
    base, _, _, _ = _one(eds, rng)
    _keys(eds, base, 2)["DefaultValue"] = rng.choice((0, 241, 251, 252, 253))


def const_mapping(eds: Eds, rng: random.Random) -> None:
    _, index, objects = _enabled(eds, rng)
    access = rng.choice(("const", "ro"))
    eds.record(index, "Mapping", mapping(1, [objects << 16 | 0x0108], access, access))


def const_entries(eds: Eds, rng: random.Random) -> None:
    _, index, _, objects = _one(eds, rng)
    eds.record(index, "Mapping", mapping(1, [objects << 16 | 0x0108, 0], access="ro"))


def fixed_count(eds: Eds, rng: random.Random) -> None:
    _, index, _, objects = _one(eds, rng)
    eds.record(index, "Mapping", mapping(2, [objects << 16 | 0x0108, objects << 16 | 0x0208], sub_0="ro"))


def some_entries_const(eds: Eds, rng: random.Random) -> None:
    _, index, _, objects = _one(eds, rng)
    eds.record(index, "Mapping", mapping(1, [objects << 16 | 0x0108, 0, 0]))
    _keys(eds, index, rng.randint(1, 3))["AccessType"] = "const"


def write_only_mapping(eds: Eds, rng: random.Random) -> None:
    _, index, _, objects = _one(eds, rng)
    eds.record(index, "Mapping", mapping(1, [objects << 16 | 0x0108, 0, 0]))
    _keys(eds, index, rng.randint(0, 1))["AccessType"] = "wo"


def wide_count(eds: Eds, rng: random.Random) -> None:
    _, index, _, _ = _one(eds, rng)
    _keys(eds, index, 0)["DataType"] = rng.choice((U16, U32))


def narrow_entry(eds: Eds, rng: random.Random) -> None:
    _, index, _, _ = _one(eds, rng)
    _keys(eds, index, 1)["DataType"] = rng.choice((U8, U16))


def mapping_limits(eds: Eds, rng: random.Random) -> None:
    _, index, _, _ = _one(eds, rng)
    _keys(eds, index, rng.choice((0, 1))).update(LowLimit=rng.choice((0, 1)), HighLimit=rng.choice((1, 2, 0xFFFF)))


def granularity(eds: Eds, rng: random.Random) -> None:
    eds.info["Granularity"] = rng.choice((0, 1, 8, 64))


def many_entries(eds: Eds, rng: random.Random) -> None:
    _, index, _, objects = _one(eds, rng)
    access = "ro" if objects == INPUTS else "rww"
    bits = {n: var(f"Bit {n}", BOOLEAN, 0, access, 1) for n in range(1, 65)}
    eds.record(0x6010 if objects == INPUTS else 0x6210, "Bits", bits)
    eds.record(index, "Mapping", mapping(0, [0] * rng.randint(9, 64)))


def enabled_and_empty(eds: Eds, rng: random.Random) -> None:
    _, index, _ = _enabled(eds, rng)
    eds.record(index, "Mapping", mapping(0, [0] * 4))


def enabled_without_count_default(eds: Eds, rng: random.Random) -> None:
    _, index, _ = _enabled(eds, rng)
    _keys(eds, index, 0).pop("DefaultValue", None)


def entries_without_default(eds: Eds, rng: random.Random) -> None:
    _, index, _ = _enabled(eds, rng)
    _keys(eds, index, 0)["DefaultValue"] = 1
    _keys(eds, index, 1).pop("DefaultValue", None)


def maps_what_is_not_there(eds: Eds, rng: random.Random) -> None:
    _, index, _ = _enabled(eds, rng)
    eds.record(index, "Mapping", mapping(1, [0x5FFF0010, 0]))


def maps_what_cannot_be_mapped(eds: Eds, rng: random.Random) -> None:
    _, index, _ = _enabled(eds, rng)
    eds.record(index, "Mapping", mapping(1, [0x10010008, 0]))


def maps_the_other_way(eds: Eds, rng: random.Random) -> None:
    _, index, objects = _enabled(eds, rng)
    eds.record(index, "Mapping", mapping(1, [(OUTPUTS if objects == INPUTS else INPUTS) << 16 | 0x0108, 0]))


def maps_too_much(eds: Eds, rng: random.Random) -> None:
    _, index, objects = _enabled(eds, rng)
    eds.record(index, "Mapping", mapping(9, [objects << 16 | n << 8 | 8 for n in range(1, 10)]))


def maps_too_long(eds: Eds, rng: random.Random) -> None:
    _, index, objects = _enabled(eds, rng)
    eds.record(index, "Mapping", mapping(2, [objects << 16 | 0x0110, objects << 16 | 0x0200, 0]))


def duplicated_section(eds: Eds, rng: random.Random) -> None:
    base, index, _, _ = _one(eds, rng)
    name = rng.choice((f"{base:04X}sub1", f"{index:04X}sub0", f"{base:04X}"))
    eds.more.append(Section(name, {"ParameterName": "Again", "ObjectType": 7, "DataType": U32, "AccessType": "ro"}))


def odd_node_id_expression(eds: Eds, rng: random.Random) -> None:
    base, _, default, _ = _one(eds, rng)
    words = ("${0:X}", "$nodeid + 0x{0:X}", "0x{0:X}+$NODEID", "$NODEID+{0}", "NODEID+0x{0:X}", "0x{0:X} + $NodeId")
    _keys(eds, base, 1)["DefaultValue"] = rng.choice(words).format(default)


def no_store(eds: Eds, _rng: random.Random) -> None:
    eds.objects.pop(0x1010, None)


def fixed_store(eds: Eds, rng: random.Random) -> None:
    _keys(eds, 0x1010, 1)["AccessType"] = rng.choice(("ro", "const", "wo"))


def store_of_another_kind(eds: Eds, rng: random.Random) -> None:
    eds.record(0x1010, "Store", {n: var(f"Save {n}", U32, 1) for n in rng.choice(((2,), (1, 2, 3), (1, 4)))})


def no_identity(eds: Eds, _rng: random.Random) -> None:
    eds.objects.pop(0x1018, None)


def no_error_register(eds: Eds, _rng: random.Random) -> None:
    eds.objects.pop(0x1001, None)


def no_dummies(eds: Eds, rng: random.Random) -> None:
    eds.dummies = rng.choice(((), (5,), (1, 2, 3, 4), (7,)))


def no_pdo_mapping_keys(eds: Eds, _rng: random.Random) -> None:
    for _, subs in eds.objects.values():
        for keys in subs.values():
            keys.pop("PDOMapping", None)


def odd_access(eds: Eds, rng: random.Random) -> None:
    for index in (INPUTS, OUTPUTS):
        for keys in eds.objects.get(index, ("", {}))[1].values():
            keys["AccessType"] = rng.choice(("ro", "rw", "rwr", "rww", "wo", "const", "RW", "r", ""))


def no_data_types(eds: Eds, rng: random.Random) -> None:
    base, index, _, _ = _one(eds, rng)
    for place in (base, index):
        for keys in eds.objects.get(place, ("", {}))[1].values():
            keys.pop("DataType", None)


def text_objects(eds: Eds, rng: random.Random) -> None:
    for index in (INPUTS, OUTPUTS):
        subs = eds.objects.get(index, ("", {}))[1]
        for sub_index in list(subs)[1:4]:
            subs[sub_index]["DataType"] = rng.choice((TEXT, DOMAIN, U64, 0x16, 0x22))


def variable_as_pdo(eds: Eds, rng: random.Random) -> None:
    base, index, _, _ = _one(eds, rng)
    eds.variable(rng.choice((base, index)), var("A variable", U32, 0))


def decimal_numbers(eds: Eds, rng: random.Random) -> None:
    base, index, default, _ = _one(eds, rng)
    _keys(eds, base, 1)["DefaultValue"] = str(default + 1)
    _keys(eds, index, 0)["DefaultValue"] = "00"


def far_pdo_numbers(eds: Eds, rng: random.Random) -> None:
    number = rng.choice((31, 255, 511))
    eds.record(0x1800 + number, "Communication", communication(0x80000680))
    eds.record(0x1A00 + number, "Mapping", mapping(0, [0, 0]))


def own_node_id(eds: Eds, rng: random.Random) -> None:
    eds.more.append(Section("DeviceComissioning", {"NodeID": str(rng.choice((0, 1, 5, 127, 200))), "Baudrate": "250"}))


def parameter_values(eds: Eds, rng: random.Random) -> None:
    base, index, default, objects = _one(eds, rng)
    own_node_id(eds, rng)
    _keys(eds, base, 1)["ParameterValue"] = f"0x{default + rng.choice((0, 1, 5)):X}"
    _keys(eds, index, 0)["ParameterValue"] = rng.choice((0, 1, 3))
    _keys(eds, index, 1)["ParameterValue"] = objects << 16 | 0x0108


def state_as_a_value(eds: Eds, rng: random.Random) -> None:
    """A drive of a family whose profile asks an object for the NMT state."""
    own_node_id(eds, rng)
    eds.info |= {"VendorNumber": 0x1E, "ProductNumber": 0x0705302D}
    if 0x1018 in eds.objects:
        for sub_index, value in ((1, 0x1E), (2, 0x0705302D)):
            _keys(eds, 0x1018, sub_index)["DefaultValue"] = value
    eds.variable(0x5110, var("NMT state", U8, 0, "ro", 0, ParameterValue=rng.choice((4, 5, 0x7F))))


def sync_elsewhere(eds: Eds, rng: random.Random) -> None:
    eds.variable(0x1005, var("SYNC", U32, rng.choice((0x080, 0x181, 0x40000080))))
    eds.variable(0x1014, var("EMCY", U32, rng.choice(("$NODEID+0x80", 0x181, 0x80000081))))


def counts_in_device_info(eds: Eds, rng: random.Random) -> None:
    eds.info |= {"NrOfRXPDO": rng.randint(0, 9), "NrOfTXPDO": rng.randint(0, 9)}


#: What may be planted, by name; the names are the functions'.
ODDITIES: dict[str, Oddity] = {
    one.__name__: one
    for one in (
        count_above_entries, impossible_count, multiplexed, no_mapping_parameter, no_communication_parameter, no_cob_id,
        only_cob_id, no_count, count_only, gap_in_the_entries, missing_cob_id_default, unusable_cob_id_default,
        restricted_cob_id, cob_id_beyond_11_bits, extended_cob_id, two_of_one_cob_id, cob_id_of_a_service, no_rtr,
        read_only_cob_id, write_only_cob_id, narrow_cob_id, signed_cob_id, cob_id_limits, odd_width,
        read_only_parameter, parameter_limits, default_outside_limits, odd_type, const_mapping, const_entries,
        fixed_count, some_entries_const, write_only_mapping, wide_count, narrow_entry, mapping_limits, granularity,
        many_entries, enabled_and_empty, enabled_without_count_default, entries_without_default,
        maps_what_is_not_there, maps_what_cannot_be_mapped, maps_the_other_way, maps_too_much, maps_too_long,
        duplicated_section, odd_node_id_expression, no_store, fixed_store, store_of_another_kind, no_identity,
        no_error_register, no_dummies, no_pdo_mapping_keys, odd_access, no_data_types, text_objects, variable_as_pdo,
        decimal_numbers, far_pdo_numbers, own_node_id, parameter_values, state_as_a_value, sync_elsewhere,
        counts_in_device_info,
    )
}  # fmt: skip
