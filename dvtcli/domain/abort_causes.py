"""The usual cause of each SDO abort code of CiA 301, and what to do. Loaded only after an error."""

from __future__ import annotations

import re
from dataclasses import replace

from dvtcli.domain.abort import Abort
from dvtcli.domain.hint import Action, Hint, as_hint

#: The usual cause of each code of CiA 301, table 22, and what to do.
USUAL_CAUSES: dict[int, Hint | str] = {
    0x0503_0000: "usually a second SDO client, or lost frames: end the other master, then try again",
    0x0504_0000: "usually a full bus: the device waited too long for the next frame; try again",
    0x0504_0001: "usually the device lacks this kind of transfer, or a second client uses its SDO channel",
    0x0504_0002: "usually a fault of the device's block transfer",
    0x0504_0003: "usually frames lost in a block transfer: try again",
    0x0504_0004: "usually data lost or changed in a block transfer: try again",
    0x0504_0005: "the device is short of memory: use fewer transfers at once, or reset it",
    0x0601_0000: "usually the object is locked: it needs another NMT state or a login, or this firmware lacks it",
    0x0601_0001: "the object has no value that can be read",
    0x0601_0002: "usually a fixed mapping or COB-ID, or the device needs a login first",
    0x0602_0000: "usually a wrong index (in text it is hexadecimal), or the EDS is of another revision",
    0x0604_0041: "usually an object that the device does not map in this direction, or not with this length",
    0x0604_0042: "usually more than 64 bits in the PDO, or more entries than the device allows",
    0x0604_0043: "another parameter excludes this value: see the device's manual",
    0x0604_0047: "the device's configuration contradicts itself: see its manual",
    0x0606_0000: "often the EEPROM: try again, then suspect the device",
    0x0607_0010: Hint(Action.READ, why="usually the object's length differs from the EDS: {} shows it"),
    0x0607_0012: Hint(Action.READ, why="usually the object is shorter than in the EDS: {} shows its length"),
    0x0607_0013: Hint(Action.READ, why="usually the object is longer than in the EDS: {} shows its length"),
    0x0609_0011: "usually an array that is shorter in this firmware; in text, sub-indices are hexadecimal",
    0x0609_0030: "usually out of range; many devices also answer so if the PDO of a parameter is not disabled first",
    0x0609_0031: "above the object's upper limit, which the device's manual or EDS gives",
    0x0609_0032: "below the object's lower limit, which the device's manual or EDS gives",
    0x0609_0036: "write the other limit first",
    0x060A_0023: "usually another client uses the SDO channel",
    0x0800_0000: Hint(Action.SHOW_FAULTS, why="usually a wrong state, or a missing login: {} may show the cause"),
    0x0800_0020: "usually a wrong signature, or the device cannot store now",
    0x0800_0021: "the device is operated locally: switch it to remote",
    0x0800_0022: "usually the device needs another NMT state, often PRE-OPERATIONAL, or its power stage off",
    0x0800_0023: "usually the device is not configured, or in its boot loader",
    0x0800_0024: "the value does not exist yet",
}
_OBJECT = re.compile(r"(?:0x)?([0-9A-F]{4}):[0-9A-F]{2}")


def usual_cause(code: int, place: str | None) -> Hint | None:
    """Return what to do after abort *code* at *place* (an object, `1A00:03`); None for a code outside the standard."""
    found = USUAL_CAUSES.get(code)
    if found is None:
        return None
    hint, written = as_hint(found), _OBJECT.fullmatch(place or "")
    if written is None:
        return hint
    index = int(written[1], 16)
    if code == Abort.NOT_MAPPABLE and 0x1400 <= index < 0x1C00:
        direction = "tpdo" if index >= 0x1800 else "rpdo"
        return hint + Hint(Action.SHOW_MAPPABLE, {"direction": direction}, "; {} lists what it maps")
    if hint.action is Action.READ:
        return replace(hint, arguments={"object": written[0].removeprefix("0x")})
    return hint
