"""A mapped object as a signal of a DBC file, so that it is read there as our own decoder reads it. Knows no file."""

from __future__ import annotations

from typing import TYPE_CHECKING

from dvtcli.domain.datatypes import Kind
from dvtcli.domain.meanings import NOTHING
from dvtcli.files.dbc_text import DbcSignal

if TYPE_CHECKING:
    from fractions import Fraction

    from dvtcli.domain.datatypes import DataType
    from dvtcli.domain.frame import Field
    from dvtcli.domain.meanings import Meanings
    from dvtcli.domain.network.network_state import NodeState
    from dvtcli.domain.object_dictionary import OdEntry
    from dvtcli.domain.scaling import Scaling
    from dvtcli.files.dbc_text import Names

_WHOLE = (Kind.BOOLEAN, Kind.INTEGER, Kind.UNSIGNED)
_NUMBERS = (Kind.BOOLEAN, Kind.INTEGER, Kind.UNSIGNED, Kind.REAL)


def pdo_signals(
    field: Field, node: NodeState, meanings: Meanings, names: Names, *, split_bits: bool = False
) -> list[DbcSignal]:
    """The object at *field* of a PDO of *node* as one signal; with *split_bits* as one a bit, where bits have names."""
    index, sub_index = field.entry.index, field.entry.sub_index
    meaning = meanings.of(index, sub_index)
    entry = node.dictionary.entry(index, sub_index) if node.dictionary else None
    kind = entry.data_type if entry else None
    if not (split_bits and meaning.bits and (kind is None or kind.kind in _WHOLE)):
        return [_pdo_signal(field, node, meanings, names)]
    name = (node.dictionary.display_name(index, sub_index) if node.dictionary else "") or f"Object_{index:04X}"
    words = [meaning.bits.get(bit, f"bit {bit}") for bit in range(field.bits)]
    what = f"0x{index:04X}:{sub_index:02X} {name}"
    return [_bit(field.start_bit + bit, names.new(f"{name}.{word}", f"bit_{bit}"), f"{what}, bit {bit} {word}", names)
            for bit, word in enumerate(words)]  # fmt: skip


def _bit(start: int, name: str, comment: str, names: Names) -> DbcSignal:
    return DbcSignal(name, start, 1, comment=comment, long_name=names.whole(name))


def _pdo_signal(field: Field, node: NodeState, meanings: Meanings, names: Names) -> DbcSignal:
    """The object at *field* of a PDO of *node*, with its unit, scale, limits and words; without a type: unsigned.

    Of a REAL only a part is raw bits; so are texts and times.
    """
    index, sub_index = field.entry.index, field.entry.sub_index
    entry = node.dictionary.entry(index, sub_index) if node.dictionary else None
    kind = entry.data_type if entry else None
    meaning = NOTHING if kind is not None and kind.kind not in _NUMBERS else meanings.of(index, sub_index)
    is_real = kind is not None and kind.kind is Kind.REAL and kind.bits == field.bits
    signed = kind is not None and kind.kind is Kind.INTEGER
    name = node.dictionary.display_name(index, sub_index) if node.dictionary else ""
    raw = _raw_limits(entry, kind, node.node_id, field.bits, is_real=is_real)
    low, high = _physical(raw, meaning)
    words = (
        {} if is_real else {value: word for value, word in meaning.values.items() if _holds(value, field.bits, signed)}
    )
    short = names.new(name, f"Object_{index:04X}_{sub_index:02X}")
    return DbcSignal(
        short, field.start_bit, field.bits, signed, is_real,
        meaning.factor, meaning.offset, meaning.unit, low, high, words, (), _comment(field, kind, name, meaning),
        names.whole(short),
    )  # fmt: skip


def _holds(value: int, bits: int, signed: bool) -> bool:
    return -(1 << bits - 1) <= value < 1 << bits - 1 if signed else 0 <= value < 1 << bits


def _raw_limits(
    entry: OdEntry | None, kind: DataType | None, node_id: int, bits: int, *, is_real: bool
) -> tuple[float, float] | None:
    """LowLimit and HighLimit, that of the type where the file has one of them only; None for none."""
    low, high = (None, None) if entry is None else entry.limits(node_id)
    ends = None if kind is None or is_real else kind.limits
    if (low is None and high is None) or (ends is None and None in (low, high)) or (kind and kind.bits != bits):
        return None
    low, high = (
        (low if ends is None or low is not None else ends[0]),
        (high if ends is None or high is not None else ends[1]),
    )
    return (low, high) if low is not None and high is not None and low <= high else None


def _physical(
    raw: tuple[float, float] | None, meaning: Scaling
) -> tuple[Fraction | float | None, Fraction | float | None]:
    """Limits are scaled as values are; a negative factor turns them round."""
    if raw is None:
        return None, None
    ends = sorted(meaning.to_physical(end) for end in raw)
    return ends[0], ends[1]


def _comment(field: Field, kind: DataType | None, name: str, meaning: Scaling) -> str:
    """The object, its type, its whole name, and the names of its bits."""
    entry = field.entry
    what = " ".join(filter(None, (f"0x{entry.index:04X}:{entry.sub_index:02X}", kind.short if kind else "", name)))
    bits = ", ".join(f"bit {bit} {word}" for bit, word in sorted(meaning.bits.items()) if bit < field.bits)
    return f"{what}; {bits}" if bits else what
