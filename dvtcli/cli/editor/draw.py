"""The editor's picture: PDOs, the frame of one, and objects; one pane at a time on a narrow screen. Pure."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from functools import lru_cache
from typing import TYPE_CHECKING, Protocol

from dvtcli.cli.editor.model import PARAMETERS, EditedPdos
from dvtcli.cli.screen.widgets import Cursor, Field, cut, filled
from dvtcli.cli.view.lines import Cell, broken, columns
from dvtcli.domain.frame import layout
from dvtcli.domain.pdo import MAX_PDO_BITS, SAM_MPDO
from dvtcli.domain.profile import Severity
from dvtcli.domain.text import plural

if TYPE_CHECKING:
    from dvtcli.cli.editor.model import Offer
    from dvtcli.domain.pdo import Pdo, PdoConfig, PdoMappingEntry

#: the panes, in the order of Tab
PDOS, FRAME, OBJECTS = range(3)
#: columns from which all panes stand side by side
SIDE_BY_SIDE = 110
#: share of the columns of each pane, in percent
_SHARES = (26, 38, 36)
#: columns from which the pane of PDOs names their objects
_WITH_OBJECTS = 50
_TITLES = ("PDOS", "FRAME", "OBJECTS")
Lines = list[list[Cell]]
#: letters of the entries in the strip of bytes
_LETTERS = "abcdefghijklmnopqrstuvwxyzABCDEFGHIJKLMNOPQRSTUVWXYZ0123456789+*"
_KEYS = (
    (("↑↓", "choose"), ("Enter", "its frame"), ("a", "add"), ("e", "on/off"), ("Tab", "frame")),
    (
        ("a", "add"), ("r", "replace"), ("d", "remove"), ("< >", "move"), ("s", "skip"), ("Enter", "edit"),
        ("e", "on/off"), ("Tab", "objects"),
    ),
    (("letters", "filter"), ("↑↓", "choose"), ("Enter", "map"), ("Tab", "PDOs")),
)  # fmt: skip
_ALWAYS = (
    ("F1", "keys"), ("F5", "plan"), ("F10/^S", "apply"), ("F2", "save"), ("^Z", "undo"), ("^Y", "redo"),
    ("Esc", "leave"),
)  # fmt: skip
#: every key, for the list of F1
ALL_KEYS = (
    ("Tab, Shift-Tab", "next and previous pane: PDOs, frame, objects"),
    ("up, down, wheel", "choose a row, as does a click"),
    ("Enter", "PDOs: to the frame; frame: edit the value; objects: map"),
    ("a, r", "add an object behind the last; replace the chosen object"),
    ("d, Delete", "remove the chosen object"),
    ("<, >, left, right", "move the chosen object in the frame"),
    ("s", "skip bits: add a dummy"),
    ("l", "length of the chosen object in bits"),
    ("e", "enable or disable the PDO"),
    ("n, L", "of a file: another node; let an RPDO receive this TPDO"),
    ("letters", "in the objects: filter by number, name or unit"),
    ("Ctrl-Z, Ctrl-Y", "take a step back, and make it again"),
    ("F5", "the plan, as map shows it"),
    ("F10, Ctrl-S", "apply as map does, or write the file; then come back"),
    ("F2", "save: .dvt a script, .yaml or .dcf the whole node"),
    ("Esc, Ctrl-C", "leave; asks if a change is not applied"),
)
#: rows of the screen that a message or a finding may take
_MESSAGE_ROWS = 3


@dataclass(slots=True)
class Named:
    """Names of a mapped entry, and the value in the last frame, in words."""

    name: str = ""
    value: str = ""


class Remark(Protocol):
    """What a rule says of a PDO."""

    @property
    def rule(self) -> str:
        """The rule's name."""
        ...

    @property
    def severity(self) -> Severity:
        """How strongly it is meant."""
        ...

    @property
    def place(self) -> str:
        """The object or the PDO."""
        ...

    @property
    def text(self) -> str:
        """The finding in words."""
        ...


@dataclass(slots=True)
class EditorView:
    """What is shown and where the cursors stand."""

    title: str
    pdos: EditedPdos
    order: Sequence[Pdo]
    pane: int = PDOS
    pdo_cursor: Cursor = field(default_factory=Cursor)
    frame_cursor: Cursor = field(default_factory=Cursor)
    object_cursor: Cursor = field(default_factory=Cursor)
    filter: Field = field(default_factory=Field)
    #: whether the chosen object replaces the entry instead of standing behind it
    replaces: bool = False
    offers: Sequence[Offer] = ()
    names: Mapping[PdoMappingEntry, Named] = field(default_factory=dict)
    #: what the rules say by PDO; None while they are asked
    findings: Mapping[Pdo, Sequence[Remark]] | None = field(default_factory=dict)
    #: why the rules could not be asked, empty if they were
    not_judged: str = ""
    message: str = ""
    is_bad: bool = False
    plain: bool = False
    #: whether a file is edited, without a bus; and whether it has several nodes
    of_file: bool = False
    has_nodes: bool = False
    #: the file's bus load and findings in a line
    status: str = ""

    @property
    def pdo(self) -> Pdo:
        """The chosen PDO."""
        return self.order[min(self.pdo_cursor.chosen, len(self.order) - 1)]

    @property
    def config(self) -> PdoConfig:
        """The chosen PDO as it is edited."""
        return self.pdos.now[self.pdo]


def picture(view: EditorView, width: int, height: int) -> Lines:
    """Return the whole screen: *height* lines of at most *width* columns."""
    above, below = _head(view, width), _below(view, width)
    room = max(1, height - len(above) - len(below))
    draw = (_pdo_lines, _frame_lines, _object_lines)
    if width >= SIDE_BY_SIDE:
        widths = [width * share // 100 - 1 for share in _SHARES]
        panes = [_pane(view, pane, draw[pane](view, widths[pane], room - 1), widths[pane], room) for pane in range(3)]
        body = [[*left, Cell(" "), *middle, Cell(" "), *right] for left, middle, right in zip(*panes, strict=True)]
    else:
        body = _pane(view, view.pane, draw[view.pane](view, width, room - 1), width, room)
    above, below = ([cut(line, width, plain=view.plain) for line in lines] for lines in (above, below))
    return [*above, *body[:room], *below]


def pane_at(view: EditorView, width: int, column: int) -> int:
    """Return the pane at *column* of a screen of *width* columns."""
    if width < SIDE_BY_SIDE:
        return view.pane
    ends = [width * sum(_SHARES[: pane + 1]) // 100 for pane in range(3)]
    return next((pane for pane, end in enumerate(ends) if column < end), OBJECTS)


def _pane(view: EditorView, pane: int, lines: Lines, width: int, room: int) -> Lines:
    """Return *lines* with the pane's title, filled up to *width* columns and *room* lines."""
    title = _TITLES[pane] if pane != FRAME else f"FRAME OF {view.pdo.label}"
    head = [Cell(filled(f" {title}", width, plain=view.plain), "reverse" if pane == view.pane else "dim")]
    whole = [head, *lines][:room]
    whole += [[] for _ in range(room - len(whole))]
    return [_filled(tuple(line), width, plain=view.plain) for line in whole]


@lru_cache(maxsize=512)  # of two pictures most lines are the same
def _filled(line: tuple[Cell, ...], width: int, *, plain: bool) -> list[Cell]:
    """Cut or fill *line* to exactly *width* columns."""
    cells = cut(list(line), width, plain=plain)
    used = "".join(cell.text for cell in cells)
    return [
        *cells,
        Cell(filled("", width, plain=plain)[len(filled(used, 0, plain=plain)) :][: max(0, width - _w(used))]),
    ]


def _w(text: str) -> int:

    return columns(text)


def _head(view: EditorView, width: int) -> Lines:
    """Return the node and its state: of both, the state is never cut."""
    changed = view.pdos.changed()
    done, held = ("written", "as the file has it") if view.of_file else ("applied", "value in the node")
    state = f"{', '.join(pdo.label for pdo in changed)} changed, not {done}" if changed else held
    if columns(state) > width // 2:
        state = f"{plural(len(changed), 'PDO')} changed, not {done}"
    title = cut([Cell("EDIT ", "bold"), Cell(view.title)], max(8, width - columns(state) - 2), plain=view.plain)
    return [[*title, Cell("  "), Cell(state, "yellow" if changed else "dim")]]


def _below(view: EditorView, width: int) -> Lines:
    """Return what the rules say of the chosen PDO, the message, and the keys."""
    message = _rows(Cell(view.message, "red" if view.is_bad else "cyan"), width)
    keys = [("F10/^S", "write") if view.of_file and key == "F10/^S" else (key, does) for key, does in _ALWAYS]
    own = (*_KEYS[view.pane], *((("n", "node"), ("L", "link")) if view.has_nodes and view.pane == PDOS else ()))
    status = _rows(Cell(view.status, "dim"), width) if view.of_file else []
    return [*status, *_rows(_rule_line(view), width), *message, _key_line(own), _key_line(keys)]


def _rows(text: Cell, width: int) -> Lines:
    """Return *text* in as many rows as it needs, at most `_MESSAGE_ROWS`; an empty text has a row, too."""
    rows = broken(text.text, max(8, width)) or [""]
    if len(rows) > _MESSAGE_ROWS:
        rows = [*rows[: _MESSAGE_ROWS - 1], " ".join(row.strip() for row in rows[_MESSAGE_ROWS - 1 :])]
    return [[Cell(row, text.style)] for row in rows]


def _key_line(keys: Sequence[tuple[str, str]]) -> list[Cell]:
    return [cell for key, what in keys for cell in (Cell(f" {key}", "bold"), Cell(f" {what} "))]


def _rule_line(view: EditorView) -> Cell:
    if view.findings is None:
        return Cell("asking the rules...", "dim")
    if view.not_judged:
        return Cell(f"the rules could not be checked: {view.not_judged}", "red")
    found = view.findings.get(view.pdo, ())
    if not found:
        others = [pdo.label for pdo, findings in view.findings.items() if findings]
        return Cell(f"the rules also have findings for {', '.join(others)}" if others else "", "yellow")
    first = max(found, key=lambda finding: finding.severity is Severity.ERROR)
    more = f"  (+{len(found) - 1})" if len(found) > 1 else ""
    style = "red" if first.severity is Severity.ERROR else "yellow"
    return Cell(f"{first.place}: {first.text} [{first.rule}]{more}", style)


def _pdo_lines(view: EditorView, width: int, room: int) -> Lines:
    lines: Lines = []
    for number in view.pdo_cursor.window(len(view.order), room):
        pdo = view.order[number]
        config = view.pdos.now[pdo]
        bad = any(finding.severity is Severity.ERROR for finding in (view.findings or {}).get(pdo, ()))
        mark = "!" if bad else "*" if config != view.pdos.held.get(pdo) else " "
        kind = config.communication.transmission_type
        state = f"{config.communication.cob_id!s:<10}" if config.enabled else f"{'off':<10}"
        lines.append([
            Cell("> " if number == view.pdo_cursor.chosen else "  ", "cyan"), Cell(mark, "red" if bad else "yellow"),
            Cell(f"{pdo.label:<7} "), Cell(state, "green" if config.enabled else "dim"),
            Cell(f" {'' if kind is None else kind:>3} {'MPDO' if config.mpdo is not None else _size(config)}"),
            Cell(f"  {' '.join(entry.object for entry in config.mapping)}" if width > _WITH_OBJECTS else "", "dim"),
        ])  # fmt: skip
    return lines


def _size(config: PdoConfig) -> str:
    return f"{(config.bits + 7) // 8} B"


def frame_rows(config: PdoConfig) -> int:
    """Return the number of rows to choose from in the frame's pane: entries, then parameters."""
    return len(config.mapping) + len(PARAMETERS)


def _frame_lines(view: EditorView, width: int, room: int) -> Lines:
    config, cursor = view.config, view.frame_cursor
    lines: Lines = [[Cell(" byte " + "".join(f" {byte:<3}" for byte in range(8)), "dim")], _strip(config)]
    entries = [_entry_line(view, number, width) for number in range(len(config.mapping))]
    free = view.pdos.bits_left(view.pdo)
    parameters: Lines = [
        [Cell("> " if cursor.chosen == len(entries) + number else "  ", "cyan"),
         Cell(f"{parameter.name:<13} ", "dim"), Cell(parameter.text(view.pdo, config))]
        for number, parameter in enumerate(PARAMETERS)
    ]  # fmt: skip
    shown = [*entries, *parameters]
    room = max(1, room - len(lines) - 1)
    for number in cursor.window(len(shown), room):
        if number == len(entries):
            lines.append(_free_line(config, free))
        lines.append(shown[number])
    return lines


def _free_line(config: PdoConfig, free: int) -> list[Cell]:
    """Return the state of the PDO, and how much of its frame is free or too much."""
    state = Cell("  enabled, " if config.enabled else "  off, ", "bold")
    if config.mpdo is not None:
        way = "SAM, source addressing" if config.mpdo == SAM_MPDO else "DAM, destination addressing"
        return [state, Cell(f"multiplexed PDO ({way})", "yellow")]
    over = config.bits - MAX_PDO_BITS
    if over > 0:
        return [state, Cell(f"{plural(over, 'bit')} too many", "red")]
    return [state, Cell(f"{plural(free, 'bit') if free % 8 else plural(free // 8, 'byte')} free", "dim")]


def _strip(config: PdoConfig) -> list[Cell]:
    """Return the frame's bytes, each with the letters of the entries in it."""
    owners: list[str] = ["" for _ in range(8)]
    for number, place in enumerate(layout(config.mapping)):
        letter = "." if place.entry.is_dummy else _LETTERS[number % len(_LETTERS)]
        for byte in place.bytes:
            if byte < len(owners) and letter not in owners[byte]:
                owners[byte] += letter
    cells = [Cell("      ")]
    for owner in owners:
        text = owner * 3 if len(owner) == 1 else owner[:3]
        cells.append(Cell(f" {text or '---':<3}", "green" if owner else "dim"))
    return cells


def _entry_line(view: EditorView, number: int, width: int) -> list[Cell]:
    config = view.config
    entry = config.mapping[number]
    place = layout(config.mapping)[number]
    first, last = place.start_bit // 8, max(place.start_bit // 8, (place.end_bit - 1) // 8)
    where = f"{first}" if first == last else f"{first}-{last}"
    named = view.names.get(entry, Named())
    name = "(skipped)" if entry.is_dummy else named.name
    chosen = view.frame_cursor.chosen == number
    letter = "." if entry.is_dummy else _LETTERS[number % len(_LETTERS)]
    room = max(8, width - 25 - len(named.value))
    return [
        Cell("> " if chosen else "  ", "cyan"), Cell(f"{letter} ", "green"), Cell(f"{where:<4} ", "dim"),
        Cell(f"{entry.object}/{entry.bits:<2} "), Cell(filled(name, room, plain=view.plain)),
        Cell(named.value, "yellow"),
    ]  # fmt: skip


def _object_lines(view: EditorView, width: int, room: int) -> Lines:
    does = "replace" if view.replaces else "map"
    lines: Lines = [[Cell(f" {does}: ", "cyan"), *view.filter.cells(max(8, width - 12))]]
    if not view.offers:
        return [*lines, [Cell("  no object matches by number, name or unit", "dim")]]
    for number in view.object_cursor.window(len(view.offers), max(1, room - 1)):
        offer = view.offers[number]
        kind = offer.listed.entry.data_type.short if offer.listed.entry.data_type else "?"
        tail = offer.reason or f"{kind} {offer.listed.unit}".rstrip()
        style = "dim" if offer.reason else ""
        name = filled(offer.listed.name, max(8, width - 12 - len(tail)), plain=view.plain)
        lines.append([
            Cell("> " if number == view.object_cursor.chosen else "  ", "cyan"),
            Cell(f"{offer.listed.entry.object} {name} ", style), Cell(tail, "dim"),
        ])  # fmt: skip
    return lines
