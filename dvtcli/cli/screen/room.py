"""Fit lines into a screen's width without cutting numbers. Pure."""

from __future__ import annotations

from collections.abc import Sequence
from fractions import Fraction

from dvtcli.cli.view.lines import Cell, clipped, columns
from dvtcli.domain.scaling import Scaling
from dvtcli.domain.text import ascii_only, safe

#: numbers of significant digits to try for a long number, highest first
_DIGITS = (6, 5, 4, 3, 2)


def cut(line: list[Cell], width: int, *, plain: bool) -> list[Cell]:
    """Return *line*, made safe and cut to *width* columns, with `…` at a cut.

    *plain*: in ASCII, in which a replacement may take more columns.
    """
    shown = [Cell(_shown(cell.text, plain=plain), cell.style) for cell in line]
    left = _clipped("".join(cell.text for cell in shown).rstrip(), width, plain=plain)
    cells: list[Cell] = []
    for cell in shown:
        part, left = left[: len(cell.text)], left[len(cell.text) :]
        if part:
            cells.append(Cell(part, cell.style))
    return cells


def wide(groups: Sequence[list[Cell]], *, plain: bool) -> int:
    """Return the columns of *groups* on a line."""
    return columns("".join(_shown(cell.text, plain=plain) for group in groups for cell in group).rstrip())


def filled(text: str, width: int, *, plain: bool) -> str:
    """*text* made safe, cut or filled up to *width* columns; *plain*: in ASCII."""
    kept = _clipped(_shown(text, plain=plain), width, plain=plain)
    return kept + " " * (width - columns(kept))


def least_and_most(meaning: Scaling, low: float, high: float, width: int) -> str:
    """Return minimum and maximum of raw values in *width* columns: rounded with `~`, or `…`, if too long."""
    whole = f"{meaning.number_text(low)} .. {meaning.number_text(high)}"
    if len(whole) <= width:
        return whole
    for digits in _DIGITS:
        least, most = (_rounded(meaning.to_physical(raw), digits) for raw in (low, high))
        if len(least) + len(most) + 5 <= width:
            return f"~{least} .. {most}"
    return "…"


def _rounded(number: float | Fraction, digits: int) -> str:
    mantissa, _, exponent = f"{float(number):.{digits}g}".partition("e")
    return f"{mantissa}e{int(exponent)}" if exponent else mantissa


def _shown(text: str, *, plain: bool) -> str:
    return ascii_only(safe(text)) if plain else safe(text)


def _clipped(text: str, width: int, *, plain: bool) -> str:
    return clipped(text, width, "..." if plain else "…")
