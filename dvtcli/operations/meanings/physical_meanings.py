"""Scale values of a node's objects, and parse typed values. Sends nothing."""

from __future__ import annotations

import re
from typing import TYPE_CHECKING

from dvtcli.domain.datatypes import Kind
from dvtcli.domain.meanings import Meanings

if TYPE_CHECKING:
    from collections.abc import Sequence

    from dvtcli.device.node_parts import NodeDescription
    from dvtcli.domain.datatypes import DataType
    from dvtcli.domain.meanings import Rules
    from dvtcli.domain.object_dictionary import ObjectDictionary
    from dvtcli.domain.profile import DeviceProfile
    from dvtcli.domain.scaling import Scaling

#: a number with decimal comma
_DECIMAL_COMMA = re.compile(r"[+-]?\d{1,30},\d{1,30}[^\d,]*")
#: types with units or words
_NUMBERS = (Kind.BOOLEAN, Kind.INTEGER, Kind.UNSIGNED, Kind.REAL)


def meanings_of(
    profile: DeviceProfile | None, dictionary: ObjectDictionary | None, more: Sequence[Rules] = ()
) -> Meanings:
    """Return the scalings of a device by *profile* and *dictionary*; *more*, as of a network file, goes first."""
    from dvtcli.files.profile.library import standards

    family = () if profile is None else (profile.physical,)
    return Meanings((*more, *family), standards(), dictionary, only_described=True)


def meaning_of(node: NodeDescription, index: int, sub_index: int) -> Scaling:
    """Return the scaling of an object of *node*."""
    return meanings_of(node.profile, node.dictionary).of(index, sub_index)


def _is_understood(kind: DataType, meaning: Scaling, text: str) -> bool:
    try:
        typed_bytes(kind, meaning, text)
    except ValueError:
        return False
    return True


def _bit_words(meaning: Scaling, kind: DataType) -> str:
    """List the words of a bit field."""
    digits = (kind.bits or 8) // 4
    return ", ".join(f"{state.text} is 0x{state.bits:0{digits}X}" for state in meaning.states)


def typed_bytes(kind: DataType, meaning: Scaling, text: str) -> bytes:
    """Encode a typed value: a number with unit or a word of *meaning*, else as *kind*.

    Raises ValueError if neither fits.
    """
    raw = meaning.to_raw(text, whole=kind.kind is not Kind.REAL) if kind.kind in _NUMBERS else None
    return kind.parse(text) if raw is None else kind.encode(raw)


def how_to_write(meaning: Scaling, kind: DataType, text: str = "") -> str | None:
    """Explain how to write a value of the object after *text* failed; None if only raw values exist."""
    if _DECIMAL_COMMA.fullmatch(text.strip()) and _is_understood(kind, meaning, text.replace(",", ".")):
        return f"with a decimal point: {text.strip().replace(',', '.')}"
    if meaning.values:
        return f"{', '.join(meaning.values.values())}; or the number"
    if meaning.states:
        return f"the number: {_bit_words(meaning, kind)}"
    if not meaning.unit or kind.kind not in _NUMBERS:
        return None
    if kind.limits is None:
        return f"with a unit: 1.5{meaning.unit}; a number alone is raw"
    low, high = kind.limits
    return f"{meaning.quantity(low)} to {meaning.quantity(high)}, with the unit; a number alone is raw"
