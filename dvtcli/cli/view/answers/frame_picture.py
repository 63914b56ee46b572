"""Draw a PDO's frame: a cell per byte, objects across their bytes."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass

from dvtcli.cli.view.columns import clipped, columns
from dvtcli.domain.mapping import MAX_PDO_BITS, SAM_MPDO
from dvtcli.domain.text import safe
from dvtcli.operations.results.pdos import PdoRow

#: The indent of a picture with its left border, and the minimum width of a byte with its right border.
_MARGIN, _LEAST = 7, 9


@dataclass(frozen=True, slots=True)
class Box:
    """A run of whole bytes with one label; *fields* are the sub-byte parts, if any."""

    first: int
    last: int
    label: str
    detail: str
    fill: str = " "
    fields: tuple[str, ...] = ()


def boxes(row: PdoRow) -> list[Box]:
    """Split the frame into boxes: an object on byte borders has its own box, shared bytes form one box."""
    if row.config.mpdo is not None:
        return list(_multiplexed(row.config.mpdo))
    spans: list[tuple[int, int, str, str, bool]] = []
    start = 0
    for number, entry in enumerate(row.config.mapping):
        mapped = row.names[number] if number < len(row.names) else None
        name = "(skipped)" if entry.is_dummy else (mapped.name if mapped and mapped.name else entry.object)
        kind = f" {mapped.type_name}" if mapped and mapped.type_name else f"/{entry.bits}"
        spans.append((start, start + entry.bits, name, entry.object + kind, entry.is_dummy))
        start += entry.bits
    return _merged(spans, start)


def _multiplexed(count: int) -> Iterator[Box]:
    """The eight bytes of an MPDO (CiA 301, 7.2.2.5.3): a node-ID, an object of that node, and its value."""
    source = count == SAM_MPDO
    yield Box(0, 0, "node-ID", "source" if source else "target")
    yield Box(1, 2, "index", "at the source" if source else "at the target")
    yield Box(3, 3, "sub-index", "")
    yield Box(4, 7, "value", "1 to 4 bytes, filled with 0")


def _merged(spans: list[tuple[int, int, str, str, bool]], used: int) -> list[Box]:
    found: list[Box] = []
    group: list[tuple[int, int, str, str, bool]] = []
    for span in spans:
        group.append(span)
        if span[1] % 8 == 0 or span[1] >= MAX_PDO_BITS:
            found.append(_box(group))
            group = []
    if group:
        found.append(_box(group))
    free = (used + 7) // 8
    if free < 8:
        found.append(Box(free, 7, "free", "", "░"))
    return found


def _box(group: list[tuple[int, int, str, str, bool]]) -> Box:
    first, last = group[0][0] // 8, max(group[0][0] // 8, min(7, (group[-1][1] - 1) // 8))
    if len(group) == 1:
        _, _, name, detail, dummy = group[0]
        return Box(first, last, name, detail, "░" if dummy else " ")
    fields = tuple(f"{start}{'' if stop - start == 1 else f'-{stop - 1}'} {name}" for start, stop, name, _, _ in group)
    return Box(first, last, f"{len(group)} fields", "", " ", fields)


def cell_width(width: int) -> int:
    """Return the columns of a byte with its border in a picture of *width* columns."""
    return max(_LEAST, (width - _MARGIN) // 8)


def picture(row: PdoRow, width: int) -> Iterator[str]:
    """The picture's lines on *width* columns, at least 79, with the sub-byte fields listed below it."""
    parts, cell = boxes(row), cell_width(width)
    numbers = "".join(f"{number:^{cell - 1}} " for number in range(8))
    yield f"byte   {numbers}".rstrip()
    yield _border(parts, cell, "┌┬┐")
    yield "      │" + "│".join(_centred(part.label, part, cell) for part in parts) + "│"
    yield "      │" + "│".join(_centred(part.detail, part, cell) for part in parts) + "│"
    yield _border(parts, cell, "└┴┘")
    for part in parts:
        if part.fields:
            last = f"-{part.last}" if part.last > part.first else ""
            yield f"      bits of byte {part.first}{last}: " + "  ".join(safe(text) for text in part.fields)


def _width(part: Box, cell: int) -> int:
    return (part.last - part.first + 1) * cell - 1


def _border(parts: list[Box], cell: int, corners: str) -> str:
    return "      " + corners[0] + corners[1].join("─" * _width(part, cell) for part in parts) + corners[2]


def _centred(text: str, part: Box, cell: int) -> str:
    width = _width(part, cell)
    if columns(text) > width and "." in text:
        text = text.rpartition(".")[2]  # the sub-index's own name says more than the start of the object's
    shown = clipped(safe(text), width)
    if part.fill != " " and shown:
        shown = clipped(f" {shown} ", width)
    room = width - columns(shown)  # the smaller half before it in a box of even width, as str.center has it
    before = room // 2 + (room & width & 1)
    return part.fill * before + shown + part.fill * (room - before)
