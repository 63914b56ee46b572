"""Text of a value for all screens: with unit or meaning, and raw in parentheses."""

from __future__ import annotations

from typing import TYPE_CHECKING

from dvtcli.domain.datatypes import Value
from dvtcli.domain.object_scalings import NOTHING, ScaledValue
from dvtcli.domain.scaling import Scaling

if TYPE_CHECKING:
    from dvtcli.domain.plan import Step

#: displayed bytes of a long value, and characters of a text beside another
MOST_SHOWN, _WIDEST = 128, 24


def value_text(value: Value | None, meaning: Scaling = NOTHING, bits: int = 0, *, hexed: bool = False) -> str:
    """*value*, of *bits* bits, for people: `48.0 V (768)`, `operation enabled (0x0637)`; `-` for None.

    With *hexed*, a number without a meaning is followed by its hex digits: its bits may have one.
    """
    if value is None:
        return "-"
    if isinstance(value, bytes):
        return cut_bytes(value)
    text = meaning.text(value, bits)
    if isinstance(value, float) and not text:
        return repr(value) if bits == 64 else f"{value:.9g}"
    if hexed and bits and isinstance(value, int) and not isinstance(value, bool) and not text.endswith(")"):
        return f"{text or value} (0x{value & ((1 << bits) - 1):0{(bits + 3) // 4}X})"
    return text or (str(value).lower() if isinstance(value, bool) else str(value))


def step_text(step: Step, data: bytes | None, known: ScaledValue | None) -> str:
    """*data* for the object in *step* with its meaning if *known*; else in the usual notation."""
    value = None if known is None else known.value(data)
    if known is None or value is None or isinstance(value, bytes):
        return step.text(data)
    if isinstance(value, str):
        return cut_text(value) if value.isprintable() else step.text(data)
    return value_text(value, known.meaning, 8 * len(data or b""))


def cut_text(text: str) -> str:
    """A text in quotes; of a long text the beginning and the length."""
    return repr(text) if len(text) <= _WIDEST else f"{text[:_WIDEST]!r}… {len(text):,} characters"


def cut_bytes(data: bytes) -> str:
    """The first bytes of *data*, and its length."""
    if len(data) <= MOST_SHOWN:
        return data.hex(" ").upper()
    return f"{data[:MOST_SHOWN].hex(' ').upper()} … {len(data):,} bytes"
