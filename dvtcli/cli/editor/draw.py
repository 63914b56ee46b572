"""The editor's picture: PDOs, the frame of one, and objects; one pane at a time on a narrow screen. Pure."""

from __future__ import annotations

import re
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from functools import lru_cache
from typing import TYPE_CHECKING, Protocol

from dvtcli.cli.editor.model import INHIBIT_PER_MS, PARAMETERS, EditedPdos
from dvtcli.cli.screen.widgets import CURSOR, Cursor, Field, cut, filled
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
_SHARES = (31, 36, 33)
#: columns from which the pane of PDOs has all their parameters and objects
_WITH_OBJECTS = 50
#: an object as findings name it
_OBJECT = re.compile(r"(?:0x)?([0-9A-F]{4}):([0-9A-F]{2})")
#: sub-indices of the communication parameter (CiA 301, 7.5.2.35 and 7.5.2.37), in the order of `PARAMETERS`
_SUB_INDICES = (1, 2, 3, 5, 6)
_TITLES = ("PDOS", "FRAME", "OBJECTS")
Lines = list[list[Cell]]
#: letters of the entries in the strip of bytes
_LETTERS = "abcdefghijklmnopqrstuvwxyzABCDEFGHIJKLMNOPQRSTUVWXYZ0123456789+*"
_KEYS = (
    (("↑ ↓", "choose"), ("Enter", "its frame"), ("a", "add"), ("e", "on/off"), ("Tab", "frame")),
    (
        ("a", "add"), ("r", "replace"), ("d", "remove"), ("< >", "move"), ("s", "skip"), ("Enter", "edit"),
        ("e", "on/off"), ("Tab", "objects"),
    ),
    (("letters", "filter"), ("↑ ↓", "choose"), ("Enter", "map"), ("Tab", "PDOs")),
)  # fmt: skip
_ALWAYS = (
    ("F1", "keys"), ("F5", "plan"), ("F10/^S", "apply"), ("F2", "save"), ("^Z", "undo"), ("^Y", "redo"),
    ("Esc", "leave"),
)  # fmt: skip
#: names of keys that are no letters
_NAMED_KEYS = {
    "Enter": ("enter", ""), "Tab": ("tab", ""), "F1": ("f1", ""), "F5": ("f5", ""), "F10/^S": ("f10", ""),
    "F2": ("f2", ""), "^Z": ("c-z", ""), "^Y": ("c-y", ""), "Esc": ("escape", ""), "↑": ("up", ""), "↓": ("down", ""),
    "letters": ("", ""),
}  # fmt: skip
_Keys = Sequence[tuple[str, str]]
#: every key, for the list of F1
ALL_KEYS = (
    ("Tab, Shift-Tab", "next and previous pane: PDOs, frame, objects"),
    ("up, down, wheel", "choose a row, as does a click; a second click is Enter"),
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
    ("c", "all findings of the rules, of a file those of check"),
    ("F5", "the plan, as map shows it; of a file, of all changed nodes"),
    ("F10, Ctrl-S", "apply as map does, or write the file; then come back"),
    ("F2", "save: .dvt a script, .yaml .yml .dcf .xdc the whole node"),
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
    #: how the bus was lost, empty if it was not
    lost: str = ""
    message: str = ""
    is_bad: bool = False
    plain: bool = False
    #: whether a file is edited, without a bus; and whether it has several nodes
    of_file: bool = False
    has_nodes: bool = False
    #: the file's bus load and findings in a line
    status: str = ""
    #: the findings of `check` about the file, also of other nodes
    listed: Sequence[Remark] = ()
    #: what differs from the node or the file, in words
    changed: Sequence[str] = ()

    @property
    def pdo(self) -> Pdo:
        """The chosen PDO."""
        return self.order[min(self.pdo_cursor.chosen, len(self.order) - 1)]

    @property
    def config(self) -> PdoConfig:
        """The chosen PDO as it is edited."""
        return self.pdos.now[self.pdo]

    def every_finding(self) -> list[tuple[str, str]]:
        """Return each finding of the rules with its style: of all PDOs, of a file of all nodes."""
        of_pdos = [finding for found in (self.findings or {}).values() for finding in found]
        return [(_finding_text(finding), _style_of(finding)) for finding in (self.listed or of_pdos)]


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
        body = _pane(view, view.pane, draw[view.pane](view, width, room - 1), width, room, is_alone=True)
    above, below = ([cut(line, width, plain=view.plain) for line in lines] for lines in (above, below))
    return [*above, *body[:room], *below]


def pane_at(view: EditorView, width: int, column: int) -> int:
    """Return the pane at *column* of a screen of *width* columns."""
    if width < SIDE_BY_SIDE:
        return view.pane
    ends = [width * sum(_SHARES[: pane + 1]) // 100 for pane in range(3)]
    return next((pane for pane, end in enumerate(ends) if column < end), OBJECTS)


def row_at(view: EditorView, row: int, width: int, height: int) -> int | None:
    """Return the number of the active pane's row that is drawn at *row* of the screen; None if none is."""
    if row >= height - len(_below(view, width)):
        return None
    entries, first = len(view.config.mapping), 4 if view.pane == FRAME else 3
    cursor, count = (
        (view.pdo_cursor, len(view.order)),
        (view.frame_cursor, frame_rows(view.config)),
        (view.object_cursor, len(view.offers)),
    )[view.pane]
    number = cursor.top + row - first
    if view.pane == FRAME and cursor.top <= entries <= number:  # the state of the frame stands behind the entries
        number = number - 1 if number > entries else -1
    return number if row >= first and 0 <= number < count else None


def _pane(view: EditorView, pane: int, lines: Lines, width: int, room: int, *, is_alone: bool = False) -> Lines:
    """Return *lines* with the pane's title, in *width* columns and *room* lines; *is_alone*: no other pane."""
    title = _TITLES[pane] if pane != FRAME else f"FRAME OF {view.pdo.label}"
    if pane == OBJECTS and is_alone:
        mapped = " ".join(entry.object for entry in view.config.mapping) or "maps nothing"
        title = f"{title} FOR {view.pdo.label}: {mapped}, {_free(view)[0]}"
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
        Cell(filled("", width, plain=plain)[len(filled(used, 0, plain=plain)) :][: max(0, width - columns(used))]),
    ]


def _head(view: EditorView, width: int) -> Lines:
    """Return the node and its state: of both, the state is never cut."""
    done, held = ("written", "as the file has it") if view.of_file else ("applied", "value in the node")
    state = f"{', '.join(view.changed)} changed, not {done}" if view.changed else held
    if columns(state) > width // 2:
        state = f"{plural(len(view.changed), 'change')}, not {done}"
    title = cut([Cell("EDIT ", "bold"), Cell(view.title)], max(8, width - columns(state) - 2), plain=view.plain)
    return [[*title, Cell("  "), Cell(state, "yellow" if view.changed else "dim")]]


def _below(view: EditorView, width: int) -> Lines:
    """Return what the rules say of the chosen PDO, the message, and the keys."""
    message = _rows(Cell(view.message, "red" if view.is_bad else "cyan"), width)
    if view.message:
        message[0] = [message[0][0]._replace(style=f"{message[0][0].style}{CURSOR}")]
    status = _rows(Cell(view.status, "dim"), width) if view.of_file else []
    return [*status, *_rows(_rule_line(view), width), *message, *map(_key_line, _keys(view))]


def _keys(view: EditorView) -> tuple[_Keys, _Keys]:
    """Return the keys of the pane, and those of every pane."""
    own = (*_KEYS[view.pane], *((("n", "node"), ("L", "link")) if view.has_nodes and view.pane == PDOS else ()))
    return own, [("F10/^S", "write") if view.of_file and key == "F10/^S" else (key, does) for key, does in _ALWAYS]


def key_at(view: EditorView, column: int, row: int) -> tuple[str, str] | None:
    """Return the key, with its text, that is named at *column* of *row*, -2 or -1 from below; None if none is."""
    end = 0
    for name, does in _keys(view)[row] if row in (-2, -1) else ():
        begin, end = end, end + columns(name) + columns(does) + 3
        if begin <= column < end:
            first, _, second = name.partition(" ")
            name = second if second and column > begin + len(first) + 1 else first  # noqa: PLW2901
            return _NAMED_KEYS.get(name, ("", name))
    return None


def _rows(text: Cell, width: int) -> Lines:
    """Return *text* in as many rows as it needs, at most `_MESSAGE_ROWS`; an empty text has a row, too."""
    rows = broken(text.text, max(8, width)) or [""]
    if len(rows) > _MESSAGE_ROWS:
        rows = [*rows[: _MESSAGE_ROWS - 1], " ".join(row.strip() for row in rows[_MESSAGE_ROWS - 1 :])]
    return [[Cell(row, text.style)] for row in rows]


def _key_line(keys: Sequence[tuple[str, str]]) -> list[Cell]:
    return [cell for key, what in keys for cell in (Cell(f" {key}", "bold"), Cell(f" {what} "))]


def _rule_line(view: EditorView) -> Cell:
    if view.lost:
        return Cell(f"{view.lost}; edits stay, but F10 cannot write", "red")
    if view.findings is None:
        return Cell("asking the rules...", "dim")
    if view.not_judged:
        return Cell(f"the rules could not be checked: {view.not_judged}", "red")
    found = view.findings.get(view.pdo, ())
    if not found:
        others = [pdo.label for pdo, findings in view.findings.items() if findings]
        return Cell(f"the rules also have findings for {', '.join(others)}: c shows them" if others else "", "yellow")
    chosen = view.frame_cursor.chosen if view.pane == FRAME else None
    first = max(found, key=lambda finding: (_row_of(view, finding) == chosen, finding.severity is Severity.ERROR))
    more = f"  (+{len(found) - 1})" if len(found) > 1 else ""
    return Cell(f"{_finding_text(first)}{more}", _style_of(first))


def _finding_text(finding: Remark) -> str:
    return f"{finding.place}: {finding.text} [{finding.rule}]"


def _row_of(view: EditorView, finding: Remark) -> int | None:
    """Return the number of the frame's row that *finding* is about, None for none."""
    found, entries = _OBJECT.fullmatch(finding.place), len(view.config.mapping)
    if found is None:
        return None
    index, sub_index = int(found[1], 16), int(found[2], 16)
    if index == view.pdo.mapping_index and 0 < sub_index <= entries:
        return sub_index - 1
    if index == view.pdo.communication_index and sub_index in _SUB_INDICES:
        return entries + _SUB_INDICES.index(sub_index)
    return None


def _marks(view: EditorView) -> dict[int | None, Remark]:
    """Return the strongest finding of each row of the frame; None is the row of the frame's state."""
    marks: dict[int | None, Remark] = {}
    for finding in (view.findings or {}).get(view.pdo, ()):
        row = _row_of(view, finding)
        if row not in marks or finding.severity is Severity.ERROR is not marks[row].severity:
            marks[row] = finding
    return marks


def _style_of(finding: Remark) -> str:
    return "red" if finding.severity is Severity.ERROR else "yellow"


def _chosen(view: EditorView, pane: int, number: int) -> Cell:
    """Return the mark in front of the row *number* of *pane*; the cursor stands at that of the active pane."""
    cursor = (view.pdo_cursor, view.frame_cursor, view.object_cursor)[pane]
    if number != cursor.chosen:
        return Cell(" ")
    return Cell(">", f"cyan{CURSOR}" if pane == view.pane else "cyan")


def _milliseconds(value: int | None, scale: int = 1) -> str:
    return "-" if not value else f"{value / scale:g}"


def _pdo_lines(view: EditorView, width: int, room: int) -> Lines:
    labels = max(map(len, (pdo.label for pdo in view.order)), default=0)
    ids = max(len("COB-ID"), *(len(str(config.communication.cob_id)) for config in view.pdos.now.values()))
    if width > _WITH_OBJECTS:
        parameters = f"STATE    TYPE  INHIBIT  {'EVENT':>8}  LEN   OBJECTS"
    else:
        parameters = f"   TYPE {'LEN':>4} INH/EVT"
    lines: Lines = [[Cell(f"   {'PDO':<{labels}} {'COB-ID':<{ids}} {parameters}", "dim")]]
    for number in view.pdo_cursor.window(len(view.order), max(1, room - 1)):
        pdo = view.order[number]
        config = view.pdos.now[pdo]
        bad = any(finding.severity is Severity.ERROR for finding in (view.findings or {}).get(pdo, ()))
        mark = "!" if bad else "*" if config != view.pdos.held.get(pdo) else " "
        lines.append([
            _chosen(view, PDOS, number), Cell(" "), Cell(mark, "red" if bad else "yellow"),
            Cell(f"{pdo.label:<{labels}} "),
            Cell(f"{config.communication.cob_id!s:<{ids}} ", "green" if config.enabled else "dim"),
            *_pdo_parameters(config, is_wide=width > _WITH_OBJECTS),
        ])  # fmt: skip
    return lines


def _pdo_parameters(config: PdoConfig, *, is_wide: bool) -> list[Cell]:
    """Return state, type, timers and length of a PDO, and if *is_wide* its objects."""
    communication = config.communication
    kind = "-" if communication.transmission_type is None else str(communication.transmission_type)
    inhibit = _milliseconds(communication.inhibit_time, INHIBIT_PER_MS)
    event = _milliseconds(communication.event_timer)
    size = "MPDO" if config.mpdo is not None else f"{(config.bits + 7) // 8} B"
    style = "green" if config.enabled else "dim"
    if not is_wide:
        timers = "" if inhibit == event == "-" else f"{inhibit}/{event}"
        return [Cell(f"{'on' if config.enabled else 'off':<3}", style), Cell(f" {kind:>3} {size:>4} {timers}")]
    times = [f"{time}{'' if time == '-' else ' ms'}" for time in (inhibit, event)]
    objects = " ".join(entry.object for entry in config.mapping)
    return [
        Cell(f"{'enabled' if config.enabled else 'off':<7} ", style),
        Cell(f" {kind:>4}  {times[0]:>7}  {times[1]:>8}  {size:<4}  "), Cell(objects, "dim"),
    ]  # fmt: skip


def frame_rows(config: PdoConfig) -> int:
    """Return the number of rows to choose from in the frame's pane: entries, then parameters."""
    return len(config.mapping) + len(PARAMETERS)


def _frame_lines(view: EditorView, width: int, room: int) -> Lines:
    config, cursor = view.config, view.frame_cursor
    lines: Lines = [[Cell(" byte " + "".join(f" {byte:<3}" for byte in range(8)), "dim")], _strip(config)]
    marks, count = _marks(view), len(config.mapping)
    entries = [_entry_line(view, number, width, marks.get(number)) for number in range(count)]
    parameters: Lines = [
        [_chosen(view, FRAME, number), _mark(found), Cell(f"{parameter.name:<13} ", "dim"),
         Cell(parameter.text(view.pdo, config)), *_rule_name(found)]
        for number, parameter in enumerate(PARAMETERS, count) for found in [marks.get(number)]
    ]  # fmt: skip
    shown = [*entries, *parameters]
    room = max(1, room - len(lines) - 1)
    for number in cursor.window(len(shown), room):
        if number == len(entries):
            state = Cell("enabled, " if config.enabled else "off, ", "bold")
            lines.append([Cell(" "), _mark(marks.get(None)), state, Cell(*_free(view)), *_rule_name(marks.get(None))])
        lines.append(shown[number])
    return lines


def _mark(finding: Remark | None) -> Cell:
    return Cell(" ") if finding is None else Cell("!", _style_of(finding))


def _rule_name(finding: Remark | None) -> list[Cell]:
    return [] if finding is None else [Cell(f"  [{finding.rule}]", _style_of(finding))]


def _free(view: EditorView) -> tuple[str, str]:
    """Return how much of the frame is free or too much, with its style."""
    config, free = view.config, view.pdos.bits_left(view.pdo)
    if config.mpdo is not None:
        way = "SAM, source addressing" if config.mpdo == SAM_MPDO else "DAM, destination addressing"
        return f"multiplexed PDO ({way})", "yellow"
    over = config.bits - MAX_PDO_BITS
    if over > 0:
        return f"{plural(over, 'bit')} too many", "red"
    return f"{plural(free, 'bit') if free % 8 else plural(free // 8, 'byte')} free", "dim"


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


def _entry_line(view: EditorView, number: int, width: int, found: Remark | None) -> list[Cell]:
    config = view.config
    entry = config.mapping[number]
    place = layout(config.mapping)[number]
    first, last = place.start_bit // 8, max(place.start_bit // 8, (place.end_bit - 1) // 8)
    where = f"{first}" if first == last else f"{first}-{last}"
    named = view.names.get(entry, Named())
    name = "(skipped)" if entry.is_dummy else named.name
    letter = "." if entry.is_dummy else _LETTERS[number % len(_LETTERS)]
    tail = _rule_name(found) or ([Cell(f" {named.value}", "yellow")] if named.value else [])
    room = max(8, width - 20 - sum(columns(cell.text) for cell in tail))
    return [
        _chosen(view, FRAME, number), _mark(found), Cell(f"{letter} ", "green"), Cell(f"{where:<4} ", "dim"),
        Cell(f"{entry.object}/{entry.bits:<2} "), Cell(_named(name, room, plain=view.plain)), *tail,
    ]  # fmt: skip


def _named(name: str, room: int, *, plain: bool) -> str:
    """Return *name* in *room* columns: if it is too long, without the name of its record."""
    _, _, last = name.partition(".")
    return filled(f"…{last}" if last and columns(name) > room else name, room, plain=plain)


def _object_lines(view: EditorView, width: int, room: int) -> Lines:
    does = "replace" if view.replaces else "map"
    lines: Lines = [[Cell(f" {does}: ", "cyan"), *view.filter.cells(max(8, width - 12))]]
    if not view.offers:
        return [*lines, [Cell("  no object matches by number, name or unit", "dim")]]
    for number in view.object_cursor.window(len(view.offers), max(1, room - 1)):
        offer = view.offers[number]
        kind = offer.listed.entry.data_type.short if offer.listed.entry.data_type else "?"
        tail = offer.reason or f"{kind} {offer.listed.unit}".rstrip()
        tail = f"{kind} {tail}" if offer.is_too_long else tail
        style = "dim" if offer.reason else ""
        name = _named(offer.listed.name, max(8, width - 11 - columns(tail)), plain=view.plain)
        lines.append([
            _chosen(view, OBJECTS, number), Cell(" "),
            Cell(f"{offer.listed.entry.object} {name} ", style), Cell(tail, "dim"),
        ])  # fmt: skip
    return lines
