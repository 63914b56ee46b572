"""Write an object dictionary as an XDD or XDC (CiA 311, version 1.1), or other values into an XDC.

An object's attributes hold its data; the ApplicationProcess gets a parameter only for contents without an attribute: a
unit, or an access type of EDS files without a mapping.
"""

from __future__ import annotations

import codecs
import re
from collections import Counter
from collections.abc import Iterator, Mapping
from contextlib import suppress
from dataclasses import replace
from datetime import datetime
from xml.etree import ElementTree
from xml.sax.saxutils import escape

from dvtcli.domain.object_dictionary import Access, ObjectDictionary, ObjectType, OdEntry, OdObject
from dvtcli.domain.objects import IDENTITY, MANDATORY, MANUFACTURER_AREA
from dvtcli.domain.profile import ObjectAddress
from dvtcli.domain.scaling import parse_offset
from dvtcli.domain.text import safe
from dvtcli.errors import InputFileError
from dvtcli.files.dbc import decimal
from dvtcli.files.eds.findings import Findings
from dvtcli.files.eds.numbers import same_value, written_limit, written_value
from dvtcli.files.eds.write_dcf import DcfText, refuse_unlike_values, value_text
from dvtcli.files.file_info import NO_DATE, as_attributes
from dvtcli.files.xdd.xdd_parameters import TYPES, Parameter
from dvtcli.files.xdd.xdd_reader import NAMESPACES, XddFile, number_of, parse_xdd
from dvtcli.files.xdd.xml_tree import XmlElement

_XSI = "http://www.w3.org/2001/XMLSchema-instance"
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
    held = dictionary.entry(IDENTITY, 3)
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
    mandatory = sum(index in dictionary for index in MANDATORY)
    own = sum(index in MANUFACTURER_AREA for index in dictionary)
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


_ACTUAL, _DEFAULT, _REFERENCE = "actualValue", "defaultValue", "uniqueIDRef"
#: encodings in which a letter of a tag has more than one byte
_WIDE = (codecs.BOM_UTF16_LE, codecs.BOM_UTF16_BE, b"<\0", b"\0<")
_ATTRIBUTE = re.compile(rb"""\s+([^\s=<>/"']+)\s*=\s*("[^"<]*"|'[^'<]*')""")
_TAG = re.compile(rb"<[^\s<>/]+")
_QUOTES = {'"': "&quot;"}


def change_values(data: bytes, source: str, values: Mapping[ObjectAddress, bytes], node_id: int) -> DcfText:
    """Return the XDC *data* (named *source*) with those of *values* that it does not mean already.

    *values* of *node_id* go by index and sub-index. Raises InputFileError if *data* is no XDC, is in UTF-16, or a value
    does not read back.
    """
    if data.startswith(_WIDE):
        raise InputFileError(f"{source} is in UTF-16, in which values cannot be changed", place=f"{source}:1")
    xdc = parse_xdd(data, source)
    writer = _Writer(xdc, data)
    described = dict(_elements(xdc))
    left_out = dict.fromkeys(values.keys() - described.keys(), "the file does not describe it")
    told: dict[ObjectAddress, bytes] = {}
    changes: dict[ObjectAddress, bytes] = {}
    for (index, sub_index), element in described.items():
        entry = xdc.dictionary[index].entries[sub_index]
        if (value := replace(entry, default=None).initial(node_id)) is not None:
            told[index, sub_index] = value
        wanted = values.get((index, sub_index))
        if wanted is None or same_value(entry.data_type, entry.initial(node_id), wanted):
            continue
        try:
            writer.write(element, entry, wanted)
        except ValueError as why:
            left_out[index, sub_index] = str(why)
        else:
            changes[index, sub_index] = wanted
    made = writer.to_bytes()
    refuse_unlike_values(parse_xdd(made, source).dictionary, told | changes, node_id)
    return DcfText(made, tuple(changes), left_out)


def _elements(xdc: XddFile) -> Iterator[tuple[ObjectAddress, XmlElement]]:
    """Iterate over the entries of the dictionary, each with the element that describes it."""
    unread = Findings()
    for index, element in xdc.objects.items():
        entries = xdc.dictionary[index].entries
        subs: dict[int | None, XmlElement] = {}
        for sub in element.all("CANopenSubObject"):
            subs.setdefault(number_of(sub, "subIndex", 0xFF, unread), sub)
        for sub_index in entries:
            yield (index, sub_index), subs.get(sub_index, element)


class _Writer:
    """The XDC *xdc* with changed attributes in its *data*."""

    def __init__(self, xdc: XddFile, data: bytes) -> None:
        self._parameters, self._data = xdc.parameters, data
        self._references = Counter(
            item.attributes.get(_REFERENCE, "")
            for element in xdc.objects.values()
            for item in (element, *element.all("CANopenSubObject"))
        )
        #: new bytes by where those begin and end that they replace
        self._edits: dict[tuple[int, int], bytes] = {}

    def write(self, element: XmlElement, entry: OdEntry, wanted: bytes) -> None:
        """Let *element* and its parameter, if that has a value, say *wanted*; raises ValueError with the reason."""
        name = element.attributes.get(_REFERENCE, "")
        parameter = self._parameters.get(name) if name else None
        own, of_parameter = element.attributes.get(_ACTUAL), _actual_of(parameter)
        like = own or ("" if parameter is None else parameter.value(_ACTUAL)) or element.attributes.get(_DEFAULT, "")
        text = value_text(entry.data_type, wanted, like)
        if safe(text) != text or not text.isascii():
            raise ValueError("it has characters that an attribute of the file cannot have")
        if of_parameter is not None and self._references[name] == 1:
            self._set(of_parameter, "value", text)
            if own is None:
                return
        elif own is None and parameter is not None and parameter.value(_ACTUAL) is not None:
            others = "which other objects have, too" if of_parameter is not None else "which has it from its template"
            raise ValueError(f"its value is that of the parameter {name}, {others}")
        self._set(element, _ACTUAL, text)

    def _set(self, element: XmlElement, name: str, text: str) -> None:
        """Let the attribute *name* of *element* be *text*; a new one stands behind the default value, else last."""
        tag = _TAG.match(self._data, element.start)
        if tag is None:
            raise AssertionError(f"no tag begins at {element.start}")
        at = last = tag.end()
        while (found := _ATTRIBUTE.match(self._data, at)) is not None:
            at = found.end()
            local = found[1].rpartition(b":")[2].decode("latin-1")
            if local == name:
                self._edits[found.start(2), found.end(2)] = _quoted(text)
                return
            if local == _DEFAULT:
                last = at
        place = last if last != tag.end() else at
        self._edits[place, place] = b" " + name.encode() + b"=" + _quoted(text)

    def to_bytes(self) -> bytes:
        """Return the file with its edits."""
        pieces, at = [], 0
        for (begin, end), new in sorted(self._edits.items()):
            pieces += [self._data[at:begin], new]
            at = end
        return b"".join([*pieces, self._data[at:]])


def _actual_of(parameter: Parameter | None) -> XmlElement | None:
    """Return the element with the actual value of *parameter* itself, not of its template."""
    return None if parameter is None else parameter.element.first(_ACTUAL)


def _quoted(text: str) -> bytes:
    return f'"{escape(text, _QUOTES)}"'.encode("ascii")
