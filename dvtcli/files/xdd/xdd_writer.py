"""Write an object dictionary as an XDD or XDC (CiA 311, version 1.1).

An object's attributes hold its data; the ApplicationProcess gets a parameter only for contents without an attribute: a
unit, or an access type of EDS files without a mapping.
"""

from __future__ import annotations

from collections.abc import Mapping
from contextlib import suppress
from datetime import datetime
from xml.etree import ElementTree

from dvtcli.domain.object_dictionary import Access, ObjectDictionary, ObjectType, OdEntry, OdObject
from dvtcli.domain.scaling import parse_offset
from dvtcli.files.dbc_text import decimal
from dvtcli.files.eds.written_values import written_limit, written_value
from dvtcli.files.file_info import NO_DATE, as_attributes
from dvtcli.files.xdd.xdd_parameters import TYPES
from dvtcli.files.xdd.xdd_reader import NAMESPACES

_XSI = "http://www.w3.org/2001/XMLSchema-instance"
_MANDATORY = (0x1000, 0x1001, 0x1018)
_MANUFACTURER = range(0x2000, 0x6000)
_OF_ONE_ENTRY = (ObjectType.NULL, ObjectType.DOMAIN, ObjectType.DEFTYPE, ObjectType.VAR)
_DUMMIES = range(1, 8)
#: Access types that an object of CiA 311 does not have: what it has, its parameter's, and the direction they stand for.
_DIRECTED = {Access.RWR: ("readWriteInput", "TPDO"), Access.RWW: ("readWriteOutput", "RPDO")}
_PARAMETER_ACCESS = {Access.RO: "read", Access.WO: "write", Access.RW: "readWrite", Access.CONST: "const"}
_MAPPED = {Access.RO: "TPDO", Access.CONST: "TPDO", Access.WO: "RPDO", Access.RW: "optional"}
_TYPE_NAMES = {code: name for name, code in reversed(TYPES.items()) if name not in ("BYTE", "WORD", "DWORD", "LWORD")}
#: Characters not allowed in XML 1.0, beside control characters and surrogates.
_REFUSED = "\ufffe\uffff"
Element = ElementTree.Element


def xdd_bytes(
    dictionary: ObjectDictionary, file_name: str, made: datetime | None, said: Mapping[str, str] | None = None
) -> bytes:
    """Return *dictionary* as an XDD named *file_name*, dated *made* (None: as in *said*).

    The result is an XDC if *dictionary* has a node-ID or values of its own. *said* are the original file's statements
    about itself, by the keys of an EDS.
    """
    root = Element("co:ISO15745ProfileContainer", {"xmlns:co": NAMESPACES[-1], "xmlns:xsi": _XSI})
    file = _file(file_name, made, as_attributes(said or {}))
    parameters = Element("co:parameterList")
    network = _network_body(dictionary, file, parameters)
    root.append(_profile("Device", _device_body(dictionary, file, parameters)))
    root.append(_profile("CommunicationNetwork", network))
    ElementTree.indent(root)
    text: bytes = ElementTree.tostring(root, encoding="utf-8", xml_declaration=True)
    return text + b"\n"


def _file(file_name: str, made: datetime | None, said: Mapping[str, str]) -> dict[str, str]:
    day = NO_DATE if made is None else made.strftime("%Y-%m-%d")
    clock = {} if made is None else {"fileCreationTime": made.strftime("%H:%M:%S")}
    return {
        "formatName": "CANopen", "formatVersion": "1.0", "fileName": file_name, "fileCreator": "dvtcli",
        "fileCreationDate": day, **clock, "fileVersion": "1", "supportedLanguages": "en",
        **{name: _allowed(text) for name, text in said.items()},
    }  # fmt: skip


def _profile(kind: str, body: Element) -> Element:
    profile = Element("co:ISO15745Profile")
    header = _add(profile, "ProfileHeader")
    for name, text in (
        ("ProfileIdentification", f"CANopen {kind} profile"), ("ProfileRevision", "1.1"), ("ProfileName", ""),
        ("ProfileSource", ""), ("ProfileClassID", kind),
    ):  # fmt: skip
        _add(header, name, text=text)
    reference = _add(header, "ISO15745Reference")
    for name, text in (("ISO15745Part", "1"), ("ISO15745Edition", "1"), ("ProfileTechnology", "CANopen")):
        _add(reference, name, text=text)
    profile.append(body)
    return profile


def _device_body(dictionary: ObjectDictionary, file: Mapping[str, str], parameters: Element) -> Element:
    info = dictionary.info
    body = Element("ProfileBody", {"xsi:type": "co:ProfileBody_Device_CANopen", **file})
    identity = _add(body, "co:DeviceIdentity")
    _add(identity, "co:vendorName", text=info.vendor_name)
    if info.vendor_id is not None:
        _add(identity, "co:vendorID", text=f"0x{info.vendor_id:08X}")
    _add(identity, "co:productName", text=info.product_name)
    if info.product_code is not None:
        _add(identity, "co:productID", text=f"0x{info.product_code:08X}")
    if info.order_code:
        _add(identity, "co:orderNumber", text=info.order_code)
    _characteristics(dictionary, body)
    if len(parameters):
        _add(body, "co:ApplicationProcess").append(parameters)
    return body


def _characteristics(dictionary: ObjectDictionary, body: Element) -> None:
    """Write data without a place in CiA 311: a revision number missing in 0x1018, an LSS serial number."""
    info = dictionary.info
    held = dictionary.entry(0x1018, 3)
    default = None if held is None else held.initial(0)
    said = {}
    if info.revision_number is not None and default != info.revision_number.to_bytes(4, "little"):
        said["RevisionNumber"] = f"0x{info.revision_number:08X}"
    if info.commissioning.lss_serial_number is not None:
        said["LSS_SerialNumber"] = str(info.commissioning.lss_serial_number)
    if not said:
        return
    function = _add(body, "co:DeviceFunction")
    found = _add(_add(function, "co:capabilities"), "co:characteristicsList")
    for name, value in said.items():
        one = _add(found, "co:characteristic")
        _add(_add(one, "co:characteristicName"), "label", {"lang": "en"}, name)
        _add(_add(one, "co:characteristicContent"), "label", {"lang": "en"}, value)


def _network_body(dictionary: ObjectDictionary, file: Mapping[str, str], parameters: Element) -> Element:
    body = Element("ProfileBody", {"xsi:type": "co:ProfileBody_CommunicationNetwork_CANopen", **file})
    layers = _add(body, "ApplicationLayers")
    layers.append(_object_list(dictionary, parameters))
    dummies = dictionary.info.dummies
    if dummies is not None:
        usage = _add(layers, "dummyUsage")
        for code in sorted({*_DUMMIES, *dummies}):
            _add(usage, "dummy", {"entry": f"Dummy{code:04X}={int(code in dummies)}"})
    rates = _add(_add(_add(body, "TransportLayers"), "PhysicalLayer"), "baudRate")
    for rate in dictionary.info.bit_rates_kbit:
        _add(rates, "supportedBaudRate", {"value": f"{rate} Kbps"})
    _management(dictionary, body)
    return body


def _management(dictionary: ObjectDictionary, body: Element) -> None:
    info, placed = dictionary.info, dictionary.info.commissioning
    management = _add(body, "NetworkManagement")
    features = {
        "groupMessaging": info.group_messaging, "dynamicChannels": info.dynamic_channels,
        "granularity": info.granularity, "nrOfRxPDO": info.rpdo_count, "nrOfTxPDO": info.tpdo_count,
        "bootUpSlave": info.boot_up_slave, "layerSettingServiceSlave": info.lss_supported,
    }  # fmt: skip
    _add(management, "CANopenGeneralFeatures", _known(features))
    _add(management, "CANopenMasterFeatures", _known({"bootUpMaster": info.boot_up_master}))
    rate = None if placed.bit_rate_kbit is None else f"{placed.bit_rate_kbit} Kbps"
    where = {
        "nodeID": info.node_id, "nodeName": placed.node_name or None, "actualBaudRate": rate,
        "networkNumber": placed.network_number, "networkName": placed.network_name or None,
        "CANopenManager": placed.is_manager,
    }  # fmt: skip
    if said := _known(where):
        _add(management, "deviceCommissioning", said)


def _known(given: Mapping[str, int | str | None]) -> dict[str, str]:
    """Return attributes for known values; flags become `true` and `false`."""
    return {
        name: str(value).lower() if isinstance(value, bool) else str(value)
        for name, value in given.items()
        if value is not None
    }


def _object_list(dictionary: ObjectDictionary, parameters: Element) -> Element:
    mandatory = sum(index in dictionary for index in _MANDATORY)
    own = sum(index in _MANUFACTURER for index in dictionary)
    counts = {
        "mandatoryObjects": str(mandatory), "optionalObjects": str(len(dictionary) - mandatory - own),
        "manufacturerObjects": str(own),
    }  # fmt: skip
    found = Element("co:CANopenObjectList", counts)
    for index in dictionary:
        _object(found, dictionary[index], parameters)
    return found


def _object(found: Element, one: OdObject, parameters: Element) -> None:
    said = {"index": f"{one.index:04X}", "name": one.own_name, "objectType": str(int(one.object_type))}
    if one.object_type in _OF_ONE_ENTRY and set(one.entries) == {0}:
        _add(found, "CANopenObject", said | _said(one.entries[0], parameters))
        return
    flags = {"objFlags": _flags(one.object_flags)} if one.object_flags else {}
    element = _add(found, "CANopenObject", {**said, **flags, "subNumber": str(len(one.entries))})
    for entry in one.entries.values():
        place = {"subIndex": f"{entry.sub_index:02X}", "name": entry.own_name, "objectType": "7"}
        _add(element, "CANopenSubObject", place | _said(entry, parameters))


def _said(entry: OdEntry, parameters: Element) -> dict[str, str]:
    """Return an entry's attributes; adds a parameter if they do not suffice."""
    code = entry.unknown_type if entry.data_type is None else entry.data_type.code
    mapped = entry.pdo_mapping
    direction = _DIRECTED[entry.access][1] if entry.access in _DIRECTED else _MAPPED[entry.access]
    said = {
        "dataType": None if code is None else f"{code:04X}",
        "accessType": "rw" if entry.access in _DIRECTED else str(entry.access),
        "lowLimit": None if entry.low is None else written_limit(entry.low, relative=entry.low_relative),
        "highLimit": None if entry.high is None else written_limit(entry.high, relative=entry.high_relative),
        "defaultValue": _value(entry, entry.default, relative=entry.default_relative),
        "actualValue": _value(entry, entry.value, relative=entry.value_relative),
        "denotation": entry.denotation or None,
        "PDOmapping": None if mapped is None else direction if mapped else "no",
        "objFlags": _flags(entry.object_flags) if entry.object_flags else None,
    }
    found = {name: _allowed(value) for name, value in said.items() if value is not None}
    if entry.unit or _scale(entry) or (entry.access in _DIRECTED and not mapped):
        found["uniqueIDRef"] = _parameter(entry, parameters)
    return found


def _value(entry: OdEntry, data: bytes | None, *, relative: bool) -> str | None:
    return None if data is None else written_value(entry.data_type, data, relative=relative)


def _flags(flags: int) -> str:
    digits = f"{flags:02X}"
    return digits if len(digits) % 2 == 0 else f"0{digits}"


def _parameter(entry: OdEntry, parameters: Element) -> str:
    """Add the parameter for *entry*; returns its name."""
    name = f"UID_{entry.index:04X}_{entry.sub_index:02X}"
    access = _DIRECTED[entry.access][0] if entry.access in _DIRECTED else _PARAMETER_ACCESS[entry.access]
    one = _add(parameters, "co:parameter", {"uniqueID": name, "access": access, **_scale(entry)})
    _add(one, "label", {"lang": "en"}, entry.own_name)
    if entry.data_type is not None and entry.data_type.code in _TYPE_NAMES:
        _add(one, _TYPE_NAMES[entry.data_type.code])
    if entry.unit:
        _add(_add(one, "co:unit", {"multiplier": "1"}), "label", {"lang": "en"}, entry.unit)
    return name


def _scale(entry: OdEntry) -> dict[str, str]:
    """Return offset and multiplier in decimal, without malformed values."""
    found = {}
    for name, text in (("offset", entry.offset), ("multiplier", entry.factor)):
        with suppress(ValueError):
            found[name] = decimal(parse_offset(text))
    return found


def _add(parent: Element, name: str, attributes: Mapping[str, str] | None = None, text: str = "") -> Element:
    given = {key: _allowed(value) for key, value in (attributes or {}).items()}
    found = ElementTree.SubElement(parent, name, given)
    if text:
        found.text = _allowed(text)
    return found


def _allowed(text: str) -> str:
    """Return *text* with ? for each character not allowed in XML 1.0."""
    return "".join("?" if char < " " or char in _REFUSED or "\ud800" <= char <= "\udfff" else char for char in text)
