"""A network as a self-contained HTML page; equal networks give equal pages."""

from __future__ import annotations

from base64 import b64encode
from collections import Counter
from collections.abc import Iterable, Iterator
from dataclasses import dataclass
from fractions import Fraction
from hashlib import sha256
from importlib.resources import files
from typing import Any

from dvtcli.domain.network.picture import (
    NetworkPicture,
    PictureField,
    PictureFinding,
    PictureFrame,
    PictureNode,
    PicturePdo,
)
from dvtcli.domain.pdo import MAX_PDO_BITS, PdoConfig
from dvtcli.domain.text import plural, safe
from dvtcli.files.picture.wiring import (
    Element,
    add,
    bit_range,
    byte_count,
    cob_id,
    drawing,
    end_text,
    ends_text,
    kbit,
    markup,
    meaning_text,
    ms,
    node_text,
    object_text,
    percent,
    style,
    timing,
    wiring,
)

_COLOURS = 6


@dataclass(frozen=True, slots=True)
class BitCell:
    """Neighbouring *bits* of a byte: those of field *number* (from 1; 0: free), and their text."""

    bits: int
    number: int
    text: str
    colour: str


@dataclass(frozen=True, slots=True)
class FieldRow:
    """An object of a frame: number, bits in the frame, name, and the receivers' objects."""

    number: int
    colour: str
    bits: str
    object: str
    name: str
    type_name: str
    meaning: str
    heard_as: tuple[str, ...]


@dataclass(frozen=True, slots=True)
class FrameCard:
    """A PDO on the page."""

    anchor: str
    title: str
    node: str
    is_tpdo: bool
    cob_id: str
    facts: tuple[str, ...]
    partners: str
    bytes: tuple[tuple[int, tuple[BitCell, ...]], ...]
    rows: tuple[FieldRow, ...]


def frame_cards(picture: NetworkPicture) -> Iterator[FrameCard]:
    """A card for each PDO that is on, node by node; RPDOs first, as the standard counts."""
    pdos = {pdo.end: pdo for _, pdo in picture.pdos}
    for node, pdo in picture.pdos:
        if pdo.config.enabled:
            partners = [pdos[end] for end in pdo.partners]
            yield _card(picture, node, pdo, partners)


def _card(picture: NetworkPicture, node: PictureNode, pdo: PicturePdo, partners: list[PicturePdo]) -> FrameCard:
    odd = pdo.config.inconsistency if node.is_told else ""
    facts = filter(None, (byte_count(pdo), timing(pdo), odd))
    verb = "received by" if pdo.is_tpdo else "receives"
    names = ", ".join(f"{end_text(end)} {_name(picture, end.node_id)}".rstrip() for end in pdo.partners)
    nobody = "no node of the network receives it" if pdo.is_tpdo else "no node of the network transmits it"
    rows = tuple(_row(number, field, partners) for number, field in enumerate(pdo.fields, 1))
    return FrameCard(
        f"{pdo.end.pdo}-{node.node_id}", pdo.end.pdo.label, node_text(picture, node.node_id), pdo.is_tpdo,
        cob_id(pdo.identifier), tuple(facts), f"{verb} {names}" if names else nobody, tuple(_bytes(pdo)), rows,
    )  # fmt: skip


def _name(picture: NetworkPicture, node_id: int) -> str:
    node = picture.node(node_id)
    return "" if node is None else node.name


def _row(number: int, field: PictureField, partners: list[PicturePdo]) -> FieldRow:
    received = [
        f"{end_text(partner.end)} {object_text(other)}"
        for partner in partners
        for other in partner.fields
        if not other.is_dummy and other.start_bit < field.end_bit and field.start_bit < other.end_bit
    ]
    named = "" if field.is_dummy else field.object
    return FieldRow(
        number, _colour(number, field), bit_range(field), named, field.label,
        field.type_name or f"{field.bits} bits", meaning_text(field.meaning), () if field.is_dummy else tuple(received),
    )  # fmt: skip


def _colour(number: int, field: PictureField | None) -> str:
    return "free" if field is None or field.is_dummy else f"t{(number - 1) % _COLOURS}"


def _bytes(pdo: PicturePdo) -> Iterator[tuple[int, tuple[BitCell, ...]]]:
    """Iterate over bytes with their cells, from bit 7 down to bit 0."""
    last = min(max((field.end_bit for field in pdo.fields), default=0), MAX_PDO_BITS)
    for byte in range((last + 7) // 8):
        yield byte, tuple(reversed(list(_cells(pdo, byte))))


def _cells(pdo: PicturePdo, byte: int) -> Iterator[BitCell]:
    """Iterate over the cells of a byte from bit 0 up."""
    bit, end = 8 * byte, 8 * byte + 8
    for number, field in enumerate(pdo.fields, 1):
        first, behind = max(field.start_bit, bit), min(field.end_bit, end)
        if first < behind:
            yield BitCell(behind - first, number, _text(field, first, behind), _colour(number, field))
    used = min(max((field.end_bit for field in pdo.fields), default=0), end)
    if used < end:
        yield BitCell(end - max(used, bit), 0, "free", "free")


def _text(field: PictureField, first: int, behind: int) -> str:
    """Return the name in a field's first cell; in later cells the bits."""
    if first == field.start_bit:
        return field.label
    return "" if field.is_dummy else f"{behind - field.start_bit - 1}…{first - field.start_bit}"


_ROWS = (
    "NMT", "SYNC, EMCY", "TIME", "TPDO1", "RPDO1", "TPDO2", "RPDO2", "TPDO3", "RPDO3", "TPDO4", "RPDO4", "SDO answer",
    "SDO request", "-", "heartbeat", "LSS",
)  # fmt: skip
_ROW, _TOP = 17, 26
#: the entries of the legend
_KINDS = ("unsent", "used", "late")
_MARKS = (1, 32, 64, 96, 127)


def cob_id_map(picture: NetworkPicture, width: int = 960, name: str = "map") -> Element:
    """Draw the map of COB-IDs, *width* wide; ids begin with *name*."""
    frames = [frame for frame in picture.frames if not frame.identifier[1]]
    used = plural(len({frame.identifier for frame in frames}), "CAN-ID")
    title = f"Map of the CAN-IDs: {used} used; its table is below"
    root = drawing(width, _TOP + _ROW * len(_ROWS) + 4, name, title)
    left = 150 if width > 600 else 92
    step = (width - left - 8) / 128
    for node_id in _MARKS:
        add(root, "text", str(node_id), x=left + step * (node_id + 0.5), y=14, class_="tick", text_anchor="middle")
    for number, words in enumerate(_ROWS):
        y = _TOP + _ROW * number
        add(root, "text", f"0x{number << 7:03X}", x=4, y=y + 11, class_="id small")
        if width > 600:
            add(root, "text", words, x=48, y=y + 11, class_="dim small")
        else:
            add(root, "text", words.partition(",")[0].removesuffix(" answer").removesuffix(" request"), x=42, y=y + 11,
                class_="dim tiny")  # fmt: skip
        add(root, "rect", x=left, y=y, width=step * 128, height=_ROW - 3, rx=2, class_="lane")
    for frame in sorted(frames, key=lambda drawn: _KINDS.index(_kind(drawn))):  # what is worst is drawn over the others
        _place(root, frame, left, step)
    return root


def _place(root: Element, frame: PictureFrame, left: float, step: float) -> None:
    can_id = frame.identifier[0]
    x, y = left + step * (can_id & 0x7F), _TOP + _ROW * (can_id >> 7)
    wide = max(step - 0.6, 4)
    mark = add(root, "rect", x=f"{x + (step - wide) / 2:.2f}", y=y, width=f"{wide:.2f}", height=_ROW - 3, rx=1,
               class_=f"place {_kind(frame)}")  # fmt: skip
    whose = "" if frame.node is None else f" of node {frame.node}"
    hears = f", received by {ends_text(frame.consumers)}" if frame.consumers else ""
    add(mark, "title", f"{cob_id(frame.identifier)} {frame.what or frame.why}{whose}{hears}{_warning(frame)}")


def _kind(frame: PictureFrame) -> str:
    """Return the frame's colour class in the legend."""
    return "late" if frame.is_late or frame.has_no_limit else "used" if frame.is_computed else "unsent"


def _warning(frame: PictureFrame) -> str:
    return ", no limit" if frame.has_no_limit else ", may be late" if frame.is_late else ""


#: widths of drawings: for a desktop, and for a phone
_WIDE, _NARROW = 960, 352


@dataclass(frozen=True, slots=True)
class Tile:
    """A number in the summary, its label, and its rating (`good`, `bad`, or empty)."""

    value: str
    label: str
    style: str = ""
    target: str = ""


@dataclass(frozen=True, slots=True)
class Entry:
    """A line of the contents: a section, and its number of items (empty if pointless)."""

    target: str
    title: str
    count: str = ""


def page(picture: NetworkPicture) -> bytes:
    """The page, UTF-8."""
    from jinja2 import Environment, FunctionLoader, StrictUndefined
    from markupsafe import Markup

    def plain(value: Any) -> Any:
        """Remove control characters from texts; leave dvtcli's own markup."""
        return value if isinstance(value, Markup) else safe(value) if isinstance(value, str) else value

    environment = Environment(
        loader=FunctionLoader(lambda name: (files(__package__) / name).read_text("utf-8")), autoescape=True,
        undefined=StrictUndefined, trim_blocks=True, lstrip_blocks=True, finalize=plain,
    )  # fmt: skip
    sheet, script = style("palette.css", "drawing.css", "page.css"), style("page.js")
    drawings = {
        f"{name}_{size}": Markup(markup(draw(picture, width, f"{name}-{size}")))  # noqa: S704 - its texts are escaped
        for name, draw in (("wiring", wiring), ("map", cob_id_map))
        for size, width in (("wide", _WIDE), ("narrow", _NARROW))
    }
    text = environment.get_template("page.html").render(
        picture=picture, tiles=tuple(_tiles(picture)), contents=tuple(_contents(picture)),
        cards=tuple(frame_cards(picture)), rate=_rate(picture),
        findings=findings_table(picture), differences=differences_table(picture),
        nodes=nodes_table(picture), pdos=pdos_table(picture), frames=frames_table(picture),
        fitting=", ".join(kbit(rate) for rate in picture.load.fitting), percent=percent,
        sheet=Markup(sheet), script=Markup(script),  # noqa: S704 - ours, without any text of a network
        sheet_hash=_hash(sheet), script_hash=_hash(script), **drawings,
    )  # fmt: skip
    return (text.rstrip() + "\n").encode()


def _hash(text: str) -> str:
    """Return the hash by which the page's policy allows a script; no other script runs."""
    return f"sha256-{b64encode(sha256(text.encode()).digest()).decode()}"


def _rate(picture: NetworkPicture) -> str:
    return kbit(picture.load.bit_rate) + (" (assumed)" if picture.load.is_assumed else "")


def _contents(picture: NetworkPicture) -> Iterator[Entry]:
    """The sections in their order: on a phone the page is long."""
    yield Entry("wiring", "Wiring")
    yield Entry("findings", "Findings", str(len(picture.findings)))
    if picture.compared:
        count = "" if picture.differences is None else str(len(picture.differences))
        yield Entry("differences", "Differences", count)
    yield Entry("nodes", "Nodes", str(len(picture.nodes)))
    yield Entry("frames", "COB-IDs, load, times", str(len(picture.frames)))
    yield Entry("pdos", "PDOs", str(sum(1 for _ in picture.pdos)))
    yield Entry("layouts", "Layouts", str(sum(1 for _ in frame_cards(picture))))


def _tiles(picture: NetworkPicture) -> Iterator[Tile]:
    """Return the most important numbers."""
    load, count = picture.load, Counter(finding.severity for finding in picture.findings)
    yield Tile(str(len(picture.nodes)), "node" if len(picture.nodes) == 1 else "nodes", target="nodes")
    on = sum(pdo.config.enabled for _, pdo in picture.pdos)
    yield Tile(str(on), "PDO is on" if on == 1 else "PDOs are on", target="pdos")
    yield Tile(str(len(picture.links)), "link" if len(picture.links) == 1 else "links", target="wiring")
    is_bad = load.total is None or load.total > 1
    yield Tile(percent(load.total), f"bus load at worst, {_rate(picture)}", "bad" if is_bad else "", "frames")
    if load.measured is not None:
        yield Tile(percent(load.measured), f"bus load measured in {load.seconds:.1f} s", target="frames")
    in_time = "good" if load.fits else "bad"
    yield Tile("all" if load.fits else "not all", "frames are in time", in_time, "frames")
    said = [plural(count[severity], severity) for severity in ("error", "warning", "note") if count[severity]]
    bad = "bad" if count["error"] else "warn" if count["warning"] else "good"
    label = f"findings: {', '.join(said)}" if said else "findings"
    yield Tile(str(len(picture.findings)) if said else "none", label, bad, "findings")
    if picture.compared:
        differing = "not known" if picture.differences is None else str(len(picture.differences))
        style_of = "good" if picture.differences == () else "bad" if picture.differences is None else "warn"
        noun = "difference" if differing == "1" else "differences"
        yield Tile(differing, f"{noun} to {picture.compared}", style_of, "differences")


_SEVERITIES = ("error", "warning", "note")
#: minimum length of a bar
_LEAST_BAR = 0.02
#: length of a node's name without a second line
_SHORT_NAME = 20
#: sorts after every number
_LAST = float("inf")


@dataclass(frozen=True, slots=True)
class TableCell:
    """A cell: text, sort key (None: the text), *style*, link *target*, *bar* of 0…1."""

    text: str
    key: float | None = None
    style: str = ""
    target: str = ""
    bar: float | None = None


@dataclass(frozen=True, slots=True)
class TableColumn:
    """The head of a column; numbers are aligned right."""

    title: str
    is_number: bool = False


@dataclass(frozen=True, slots=True)
class PageTable:
    """A table with sortable columns."""

    name: str
    caption: str
    columns: tuple[TableColumn, ...]
    rows: tuple[tuple[TableCell, ...], ...]


def findings_table(picture: NetworkPicture) -> PageTable:
    """Return the findings of `check`."""
    has_lines = any(finding.line for finding in picture.findings)
    columns = ("Severity", "Node", "What", "Rule", *(("Line",) if has_lines else ()))
    rows = (
        (
            TableCell(finding.severity, _SEVERITIES.index(finding.severity), f"severity {finding.severity}"),
            _node(picture, finding.node),
            TableCell(finding.text),
            TableCell(finding.rule, style="code"),
            *((_line(finding),) if has_lines else ()),
        )
        for finding in sorted(picture.findings, key=lambda found: _SEVERITIES.index(found.severity))
    )
    return _table("findings", "Findings of the rules", columns, rows, "Line")


def _line(finding: PictureFinding) -> TableCell:
    return TableCell(
        "-" if finding.line is None else str(finding.line), _LAST if finding.line is None else finding.line
    )


def differences_table(picture: NetworkPicture) -> PageTable:
    """Return the differences between nodes and a file."""
    columns = ("Node", "PDO or object", "What", "On the node", f"In {picture.compared}")
    rows = (
        (
            _node(picture, difference.node),
            TableCell(difference.what),
            TableCell(difference.key, style="code"),
            TableCell(difference.was),
            TableCell(difference.will),
        )
        for difference in picture.differences or ()
    )
    return _table("differences", f"Differences to {picture.compared}", columns, rows)


def nodes_table(picture: NetworkPicture) -> PageTable:
    """Return every node with its device, number of PDOs, and services."""
    columns = ("Node-ID", "Name", "Device", "TPDOs", "RPDOs", "Heartbeat", "Watches", "SYNC", "EMCY")
    rows = []
    for node in picture.nodes:
        facts = dict(node.facts)
        sends, hears = (len(node.enabled(is_tpdo=is_tpdo)) for is_tpdo in (True, False))
        device = node.title if node.is_told else "only the values of the file are known"
        rows.append((
            TableCell(str(node.node_id), node.node_id), TableCell(node.name or "-", style=_name_style(node.name)),
            TableCell(device or "-"), TableCell(str(sends), sends), TableCell(str(hears), hears),
            *(TableCell(facts.get(key, "-")) for key in ("heartbeat", "watches", "SYNC", "EMCY")),
        ))  # fmt: skip
    return _table("nodes", "Nodes", columns, rows, "Node-ID", "TPDOs", "RPDOs")


def pdos_table(picture: NetworkPicture) -> PageTable:
    """Return every PDO, including disabled PDOs."""
    columns = ("Node", "PDO", "State", "COB-ID", "Length", "Timing", "Maps", "Linked with")
    rows = []
    for node, pdo in picture.pdos:
        target = f"{pdo.end.pdo}-{node.node_id}" if pdo.config.enabled else ""
        maps = ", ".join("skipped" if field.is_dummy else object_text(field) for field in pdo.fields)
        key = pdo.end.pdo.number + 1000 * pdo.is_tpdo
        rows.append((
            _node(picture, node.node_id), TableCell(pdo.end.pdo.label, key, target=target),
            _state(pdo.config, is_told=node.is_told),
            _cob_id(pdo.identifier) if pdo.config.has_cob_id else TableCell("not told", _LAST),
            TableCell(byte_count(pdo), pdo.config.bits), TableCell(timing(pdo) or "-"), TableCell(maps or "-"),
            TableCell(ends_text(pdo.partners) or "-"),
        ))  # fmt: skip
    return _table("pdos", "PDOs", columns, rows)


def frames_table(picture: NetworkPicture) -> PageTable:
    """Return every CAN-ID with producer, consumers and bus load."""
    received = picture.load.measured is not None
    columns = ["COB-ID", "What", "Sent by", "Received by", "Bytes", "At most", "Load", "Response", "Deadline"]
    columns += ["Heard/s", "Measured load"] if received else []
    most = max((float(frame.share) for frame in picture.frames if frame.share is not None), default=0.0)
    rows = []
    for frame in picture.frames:
        row = [
            _cob_id(frame.identifier), TableCell(frame.what or "-"), _node(picture, frame.node),
            TableCell(ends_text(frame.consumers) or "-"),
            _length(frame), _at_most(frame), *_times(frame, most),
        ]  # fmt: skip
        if received:
            row += [
                TableCell(f"{frame.measured_hz or 0:.1f}", frame.measured_hz or 0),
                TableCell(percent(frame.measured_share or 0), frame.measured_share or 0),
            ]
        rows.append(tuple(row))
    numbers = ("Bytes", "Load", "Response", "Deadline", "Heard/s", "Measured load")
    return _table("frames", "Frames on the bus", columns, rows, *numbers)


def _table(
    name: str, caption: str, titles: Iterable[str], rows: Iterable[tuple[TableCell, ...]], *numbers: str
) -> PageTable:
    columns = tuple(TableColumn(title, title in numbers) for title in titles)
    return PageTable(name, caption, columns, tuple(rows))


def _node(picture: NetworkPicture, node_id: int | None) -> TableCell:
    text = node_text(picture, node_id)
    return TableCell(text, _LAST if node_id is None else node_id, _name_style(text))


def _name_style(text: str) -> str:
    """Keep a short name on one line; break a long name if space requires."""
    return "node short" if len(text) <= _SHORT_NAME else "node"


def _cob_id(identifier: tuple[int, bool]) -> TableCell:
    can_id, extended = identifier
    return TableCell(cob_id(identifier), can_id + (1 << 11 if extended else 0), "code")


def _state(config: PdoConfig, *, is_told: bool) -> TableCell:
    if config.inconsistency and is_told:
        return TableCell("not whole", 2, "severity error")
    return TableCell("on", 0, "on") if config.enabled else TableCell("off", 1, "dim")


def _length(one: PictureFrame) -> TableCell:
    return TableCell(str(one.data_bytes) if one.what else "-", one.data_bytes)


def _at_most(one: PictureFrame) -> TableCell:
    key = _LAST if one.period_us is None else float(one.period_us)
    return TableCell(one.why or "-", key, "bad" if one.has_no_limit else "")


def _times(one: PictureFrame, most: float) -> Iterator[TableCell]:
    """Return a frame's bus load, response time and deadline."""
    if not one.is_computed:
        yield from (TableCell("-", _LAST) for _ in range(3))
        return
    share = None if one.share is None else float(one.share)
    bar = share / most if share is not None and most and share > _LEAST_BAR * most else None
    yield TableCell(percent(share), _LAST if share is None else share, "bad" if share is None else "", bar=bar)
    late = "bad" if one.is_late else ""
    yield TableCell("no bound" if one.response_us is None else ms(one.response_us), _key(one.response_us), late)
    yield TableCell(ms(one.deadline_us) + (" - late" if one.is_late else ""), _key(one.deadline_us), late)


def _key(time_us: Fraction | None) -> float:
    return _LAST if time_us is None else float(time_us)
