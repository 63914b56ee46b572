"""Read XDD and XDC files (CiA 311), and report oddities.

`read_xdd` gives the same object dictionary as the EDS of the same device; objects are built on first access, findings
on request. Refuses files of other kinds by name.
"""

from __future__ import annotations

import re
from collections.abc import Callable, Mapping
from dataclasses import dataclass, replace
from functools import cached_property, partial
from pathlib import Path
from typing import NamedTuple

from dvtcli.domain.object_dictionary import Commissioning, DeviceInfo, ObjectDictionary, ObjectType, OdEntry, OdObject
from dvtcli.domain.objects import IDENTITY
from dvtcli.errors import InputFileError
from dvtcli.files.eds.entry import EntryPlace, read_entry
from dvtcli.files.eds.findings import (
    BAD_LINE,
    BAD_NUMBER,
    DEVICE_IDENTITY,
    NO_NODE_ID,
    NO_SUB_INDICES,
    NODE_ID,
    OBJECT_TYPE,
    SUB_INDICES_OF_VAR,
    SUB_NUMBER,
    EdsFinding,
    Findings,
)
from dvtcli.files.eds.ini import IniValue, Values
from dvtcli.files.eds.numbers import number_key, read_number
from dvtcli.files.input_file import read_input_head
from dvtcli.files.xdd.xdd_parameters import (
    COMMISSIONING,
    MAPPING_DIRECTION,
    MAPPING_WORD,
    NO_INDEX,
    NO_PARAMETER,
    OBJECT_LISTS,
    OBJECT_TWICE,
    OTHER_NAMESPACE,
    Parameter,
    read_parameters,
)
from dvtcli.files.xdd.xml_tree import MOST_BYTES, XmlElement, XmlTree, read_xml

#: The published namespaces of CiA 311.
NAMESPACES = ("http://www.canopen.org/xml/1.0", "http://www.canopen.org/xml/1.1")
_ROOT = "ISO15745ProfileContainer"
_XDD = "an XDD or XDC (CiA 311) has the element CANopenObjectList"


def must_be_canopen(tree: XmlTree, source: str) -> None:
    """Raise InputFileError, naming the actual kind, if *tree* is not CiA 311; *source* is its name for messages."""
    what = _other(tree)
    if what is not None:
        name, hint = what
        raise InputFileError(f"{source} is {name}", place=f"{source}:{tree.root.line}", why=_XDD, hint=hint)


def _other(tree: XmlTree) -> tuple[str, str | None] | None:
    """Return the kind of another file and a remedy; None for CiA 311."""
    named = [tree.namespace, *tree.types]
    if any("powerlink" in name.lower() for name in named):
        return (
            "a description of an Ethernet POWERLINK device (EPSG DS 311), not of a CANopen device",
            "its maker may have an EDS or XDD of the CANopen variant",
        )
    if tree.root.name == "EtherCATInfo":
        hint = "the maker's EDS has the same objects, where the device speaks CANopen"
        return "a description of an EtherCAT device (ESI), not of a CANopen device", hint
    if next(tree.root.anywhere("CANopenObjectList"), None) is not None:
        return None
    if tree.root.name != _ROOT:
        return f"no XDD or XDC: its first element is {tree.root.name[:60]}", None
    return "no description of a CANopen device: it has no CANopenObjectList", None


_KNOWN = frozenset(ObjectType)
_OF_ONE_ENTRY = (ObjectType.NULL, ObjectType.DOMAIN, ObjectType.DEFTYPE, ObjectType.VAR)
#: PDOmapping -> whether it can be mapped, and the access type of EDS files that stands for that direction alone.
_MAPPING = {"no": "", "default": "rw", "optional": "rw", "tpdo": "rwr", "rpdo": "rww"}
_FORBIDS = {"tpdo": ("wo",), "rpdo": ("ro", "const")}
#: PDOmapping -> the access type of a parameter about process data of the other direction: CANopenEditor writes so.
_OTHER_DIRECTION = {"tpdo": "rww", "rpdo": "rwr"}
#: An attribute or child of a parameter -> the equivalent key of an EDS.
_VALUES = {"defaultValue": "defaultvalue", "actualValue": "parametervalue"}
_LIMITS = {"lowLimit": ("lowlimit", "minValue"), "highLimit": ("highlimit", "maxValue")}


def number_of(element: XmlElement, attribute: str, highest: int, findings: Findings) -> int | None:
    """Return index or sub-index of *element*, hexadecimal, 0..*highest*; None if missing or malformed (reported)."""
    text = element.attributes.get(attribute, "").strip()
    try:
        number = int(text.removeprefix("0x"), 16) if text[:1].isalnum() else -1
    except ValueError:
        number = -1
    if 0 <= number <= highest:
        return number
    findings.add(NO_INDEX, element.line, f"{attribute}={text[:20]!r} is not a number of an object; left out")
    return None


class _XddObject(NamedTuple):
    """An object or sub-object: its *element*, and the referenced *parameter*."""

    element: XmlElement
    parameter: Parameter | None

    def values(self, findings: Findings) -> Values:
        """Return the contents of both as the keys of an EDS."""
        found: Values = {}
        self._take(found, "parametername", "name", self._own("name") or self._parameter_text("label"))
        self._take(found, "datatype", "dataType", self._data_type())
        for name, key in _VALUES.items():
            own = self._own(name)
            value = own if own is not None else self.parameter.value(name) if self.parameter else None
            self._take(found, key, name, value)
            self._take_other(found, key, name)
        for name, (key, of_parameter) in _LIMITS.items():
            own = self._own(name)
            value = own if own is not None else self.parameter.limit(of_parameter) if self.parameter else None
            self._take(found, key, name, value)
        self._take(found, "denotation", "denotation", self._own("denotation") or self._parameter_text("denotation"))
        self._take(found, "unit", "unit", self._parameter_text("unit"))
        self._take(found, "factor", "multiplier", self._parameter_text("factor"))
        self._take_flags(found)
        self._take_access(found, findings)
        return found

    def entry(self, values: Values, place: EntryPlace, findings: Findings) -> OdEntry:
        """Build the entry from *values*, with the offset, for which an EDS has no key."""
        return replace(read_entry(values, place, findings), offset=self._parameter_text("offset") or "")

    def _take(self, found: Values, key: str, name: str, value: str | None) -> None:
        """Set *key* to *value*, named *name* in the file; an empty value has no effect."""
        if value is not None and value.strip():
            found[key] = IniValue(name, value.strip(), self.element.line)

    def _take_other(self, found: Values, key: str, name: str) -> None:
        """Keep the parameter's value beside the object's own, if both exist."""
        said = (self.parameter.value(name) or "").strip() if self.parameter else ""
        if self.parameter and said and key in found and found[key].value != said:
            found[key] = found[key]._replace(other=IniValue(name, said, self.parameter.element.line))

    def _own(self, name: str) -> str | None:
        return self.element.attributes.get(name)

    def _parameter_text(self, name: str) -> str | None:
        return None if self.parameter is None else str(getattr(self.parameter, name))

    def _data_type(self) -> str | None:
        own = (self._own("dataType") or "").strip()
        if own:
            return own if own[:2].lower() == "0x" else f"0x{own}"
        code = None if self.parameter is None else self.parameter.type_code
        return None if code is None else f"0x{code:04X}"

    def _take_flags(self, found: Values) -> None:
        flags = (self._own("objFlags") or "").strip()
        self._take(found, "objflags", "objFlags", flags if flags[:2].lower() in ("", "0x") else f"0x{flags}")

    def _take_access(self, found: Values, findings: Findings) -> None:
        """AccessType and PDOMapping of an EDS, from accessType, the parameter's access and PDOmapping."""
        given = (self._own("accessType") or "").strip().lower()
        of_parameter = "" if self.parameter is None else self.parameter.access
        access = of_parameter if not given or (given == "rw" and of_parameter in ("rwr", "rww")) else given
        word = (self._own("PDOmapping") or self._own("PDOMapping") or "").strip().lower()
        mapped = self._mapped(word, access, findings)
        if access == _OTHER_DIRECTION.get(word):
            text = f"PDOmapping={word.upper()}, and the parameter's access is {of_parameter}: PDOmapping counts"
            findings.add(MAPPING_DIRECTION, self.element.line, text)
            access = "rw"
        if mapped == "1" and access == "rw":
            access = _MAPPING[word]
        self._take(found, "accesstype", "accessType", access)
        self._take(found, "pdomapping", "PDOmapping", mapped)

    def _mapped(self, word: str, access: str, findings: Findings) -> str:
        """Return `1` if mappable, `0` if not, empty if unknown."""
        if word and word not in _MAPPING:
            findings.add(MAPPING_WORD, self.element.line, f"PDOmapping={word[:20]} is not known; ignored")
            return ""
        if access in _FORBIDS.get(word, ()):
            text = f"PDOmapping={word.upper()} of an object that is {access}: taken as not mappable"
            findings.add(MAPPING_DIRECTION, self.element.line, text)
            return "0"
        return "" if not word else "1" if _MAPPING[word] else "0"


def build_object(index: int, element: XmlElement, parameters: Mapping[str, Parameter], findings: Findings) -> OdObject:
    """Build the object *index* from its CANopenObject; *parameters* by uniqueID."""
    described = _described(element, parameters, findings)
    subs = element.all("CANopenSubObject")
    values = described.values(Findings() if subs else findings)
    object_type = _object_type(element, has_subs=bool(subs), findings=findings)
    entries = _sub_entries(index, subs, parameters, findings)
    if not entries and object_type in _OF_ONE_ENTRY:
        place = EntryPlace(index, 0, element.line, of_many=False, domain=object_type == ObjectType.DOMAIN)
        entries[0] = described.entry(values, place, findings)
    _check_count(index, element, len(entries), object_type, findings)
    flags = 0 if object_type in _OF_ONE_ENTRY else number_key(values, "objflags", 0, 0xFFFF_FFFF, findings) or 0
    name = values["parametername"].value if "parametername" in values else f"{index:04X}"
    return OdObject(index, name, object_type, dict(sorted(entries.items())), element.line, flags)


def _described(element: XmlElement, parameters: Mapping[str, Parameter], findings: Findings) -> _XddObject:
    name = element.attributes.get("uniqueIDRef", "")
    if name and name not in parameters:
        findings.add(NO_PARAMETER, element.line, f"uniqueIDRef={name[:60]} names no parameter; ignored")
    return _XddObject(element, parameters.get(name) if name else None)


def _sub_entries(
    index: int, subs: list[XmlElement], parameters: Mapping[str, Parameter], findings: Findings
) -> dict[int, OdEntry]:
    entries: dict[int, OdEntry] = {}

    def entry(sub: XmlElement, sub_index: int, found: Findings) -> OdEntry:
        described = _described(sub, parameters, found)
        return described.entry(described.values(found), EntryPlace(index, sub_index, sub.line, of_many=True), found)

    for sub in subs:
        sub_index = number_of(sub, "subIndex", 0xFF, findings)
        if sub_index is None:
            continue
        if sub_index in entries:
            text = f"{index:04X}:{sub_index:02X} is described in line {entries[sub_index].line} too; that entry is used"
            is_lost = entry(sub, sub_index, Findings()).value not in (None, entries[sub_index].value)
            findings.add(OBJECT_TWICE, sub.line, text, value_lost=is_lost, value_unread=True)
            continue
        entries[sub_index] = entry(sub, sub_index, findings)
    return entries


def _object_type(element: XmlElement, *, has_subs: bool, findings: Findings) -> int:
    """Return the object type, never VAR for an object with sub-indices."""
    text = element.attributes.get("objectType", "").strip()
    likely = ObjectType.RECORD if has_subs else ObjectType.VAR
    given = int(text) if text.isascii() and text.isdecimal() and len(text) < 4 else None
    if given is None:
        findings.add(OBJECT_TYPE, element.line, f"objectType={text[:20]!r} is not a number: taken as {likely.name}")
        return likely
    if has_subs and given in _OF_ONE_ENTRY:
        text = f"objectType={given} has no sub-indices, yet the file lists some"
        findings.add(SUB_INDICES_OF_VAR, element.line, text)
        return likely
    if given not in _KNOWN:
        findings.add(OBJECT_TYPE, element.line, f"objectType={given} is not known (CiA 301, table 42)")
    return given


def _check_count(index: int, element: XmlElement, count: int, object_type: int, findings: Findings) -> None:
    if object_type in _OF_ONE_ENTRY:
        return
    if not count:
        findings.add(NO_SUB_INDICES, element.line, f"{index:04X} has no sub-indices")
    text = element.attributes.get("subNumber", "").strip()
    if count and text.isascii() and text.isdecimal() and int(text[:6]) != count:
        findings.add(SUB_NUMBER, element.line, f"subNumber={text[:6]}, but the file has {count} sub-indices")


@dataclass(frozen=True)
class XddFile:
    """A parsed file: its *dictionary*, the *tree* of elements, and its objects' elements by index.

    *first_findings* are those of the device data; `findings` has all.
    """

    dictionary: ObjectDictionary
    tree: XmlTree
    objects: dict[int, XmlElement]
    parameters: dict[str, Parameter]
    first_findings: tuple[EdsFinding, ...]

    @property
    def node_id(self) -> int | None:
        """The node-ID of an XDC's deviceCommissioning, 1..127, or None."""
        return self.dictionary.info.node_id

    @property
    def sections(self) -> int:
        """How many elements describe objects and sub-indices."""
        lists = self.tree.root.anywhere("CANopenObjectList")
        return sum(
            1 + len(element.all("CANopenSubObject"))
            for object_list in lists
            for element in object_list.all("CANopenObject")
        )

    @property
    def understood(self) -> int:
        """The number of objects in the dictionary."""
        many = (len(entry.entries) for entry in self.dictionary.values())
        of_many = sum(1 for element in self.objects.values() if element.first("CANopenSubObject") is None)
        return len(self.objects) + sum(many) - of_many

    @cached_property
    def findings(self) -> tuple[EdsFinding, ...]:
        """Everything odd in the file, by line; this looks at every object and takes its time."""
        findings = Findings(list(self.first_findings))
        for index, element in self.objects.items():
            build_object(index, element, self.parameters, findings)
        return findings.in_order()


def read_xdd(path: Path) -> XddFile:
    """Read the XDD or XDC file at *path*.

    Raises InputFileError if the file is no XDD or XDC, OSError if it cannot be read.
    """
    return parse_xdd(read_input_head(path, MOST_BYTES + 1), path.name)


def parse_xdd(data: bytes, source: str) -> XddFile:
    """Parse the bytes of an XDD or XDC file; *source* is its name for messages.

    Raises InputFileError, with the line, for bad XML, a document type, another bus, or a file without objects.
    """
    tree = read_xml(data, source)
    must_be_canopen(tree, source)
    findings = Findings()
    if tree.namespace not in NAMESPACES:
        findings.add(OTHER_NAMESPACE, tree.root.line, f"namespace {tree.namespace[:80]!r}; read all the same")
    elements = _objects(tree.root, findings)
    parameters = read_parameters(tree.root, findings)
    build = partial(_build, elements, parameters)
    identity = build(IDENTITY) if IDENTITY in elements else None
    info = read_device_info(tree.root, identity, findings)
    objects: dict[int, OdObject | Callable[[], OdObject]] = {index: partial(build, index) for index in elements}
    return XddFile(ObjectDictionary(objects, info, source), tree, elements, parameters, tuple(findings.found))


def _build(elements: dict[int, XmlElement], parameters: dict[str, Parameter], index: int) -> OdObject:
    """Build an object on first access; `XddFile.findings` collects its findings."""
    return build_object(index, elements[index], parameters, Findings())


def _values(element: XmlElement) -> list[tuple[str, str]]:
    """Return the actual values of an object and its sub-indices, as written."""
    every = [element, *element.all("CANopenSubObject")]
    return [(item.attributes.get("subIndex", ""), item.attributes.get("actualValue", "").strip()) for item in every]


def _objects(root: XmlElement, findings: Findings) -> dict[int, XmlElement]:
    """Return the objects of the first list, by index."""
    first, *others = root.anywhere("CANopenObjectList")
    for other in others:
        text = f"a list of objects is in line {first.line} too; this one is left out"
        findings.add(OBJECT_LISTS, other.line, text)
    found: dict[int, XmlElement] = {}
    for element in first.all("CANopenObject"):
        index = number_of(element, "index", 0xFFFF, findings)
        if index is None:
            continue
        if index in found:
            text = f"{index:04X} is in line {found[index].line} too; that entry is used"
            is_lost = _values(element) != _values(found[index])
            findings.add(OBJECT_TWICE, element.line, text, value_lost=is_lost, value_unread=True)
            continue
        found[index] = element
    return found


_U32 = 0xFFFF_FFFF
_HIGHEST_NODE_ID = 127
_UNCONFIGURED = 255
_DUMMY = re.compile(r"Dummy([0-9a-fA-F]{4})\s*=\s*([01])")
_RATE = re.compile(r"\s*([0-9]{1,4})\s*(?:[kK]\s*[bB]|$)")
_TRUE = {"true": True, "1": True, "false": False, "0": False}
#: The characteristics written by dvtcli.
OWN_CHARACTERISTICS = ("RevisionNumber", "LSS_SerialNumber")
_NOTHING = XmlElement("", 1, {})


def read_device_info(root: XmlElement, identity: OdObject | None, findings: Findings) -> DeviceInfo:
    """Read the device data below *root*; missing numbers come from *identity* (0x1018)."""
    device = next(root.anywhere("DeviceIdentity"), _NOTHING)
    general = next(root.anywhere("CANopenGeneralFeatures"), _NOTHING)
    master = next(root.anywhere("CANopenMasterFeatures"), _NOTHING)
    placed = next(root.anywhere("deviceCommissioning"), _NOTHING)
    special = _characteristics(root)
    return DeviceInfo(
        vendor_name=device.said("vendorName"),
        product_name=device.said("productName"),
        vendor_id=_identity(device, "vendorID", identity, 1, findings),
        product_code=_identity(device, "productID", identity, 2, findings),
        revision_number=special.get("RevisionNumber", _of_identity(identity, 3)),
        granularity=_number(general, "granularity", 0xFF, findings),
        rpdo_count=_number(general, "nrOfRxPDO", 512, findings),
        tpdo_count=_number(general, "nrOfTxPDO", 512, findings),
        node_id=_node_id(placed, findings),
        bit_rates_kbit=_bit_rates(root),
        dummies=_dummies(root, findings),
        order_code=device.said("orderNumber"),
        boot_up_master=_flag(master, "bootUpMaster"),
        boot_up_slave=_flag(general, "bootUpSlave"),
        dynamic_channels=_number(general, "dynamicChannels", _U32, findings),
        group_messaging=_flag(general, "groupMessaging"),
        lss_supported=_flag(general, "layerSettingServiceSlave"),
        commissioning=_commissioning(placed, special.get("LSS_SerialNumber"), findings),
    )


def _identity(
    device: XmlElement, name: str, identity: OdObject | None, sub_index: int, findings: Findings
) -> int | None:
    """Read a number of DeviceIdentity, else the default of 1018:*sub_index*; warns if both exist and differ."""
    in_object = _of_identity(identity, sub_index)
    element = device.first(name)
    text = "" if element is None else element.text.strip()
    if element is None or not text:
        return in_object
    given = _whole_number(text)
    if given is None or not 0 <= given <= _U32:
        findings.add(BAD_NUMBER, element.line, f"{name} is {text[:40]!r}, not a number; ignored")
        return in_object
    if in_object not in (None, given):
        said = f"{name} is {text}, but 1018:{sub_index:02X} holds 0x{in_object:08X}"
        findings.add(DEVICE_IDENTITY, element.line, said)
    return given


def _of_identity(identity: OdObject | None, sub_index: int) -> int | None:
    entry = None if identity is None else identity.entries.get(sub_index)
    data = None if entry is None else entry.initial(0)
    return None if data is None or len(data) > 4 else int.from_bytes(data, "little")


def _whole_number(text: str) -> int | None:
    try:
        return read_number(text)
    except ValueError:
        return None


def _number(element: XmlElement, name: str, highest: int, findings: Findings) -> int | None:
    """Read the decimal number *name* of *element*; None if absent, or malformed (reported)."""
    text = element.attributes.get(name, "").strip()
    if not text:
        return None
    number = _whole_number(text)
    if number is None or not 0 <= number <= highest:
        findings.add(BAD_NUMBER, element.line, f"{name}={text[:40]!r} is not within 0..{highest}; ignored")
        return None
    return number


def _flag(element: XmlElement, name: str) -> bool | None:
    return _TRUE.get(element.attributes.get(name, "").strip().lower())


def _bit_rates(root: XmlElement) -> tuple[int, ...]:
    """The bit rates in kbit/s, ascending; `auto-baudRate` is none."""
    found = (_RATE.match(element.attributes.get("value", "")) for element in root.anywhere("supportedBaudRate"))
    return tuple(sorted({int(rate[1]) for rate in found if rate is not None}))


def _dummies(root: XmlElement, findings: Findings) -> frozenset[int] | None:
    """Return the data types that may pad an RPDO; None if the file has no dummyUsage."""
    usage = next(root.anywhere("dummyUsage"), None)
    if usage is None:
        return None
    allowed = set()
    for element in usage.all("dummy"):
        found = _DUMMY.fullmatch(element.attributes.get("entry", "").strip())
        if found is None:
            findings.add(BAD_LINE, element.line, "a dummy whose entry is not Dummy0001=0 or Dummy0001=1; ignored")
        elif found[2] == "1":
            allowed.add(int(found[1], 16))
    return frozenset(allowed)


def _node_id(placed: XmlElement, findings: Findings) -> int | None:
    text = placed.attributes.get("nodeID", "").strip()
    if not text:
        return None
    node_id = _whole_number(text)
    if node_id is not None and 1 <= node_id <= _HIGHEST_NODE_ID:
        return node_id
    if node_id in (0, _UNCONFIGURED):
        findings.add(NO_NODE_ID, placed.line, f"nodeID={node_id} means not configured")
    else:
        said = f"nodeID={text[:40]} is not a node-ID (1..127): the node of the values is unknown; ignored"
        findings.add(NODE_ID, placed.line, said, value_lost=True)
    return None


def _characteristics(root: XmlElement) -> dict[str, int]:
    """Read dvtcli's entries in DeviceFunction, because CiA 311 has no other place for them."""
    found: dict[str, int] = {}
    for name, content in map(characteristic, root.anywhere("characteristic")):
        number = _whole_number(content)
        if name in OWN_CHARACTERISTICS and number is not None and 0 <= number <= _U32:
            found.setdefault(name, number)
    return found


def characteristic(element: XmlElement) -> tuple[str, str]:
    """Return the name and content of a characteristic; empty if it has none."""
    labels = (element.first(part, "label") for part in ("characteristicName", "characteristicContent"))
    name, content = ("" if label is None else label.text.strip() for label in labels)
    return name, content


def _commissioning(placed: XmlElement, serial_number: int | None, findings: Findings) -> Commissioning:
    text = placed.attributes.get("actualBaudRate", "")
    rate = _RATE.match(text)
    if text.strip() and rate is None:
        findings.add(COMMISSIONING, placed.line, f"actualBaudRate={text[:40]!r} is not a bit rate; ignored")
    return Commissioning(
        placed.attributes.get("nodeName", "").strip(),
        None if rate is None else int(rate[1]),
        _number(placed, "networkNumber", _U32, findings),
        placed.attributes.get("networkName", "").strip(),
        _flag(placed, "CANopenManager"),
        serial_number,
    )
