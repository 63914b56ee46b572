"""Which of a maker's objects is process data by its name: a guess, where no standard and no PDO says what it is.

Knows names only, in English and German. Does not know what a PDO maps, what an object holds, nor names of commands such
as `Factory reset`.
"""

from __future__ import annotations

import re

from dvtcli.domain.object_dictionary import normalised

#: words of what commands, is measured, or goes by PDO from one device to another
_PROCESS = re.compile(
    r"(?<![a-z])(target|demand|demanded|commanded|commands?|set_?points?|set_value|desired|actual|measured|measurements?"
    r"|received?|sent|transmit(ted)?|process_values?|pv|debug_values?|control_?(word|byte|bits?)|status_?(word|byte|bits?)"
    r"|(digital|analog(ue)?|physical|pulse|relay|pwm)_outputs?|output_(levels?|states?|values?|control)"
    r"|(digital|analog(ue)?|physical)_inputs?|input_(levels?|states?|values?|voltage)|(position|velocity|torque|time)_input"
    r"|(position|speed|velocity|torque)_reference|reference_(position|speed|velocity)|interpolation_data|steer_angle|utc"
    r"|scet|[a-z]*(soll|ist)_?werte?|(steuer|status)_?wort)(?![a-z])"
    # where the name ends with it: `Deadman switch`, `Pump switch 7`, `Output 3`
    r"|(?<![a-z])(switch|inputs?|outputs?)(_(left|right|inner|outer|front|rear|upper|lower|\d+))*$"
)
#: words that make a setting of all these: `Output current limit`, `Target reached window`, `Measured value filter`
_SETTING = re.compile(
    r"(?<![a-z])(gains?|k[pid]|limits?|limitation|max(imum)?|min(imum)?|rated|nominal|ranges?|windows?|thresholds?|time_?out"
    r"|delay|debounce|hysteresis|dead_?band|offsets?|scal(e|es|ing)|factors?|numerator|denominator|ramps?|slope|filters?"
    r"|bandwidth|cut_?off|inertia|friction|coefficients?|corrections?|calibration|config(uration)?|set_?up|settings?"
    r"|param(eter)?s?|options?|polarity|inver(t|ted|sion)|types?|units?|resolution|defaults?|masks?|assignment|function|mode"
    r"|selection|selector|source|(fault|error|safe)_(value|state)|time_constant|period|interval"
    r"|nenn[a-z]+|[a-z]*grenzen?|[a-z]*begrenzung|faktor|rampe|verzögerung)(?![a-z])"
)
_CAMEL = re.compile(r"(?<=[a-z])(?=[A-Z])")


def is_named_as_process_data(name: str) -> bool:
    """Whether *name* is that of a command, a target, a measured value, an input or an output.

    `Torque set-point`, `StatusWord left` and `Key switch` are; `Nominal current` and `Output current limit` are
    settings, and so is whatever no word tells of.
    """
    words = normalised(_CAMEL.sub("_", name))
    return bool(_PROCESS.search(words)) and not _SETTING.search(words)
