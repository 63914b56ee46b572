"""Rules about the PDOs in a file: both halves present, counts, values at power-on.

`_judged` names the rules shared with `map`; the other rules are about errors that only a file can have.
"""

from __future__ import annotations

import re
from collections.abc import Iterator
from functools import partial

from dvtcli.domain.lint import ERROR, NOTE, WARNING, LintRule, RuleCheck, check
from dvtcli.domain.lint.described import HELD, DefaultPdo, DescribedDevice, Found, Spot
from dvtcli.domain.objects import COB_ID_SYNC
from dvtcli.domain.pdo import MAX_ENTRIES, is_mpdo
from dvtcli.domain.profile import Severity
from dvtcli.domain.rules import can_id, communication, mapped_object, pdo_mapping
from dvtcli.domain.rules.can_id import BASES
from dvtcli.domain.rules.finding import Rule

_COMMUNICATION = "CiA 301, 7.5.2.35 and 7.5.2.37"
_MAPPING = "CiA 301, 7.5.2.36 and 7.5.2.38"
_NO_RTR = 1 << 30


@check("half-pdo", ERROR, "a PDO lacks its communication parameter or its mapping", _COMMUNICATION)
def half_pdo(device: DescribedDevice) -> Found:
    """Half of the PDO's parameters are missing, so the PDO is unusable."""
    for pdo in device.pdos:
        if pdo.has_communication and not pdo.has_mapping:
            yield Spot(pdo.pdo.communication_index), f"{pdo.pdo.label} has no mapping {pdo.pdo.mapping_index:04X}"
        elif pdo.has_mapping and not pdo.has_communication:
            missing = f"{pdo.pdo.communication_index:04X}"
            yield Spot(pdo.pdo.mapping_index), f"{pdo.pdo.label} has no communication parameter {missing}"


@check("no-cob-id", ERROR, "a communication parameter without sub-index 01, the COB-ID", _COMMUNICATION)
def no_cob_id(device: DescribedDevice) -> Found:
    """The PDO can be neither enabled nor disabled."""
    yield from _without(device, 1, "COB-ID")


@check("no-transmission-type", WARNING, "a communication parameter without sub-index 02, the transmission type",
       _COMMUNICATION)  # fmt: skip
def no_transmission_type(device: DescribedDevice) -> Found:
    """The standard requires a transmission type; small devices' RPDOs often lack it."""
    yield from _without(device, 2, "transmission type")


@check("unknown-cob-id", NOTE, "a COB-ID without a default: it is not known whether the PDO is enabled by default",
       _COMMUNICATION)  # fmt: skip
def unknown_cob_id(device: DescribedDevice) -> Found:
    """Tools assume disabled, or 0."""
    for pdo in device.pdos:
        index = pdo.pdo.communication_index
        if pdo.cob_id is None and device.dictionary.entry(index, 1) is not None:
            yield Spot(index, 1), f"{pdo.pdo.label} has a COB-ID without DefaultValue: enabled or not is not known"


@check("base-cob-id", WARNING, "a COB-ID is a base of the pre-defined connection set, without the node-ID",
       "CiA 301, 7.3.5; CiA 306, 4.6.3: $NODEID")  # fmt: skip
def base_cob_id(device: DescribedDevice) -> Found:
    """All nodes would share the CAN-ID, enabled or not. A DCF is exempt: it is for one node."""
    for pdo in () if device.configured else device.pdos:
        index, own = pdo.pdo.communication_index, pdo.pdo.default_can_id(0)
        entry = device.dictionary.entry(index, 1)
        if entry is None or entry.default_relative or pdo.cob_id is None or pdo.cob_id & 0x3FFF_FFFF not in BASES:
            continue
        meant = "$NODEID+" + (f"0x{pdo.cob_id:X}" if own is None else f"0x{pdo.cob_id & 0xC000_0000 | own:X}")
        text = f"{pdo.pdo.label} has 0x{pdo.cob_id:X} without $NODEID on every node, expected {meant}"
        yield Spot(index, 1, HELD), text


@check("count-over-entries", ERROR, "the count of a mapping is above the entries that are described, or above 64",
       _MAPPING)  # fmt: skip
def count_over_entries(device: DescribedDevice) -> Found:
    """The device would have to map missing entries."""
    for pdo in device.pdos:
        if not pdo.has_mapping or pdo.count is None or is_mpdo(pdo.count):
            continue
        entries = len(device.dictionary[pdo.pdo.mapping_index].entries.keys() - {0})
        if pdo.count > min(entries, MAX_ENTRIES):
            yield _count(pdo), f"{pdo.pdo.label} maps {pdo.count} objects; {entries} entries are described"


@check("unknown-count", NOTE, "the count of a mapping has no default: the content of the PDO is unknown", _MAPPING)
def unknown_count(device: DescribedDevice) -> Found:
    """A tool can only ask the device."""
    for pdo in device.pdos:
        index = pdo.pdo.mapping_index
        if pdo.count is None and device.dictionary.entry(index, 0) is not None:
            yield Spot(index, 0), f"{pdo.pdo.label} has a mapping without a count: its content is unknown"


@check("mapped-twice", NOTE, "a TPDO carries the same object twice", _MAPPING)
def mapped_twice(device: DescribedDevice) -> Found:
    """The object takes space twice in every frame. For RPDOs see `double-target`."""
    for pdo in device.pdos:
        seen: dict[tuple[int, int], int] = {}
        for number, entry in enumerate(pdo.config.mapping if pdo.pdo.is_tpdo else (), 1):
            first = seen.setdefault((entry.index, entry.sub_index), number)
            if first != number:
                spot = Spot(pdo.pdo.mapping_index, number, HELD)
                yield spot, f"{pdo.pdo.label} maps {entry.object} as entry {first} and {number}"


@check("mpdo", NOTE, "a PDO is multiplexed by default (count 0xFE or 0xFF): it maps no objects", _MAPPING)
def mpdo(device: DescribedDevice) -> Found:
    """The contents of a multiplexed PDO are given in its frames."""
    for pdo in device.pdos:
        if pdo.config.mpdo is not None:
            yield _count(pdo), f"{pdo.pdo.label} is a multiplexed PDO (count 0x{pdo.config.mpdo:02X})"


@check("empty-entry", ERROR, "the count of a mapping includes an entry that is 0", _MAPPING)
def empty_entry(device: DescribedDevice) -> Found:
    """A device that checks its mapping refuses an empty entry."""
    for one, number, word in _counted(device):
        if word == 0:
            spot = Spot(one.pdo.mapping_index, number, HELD)
            yield spot, f"entry {number} of {one.count} of {one.pdo.label} is 0"


@check("unknown-entry", WARNING, "the count of a mapping includes an entry without a default", _MAPPING)
def unknown_entry(device: DescribedDevice) -> Found:
    """The PDO's contents are unknown from the file."""
    for one, number, word in _counted(device):
        entry = device.dictionary.entry(one.pdo.mapping_index, number)
        if word is None and entry is not None:
            yield (
                Spot(one.pdo.mapping_index, number),
                f"entry {number} of {one.count} of {one.pdo.label} has no default",
            )


@check("enabled-and-empty", NOTE, "a PDO is enabled by default, but has no mapped objects", f"ours: {_MAPPING}")
def enabled_and_empty(device: DescribedDevice) -> Found:
    """Frames would have no data, and the PDO could not be rolled back after a change."""
    for pdo in device.pdos:
        if pdo.cob_id is not None and pdo.config.enabled and pdo.count == 0:
            spot = Spot(pdo.pdo.communication_index, 1, HELD)
            yield spot, f"{pdo.pdo.label} is enabled by default, but has no mapped objects"


@check("fixed-pdo", NOTE, "only a part of a mapping can be written", f"{_MAPPING}; CiA 306, AccessType")
def partly_fixed(device: DescribedDevice) -> Found:
    """A fixed count with writable entries, or the reverse: mapping is impossible, or only with fillers."""
    for pdo in device.pdos:
        if not pdo.has_mapping:
            continue
        entries = device.dictionary[pdo.pdo.mapping_index].entries
        writable = {sub: entry.access.writable for sub, entry in entries.items()}
        if len(set(writable.values())) > 1:
            fixed = ", ".join(f"{sub:02X}" for sub, free in list(writable.items())[:8] if not free)
            yield Spot(pdo.pdo.mapping_index), f"{pdo.pdo.label}: sub-index {fixed} cannot be written, the others can"


@check("cob-id-fixed", NOTE, "the COB-ID of a PDO cannot be written: the PDO cannot be remapped", _COMMUNICATION)
def cob_id_fixed(device: DescribedDevice) -> Found:
    """The mapping sequence begins with disabling the PDO (bit 31)."""
    for pdo in device.pdos:
        entry = device.dictionary.entry(pdo.pdo.communication_index, 1)
        if entry is not None and not entry.access.writable:
            yield (
                Spot(entry.index, 1, "accesstype"),
                f"the COB-ID of {pdo.pdo.label} is {entry.access}: it stays as it is",
            )


@check("synchronous-without-sync", WARNING, "a PDO is synchronous by default on a device without 0x1005",
       "CiA 301, 7.5.2.5 and 7.5.2.35")  # fmt: skip
def synchronous_without_sync(device: DescribedDevice) -> Found:
    """The PDO waits for a SYNC that the device does not support."""
    if COB_ID_SYNC in device.dictionary:
        return
    for pdo in device.pdos:
        kind = pdo.config.communication.transmission_type
        if pdo.config.enabled and kind is not None and kind <= 240:
            spot = Spot(pdo.pdo.communication_index, 2, HELD)
            yield spot, f"{pdo.pdo.label} has transmission type {kind}, and the device has no 1005 (SYNC)"


@check("timer-below-inhibit", WARNING, "the event timer of a TPDO is shorter than its inhibit time", _COMMUNICATION)
def timer_below_inhibit(device: DescribedDevice) -> Found:
    """The inhibit time (100 µs each) wins: frames come later than the event timer (ms) demands."""
    for pdo in device.pdos:
        text = communication.timer_below_inhibit(pdo.config.communication)
        if pdo.pdo.is_tpdo and text:
            yield Spot(pdo.pdo.communication_index, 5, HELD), f"{pdo.pdo.label}: {text}"


@check("default-cob-id", NOTE, "PDO 1 to 4 has another default CAN-ID than the pre-defined connection set's",
       "CiA 301, 7.3.5")  # fmt: skip
def default_cob_id(device: DescribedDevice) -> Found:
    """Masters that rely on the pre-defined connection set do not receive the PDO."""
    for pdo in device.pdos:
        expected = pdo.pdo.default_can_id(device.node_id)
        held = pdo.config.communication.cob_id
        if pdo.cob_id is None or expected is None or device.configured or not held.valid or held.can_id == expected:
            continue
        text = f"{pdo.pdo.label} boots with {held}; the pre-defined set has 0x{expected:03X} for node {device.node_id}"
        yield Spot(pdo.pdo.communication_index, 1, HELD), text


@check("pdo-count", WARNING, "NrOfRXPDO or NrOfTXPDO is not the number of PDOs in the file", "CiA 306, DeviceInfo")
def pdo_count(device: DescribedDevice) -> Found:
    """Masters size their tables by the PDO count."""
    info = device.dictionary.info
    for tpdo, key, stated in ((False, "NrOfRXPDO", info.rpdo_count), (True, "NrOfTXPDO", info.tpdo_count)):
        described = sum(pdo.pdo.is_tpdo is tpdo for pdo in device.pdos)
        if stated is not None and stated != described:
            yield Spot(section="deviceinfo", key=key.lower()), f"{key}={stated}, but {described} are described"


def _without(device: DescribedDevice, sub_index: int, name: str) -> Found:
    for pdo in device.pdos:
        index = pdo.pdo.communication_index
        if pdo.has_communication and sub_index not in device.dictionary[index].entries:
            yield Spot(index), f"{pdo.pdo.label} has no sub-index {sub_index:02X}, its {name}"


def _counted(device: DescribedDevice) -> Iterator[tuple[DefaultPdo, int, int | None]]:
    """Every entry up to the count, with its raw word."""
    for pdo in device.pdos:
        for number, word in pdo.entries.items():
            yield pdo, number, word


def _count(one: DefaultPdo) -> Spot:
    return Spot(one.pdo.mapping_index, 0, HELD)


_PLACE = re.compile(r"0x([0-9A-F]{4}):([0-9A-F]{2})")
_DECLARED: dict[str, Rule] = {
    rule.name: rule for file in (can_id, communication, pdo_mapping, mapped_object) for rule in file.RULES
}


def _judged(
    name: str, severity: Severity, sense: str, of: str = "", meant: Severity = ERROR
) -> RuleCheck[DescribedDevice, Spot]:
    """A check that reports the `map` rule *of* (default: the same name), from severity *meant* on."""
    rule = LintRule(name, severity, f"a PDO of the file {sense}", _DECLARED[of or name].source)
    return RuleCheck(rule, partial(_look, of or name, meant))


def _look(name: str, meant: Severity, device: DescribedDevice) -> Found:
    for finding in device.judged:
        place = _PLACE.fullmatch(finding.place)
        if finding.rule == name and finding.severity is meant and place is not None:
            index, sub_index = int(place[1], 16), int(place[2], 16)
            if name == "object-exists" and (device.number(index, sub_index) or 0) >> 16 in device.added:
                continue  # which modules are connected, and so how many sub-indices there are, is not known
            yield Spot(index, sub_index, HELD), finding.text


#: The other rules of `map` judge a requested change.
CHECKS = (
    _judged("object-exists", ERROR, "maps an object that is not in the file"),
    _judged("direction", ERROR, "sends an unreadable object, or receives a read-only object"),
    _judged("mappable", ERROR, "maps an object with PDOMapping=0"),
    _judged("read-write-object", WARNING, "sends an object for RPDOs (rww)"),
    _judged("entry-length", ERROR, "maps a length other than the object's, 0 bits, or more than 64 bits"),
    _judged("granularity", ERROR, "maps a length that is not a multiple of Granularity"),
    _judged("pdo-length", ERROR, "maps more than 64 bits"),
    _judged("dummy-direction", ERROR, "is a TPDO and skips bits"),
    _judged("dummy-supported", ERROR, "skips bits with a dummy that DummyUsage does not allow"),
    _judged("dummy-length", ERROR, "maps a dummy with a length other than its type's"),
    _judged("double-target", ERROR, "is an RPDO and maps an object twice"),
    _judged("several-writers", NOTE, "receives an object that another enabled RPDO receives, too", "double-target",
            WARNING),
    _judged("transmission-type", ERROR,
        "has a reserved transmission type, or an RTR type that its COB-ID does not allow"),
    _judged("can-id-length", ERROR, "has a CAN-ID of more than 11 bits without bit 29 (frame)"),
    _judged("can-id-restricted", ERROR, "is enabled on a CAN-ID that CiA 301 restricts"),
    _judged("can-id-in-use", ERROR, "is enabled on the CAN-ID of SYNC or of the node's EMCY"),
    _judged("can-id-elsewhere", WARNING, "is enabled on the CAN-ID of TIME or of another node's EMCY", "can-id-in-use",
            WARNING),
    _judged("can-id-clash", ERROR, "is enabled with the CAN-ID of another enabled PDO"),
)  # fmt: skip
