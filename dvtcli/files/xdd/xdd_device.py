"""Read the device data of an XDD or XDC: DeviceIdentity, NetworkManagement, baudRate, dummyUsage (CiA 311).

Missing numbers come from the identity object.
"""

from __future__ import annotations

import re

from dvtcli.domain.object_dictionary import Commissioning, DeviceInfo, OdObject
from dvtcli.files.eds.findings import Findings
from dvtcli.files.eds.numbers import read_number
from dvtcli.files.eds.read_rules import BAD_LINE, BAD_NUMBER, DEVICE_IDENTITY, NO_NODE_ID, NODE_ID
from dvtcli.files.xdd.xdd_rules import COMMISSIONING
from dvtcli.files.xdd.xml_tree import XmlElement

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
    given = _whole(text)
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


def _whole(text: str) -> int | None:
    try:
        return read_number(text)
    except ValueError:
        return None


def _number(element: XmlElement, name: str, highest: int, findings: Findings) -> int | None:
    """Read the decimal number *name* of *element*; None if absent, or malformed (reported)."""
    text = element.attributes.get(name, "").strip()
    if not text:
        return None
    number = _whole(text)
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
    node_id = _whole(text)
    if node_id is not None and 1 <= node_id <= _HIGHEST_NODE_ID:
        return node_id
    if node_id in (0, _UNCONFIGURED):
        findings.add(NO_NODE_ID, placed.line, f"nodeID={node_id} means not configured")
    else:
        said = f"nodeID={text[:40]} is no node-ID, which is 1..127: the node of the values is not known; ignored"
        findings.add(NODE_ID, placed.line, said, value_lost=True)
    return None


def _characteristics(root: XmlElement) -> dict[str, int]:
    """Read dvtcli's entries in DeviceFunction, because CiA 311 has no other place for them."""
    found: dict[str, int] = {}
    for name, content in map(characteristic, root.anywhere("characteristic")):
        number = _whole(content)
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
        findings.add(COMMISSIONING, placed.line, f"actualBaudRate={text[:40]!r} is no bit rate; ignored")
    return Commissioning(
        placed.attributes.get("nodeName", "").strip(),
        None if rate is None else int(rate[1]),
        _number(placed, "networkNumber", _U32, findings),
        placed.attributes.get("networkName", "").strip(),
        _flag(placed, "CANopenManager"),
        serial_number,
    )
