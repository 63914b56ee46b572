"""The dialog that shows what edited PDOs would write."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping
from typing import TYPE_CHECKING

from dvtcli.cli.screen.widgets import TextDialog
from dvtcli.cli.view.lines import Cell, Line, broken, columns, with_hints
from dvtcli.cli.view.renderers import remarks, text
from dvtcli.domain.text import join_some
from dvtcli.operations.pdos.edit_pdos import plan_edited

if TYPE_CHECKING:
    from dvtcli.cli.conversation import Conversation
    from dvtcli.cli.view.typed_hints import TypedHints
    from dvtcli.operations.exchange.edit_file import Edited
    from dvtcli.operations.results import Changed


def plan_dialog(
    session: Conversation, edited: Mapping[int, Edited], width: int, titles: Mapping[int, str] | None = None
) -> TextDialog:
    """Plan the *edited* nodes, and show the writes in *width* columns; *titles* are the nodes of a file, None of a bus.

    Raises the errors of `plan_edited`.
    """
    lines: list[list[Cell]] = []
    for node_id, pdos in sorted(edited.items()):
        result = plan_edited(session, node_id, pdos.held, pdos.changed)
        if titles is not None and len(titles) > 1:
            lines.append([Cell(f"node {node_id} {titles[node_id]}", "bold")])
        lines += _result_lines(session.output.hints, result, max(60, width), of_file=titles is not None)
        lines += _stay_off(pdos)
    return TextDialog("PLAN", lines, "f5")


def _stay_off(edited: Edited) -> Iterator[list[Cell]]:
    """Name the edited PDOs that were off and stay off."""
    off = [pdo for pdo, config in edited.changed.items() if not (config.enabled or edited.held[pdo].enabled)]
    if off:
        labels = join_some(pdo.label for pdo in off)
        yield [Cell(f"{labels} {'stays' if len(off) == 1 else 'stay'} off: e enables a PDO", "yellow")]


def _result_lines(
    hints: Callable[[], TypedHints], result: Changed, width: int, *, of_file: bool
) -> Iterator[list[Cell]]:
    found: list[Line] = [*remarks(result)]
    if of_file:  # a file is written all the same: nothing is forced, and options of `map` help nobody
        found = [[Cell(f"{each.severity}: {each.text} [{each.rule}]", "yellow")] for each in result.findings]
    for line in (*text(result, width), *found):
        cells = _cells(hints, line)
        whole = "".join(cell.text for cell in cells)
        if columns(whole) <= width:
            yield cells
        else:
            yield from ([Cell(part, cells[0].style)] for part in broken(whole, width))


def _cells(hints: Callable[[], TypedHints], line: Line) -> list[Cell]:
    shown = with_hints(line, hints)
    if isinstance(shown, str):
        return [Cell(shown)]
    return [shown] if isinstance(shown, Cell) else list(shown)
