"""The text of a comparison of read and wanted values."""

from __future__ import annotations

from collections.abc import Iterator
from typing import TYPE_CHECKING

from dvtcli.cli.view.lines import Cell, Line
from dvtcli.domain.cob_id import can_id_text
from dvtcli.domain.several import plural

if TYPE_CHECKING:
    from dvtcli.operations.results import Compared, ComparedNodes


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
        yield f"            {result.against} says nothing of {plural(result.unsaid, 'more parameter')}: not compared"
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
        yield [Cell("on the bus  "), Cell(f"no enabled TPDO{where} that could send a frame", "yellow")]
    for pdo, frame, milliseconds in result.frames:
        if frame is None:
            yield [Cell(f"on the bus  {pdo}{where}: "), Cell(f"no frame within {milliseconds:.0f} ms", "yellow")]
        else:
            data = frame.data.hex(" ").upper()
            after = f"after {milliseconds:.1f} ms"
            can_id = can_id_text(frame.can_id, extended=frame.extended)
            yield f"on the bus  {pdo}{where}: {can_id} [{len(frame.data)}] {data} {after}"
