"""The table of all keys of a network file, from which reader, JSON schema and documentation are made.

Keys are those of dcfgen's YAML (Lely core, python/dcf-tools), and dvtcli's own.
"""

from __future__ import annotations

from collections.abc import Iterable
from enum import StrEnum
from typing import NamedTuple


class Where(StrEnum):
    """The mapping that contains a key."""

    FILE = "file"
    OPTIONS = "options"
    MASTER = "master"
    NODE = "node"
    IDENTITY = "identity"
    TPDO = "tpdo"
    RPDO = "rpdo"
    ENTRY = "entry"
    SDO = "sdo"
    LINK = "link"


class Kind(StrEnum):
    """The kind of a key's value."""

    ANYTHING = "anything"
    INTEGER = "integer"
    NUMBER = "number"
    TRUTH = "true or false"
    TEXT = "text"
    COB_ID = "integer or auto"
    OBJECT = "object"
    VALUE = "value"
    STORE = "true, false, or what to store"
    WATCH = "true, false, or producer: ms"
    TABLE = "mapping"
    NODES = "name: node"
    PDOS = "number: PDO"
    NUMBERS = "sub-index: number"
    PINS = "group: pin: object"
    MEANINGS = "object: unit"
    ENTRIES = "list of objects"
    MODULES = "list of numbers"
    VALUES = "list of values"
    LINKS = "list of links"
    ENDPOINT = "NODE:tpdoN"
    ENDPOINTS = "NODE:rpdoN, or a list"
    HEARTBEAT = "ms or false"


class NetworkKey(NamedTuple):
    """A key: its place, kind of value and meaning; *noted*: known, but without effect.

    Numbers are within *low*..*high* of *unit*. *object* is the object set by the key, with its size in bytes.
    """

    where: Where
    name: str
    kind: Kind
    sense: str
    low: float = 0
    high: float = 0
    unit: str = ""
    object: tuple[int, int, int] | None = None
    noted: bool = False
    required: bool = False


_U8, _U16, _U32 = 0xFF, 0xFFFF, 0xFFFF_FFFF
_TPDO_ONLY = "set on a TPDO only"


def _noted(where: Where, sense: str, *names: str) -> Iterable[NetworkKey]:
    return (NetworkKey(where, name, Kind.ANYTHING, sense, noted=True) for name in names)


def _of_each_pdo(where: Where) -> Iterable[NetworkKey]:
    yield NetworkKey(where, "enabled", Kind.TRUTH, "bit 31 of the COB-ID clear")
    yield NetworkKey(
        where, "cob_id", Kind.COB_ID,
        "CAN-ID, with bit 29 for a 29-bit CAN-ID, bit 30 for no RTR, bit 31 for off; `auto`: the pre-defined CAN-ID "
        "of PDO 1…4, else the next free CAN-ID", 0, _U32,
    )  # fmt: skip
    yield NetworkKey(where, "rtr_allowed", Kind.TRUTH, "bit 30 of the COB-ID clear")
    yield NetworkKey(where, "transmission", Kind.INTEGER, "transmission type", 0, _U8)


KEYS: tuple[NetworkKey, ...] = (
    NetworkKey(Where.FILE, "nodes", Kind.NODES, "the nodes by name; they may stand at the top level, too"),
    NetworkKey(Where.FILE, "defaults", Kind.TABLE, "keys for every node; a node's own keys override them one by one"),
    NetworkKey(Where.FILE, "links", Kind.LINKS, "which RPDOs receive which TPDO"),
    NetworkKey(Where.FILE, "master", Kind.TABLE, "the master; nothing of it is written to a node"),
    NetworkKey(Where.FILE, "options", Kind.TABLE, "dcfgen's own options"),
    NetworkKey(
        Where.OPTIONS, "heartbeat_multiplier", Kind.NUMBER,
        "multiple of the producer's time after which a heartbeat is late; 3 by default", 1, 100,
    ),
    *_noted(Where.OPTIONS, "the folder of dcfgen's output", "dcf_path"),
    *_noted(Where.OPTIONS, "how often a master tries again", "retry_factor"),
    NetworkKey(Where.MASTER, "node_id", Kind.INTEGER, "its node-ID; 255 for none", 1, 255),
    NetworkKey(Where.MASTER, "sync_period", Kind.INTEGER, "how often it sends SYNC", 0, _U32, "µs"),
    NetworkKey(Where.MASTER, "heartbeat_producer", Kind.INTEGER, "how often it sends a heartbeat", 0, _U16, "ms"),
    NetworkKey(
        Where.MASTER, "baudrate", Kind.INTEGER, "the bus's bit rate, for load and deadlines; unknown by default", 1,
        1000, "kbit/s",
    ),
    NetworkKey(Where.MASTER, "heartbeat_multiplier", Kind.NUMBER, "as in `options`, for its own heartbeat", 1, 100),
    *_noted(
        Where.MASTER, "of the master", "vendor_id", "product_code", "revision_number", "serial_number",
        "sync_window", "sync_overflow", "time_cob_id", "emcy_inhibit_time", "heartbeat_consumer", "error_behavior",
        "nmt_inhibit_time", "start", "start_nodes", "start_all_nodes", "reset_all_nodes", "stop_all_nodes", "boot_time",
    ),
    NetworkKey(Where.NODE, "node_id", Kind.INTEGER, "its node-ID", 1, 127, required=True),
    NetworkKey(Where.NODE, "dcf", Kind.TEXT, "its EDS, DCF, XDD or XDC, relative to this file (`@BUS_CONFIG_PATH@`: "
                "its folder); or the name of a simulated family; or of a file in the EDS library"),
    NetworkKey(Where.NODE, "eds", Kind.TEXT, "as `dcf`, if `dcf` is absent"),
    NetworkKey(Where.NODE, "modules", Kind.MODULES,
                "the modules of a modular device in their order, by their numbers in [SupportedModules] of `dcf`; by "
                "default read from 0x1027", 1, _U16),
    NetworkKey(Where.NODE, "profile", Kind.TEXT, "its device family (a profile); by default found by its identity"),
    NetworkKey(Where.NODE, "identity", Kind.TABLE, "the required values of 0x1018; another device is not written"),
    NetworkKey(Where.NODE, "vendor_id", Kind.INTEGER, "as `identity.vendor`; 0: not checked", 0, _U32),
    NetworkKey(Where.NODE, "product_code", Kind.INTEGER, "as `identity.product`; 0: not checked", 0, _U32),
    NetworkKey(Where.NODE, "revision_number", Kind.INTEGER, "as `identity.revision`; 0: not checked", 0, _U32),
    NetworkKey(Where.NODE, "serial_number", Kind.INTEGER, "as `identity.serial`; 0: not checked", 0, _U32),
    NetworkKey(Where.NODE, "tpdo", Kind.PDOS, "TPDOs by number, 1…512"),
    NetworkKey(Where.NODE, "rpdo", Kind.PDOS, "RPDOs by number, 1…512"),
    NetworkKey(Where.NODE, "sdo", Kind.VALUES, "objects and the values that they should hold"),
    NetworkKey(
        Where.NODE, "heartbeat_producer", Kind.INTEGER, "how often it sends a heartbeat; 0: never", 0, _U16, "ms",
        (0x1017, 0, 2),
    ),
    NetworkKey(
        Where.NODE, "heartbeat_consumer", Kind.WATCH,
        "the producers (name or node-ID) that it monitors, each with the time after which its heartbeat is late; "
        "0: not monitored; true: the master", 0, _U16, "ms",
    ),
    NetworkKey(Where.NODE, "guard_time", Kind.INTEGER, "node guarding", 0, _U16, "ms", (0x100C, 0, 2)),
    NetworkKey(
        Where.NODE, "life_time_factor", Kind.INTEGER, "times `guard_time` is its life time", 0, _U8, "", (0x100D, 0, 1)
    ),
    NetworkKey(
        Where.NODE, "sync_cob_id", Kind.INTEGER, "COB-ID of SYNC, with bit 30 if it sends SYNC", 0, _U32, "",
        (0x1005, 0, 4),
    ),
    NetworkKey(
        Where.NODE, "sync_period", Kind.INTEGER, "period of SYNC, as received or sent by this node", 0, _U32, "µs",
        (0x1006, 0, 4),
    ),
    NetworkKey(Where.NODE, "time_cob_id", Kind.INTEGER, "COB-ID of the time stamp", 0, _U32, "", (0x1012, 0, 4)),
    NetworkKey(
        Where.NODE, "error_behavior", Kind.NUMBERS, "its behaviour after an error, by sub-index of 0x1029", 0, _U8
    ),
    NetworkKey(Where.NODE, "vpdo", Kind.PINS, "virtual PDOs: the object of each pin of a group, or `none`"),
    NetworkKey(
        Where.NODE, "physical", Kind.MEANINGS,
        "units of its objects, as in `[physical]` of a profile: `6C01:02: 0.1 bar`; nothing of it is written",
    ),
    NetworkKey(
        Where.NODE, "store", Kind.STORE,
        "the group to store afterwards: true or `all`, `communication`, `application`, a sub-index of 0x1010", 1, 127,
    ),
    NetworkKey(Where.NODE, "prune", Kind.TRUTH, "whether enabled PDOs that are not in the file are disabled"),
    NetworkKey(
        Where.NODE, "stamp", Kind.TRUTH,
        "whether a date and time that stand for these settings are written to 0x1020, before the store; needs "
        "store: true",
    ),
    *_noted(Where.NODE, "the folder of dcfgen's output", "dcf_path"),
    *_noted(Where.NODE, "how the master watches the node", "heartbeat_multiplier", "retry_factor"),
    *_noted(
        Where.NODE, "done by dcfgen's master at start, never by dvtcli", "boot", "mandatory", "reset_communication",
        "restore_configuration", "software_file", "software_version", "configuration_file",
    ),
    NetworkKey(Where.IDENTITY, "vendor", Kind.INTEGER, "vendor-ID, 0x1018:01", 0, _U32),
    NetworkKey(Where.IDENTITY, "product", Kind.INTEGER, "product code, 0x1018:02", 0, _U32),
    NetworkKey(Where.IDENTITY, "revision", Kind.INTEGER, "revision number, 0x1018:03", 0, _U32),
    NetworkKey(Where.IDENTITY, "serial", Kind.INTEGER, "serial number, 0x1018:04", 0, _U32),
    *_of_each_pdo(Where.TPDO),
    NetworkKey(Where.TPDO, "inhibit_time", Kind.INTEGER, "inhibit time", 0, _U16, "100 µs"),
    NetworkKey(Where.TPDO, "inhibit_ms", Kind.NUMBER, "inhibit time, in steps of 0.1", 0, 6553.5, "ms"),
    NetworkKey(Where.TPDO, "event_timer", Kind.INTEGER, "event timer; 0: off", 0, _U16, "ms"),
    NetworkKey(Where.TPDO, "sync_start", Kind.INTEGER, "SYNC start value", 0, _U8),
    NetworkKey(Where.TPDO, "mapping", Kind.ENTRIES, "all of its objects in frame order; [] for none"),
    *_noted(Where.TPDO, "set on an RPDO only; event_timer is the time of a TPDO", "event_deadline"),
    *_of_each_pdo(Where.RPDO),
    NetworkKey(
        Where.RPDO, "event_deadline", Kind.INTEGER, "time without a frame after which the node reports an error", 0,
        _U16, "ms",
    ),
    NetworkKey(Where.RPDO, "mapping", Kind.ENTRIES, "all of its objects in frame order; [] for none"),
    *_noted(Where.RPDO, _TPDO_ONLY, "inhibit_time", "sync_start"),
    *_noted(Where.RPDO, f"{_TPDO_ONLY}; event_deadline is the time of an RPDO", "event_timer"),
    NetworkKey(Where.ENTRY, "index", Kind.INTEGER, "the object's index", 0, _U16, required=True),
    NetworkKey(Where.ENTRY, "sub_index", Kind.INTEGER, "its sub-index, 0 by default", 0, _U8),
    NetworkKey(Where.ENTRY, "bits", Kind.INTEGER, "its length, found automatically by default", 1, 64, "bits"),
    NetworkKey(Where.SDO, "index", Kind.INTEGER, "the object's index", 0, _U16),
    NetworkKey(Where.SDO, "sub_index", Kind.INTEGER, "its sub-index, 0 by default", 0, _U8),
    NetworkKey(Where.SDO, "object", Kind.OBJECT, "its name, or `6081:00`, instead of both"),
    NetworkKey(
        Where.SDO, "value", Kind.VALUE,
        "its new value; 0 by default, as in dcfgen; `$NODEID+0x80` follows the node-ID",
    ),
    NetworkKey(Where.LINK, "from", Kind.ENDPOINT, "the TPDO", required=True),
    NetworkKey(Where.LINK, "to", Kind.ENDPOINTS, "the RPDOs that receive it", required=True),
    NetworkKey(
        Where.LINK, "heartbeat", Kind.HEARTBEAT,
        "the producer's heartbeat, which the consumers monitor; false: not monitored; by default the producer's time",
        1, _U16, "ms",
    ),
)  # fmt: skip

OF: dict[Where, dict[str, NetworkKey]] = {
    where: {key.name: key for key in KEYS if key.where is where} for where in Where
}
#: equivalent keys: if a node has either, `defaults` do not add the other
INSTEAD = {"inhibit_time": "inhibit_ms", "inhibit_ms": "inhibit_time"}
#: words for `store` beside true, false and a number
STORE_WORDS = ("all", "communication", "application")
