"""The window of a full screen: its rows are kept, and only those that changed are drawn again."""

from __future__ import annotations

from collections import defaultdict
from collections.abc import Callable, Iterable
from functools import lru_cache
from typing import TYPE_CHECKING

from prompt_toolkit.application import get_app
from prompt_toolkit.data_structures import Point
from prompt_toolkit.layout import FormattedTextControl, Window
from prompt_toolkit.layout.screen import Char
from prompt_toolkit.mouse_events import MouseEvent, MouseEventType

from dvtcli.cli.screen.widgets import CURSOR
from dvtcli.cli.view.lines import columns
from dvtcli.domain.text import ascii_only

if TYPE_CHECKING:
    from prompt_toolkit.key_binding.key_bindings import NotImplementedOrNone
    from prompt_toolkit.layout.mouse_handlers import MouseHandlers
    from prompt_toolkit.layout.screen import Screen, WritePosition

    from dvtcli.cli.view.lines import Cell

_ACTS = {
    MouseEventType.MOUSE_UP: "click", MouseEventType.SCROLL_UP: "wheel-up", MouseEventType.SCROLL_DOWN: "wheel-down"
}  # fmt: skip
#: Takes what the mouse does: `click`, `wheel-up` or `wheel-down`, with column and row, both from 0.
Mouse = Callable[[str, int, int], None]
#: Picture of a screen, for columns and rows.
Lines = Callable[[int, int], Iterable[list["Cell"]]]
_Row = defaultdict[int, Char]


@lru_cache(maxsize=4096)
def _char(text: str, style: str) -> Char:
    return Char(text, style)


_BLANK, _BEHIND_WIDE = _char(" ", ""), _char("", "")


def _blank() -> Char:
    return _BLANK


class Canvas(Window):
    """Shows *lines*, in ASCII if *plain*; *mouse* gets what the mouse does. The cursor stands where a cell has it.

    prompt_toolkit compares all characters of two pictures, which takes longer than a key may: a row that is still the
    same is left empty in both.
    """

    def __init__(self, lines: Lines, mouse: Mouse | None, *, plain: bool) -> None:
        super().__init__(FormattedTextControl(""))
        self._lines, self._mouse, self._plain = lines, mouse, plain
        self._size = (0, 0)
        self._cells: list[tuple[Cell, ...]] = []
        self._rows: list[_Row] = []
        self._cursor = Point(0, 0)
        #: the screen with the last picture, and its rows
        self._screen: Screen | None = None
        self._drawn: list[_Row] = []
        self._handlers: defaultdict[int, Callable[[MouseEvent], NotImplementedOrNone]] = defaultdict(
            lambda: self._mouse_event
        )

    def renew(self, columns: int, rows: int) -> bool:
        """Make the picture anew; True if it is another one."""
        cells = [tuple(line) for line in self._lines(columns, rows)][:rows]
        is_resized = (columns, rows) != self._size
        if cells == self._cells and not is_resized:
            return False
        known = {} if is_resized else dict(zip(self._cells, self._rows, strict=True))
        before = [] if is_resized else list(zip(self._cells, self._rows, strict=True))
        self._rows = []
        for number, line in enumerate(cells):
            is_same = number < len(before) and before[number][0] == line
            self._rows.append(before[number][1] if is_same else known.get(line) or self._row(line, columns))
        self._cells, self._size = cells, (columns, rows)
        self._cursor = self._cursor_place()
        return True

    def _cursor_place(self) -> Point:
        """Return the place of the last cell with the cursor, else the first place."""
        for number in reversed(range(len(self._cells))):
            before = ""
            for cell in self._cells[number]:
                if cell.style.endswith(CURSOR):
                    return Point(min(columns(before), max(0, self._size[0] - 1)), number)
                before += cell.text
        return Point(0, 0)

    def _row(self, line: Iterable[Cell], columns: int) -> _Row:
        """Return *line* by columns: a wide character takes two, a combining one none."""
        row, column = _Row(_blank), 0
        for cell in line:
            name = cell.style.removesuffix(CURSOR)
            style = f"class:{name}" if name else ""
            for letter in ascii_only(cell.text) if self._plain else cell.text:
                char = _char(letter, style)
                if not char.width and column:
                    row[column - 1] = _char(row[column - 1].char + letter, row[column - 1].style)
                if column + char.width > columns:
                    return row
                if char.width:
                    row[column] = char
                    for behind in range(column + 1, column + char.width):
                        row[behind] = _BEHIND_WIDE
                    column += char.width
        return row

    def write_to_screen(
        self,
        screen: Screen,
        mouse_handlers: MouseHandlers,
        write_position: WritePosition,
        parent_style: str,  # noqa: ARG002 - the window stands alone
        erase_bg: bool,  # noqa: ARG002 - as prompt_toolkit calls it
        z_index: int | None,  # noqa: ARG002
    ) -> None:
        """Write the picture, without the rows that *screen*'s predecessor has, too."""
        size = write_position.width, write_position.height
        if size != self._size:
            self.renew(*size)
        application = get_app()
        before = self._screen if application.renderer.last_rendered_screen is self._screen else None
        if application.is_done:
            before = None
        for number, row in enumerate(self._rows):
            is_same = before is not None and number < len(self._drawn) and self._drawn[number] is row
            screen.data_buffer[number] = _Row(_blank) if is_same else row
            if before is not None and number < len(self._drawn):
                before.data_buffer[number] = _Row(_blank) if is_same else self._drawn[number]
        if before is not None:
            for number in range(len(self._rows), len(self._drawn)):
                before.data_buffer[number] = self._drawn[number]
        screen.width, screen.height = size
        screen.show_cursor = True
        screen.set_cursor_position(self, self._cursor)
        screen.visible_windows_to_write_positions[self] = write_position
        if self._mouse is not None:
            for number in range(size[1]):
                mouse_handlers.mouse_handlers[number] = self._handlers
        self._screen, self._drawn = screen, self._rows

    def _mouse_event(self, event: MouseEvent) -> NotImplementedOrNone:
        if self._mouse is not None and (act := _ACTS.get(event.event_type)) is not None:
            self._mouse(act, event.position.x, event.position.y)
        return None
