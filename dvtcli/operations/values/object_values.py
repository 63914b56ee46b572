"""Types and values of a node's objects: as typed, in physical units, in words, and for results. Sends nothing."""

from __future__ import annotations

import re
from typing import TYPE_CHECKING

from dvtcli.domain.datatypes import BY_SHORT_NAME, DataType, Kind
from dvtcli.domain.hint import Action, Hint
from dvtcli.domain.object_scalings import NOTHING, ObjectScalings, ScaledValue
from dvtcli.domain.text import hex_preview
from dvtcli.errors import SdoProtocolError

if TYPE_CHECKING:
    from collections.abc import Mapping, Sequence

    from dvtcli.device.node_parts import NodeDescription
    from dvtcli.domain.object_dictionary import ObjectDictionary
    from dvtcli.domain.object_scalings import Rules
    from dvtcli.domain.profile import DeviceProfile
    from dvtcli.domain.scaling import Scaling
    from dvtcli.operations.results.values import ValueRead

#: Strings at the same place in every device (CiA 301, 7.5.2.8 ff.).
_STRINGS = frozenset({0x1008, 0x1009, 0x100A})
#: types not obvious from bytes
_NEEDS_TYPE = frozenset({Kind.INTEGER, Kind.REAL, Kind.VISIBLE_STRING, Kind.UNICODE_STRING})
#: the first index after communication objects, and the maximum bytes of a number always printed in decimal
_MAKERS, _SHORT = 0x2000, 2
_BY_SIZE = {1: "u8", 2: "u16", 4: "u32", 8: "u64"}


def type_of(node: NodeDescription, index: int, sub_index: int, size: int) -> DataType:
    """Return the object's type in the EDS, else by its *size* in bytes."""
    entry = node.dictionary.entry(index, sub_index) if node.dictionary else None
    if entry is not None and entry.data_type is not None:
        return entry.data_type
    return BY_SHORT_NAME["vs" if index in _STRINGS else _BY_SIZE.get(size, "os")]


def scaled_objects(node: NodeDescription, sizes: Mapping[str, int]) -> dict[str, ScaledValue]:
    """Map the objects in *sizes* (printed form: bytes) to scaled values, if a scaling is known."""
    scalings = scalings_of(node.profile, node.dictionary)
    found = {}
    for place, size in sizes.items():
        index, sub_index = (int(part, 16) for part in place.split(":"))
        meaning, kind = scalings.of(index, sub_index), type_of(node, index, sub_index, size)
        if meaning.says or kind.kind in _NEEDS_TYPE or _is_count(node, index, sub_index):
            found[place] = ScaledValue(kind, meaning)
    return found


def _is_count(node: NodeDescription, index: int, sub_index: int) -> bool:
    """Tell whether the EDS has a long unsigned number; communication objects (0x1000…) are bit fields."""
    entry = node.dictionary.entry(index, sub_index) if node.dictionary else None
    kind = None if entry is None else entry.data_type
    return index >= _MAKERS and kind is not None and kind.kind is Kind.UNSIGNED and (kind.size or 0) > _SHORT


def value_words(node: NodeDescription, index: int, sub_index: int, data: bytes) -> str:
    """Print *data* of an object: `48.0 V (768)`, a word, a number; else its first bytes."""
    kind = type_of(node, index, sub_index, len(data))
    try:
        value = kind.decode(data)
    except ValueError:
        return hex_preview(data)
    if isinstance(value, bytes):
        return hex_preview(data)
    return scalings_of(node.profile, node.dictionary).of(index, sub_index).text(value, 8 * len(data)) or str(value)


def value_result(
    node: NodeDescription, index: int, sub_index: int, data: bytes, asked: DataType | None, *, written: bool = False
) -> ValueRead:
    """The answer for an object that holds *data*; *asked* is a type the user named."""
    from dvtcli.operations.results.values import ValueRead

    kind = asked or type_of(node, index, sub_index, len(data))
    if asked is None and kind.size is not None and kind.size != len(data):
        kind = BY_SHORT_NAME[_BY_SIZE.get(len(data), "os")]  # the device disagrees with its file: show what it sent
    try:
        value = kind.decode(data)
    except ValueError as wrong:
        raise SdoProtocolError(
            f"0x{index:04X}:{sub_index:02X} answered {len(data)} bytes ({data[:16].hex(' ')}): {wrong}",
            node=node.node_id,
            place=f"{index:04X}:{sub_index:02X}",
            hint=Hint(Action.GIVE, {"as_type": None}, "names another type")
            + Hint(Action.GIVE, {"as_type": "os"}, "shows the bytes"),
        ) from wrong
    name = node.dictionary.display_name(index, sub_index) if node.dictionary else ""
    return ValueRead(
        node.node_id,
        f"{index:04X}:{sub_index:02X}",
        name,
        value,
        data,
        kind.short,
        scalings_of(node.profile, node.dictionary).of(index, sub_index) if asked is None else NOTHING,
        written,
    )


def planned_words(node: NodeDescription, index: int, sub_index: int, data: bytes) -> str:
    """Print *data* with its scaling, if known; else raw."""
    from dvtcli.device.virtual_pdos import names_objects
    from dvtcli.domain.plan import Step, step_text

    step = Step(index, sub_index, None, data, "", names_objects(node, index, sub_index))
    return step_text(step, data, scaled_objects(node, {step.object: len(data)}).get(step.object))


#: a number with decimal comma
_DECIMAL_COMMA = re.compile(r"[+-]?\d{1,30},\d{1,30}[^\d,]*")
#: types with units or words
_NUMBERS = (Kind.BOOLEAN, Kind.INTEGER, Kind.UNSIGNED, Kind.REAL)


def scalings_of(
    profile: DeviceProfile | None, dictionary: ObjectDictionary | None, more: Sequence[Rules] = ()
) -> ObjectScalings:
    """Return the scalings of a device by *profile* and *dictionary*; *more*, as of a network file, goes first."""
    from dvtcli.files.profiles import standards

    family = () if profile is None else (profile.physical,)
    return ObjectScalings((*more, *family), standards(), dictionary, only_described=True)


def scaling_of(node: NodeDescription, index: int, sub_index: int) -> Scaling:
    """Return the scaling of an object of *node*."""
    return scalings_of(node.profile, node.dictionary).of(index, sub_index)


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
