"""The text of PDOs: a node's list, and a single PDO with its frame picture."""

from __future__ import annotations

from collections.abc import Iterator
from typing import NamedTuple

from dvtcli.cli.view.lines import Cell, Line, Table, clipped, columns
from dvtcli.domain.frame import layout
from dvtcli.domain.object_scalings import value_text
from dvtcli.domain.pdo import MAX_PDO_BITS, SAM_MPDO, PdoConfig, transmission_type_text
from dvtcli.domain.text import plural, safe
from dvtcli.operations.results.pdos import LastFrame, ListedRow, MappedName, PdoListing, PdoRow, VpdoListing


def vpdo_lines(result: VpdoListing, width: int) -> Iterator[Line]:
    """Show a line per active pin, and a line for a group without any."""
    if result.said:
        yield result.said
    table = Table(("GROUP", "PIN", "OBJECT", "NAME"), frozenset({1}), 3)
    for group in result.groups:
        label = Cell(group.name, "bold")
        for row in group.rows:
            tied = "none" if row.index is None else f"0x{row.index:04X}"
            table.add(label, f"{row.pin}", Cell(tied, "dim" if row.index is None else ""), row.name)
            label = Cell("")
        if not group.rows:
            table.add(label, "-", Cell("none", "dim"), "")
    yield from table.lines(width)
    free = ", ".join(f"{group.name} {len(group.rows)} of {group.pins}" for group in result.groups)
    yield [Cell(f"active pins: {free}", "dim")]


def listing_lines(result: PdoListing, width: int) -> Iterator[Line]:
    """Show the PDOs of a node, or a single PDO."""
    if result.detail:
        yield from _detail(result, result.rows[0], width)
        return
    shown = [row for row in result.rows if result.show_all or _is_of_interest(row)]
    table = Table(
        ("PDO", "COB-ID", "STATE", "TYPE", "INHIBIT", "EVENT", "LEN", "MAPPED OBJECTS"), frozenset({4, 5, 6}), 7
    )
    for row in shown:
        table.add(*_cells(row))
    if shown:
        yield from table.lines(width)
    yield from (line for row in shown for line in _inconsistency(row))
    hidden = len(result.rows) - len(shown)
    if hidden:
        yield f"{hidden} more {'is' if hidden == 1 else 'are'} off and empty: pdo --all"
    elif not result.rows:
        yield f"node {result.node} has no PDOs"


def _is_of_interest(row: PdoRow) -> bool:
    return row.config.enabled or bool(row.config.count or row.config.inconsistency) or row.unstored


def _inconsistency(row: PdoRow) -> Iterator[Line]:
    """Show the error in a PDO's configuration, and the remedy."""
    yield from _impossible(row)
    if not row.config.inconsistency:
        return
    way = "map or clear repairs it" if not row.config.lacking else ""
    if not row.config.has_mapping and row.config.enabled:
        way = f"disable {row.pdo} switches it off"
    yield [
        Cell(f"{row.pdo.label} is inconsistent: ", "red"),
        Cell("; ".join(filter(None, [row.config.inconsistency, way]))),
    ]


def _impossible(row: PdoRow) -> Iterator[Line]:
    """Show an enabled PDO's mapping beyond the size of a frame."""
    if not row.config.enabled or row.config.mpdo is not None:
        return
    if row.config.bits > 64:
        yield [Cell(f"{row.pdo.label} is enabled with {row.config.bits} bits", "red"), Cell(": a PDO has at most 64")]
    for number, entry in enumerate(row.config.mapping, 1):
        if not entry.bits:
            yield [Cell(f"{row.pdo.label} is enabled with mapping entry {number} empty", "red")]


def _cells(row: PdoRow) -> list[str | Cell]:
    parameter = row.config.communication
    state = _state(row, "dim")
    inhibit = "" if parameter.inhibit_time is None else _milliseconds(parameter.inhibit_time / 10)
    timer = "" if parameter.event_timer is None else _milliseconds(parameter.event_timer)
    mapped = ", ".join(_names(row)) or "-"
    return [
        Cell(row.pdo.label, "bold"), _cob_id(row), state, _type(row.config, row), inhibit, timer,
        _length(row.config), mapped + (" *" if row.unstored else ""),
    ]  # fmt: skip


def _state(row: PdoRow, off: str) -> Cell:
    """Return whether the PDO is enabled; *off* is the style of a disabled PDO."""
    if not row.config.has_cob_id:
        return Cell("?", "yellow")
    return Cell("enabled", "green") if row.config.enabled else Cell("off", off)


def _cob_id(row: PdoRow) -> str:
    return str(row.config.communication.cob_id) if row.config.has_cob_id else "-"


def _milliseconds(value: float) -> str:
    return f"{value:g} ms" if value else "0"


def _type(config: PdoConfig, row: PdoRow) -> str:
    kind = config.communication.transmission_type
    return "-" if kind is None else f"{kind} {transmission_type_text(kind, row.pdo.direction)}"


def _length(config: PdoConfig) -> str:
    if config.mpdo is not None:
        return "MPDO"
    return f"{config.bits // 8} B" if config.bits % 8 == 0 else f"{config.bits} bit"


def _names(row: PdoRow) -> Iterator[str]:
    for number, entry in enumerate(row.config.mapping):
        name = row.names[number].name if number < len(row.names) else ""
        yield f"(skip {entry.bits} bits)" if entry.is_dummy else name or entry.object


def _detail(result: PdoListing, row: PdoRow, width: int) -> Iterator[Line]:
    pdo, parameter = row.pdo, row.config.communication
    where = f"comm 0x{pdo.communication_index:04X}, map 0x{pdo.mapping_index:04X}"
    yield [
        Cell(f"{pdo.label} of node {result.node}", "bold"), Cell(f' "{result.title}"    {where}'),
        Cell(", not stored", "yellow") if row.unstored else Cell(""),
    ]  # fmt: skip
    state = _state(row, "yellow")
    rtr = ", RTR allowed" if parameter.cob_id.rtr_allowed else ", no RTR"
    rtr = rtr if row.config.has_cob_id else ""  # nobody knows
    wide = ", 29-bit" if parameter.cob_id.extended else ""
    default = "" if row.default_can_id is None else f" (default 0x{row.default_can_id:03X})"
    yield from _inconsistency(row)
    yield [Cell(f"  COB-ID    {_cob_id(row)} "), state, Cell(f"{rtr}{wide}{default}")]
    yield f"  type      {_type(row.config, row)}{_sync_note(result, row)}"
    if parameter.inhibit_time is not None:
        yield f"  inhibit   {parameter.inhibit_time} x 100 us = {_milliseconds(parameter.inhibit_time / 10)}"
    if parameter.event_timer is not None:
        yield f"  event     {parameter.event_timer} ms" + ("" if parameter.event_timer else " = off")
    if parameter.sync_start_value:
        yield f"  SYNC start value {parameter.sync_start_value}"
    yield from picture(row, width)
    if row.config.mpdo is not None:
        yield from _multiplexed_note(row)
        return
    used = row.config.bits
    yield f"      {used} of 64 bits used ({plural((used + 7) // 8, 'byte')} on the bus), least significant byte first"
    yield from _entries(row, width)


def _multiplexed_note(row: PdoRow) -> Iterator[Line]:
    """Say what an MPDO carries, and where its list of objects is (CiA 301, 7.5.2.39 and 7.5.2.40)."""
    count = row.config.mpdo or 0
    if count == SAM_MPDO:
        where = "scanner list (0x1FA0…0x1FCF)" if row.pdo.is_tpdo else "dispatcher list (0x1FD0…0x1FFF)"
        yield f"      multiplexed (SAM, count 0x{count:02X}): bit 7 of byte 0 is 0; the objects are in the {where}"
        yield from map(_listed, row.listed or ())
        if row.listed == ():
            yield "      that list is empty, or cannot be read"
        return
    first = row.config.multiplexed[0] if row.config.multiplexed and row.config.multiplexed[0].index else None
    what = f"; it sends {first.object}" if first is not None and row.pdo.is_tpdo else ""
    yield f"      multiplexed (DAM, count 0x{count:02X}): bit 7 of byte 0 is 1, node-ID 0 means all nodes{what}"


def _listed(row: ListedRow) -> Line:
    """Show an entry of a scanner list, or of a dispatcher list with whose objects it takes."""
    entry, name = row.objects, f" {row.name}" if row.name else ""
    source = f"node {entry.node_id} {entry.sources} -> " if entry.sources else ""
    return f"      {row.place}  {source}{entry.objects}{name}"


def _sync_note(result: PdoListing, row: PdoRow) -> str:
    kind = row.config.communication.transmission_type
    period = result.sync_period_us
    if kind is None or not 1 <= kind <= 240 or not row.pdo.is_tpdo or not period:
        return ""
    rate = 1_000_000 / (period * kind)
    return f" (0x1006: SYNC every {period / 1000:g} ms, so {rate:g} frames/s)"


def _entries(row: PdoRow, width: int) -> Iterator[Line]:
    if not row.config.mapping:
        return
    last = ("LAST VALUE",) if row.last else ()
    units = ("UNIT",) if any(mapped.meaning.has_number for mapped in row.names) else ()
    table = Table(("#", "OBJECT", "NAME", "TYPE", "BITS", "BYTES", *last, *units), frozenset({0, 4, 5}), shrink=2)
    for number, field in enumerate(layout(row.config.mapping)):
        mapped = row.names[number] if number < len(row.names) else MappedName()
        name = f"(skip {field.bits} bits)" if field.entry.is_dummy else mapped.name
        cells = [_range(field.start_bit, field.end_bit - 1), _range(field.start_bit // 8, (field.end_bit - 1) // 8)]
        if row.last:
            hexed = not mapped.type_name.startswith("i")
            cells.append(value_text(row.last.values[number], mapped.meaning, field.bits, hexed=hexed))
        cells += [mapped.meaning.scale] if units else []
        table.add(str(number + 1), field.entry.object, Cell(name, "bold"), mapped.type_name, *cells)
    yield from table.lines(width)
    if row.last:
        yield from _last_frame(row.last)


def _range(first: int, last: int) -> str:
    return f"{first}" if first >= last else f"{first}-{last}"


def _last_frame(last: LastFrame) -> Iterator[Line]:
    period = ""
    if last.period is not None:
        times = last.period
        period = f", period {1000 * times.last_s:.1f} ms ({1000 * times.least_s:.1f}..{1000 * times.most_s:.1f})"
    yield f"  last frame  {last.data.hex(' ').upper()}     {last.age_s:.1f} s ago{period}"


#: The indent of a picture with its left border, and the minimum width of a byte with its right border.
_MARGIN, _LEAST = 7, 9


class Box(NamedTuple):
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
