"""Write an object dictionary as an EDS or DCF (CiA 306)."""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Mapping
from dataclasses import dataclass, field
from datetime import datetime

from dvtcli.domain.object_dictionary import ObjectDictionary, ObjectType, OdEntry, OdObject
from dvtcli.domain.objects import MANDATORY, MANUFACTURER_AREA
from dvtcli.files.eds.ini import IniSection, decode
from dvtcli.files.eds.numbers import written_limit, written_value
from dvtcli.files.file_info import as_keys, in_order

_RATES = (10, 20, 50, 125, 250, 500, 800, 1000)
_DUMMIES = range(1, 8)
_OF_ONE_ENTRY = (ObjectType.NULL, ObjectType.DOMAIN, ObjectType.DEFTYPE, ObjectType.VAR)


@dataclass(frozen=True, slots=True)
class KeptText:
    """Text of an EDS beside its dictionary: whole *sections*, and *keys* by the name of their section in lower case."""

    sections: tuple[IniSection, ...] = ()
    keys: Mapping[str, Mapping[str, str]] = field(default_factory=dict)

    def added_to(self, section: str) -> str:
        """Return the text *section* with its keys behind."""
        found = self.keys.get(section[1 : section.index("]")].lower(), {})
        return "\n".join([section, *(f"{key}={_one_line(value)}" for key, value in found.items())])


def eds_text(
    dictionary: ObjectDictionary,
    file_name: str,
    description: str,
    made: datetime | None,
    said: Mapping[str, str] | None = None,
    keeps: KeptText | None = None,
) -> str:
    """Return *dictionary* as the text of an EDS named *file_name*; *description* is a line about it.

    *said* are keys of FileInfo to keep, *keeps* is other text; *made* is the date (None: as in *said*). The result is a
    DCF if *dictionary* has a node-ID or values of its own.
    """
    sections = [
        _section("FileInfo", in_order({**_file_info(file_name, description, made), **as_keys(said or {})})),
        _section("DeviceInfo", _device_info(dictionary)),
        *_dummy_usage(dictionary),
        *_commissioning(dictionary),
        *_lists(dictionary),
    ]
    for index in dictionary:
        sections += object_sections(dictionary[index])
    if keeps is not None:
        sections = [keeps.added_to(section) for section in sections]
        sections += ["\n".join(map(_one_line, f"[{section.text}".rstrip().split("\n"))) for section in keeps.sections]
    return "\n\n".join(sections) + "\n"


def eds_bytes(text: str) -> bytes:
    """Encode *text* with CRLF in Windows-1252 if the result reads back equal, else in UTF-8."""
    text = text.replace("\n", "\r\n")
    try:
        data = text.encode("cp1252")
    except UnicodeEncodeError:
        return text.encode()
    return data if decode(data)[0] == text else text.encode()


def _section(name: str, keys: Mapping[str, str]) -> str:
    return "\n".join([f"[{name}]", *(f"{key}={_one_line(value)}" for key, value in keys.items())])


def _one_line(text: str) -> str:
    """Replace characters of *text*, possibly from a device, that end a line or steer a terminal."""
    return "".join(char if char.isprintable() or char == "\xa0" else "?" for char in text).strip()


def _file_info(file_name: str, description: str, made: datetime | None) -> dict[str, str]:
    said = {
        "FileName": file_name, "FileVersion": "1", "FileRevision": "0", "EDSVersion": "4.0",
        "Description": description, "CreatedBy": "dvtcli",
    }  # fmt: skip
    if made is None:
        return said
    clock, day = made.strftime("%I:%M%p"), made.strftime("%m-%d-%Y")
    dates = {
        "CreationTime": clock, "CreationDate": day, "ModificationTime": clock, "ModificationDate": day,
        "ModifiedBy": "dvtcli",
    }  # fmt: skip
    return said | dates


def _device_info(dictionary: ObjectDictionary) -> dict[str, str]:
    """Return the keys of the known data: readers stop at a number that is empty."""
    info = dictionary.info
    rates = sorted({*_RATES, *info.bit_rates_kbit})
    keys = {
        "VendorName": info.vendor_name,
        "VendorNumber": _id(info.vendor_id),
        "ProductName": info.product_name,
        "ProductNumber": _id(info.product_code),
        "RevisionNumber": _id(info.revision_number),
        "OrderCode": info.order_code,
        **{f"BaudRate_{rate}": str(int(rate in info.bit_rates_kbit)) for rate in rates},
        "SimpleBootUpMaster": _flag(info.boot_up_master), "SimpleBootUpSlave": _flag(info.boot_up_slave),
        "Granularity": _count(info.granularity), "DynamicChannelsSupported": _count(info.dynamic_channels),
        "GroupMessaging": _flag(info.group_messaging), "NrOfRXPDO": _count(info.rpdo_count),
        "NrOfTXPDO": _count(info.tpdo_count), "LSS_Supported": _flag(info.lss_supported),
    }  # fmt: skip
    return {key: value for key, value in keys.items() if value}


def _id(number: int | None) -> str:
    return "" if number is None else f"0x{number:08X}"


def _count(number: int | None) -> str:
    return "" if number is None else str(number)


def _flag(given: bool | None) -> str:
    return "" if given is None else str(int(given))


def _dummy_usage(dictionary: ObjectDictionary) -> Iterator[str]:
    dummies = dictionary.info.dummies
    if dummies is not None:
        codes = sorted({*_DUMMIES, *dummies})
        yield _section("DummyUsage", {f"Dummy{code:04X}": str(int(code in dummies)) for code in codes})


def _commissioning(dictionary: ObjectDictionary) -> Iterator[str]:
    """Write [DeviceComissioning] (the standard's spelling); nothing if empty."""
    info, placed = dictionary.info, dictionary.info.commissioning
    keys = {
        "NodeID": _count(info.node_id), "NodeName": placed.node_name, "Baudrate": _count(placed.bit_rate_kbit),
        "NetNumber": _count(placed.network_number), "NetworkName": placed.network_name,
        "CANopenManager": _flag(placed.is_manager), "LSS_SerialNumber": _count(placed.lss_serial_number),
    }  # fmt: skip
    said = {key: value for key, value in keys.items() if value}
    if said:
        yield _section("DeviceComissioning", said)


def _lists(dictionary: ObjectDictionary) -> Iterator[str]:
    manufacturer = [index for index in dictionary if index in MANUFACTURER_AREA]
    optional = [index for index in dictionary if index not in MANUFACTURER_AREA and index not in MANDATORY]
    for name, indices in (
        ("MandatoryObjects", [index for index in MANDATORY if index in dictionary]),
        ("OptionalObjects", optional),
        ("ManufacturerObjects", manufacturer),
    ):
        rows = {str(number): f"0x{index:04X}" for number, index in enumerate(indices, 1)}
        yield _section(name, {"SupportedObjects": str(len(indices)), **rows})


def object_sections(one: OdObject) -> Iterable[str]:
    """Return the sections of an object, lines with LF except the last."""
    if one.object_type in _OF_ONE_ENTRY and set(one.entries) == {0}:
        yield _section(f"{one.index:04X}", _entry(one.entries[0], one.object_type))
        return
    head = {"ParameterName": one.own_name, "ObjectType": f"0x{one.object_type:X}", "SubNumber": str(len(one.entries))}
    if one.object_flags:
        head["ObjFlags"] = f"0x{one.object_flags:X}"
    yield _section(f"{one.index:04X}", head)
    for entry in one.entries.values():
        yield _section(f"{one.index:04X}sub{entry.sub_index:X}", _entry(entry, ObjectType.VAR))


def _entry(entry: OdEntry, object_type: int) -> dict[str, str]:
    keys = {
        "ParameterName": entry.own_name, "ObjectType": f"0x{object_type:X}", "DataType": _data_type(entry),
        "LowLimit": _limit(entry.low, relative=entry.low_relative),
        "HighLimit": _limit(entry.high, relative=entry.high_relative),
        "AccessType": str(entry.access),
        "DefaultValue": _value(entry, entry.default, relative=entry.default_relative),
        "ParameterValue": _value(entry, entry.value, relative=entry.value_relative),
        "PDOMapping": _flag(entry.pdo_mapping),
        "ObjFlags": f"0x{entry.object_flags:X}" if entry.object_flags else "",
        "Unit": entry.unit, "Factor": entry.factor, "Denotation": entry.denotation,
    }  # fmt: skip
    return {key: value for key, value in keys.items() if value or key == "ParameterName"}


def _data_type(entry: OdEntry) -> str:
    code = entry.unknown_type if entry.data_type is None else entry.data_type.code
    return "" if code is None else f"0x{code:04X}"


def _limit(limit: int | float | None, *, relative: bool) -> str:
    return "" if limit is None else written_limit(limit, relative=relative)


def _value(entry: OdEntry, data: bytes | None, *, relative: bool) -> str:
    return "" if data is None else written_value(entry.data_type, data, relative=relative) or ""
