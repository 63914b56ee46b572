"""Names that suggest process data, a control word or a setting."""

from __future__ import annotations

import re

from dvtcli.domain.object_dictionary import normalised

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
