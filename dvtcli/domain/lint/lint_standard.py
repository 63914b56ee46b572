"""Rules about the communication objects of CiA 301: mandatory objects, types and access."""

from __future__ import annotations

from dvtcli.domain.can_ids import SDO_REQUEST_BASE, SDO_RESPONSE_BASE
from dvtcli.domain.cob_id import CobId
from dvtcli.domain.lint import ERROR, NOTE, WARNING, check
from dvtcli.domain.lint.described import HELD, OF_MANY, DescribedDevice, Found, Spot, at
from dvtcli.domain.object_dictionary import Access, ObjectType, OdEntry
from dvtcli.domain.objects import (
    COB_ID_EMCY,
    COB_ID_SYNC,
    COB_ID_TIME,
    CYCLE_PERIOD,
    DEVICE_TYPE,
    ERROR_REGISTER,
    GUARD_TIME,
    IDENTITY,
    LIFE_TIME_FACTOR,
    PRODUCER_HEARTBEAT,
    RESTORE_PARAMETERS,
    STORE_PARAMETERS,
    SYNC_OVERFLOW,
)
from dvtcli.domain.pdo import Pdo
from dvtcli.domain.rules.can_id import restricted_use
from dvtcli.domain.standard_objects import (
    must_be_writable,
    reserved,
    reserved_sub_index,
    source,
    standard_entry,
    standard_object_type,
)

_NAMES = {DEVICE_TYPE: "device type", ERROR_REGISTER: "error register", IDENTITY: "identity object"}


@check("mandatory-object", ERROR, "0x1000, 0x1001 or 0x1018 is missing", source(0x1000, 0x1001, 0x1018))
def mandatory_object(device: DescribedDevice) -> Found:
    """Every device has them."""
    for index, name in _NAMES.items():
        if index not in device.dictionary:
            yield Spot(section="mandatoryobjects"), f"{index:04X} ({name}) is missing: every device must have it"


@check("vendor-id-object", ERROR, "0x1018 has no sub-index 01, the vendor-ID", source(0x1018))
def vendor_id_object(device: DescribedDevice) -> Found:
    """Only the other parts of the identity are optional."""
    if IDENTITY in device.dictionary and 1 not in device.dictionary[IDENTITY].entries:
        yield Spot(IDENTITY), "no sub-index 01: the vendor-ID is mandatory"


@check("standard-type", ERROR, "an object of 0x1000 to 0x1BFF has another length than in CiA 301", "CiA 301, 7.5.2")
def standard_type(device: DescribedDevice) -> Found:
    """Every master writes the standard's length, and the device refuses it."""
    yield from _other_types(device, of_same_length=False)


@check(
    "standard-kind",
    WARNING,
    "an object of 0x1000 to 0x1BFF has another data type than in CiA 301, but the same length",
    "CiA 301, 7.5.2",
)
def standard_kind(device: DescribedDevice) -> Found:
    """COB-IDs and identities read as negative numbers."""
    yield from _other_types(device, of_same_length=True)


@check("standard-access", WARNING, "an object of 0x1000 to 0x1BFF cannot be read, or can be written although "
       "CiA 301 fixes it", "CiA 301, 7.5.2")  # fmt: skip
def standard_access(device: DescribedDevice) -> Found:
    """A device may make a writable object read-only; for PDOs see `fixed-pdo`."""
    for entry in device.entries:
        standard = standard_entry(entry.index, entry.sub_index)
        if standard is None or standard.access is None:
            continue
        if entry.access is Access.WO or (entry.access.writable and not standard.access.writable):
            yield at(entry, "accesstype"), f"is {entry.access}; CiA 301 has {standard.access}"


@check("standard-read-only", WARNING, "an object of 0x1000 to 0x13FF cannot be written, although CiA 301 has it rw",
       "CiA 301, 7.5.2")  # fmt: skip
def standard_read_only(device: DescribedDevice) -> Found:
    """A master that configures the object gets an abort; for PDOs see `fixed-pdo`."""
    for entry in device.entries:
        if must_be_writable(entry.index, entry.sub_index, entry.access):
            yield at(entry, "accesstype"), f"is {entry.access}; CiA 301 has rw"


@check("reserved-sub-index", NOTE, "a PDO communication parameter has sub-index 04, which is reserved",
       source(0x1400, 0x1800))  # fmt: skip
def reserved_sub_indices(device: DescribedDevice) -> Found:
    """CiA 301 lets no device have it; a device that is as its file does."""
    for entry in device.entries:
        if reserved_sub_index(entry.index, entry.sub_index):
            yield at(entry), "CiA 301 reserves this sub-index"


@check("standard-object-type", WARNING, "an object of 0x1000 to 0x1BFF has one entry instead of CiA 301's sub-indices, "
       "or the reverse", "CiA 301, 7.5.2")  # fmt: skip
def standard_shape(device: DescribedDevice) -> Found:
    """A reader of sub-index 0 gets an unexpected value."""
    for found in device.objects:
        standard = standard_object_type(found.index)
        if standard is not None and (found.object_type in OF_MANY) is not (standard in OF_MANY):
            yield Spot(found.index, key="objecttype"), f"is {_object_type(found.object_type)}; CiA 301: {standard.name}"


@check("array-or-record", NOTE, "an object of 0x1000 to 0x1BFF is an ARRAY instead of CiA 301's RECORD, or the reverse",
       "CiA 301, 7.5.2")  # fmt: skip
def array_or_record(device: DescribedDevice) -> Found:
    """Some libraries cannot write a mapping that is an ARRAY."""
    for found in device.objects:
        standard = standard_object_type(found.index)
        if standard in OF_MANY and found.object_type in OF_MANY and standard != found.object_type:
            yield Spot(found.index, key="objecttype"), f"is {_object_type(found.object_type)}; CiA 301: {standard.name}"


@check("reserved-index", WARNING, "an index that CiA 301 reserves", "CiA 301, 7.4.1 and 7.5.2")
def reserved_index(device: DescribedDevice) -> Found:
    """A later version of the standard may use the index."""
    for index in device.dictionary:
        if reserved(index):
            yield Spot(index), "the index is reserved"


@check("no-error-control", WARNING, "neither heartbeat (0x1017) nor guarding (0x100C and 0x100D)",
       "CiA 301, 7.2.8.2.2")  # fmt: skip
def no_error_control(device: DescribedDevice) -> Found:
    """A lost node would go unnoticed."""
    if device.dictionary and PRODUCER_HEARTBEAT not in device.dictionary and GUARD_TIME not in device.dictionary:
        yield Spot(section="optionalobjects"), "neither 1017 (heartbeat) nor 100C and 100D (guarding) is described"


@check("half-guarding", WARNING, "guard time without life time factor, or the reverse", source(0x100C, 0x100D))
def half_guarding(device: DescribedDevice) -> Found:
    """Guarding takes both."""
    for there, missing in ((GUARD_TIME, LIFE_TIME_FACTOR), (LIFE_TIME_FACTOR, GUARD_TIME)):
        if there in device.dictionary and missing not in device.dictionary:
            yield Spot(there), f"without {missing:04X}: guarding takes both"


def _other_types(device: DescribedDevice, *, of_same_length: bool) -> Found:
    for entry in device.entries:
        standard = standard_entry(entry.index, entry.sub_index)
        if standard is None or entry.data_type is None or entry.data_type == standard.data_type:
            continue
        if (entry.bits == standard.data_type.bits) is of_same_length:
            yield at(entry, "datatype"), f"is {entry.data_type.name}; CiA 301 has {standard.data_type.name}"


def _object_type(code: int) -> str:
    known = next((object_type.name for object_type in ObjectType if object_type == code), "")
    return known or f"0x{code:X}"


#: COB-IDs of services, and their services.
_SERVICES = {COB_ID_SYNC: "SYNC", COB_ID_TIME: "TIME", COB_ID_EMCY: "EMCY"}
_MOST_COUNTED = 240
#: Sub-indices of 0x1200 with their pre-defined CAN-ID for node 0.
_SDO = {1: SDO_REQUEST_BASE, 2: SDO_RESPONSE_BASE}
_DRIVE, _INPUTS_AND_OUTPUTS = 402, 401
_CONTROLWORD_AND_STATUSWORD = (0x6040, 0x6041)
_FIRST_PROFILE_INDEX, _LAST_PROFILE_INDEX = 0x6000, 0x67FF


@check("service-can-id", WARNING, "SYNC, TIME or EMCY has a default CAN-ID that CiA 301 restricts",
       "CiA 301, 7.3.5")  # fmt: skip
def service_can_id(device: DescribedDevice) -> Found:
    """The CAN-ID would collide with NMT, SDO or heartbeat."""
    for index, service in _SERVICES.items():
        number = device.number(index)
        if number is None:
            continue
        cob_id = CobId.from_raw(number & 0xFFFF_FFFF)
        use = None if cob_id.extended or not cob_id.fits_frame else restricted_use(cob_id.can_id)
        if use and not (index == COB_ID_EMCY and number >> 31):
            yield Spot(index, 0, HELD), f"{service} has CAN-ID {cob_id}, which CiA 301 restricts: {use}"


@check("sync-without-period", WARNING, "the device produces SYNC (0x1005, bit 30), but has no period (0x1006)",
       source(0x1005, 0x1006))  # fmt: skip
def sync_without_period(device: DescribedDevice) -> Found:
    """The device would never send a SYNC."""
    number = device.number(COB_ID_SYNC)
    if number is not None and number >> 30 & 1 and not device.number(CYCLE_PERIOD):
        yield Spot(COB_ID_SYNC, 0, HELD), "produces SYNC (bit 30), and 1006 (period) is missing or 0"


@check("sync-counter", WARNING, "the default of 0x1019 is 1 or more than 240", source(0x1019))
def sync_counter(device: DescribedDevice) -> Found:
    """Both are reserved."""
    number = device.number(SYNC_OVERFLOW)
    if number is not None and (number == 1 or number > _MOST_COUNTED):
        yield Spot(SYNC_OVERFLOW, 0, HELD), f"is {number}; the SYNC counter overflows at 2..{_MOST_COUNTED}, or is 0"


@check("sdo-can-id", WARNING, "the default SDO server has other CAN-IDs than 0x600 and 0x580 plus node-ID, or without "
       "$NODEID",
       source(0x1200))  # fmt: skip
def sdo_can_id(device: DescribedDevice) -> Found:
    """No client could reach the node."""
    for sub_index, base in _SDO.items():
        number, entry = device.number(0x1200, sub_index), device.dictionary.entry(0x1200, sub_index)
        if number is None or entry is None:
            continue
        if number != base + device.node_id:
            text = f"is 0x{number:X}; the default SDO has 0x{base:X} plus node-ID ($NODEID+0x{base:X})"
            yield Spot(0x1200, sub_index, HELD), text
        elif not device.configured and not entry.default_relative:
            text = f"is 0x{number:X} without $NODEID: it is right for node {device.node_id} only ($NODEID+0x{base:X})"
            yield Spot(0x1200, sub_index, HELD), text


@check(
    "fixed-cob-id",
    NOTE,
    "a COB-ID that is enabled by default does not depend on the node-ID: it is the same on every node",
    "CiA 301, 7.3.5; CiA 306, 4.6.3: $NODEID",
)
def fixed_cob_id(device: DescribedDevice) -> Found:
    """Two such devices on one bus collide. A DCF is exempt: it is for one node."""
    if device.configured:
        return
    for entry in device.entries:
        if _is_cob_id(entry) and entry.default is not None and not entry.default_relative:
            number = int.from_bytes(entry.default, "little")
            if number and not number >> 31 & 1:
                yield at(entry, "defaultvalue"), f"0x{number:X} without $NODEID: two of these devices on a bus meet"


@check("store-without-restore", NOTE, "store (0x1010) without restore (0x1011), or the reverse",
       source(0x1010, 0x1011))  # fmt: skip
def store_without_restore(device: DescribedDevice) -> Found:
    """Restoring the defaults is impossible."""
    for there, missing in ((STORE_PARAMETERS, RESTORE_PARAMETERS), (RESTORE_PARAMETERS, STORE_PARAMETERS)):
        if there in device.dictionary and missing not in device.dictionary:
            yield Spot(there), f"without {missing:04X}"


@check("profile-objects", WARNING, "the objects that the device profile of 0x1000 asks for are missing",
       f"{source(0x1000)}; CiA 401; CiA 402")  # fmt: skip
def profile_objects(device: DescribedDevice) -> Found:
    """A drive without controlword and statusword, an I/O module without any input or output."""
    number = device.number(DEVICE_TYPE)
    profile = None if number is None else number & 0xFFFF
    if profile == _DRIVE:
        missing = [f"{index:04X}" for index in _CONTROLWORD_AND_STATUSWORD if index not in device.dictionary]
        if missing:
            yield Spot(DEVICE_TYPE, 0, HELD), f"a drive (CiA 402) without {' and '.join(missing)}"
    inputs_or_outputs = any(
        _FIRST_PROFILE_INDEX <= index <= _LAST_PROFILE_INDEX for index in (*device.dictionary, *device.added)
    )
    if profile == _INPUTS_AND_OUTPUTS and not inputs_or_outputs:
        yield Spot(DEVICE_TYPE, 0, HELD), "an I/O module (CiA 401) without any input or output"


def _is_cob_id(entry: OdEntry) -> bool:
    pdo = Pdo.at(entry.index)
    if pdo is not None:
        return entry.index == pdo.communication_index and entry.sub_index == 1 and pdo.number <= 4
    return entry.index == COB_ID_EMCY
