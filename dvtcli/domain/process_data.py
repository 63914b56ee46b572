"""Objects that a store does not keep: commands to a machine, and process data, also by their names."""

from __future__ import annotations

import re

from dvtcli.domain.object_dictionary import Access, OdEntry, normalised
from dvtcli.domain.objects import MANUFACTURER_AREA, PROFILE_AREA, in_first


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


#: Controlword, target and demand objects of the first axis (CiA 402-2: 0x6040, 0x6042, 0x6071, 0x607A, 0x60B0…0x60B2,
#: 0x60C1, 0x60FE, 0x60FF)
_OF_DRIVES = frozenset({0x6040, 0x6042, 0x6071, 0x607A, 0x60B0, 0x60B1, 0x60B2, 0x60C1, 0x60FE, 0x60FF})
#: Outputs of an I/O module (CiA 401-1, 7.2: digital 0x6200, 0x6220, 0x6300, 0x6320, analogue 0x6400…0x6411)
_OF_OUTPUTS = frozenset({0x6200, 0x6220, 0x6300, 0x6320, 0x6400, 0x6410, 0x6411})
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
    if index not in PROFILE_AREA:
        return index in MANUFACTURER_AREA and entry is not None and may_be_commanded(entry)
    first = in_first(index)
    return first in _OF_DRIVES or (first in _OF_OUTPUTS and entry is not None and may_be_commanded(entry))


def is_standard_command(index: int, entry: OdEntry | None) -> bool:
    """Like `is_command`, but only for standard objects; a manufacturer-specific object may be a setting."""
    return index >= 0x6000 and is_command(index, entry)


def is_controlword(index: int) -> bool:
    """Whether the object at *index* is the controlword of an axis (CiA 402-2, 8.4.1)."""
    return index in PROFILE_AREA and in_first(index) == 0x6040


def answers_with_state(index: int) -> bool:
    """Whether the standard object at *index* reads back another value than was written."""
    return index in _ANSWERS_STATE


def is_control_word(index: int, entry: OdEntry | None, names: str) -> bool:
    """Whether the object at *index*, named *names* in a file, is a control word: its maker may add a busy bit."""
    if not is_controlword(index) and (index not in MANUFACTURER_AREA or entry is None):
        return False

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


#: patterns of names, compiled when first used: words for commands, measured values, and PDO data between devices
_PROCESS = (
    r"(?<![a-z])(target|demand|demanded|commanded|commands?|cmds?|set_?points?|set_value|desired|actual|measured|measurements?"
    r"|received?|sent|transmit(ted)?|process_values?|pv|debug_values?|(control|ctrl)_?(word|byte|bits?)|status_?(word|byte|bits?)"
    r"|(digital|analog(ue)?|physical|pulse|relay|pwm)_outputs?|output_(levels?|states?|values?|control)"
    r"|(digital|analog(ue)?|physical)_inputs?|input_(levels?|states?|values?|voltage)|(position|velocity|torque|time)_input"
    r"|(position|speed|velocity|torque)_reference|ref(erence)?_(position|speed|velocity|torque)|interpolation_data|steer_angle|utc"
    r"|scet|[a-z]*(soll|ist)_?werte?|(steuer|status)_?wort)(?![a-z])"
    # at the end of a name: `Deadman switch`, `Pump switch 7`, `Output 3`, `Speed_Ref`, `PWM1`
    r"|(?<![a-z])(switch|inputs?|outputs?|ref|reference|throttle|brake|relays?|pwm|valves?|lamps?|leds?|horn|duty(_(cycle|ratio))?)"
    r"(_?(left|right|inner|outer|front|rear|upper|lower|\d))*$"
)
_CONTROL_WORD = r"(?<![a-z])((control|ctrl|command|cmd)_?(word|byte|bits?|register)|(steuer|kommando)_?wort)(?![a-z])"
#: words of a setting, and of no object with immediate effect
_SURE = (
    r"gains?|k[pid]|kff[av]|limits?|limitation|max(imum)?|min(imum)?|rated|nominal|windows?|thresholds?|time_?out"
    r"|delay|debounce|hysteresis|dead_?band|scal(e|es|ing)|factors?|gear_ratio|numerator|denominator|ramps?|slope|filters?"
    r"|bandwidth|cut_?off|inertia|friction|coefficients?|constant(?!_[a-z])|calibration|config(uration)?|set_?up"
    r"|param(eter)?s?|options?|polarity|inver(t|ted|sion)|types?|units?|resolution|defaults?|assignment"
    r"|(fault|error|safe)_(value|state)|interval|home_position|homing_([a-z]+_)?(offset|method|speed|velocity|acceleration)"
    r"|nenn[a-z]+|[a-z]*grenzen?|[a-z]*begrenzung|faktor|rampe|verzögerung"
)
#: words that turn these into settings: `Output current limit`, `Target reached window`, `Measured value filter`
_SETTING = (
    rf"(?<![a-z])({_SURE}|ranges?|offsets?|corrections?|settings?|masks?|period|function|mode|selection|selector|source)"
    r"(?![a-z])"
)
_SURE_SETTING = rf"(?<![a-z])({_SURE})(?![a-z])"
#: words that decide despite a limit: `Torque limit command`, `Limit switch`
_ACTS = (
    r"(?<![a-z])(targets?|demand|commands?|cmds?|set_?points?|set_value|request|ref|reference|switch|relays?|valves?|lamps?|leds?|horn"
    r"|[a-z]*soll_?werte?)(_?(left|right|inner|outer|front|rear|upper|lower|\d))*$"
)
#: the unit `min`, not a minimum
_PER_MINUTE = r"(?i)(/|\bper)\s*min\b|\bmin\s*\^?-1\b"
_CAMEL = r"(?<=[a-z])(?=[A-Z])"


def is_named_as_process_data(name: str) -> bool:
    """Whether *name* suggests a command, a setpoint, a measured value, an input or an output.

    `Torque set-point`, `StatusWord left` and `Key switch` do; `Nominal current`, `Output current limit` and any name
    without a known word do not.
    """
    words = _words(name)
    return bool(re.search(_PROCESS, words)) and not re.search(_SETTING, words)


def is_named_as_control_word(name: str) -> bool:
    """Whether *name* suggests a control word, such as `Pump control word`."""
    words = _words(name)
    return bool(re.search(_CONTROL_WORD, words)) and not re.search(_SETTING, words)


def is_named_as_setting(name: str, whole: str) -> bool:
    """Whether *name* marks a setting, and neither it nor the *whole* object's name suggests an action.

    `Nominal current` and `Velocity loop Kp` do. `Operation mode`, `Torque offset`, `Torque limit command` and
    `Commands.Maximum torque` are ambiguous: the user has to name them.
    """
    acts = any(re.search(_ACTS, _words(text)) for text in (name, whole))
    return bool(re.search(_SURE_SETTING, _words(name))) and not acts


def _words(name: str) -> str:
    return normalised(re.sub(_CAMEL, "_", re.sub(_PER_MINUTE, "", name)))
