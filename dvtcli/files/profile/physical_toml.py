"""The table `[physical]` of a profile or a standard's file: objects, and the meaning of their values."""

from __future__ import annotations

import re
from fractions import Fraction
from typing import Any

from dvtcli.domain.object_scalings import ObjectRange, ScalingRule
from dvtcli.domain.process_data import STATES
from dvtcli.domain.scaling import Scaling, State, parse_factor, parse_scale, spelled
from dvtcli.files.toml_item import Item, Schema, integer, integers, members, string

_PLACE = re.compile(
    r"(?P<first>[0-9A-F]{4})(?:-(?P<last>[0-9A-F]{4}))?(?::(?P<sub>[0-9A-F]{2})(?:-(?P<last_sub>[0-9A-F]{2}))?)?"
)


def physical_rules(item: Item) -> dict[ObjectRange, ScalingRule]:
    """Read meanings (`"1/256 V"`, or a table) by objects (`"5100:01"`, `"6C01:01-05"`, `2220-2224`)."""
    return {_place(member): _meaning(member) for member in item.items()}


def _place(item: Item) -> ObjectRange:
    match = _PLACE.fullmatch(item.key)
    if match is None:
        item.fail("the key must be an object such as 5100:01, or several: 2220-2224, 6C01:01-05")
    first, sub = int(match["first"], 16), int(match["sub"] or "0", 16)
    place = ObjectRange(first, int(match["last"] or match["first"], 16), sub, int(match["last_sub"] or f"{sub:X}", 16))
    if place.first > place.last or place.first_sub > place.last_sub:
        item.fail("the lower number stands first")
    return place


def _meaning(item: Item) -> ScalingRule:
    if isinstance(item.value, str):
        factor, unit = parse_scale(string(item))
        return ScalingRule(Scaling(unit, factor))
    said = item.table(_MEANING)
    if not said:
        item.fail("says nothing: give a unit, a factor, values or bits")
    numbered = {key: said.pop(key) for key in ("numbered", "per") if key in said}
    return ScalingRule(Scaling(**said), **numbered)


def _fraction(item: Item) -> Fraction:
    """Read a number, or a text like `1/256`."""
    if isinstance(item.value, bool) or not isinstance(item.value, int | float | str):
        item.fail(f"must be a number, or a text such as '1/256', not {item.shown}")
    try:
        return parse_factor(str(item.value))
    except ValueError as wrong:
        item.fail(str(wrong))


def _offset(item: Item) -> Fraction:
    return Fraction(0) if item.value == 0 and not isinstance(item.value, bool) else _fraction(item)


def _unit(item: Item) -> str:
    return spelled(string(item))


def _texts(low: int, high: int) -> Any:
    """Return a reader of tables number -> text, numbers within *low*..*high*."""

    def read(item: Item) -> dict[int, str]:
        texts = {}
        for member in item.items():
            number = int(member.key) if re.fullmatch(r"-?[0-9]{1,10}", member.key) else None
            if number is None or not low <= number <= high:
                member.fail(f"the key must be a number within {low}..{high}")
            texts[number] = string(member)
        return texts

    return read


def _states(item: Item) -> tuple[State, ...]:
    """Read a list of [mask, bits, text], or `"statusword"` for a drive's states."""
    if item.value == "statusword":
        return tuple(State(*row) for row in STATES)
    states = []
    for member in members(item):
        parts = members(member)
        if len(parts) != 3:
            member.fail("must be a mask, the bits in it, and a text")
        mask, bits = integers(0, 0xFFFF_FFFF)(Item([parts[0].value, parts[1].value], *_rest(member)))
        if bits & ~mask:
            member.fail(f"0x{bits:X} has bits that the mask 0x{mask:X} hides: it can never match")
        states.append(State(mask, bits, string(parts[2])))
    return tuple(states)


def _rest(item: Item) -> tuple[Any, ...]:
    return item.path, item.source, item.lines


_MEANING: Schema = {
    "unit": _unit,
    "factor": _fraction,
    "offset": _offset,
    "values": _texts(-(1 << 31), (1 << 32) - 1),
    "states": _states,
    "bits": _texts(0, 63),
    "numbered": string,
    "per": integer(1, 64),
}
