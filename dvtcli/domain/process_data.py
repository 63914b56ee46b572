"""Objects that a store does not keep: commands to a machine, and process data."""

from __future__ import annotations

from dvtcli.domain.object_dictionary import Access, OdEntry


def rpdo_may_take(entry: OdEntry) -> bool:
    """Whether an RPDO can write *entry* (CiA 306, 4.6.3.2); a missing PDOMapping means 0, except for rww."""
    if entry.access is Access.RWW:
        return entry.pdo_mapping is not False
    return bool(entry.pdo_mapping) and entry.access in (Access.RW, Access.WO)


def pdo_may_carry(entry: OdEntry) -> bool:
    """Whether an RPDO can write *entry*, or a TPDO transmit it."""
    return bool(entry.pdo_mapping) or rpdo_may_take(entry)


def may_be_commanded(entry: OdEntry) -> bool:
    """Whether a PDO can carry *entry* and a master write it."""
    return pdo_may_carry(entry) and entry.access.writable


#: Index distance between axes, or logical devices (CiA 402-2, 7)
_AXIS, _LAST = 0x800, 0x9FFF
#: Controlword, target and demand objects of the first axis (CiA 402-2: 0x6040, 0x6042, 0x6071, 0x607A, 0x60B0…0x60B2,
#: 0x60C1, 0x60FE, 0x60FF)
_OF_DRIVES = frozenset({0x6040, 0x6042, 0x6071, 0x607A, 0x60B0, 0x60B1, 0x60B2, 0x60C1, 0x60FE, 0x60FF})
#: Outputs of an I/O module (CiA 401-1, 7.2: digital 0x6200, 0x6220, 0x6300, 0x6320, analogue 0x6400…0x6411)
_OF_OUTPUTS = frozenset({0x6200, 0x6220, 0x6300, 0x6320, 0x6400, 0x6410, 0x6411})
_MAKERS = range(0x2000, 0x6000)
#: Objects that read back a capability or a state: store and restore, high resolution time stamp, OS
#: command, mode, debugger and prompt (CiA 301, 7.5.2.13, 7.5.2.14, 7.5.2.16, 7.5.2.26 to 7.5.2.29), configuration
#: request, request NMT and request node guarding (CiA 302-2), program data and program control (CiA 302-3)
_ANSWERS_STATE = frozenset(
    {0x1010, 0x1011, 0x1013, 0x1023, 0x1024, 0x1025, 0x1026, 0x1F25, 0x1F50, 0x1F51, 0x1F82, 0x1F83}
)


def is_command(index: int, entry: OdEntry | None) -> bool:
    """Whether the object at *index*, described in a file as *entry*, is a command, a setpoint or an output.

    A manufacturer-specific object counts if the file says that a PDO can carry it.
    """
    if not 0x6000 <= index <= _LAST:
        return index in _MAKERS and entry is not None and may_be_commanded(entry)
    first = 0x6000 + (index - 0x6000) % _AXIS
    return first in _OF_DRIVES or (first in _OF_OUTPUTS and entry is not None and may_be_commanded(entry))


def is_standard_command(index: int, entry: OdEntry | None) -> bool:
    """Like `is_command`, but only for standard objects; a manufacturer-specific object may be a setting."""
    return index >= 0x6000 and is_command(index, entry)


def is_controlword(index: int) -> bool:
    """Whether the object at *index* is the controlword of an axis (CiA 402-2, 8.4.1)."""
    return 0x6000 <= index <= _LAST and (index - 0x6000) % _AXIS == 0x40


def answers_with_state(index: int) -> bool:
    """Whether the standard object at *index* reads back another value than was written."""
    return index in _ANSWERS_STATE


def is_control_word(index: int, entry: OdEntry | None, names: str) -> bool:
    """Whether the object at *index*, named *names* in a file, is a control word: its maker may add a busy bit."""
    if not is_controlword(index) and (index not in _MAKERS or entry is None):
        return False
    from dvtcli.domain.process_names import is_named_as_control_word

    return is_controlword(index) or is_named_as_control_word(names)


def commanded_by_other(received: int, hears: OdEntry | None, sent: int, sends: OdEntry | None) -> bool:
    """Whether a standard command or output *received* receives *sent*, another object that is not a command.

    *hears* and *sends* are their descriptions in files. Manufacturer-specific objects are not judged.
    """
    return received != sent and is_standard_command(received, hears) and not is_command(sent, sends)


#: (mask, bits, state): CiA 402-2, 8.4.2
STATES = (
    (0x4F, 0x00, "not ready to switch on"),
    (0x4F, 0x40, "switch on disabled"),
    (0x6F, 0x21, "ready to switch on"),
    (0x6F, 0x23, "switched on"),
    (0x6F, 0x27, "operation enabled"),
    (0x6F, 0x07, "quick stop active"),
    (0x4F, 0x0F, "fault reaction active"),
    (0x4F, 0x08, "fault"),
)


def drive_state(statusword: int) -> str:
    """Drive state in words for *statusword* (0…0xFFFF); empty if not in the standard."""
    return next((text for mask, bits, text in STATES if statusword & mask == bits), "")
