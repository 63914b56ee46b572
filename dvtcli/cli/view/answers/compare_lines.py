"""The text of comparisons: of a whole device and a file, and of PDOs."""

from __future__ import annotations

import re
from collections.abc import Iterable, Iterator
from typing import TYPE_CHECKING

from dvtcli.cli.view.lines import Cell, Line, Table
from dvtcli.domain.cob_id import can_id_text
from dvtcli.domain.network.concise_dcf import download_lines
from dvtcli.domain.object_scalings import cut_text
from dvtcli.domain.object_scalings import value_text as physical_text
from dvtcli.domain.objects import COMMUNICATION_AREA
from dvtcli.domain.text import join_some, plural

if TYPE_CHECKING:
    from dvtcli.operations.results import Compared, ComparedNodes
    from dvtcli.operations.results.comparisons import ObjectDifference, WholeCompared


def compared_nodes_lines(result: ComparedNodes, width: int) -> Iterator[Line]:
    """Show each node's lines, one node after another."""
    for node in result.nodes:
        yield from compared_lines(node, width)


def compared_lines(result: Compared, _width: int) -> Iterator[Line]:
    """Show equal values as a count, and every difference."""
    where = f" of node {result.node}" if result.named else ""
    for label, difference in result.differences:
        yield [Cell(f"  {label}{where}  ", "red"), Cell(difference)]
    what = _compared_text(result)
    if result.differences:
        differing = len({label for label, _ in result.differences})
        if result.pdos and result.objects:
            what = f"{result.pdos + result.objects} ({what})"
        yield f"{differing} of {what}{where} differ{'s' if differing == 1 else ''} from {result.against}"
    else:
        yield f"read back   {plural(result.parameters, 'parameter')} of {what}{where} equal to {result.against}"
    if result.unsaid:
        yield f"            {result.against} has no value for {plural(result.unsaid, 'more parameter')}: not compared"
    if result.not_comparable:
        yield f"            {', '.join(result.not_comparable)}{where} cannot be read back: not compared"
    yield from _frame_lines(result, where)
    if result.state_note:
        yield f"            {result.state_note}"


def _compared_text(result: Compared) -> str:
    objects = plural(result.objects, "object")
    if not result.objects:
        return plural(result.pdos, "PDO")
    return f"{plural(result.pdos, 'PDO')} and {objects}" if result.pdos else objects


def _frame_lines(result: Compared, where: str) -> Iterator[Line]:
    if result.frame_asked and not result.frames:
        yield [Cell("on the bus  "), Cell(f"no enabled TPDO{where} that could transmit a frame", "yellow")]
    for pdo, frame, milliseconds in result.frames:
        if frame is None:
            yield [Cell(f"on the bus  {pdo}{where}: "), Cell(f"no frame within {milliseconds:.0f} ms", "yellow")]
        else:
            data = frame.data.hex(" ").upper()
            after = f"after {milliseconds:.1f} ms"
            can_id = can_id_text(frame.can_id, extended=frame.extended)
            yield f"on the bus  {pdo}{where}: {can_id} [{len(frame.data)}] {data} {after}"


#: number of bytes to show of a long value
_MOST_SHOWN = 8


def whole_compared_lines(result: WholeCompared, width: int) -> Iterator[Line]:
    """Show differing settings; then the device's identity data, and objects that are no settings."""
    if result.unlike:
        yield [Cell("another device: ", "yellow"), Cell(result.unlike)]
    if result.differences:
        yield from _rows(result, result.differences, width)
        for difference in result.differences:
            yield from (f"  {text}" for text in download_lines(difference.object, difference.before, difference.after))
        verb = "differs" if len(result.differences) == 1 else "differ"
        yield f"{len(result.differences)} of {plural(result.objects, 'setting')} {verb} from {result.first}"
    else:
        yield f"{plural(result.objects, 'setting')} of {result.second} equal to {result.first}"
    for label, found in (("of itself", result.about), ("apart", result.apart)):
        if found and result.shows_all:
            yield [Cell(f"{label}:", "dim")]
            yield from _rows(result, found, width)
            yield from _reasons(found)
        elif found:
            verb = "is not a setting" if len(found) == 1 else "are no settings"
            objects = join_some(difference.object for difference in found)
            yield f"{label:<11} {objects} {verb}: not counted; --all shows them"
    if result.unread:
        verb = "was" if len(result.unread) == 1 else "were"
        yield f"not read    {join_some(result.unread)} {verb} not read by one side: not compared"
    if result.unsaid:
        silent = "one of them" if result.node is None else result.first
        yield f"            {silent} has no value for {plural(result.unsaid, 'more setting')}: not compared"


def _reasons(found: Iterable[ObjectDifference]) -> Iterator[Line]:
    """Show why objects are no settings, if known: in part a guess."""
    by_why: dict[str, list[str]] = {}
    for difference in found:
        if difference.apart:
            by_why.setdefault(difference.apart, []).append(difference.object)
    for why, places in by_why.items():
        yield [Cell(f"            {join_some(places)} {why}", "dim")]


def _rows(result: WholeCompared, found: Iterable[ObjectDifference], width: int) -> Iterable[Line]:
    sides = (re.split(r"[/\\]", side)[-1] for side in (result.first, result.second))  # a whole path takes a screen
    table = Table(("OBJECT", "NAME", *sides), shrink=1)
    for difference in found:
        before, after = (
            difference.unread if data is None else value_text(difference, data)
            for data in (difference.before, difference.after)
        )
        table.add(difference.object, Cell(difference.name, "bold"), before or "-", Cell(after or "-", "red"))
    return table.lines(width)


def value_text(one: ObjectDifference, data: bytes | None) -> str:
    """Return a value for display; for a long value its beginning and length."""
    if data is None:
        return "-"
    value = one.value(data)
    if one.meaning.says and isinstance(value, int | float):
        return physical_text(value, one.meaning, 8 * len(data))
    if isinstance(value, int) and not isinstance(value, bool) and value >= 0 and _is_word(one, data):
        return f"0x{value:0{2 * len(data)}X}"
    if isinstance(value, str):
        return cut_text(value)
    if value is not None and not isinstance(value, bytes):
        return str(value)
    shown = data[:_MOST_SHOWN].hex(" ").upper()
    return shown if len(data) <= _MOST_SHOWN else f"{shown} … {len(data):,} bytes"


def _is_word(one: ObjectDifference, data: bytes) -> bool:
    """Whether a value is shown in hexadecimal: a COB-ID, a mapping entry, an identity, a device type."""
    return len(data) == 4 and int(one.object[:4], 16) in COMMUNICATION_AREA
