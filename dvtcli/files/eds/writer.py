"""Writing an object dictionary as an EDS (CiA 306). Does not know where its objects come from."""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Mapping
from datetime import datetime

from dvtcli.domain.datatypes import Kind
from dvtcli.domain.object_dictionary import ObjectDictionary, ObjectType, OdEntry, OdObject

_MANDATORY = (0x1000, 0x1001, 0x1018)
_MANUFACTURER = range(0x2000, 0x6000)


def eds_text(dictionary: ObjectDictionary, file_name: str, description: str, made: datetime) -> str:
    """*dictionary* as the text of an EDS called *file_name*; *made* is when, *description* one line about it."""
    sections = [
        _section("FileInfo", _file_info(file_name, description, made)),
        _section("DeviceInfo", _device_info(dictionary)),
        *_lists(dictionary),
    ]
    for index in dictionary:
        sections += object_sections(dictionary[index])
    return "\n\n".join(sections) + "\n"


def _section(name: str, keys: Mapping[str, str]) -> str:
    return "\n".join([f"[{name}]", *(f"{key}={_one_line(value)}" for key, value in keys.items())])


def _one_line(text: str) -> str:
    """*text*, which may come from a device, without anything that would end a line, or be no Latin-1."""
    return "".join(char if " " <= char <= "~" else "?" for char in text).strip()


def _file_info(file_name: str, description: str, made: datetime) -> dict[str, str]:
    clock, day = made.strftime("%I:%M%p"), made.strftime("%m-%d-%Y")
    return {
        "FileName": file_name, "FileVersion": "1", "FileRevision": "0", "EDSVersion": "4.0",
        "Description": description, "CreationTime": clock, "CreationDate": day, "CreatedBy": "dvtcli",
        "ModificationTime": clock, "ModificationDate": day, "ModifiedBy": "dvtcli",
    }  # fmt: skip


def _device_info(dictionary: ObjectDictionary) -> dict[str, str]:
    info = dictionary.info
    rates = (10, 20, 50, 125, 250, 500, 800, 1000)
    return {
        "VendorName": info.vendor_name or "unknown",
        "VendorNumber": f"0x{info.vendor_id or 0:08X}",
        "ProductName": info.product_name or "unknown",
        "ProductNumber": f"0x{info.product_code or 0:08X}",
        "RevisionNumber": f"0x{info.revision_number or 0:08X}",
        **{f"BaudRate_{rate}": str(int(rate in info.bit_rates_kbit)) for rate in rates},
        "SimpleBootUpMaster": "0", "SimpleBootUpSlave": "1", "Granularity": str(info.granularity or 8),
        "DynamicChannelsSupported": "0", "GroupMessaging": "0",
        "NrOfRXPDO": str(info.rpdo_count or 0), "NrOfTXPDO": str(info.tpdo_count or 0), "LSS_Supported": "0",
    }  # fmt: skip


def _lists(dictionary: ObjectDictionary) -> Iterator[str]:
    manufacturer = [index for index in dictionary if index in _MANUFACTURER]
    optional = [index for index in dictionary if index not in _MANUFACTURER and index not in _MANDATORY]
    for name, indices in (
        ("MandatoryObjects", [index for index in _MANDATORY if index in dictionary]),
        ("OptionalObjects", optional),
        ("ManufacturerObjects", manufacturer),
    ):
        rows = {str(number): f"0x{index:04X}" for number, index in enumerate(indices, 1)}
        yield _section(name, {"SupportedObjects": str(len(indices)), **rows})


def object_sections(one: OdObject) -> Iterable[str]:
    """The sections of an object, lines with LF, without one at the end."""
    if one.object_type == ObjectType.VAR:
        yield _section(f"{one.index:04X}", _entry(one.entries[0]))
        return
    head = {"ParameterName": one.name, "ObjectType": f"0x{one.object_type:X}", "SubNumber": str(len(one.entries))}
    yield _section(f"{one.index:04X}", head)
    for entry in one.entries.values():
        yield _section(f"{one.index:04X}sub{entry.sub_index:X}", _entry(entry))


def _entry(entry: OdEntry) -> dict[str, str]:
    keys = {"ParameterName": entry.name, "ObjectType": f"0x{ObjectType.VAR:X}"}
    if entry.data_type is not None:
        keys["DataType"] = f"0x{entry.data_type.code:04X}"
    keys["AccessType"] = str(entry.access)
    if entry.default is not None:
        keys["DefaultValue"] = _value(entry, entry.default, is_relative=entry.default_relative)
    if entry.value is not None:
        keys["ParameterValue"] = _value(entry, entry.value, is_relative=entry.value_relative)
    return {**keys, "PDOMapping": str(int(bool(entry.pdo_mapping)))}


def _value(entry: OdEntry, data: bytes, *, is_relative: bool) -> str:
    if entry.data_type is not None and entry.data_type.kind is Kind.VISIBLE_STRING:
        return str(entry.data_type.decode(data))
    number = int.from_bytes(data, "little")
    digits = f"0x{number:0{2 * len(data)}X}"
    return f"$NODEID+{digits}" if is_relative else digits
