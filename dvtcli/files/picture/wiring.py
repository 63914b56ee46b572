"""Draw a network's wiring: producers on the left, consumers on the right, a curve for each link.

A node with both roles appears on both sides, so that all curves run from left to right.
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Sequence
from dataclasses import dataclass
from fractions import Fraction
from importlib.resources import files
from xml.etree import ElementTree

from dvtcli.domain.network.network_config import Endpoint
from dvtcli.domain.network.network_state import Identifier, identifier_text
from dvtcli.domain.network.picture import NetworkPicture, PictureField, PictureLink, PictureNode, PicturePdo
from dvtcli.domain.pdo import transmission_type_text
from dvtcli.domain.scaling import Scaling
from dvtcli.domain.text import plural, safe

_HEAD, _ROW, _FOOT, _GAP, _TOP, _MARGIN = 36, 26, 8, 16, 40, 4
_COLOURS = 6
#: share of the drawing for the boxes of each side
_BOX = 0.36


@dataclass(frozen=True, slots=True)
class _Column:
    """A side of the drawing: its boxes from *x* on, and the ports of their PDOs at *port_x*."""

    x: float
    port_x: float
    width: float
    is_tpdo: bool


def wiring(picture: NetworkPicture, width: int = 960, name: str = "wiring") -> Element:
    """Draw the wiring, *width* wide; ids begin with *name*."""
    box = round(width * _BOX)
    left = _Column(_MARGIN, _MARGIN + box, box, is_tpdo=True)
    right = _Column(width - _MARGIN - box, width - _MARGIN - box, box, is_tpdo=False)
    sends, hears = _sides(picture)
    height = max(_height(sends, is_tpdo=True), _height(hears, is_tpdo=False))
    count = f"{plural(len(picture.nodes), 'node')}, {plural(len(picture.links), 'link')}"
    root = drawing(width, height, name, f"Wiring of {picture.title}: {count}; its table is that of the PDOs")
    _arrows(root, name)
    add(root, "text", "Sends", x=left.x + 2, y=22, class_="side")
    add(root, "text", "Hears", x=right.x + 2, y=22, class_="side")
    links = add(root, "g", class_="links")
    ports = dict(_boxes(root, left, sends)) | dict(_boxes(root, right, hears))
    colours = {node.node_id: number % _COLOURS for number, node in enumerate(sends)}
    for link in picture.links:
        _link(links, link, ports, colours[link.producer.node_id], name)
    return root


def _sides(picture: NetworkPicture) -> tuple[list[PictureNode], list[PictureNode]]:
    """Split nodes into producers (and nodes without an enabled PDO) and consumers."""
    hears = [node for node in picture.nodes if node.enabled(is_tpdo=False)]
    ids = {node.node_id for node in hears}
    sends = [node for node in picture.nodes if node.enabled(is_tpdo=True) or node.node_id not in ids]
    return sends, hears


def _box_height(node: PictureNode, *, is_tpdo: bool) -> int:
    return _HEAD + _ROW * max(1, len(node.enabled(is_tpdo=is_tpdo))) + _FOOT


def _height(nodes: Sequence[PictureNode], *, is_tpdo: bool) -> int:
    return _TOP + sum(_box_height(node, is_tpdo=is_tpdo) + _GAP for node in nodes) + _MARGIN


def _arrows(root: Element, name: str) -> None:
    """Define an arrow head for each link colour."""
    defs = add(root, "defs")
    for number in (*map(str, range(_COLOURS)), "bad"):
        marker = add(
            defs, "marker", id=f"{name}-arrow-{number}", viewBox="0 0 8 8", refX=7, refY=4, markerWidth=7,
            markerHeight=7, orient="auto",
        )  # fmt: skip
        add(marker, "path", d="M0 0.5 8 4 0 7.5z", class_=f"point c{number}")


def _boxes(
    root: Element, column: _Column, nodes: Sequence[PictureNode]
) -> Iterator[tuple[Endpoint, tuple[float, float]]]:
    """Draw the boxes of a side; yields the position of each PDO's port."""
    y = _TOP
    for node in nodes:
        height = _box_height(node, is_tpdo=column.is_tpdo)
        group = add(root, "g", class_="node" if node.is_told else "node untold")
        add(group, "title", f"{title_of(node)}{f' ({node.title})' if node.title else ''}")
        add(group, "rect", x=column.x, y=y, width=column.width, height=height, rx=8, class_="box")
        add(group, "text", str(node.node_id), x=column.x + 14, y=y + 23, class_="number")
        room = column.width - 58
        add(group, "text", clipped_name(_name(node), room, 14), x=column.x + 48, y=y + 23, class_="name")
        pdos = node.enabled(is_tpdo=column.is_tpdo)
        if not pdos:
            add(group, "text", "no PDO is enabled", x=column.x + 14, y=y + _HEAD + 16, class_="dim")
        for number, pdo in enumerate(pdos):
            middle = y + _HEAD + _ROW * number + _ROW / 2
            _port(group, column, pdo, middle)
            yield pdo.end, (column.port_x, middle)
        y += height + _GAP


def _name(node: PictureNode) -> str:
    return node.name or node.title or "node"


def _port(group: Element, column: _Column, pdo: PicturePdo, y: float) -> None:
    row = add(group, "g", class_="pdo")
    what = ", ".join(field.label for field in pdo.fields)
    add(row, "title", f"{end_text(pdo.end)} {cob_id(pdo.identifier)}: {what or byte_count(pdo)}")
    add(row, "text", pdo.end.pdo.label, x=column.x + 14, y=y + 4.5, class_="label")
    add(row, "text", cob_id(pdo.identifier), x=column.x + 72, y=y + 4.5, class_="id")
    room = column.width - 160
    if room > 60:
        held = ", ".join(field.label for field in pdo.fields if not field.is_dummy) or byte_count(pdo)
        add(row, "text", clipped(held, room, 12), x=column.x + 146, y=y + 4, class_="dim")
    linked = bool(pdo.partners)
    add(row, "circle", cx=column.port_x, cy=y, r=4.5, class_="port" if linked else "port open")


def _link(
    links: Element, link: PictureLink, ports: dict[Endpoint, tuple[float, float]], colour: int, name: str
) -> None:
    (x1, y1), (x2, y2) = ports[link.producer], ports[link.consumer]
    start, stop = x1 + 5, x2 - 6
    bend = (stop - start) * 0.45
    kind = str(colour) if link.fits else "bad"
    curve = add(
        links, "path", d=f"M{start:g} {y1:g}C{start + bend:g} {y1:g} {stop - bend:g} {y2:g} {stop:g} {y2:g}",
        class_=f"link c{kind}", marker_end=f"url(#{name}-arrow-{kind})",
    )  # fmt: skip
    unlike = "" if link.fits else "; their layouts differ"
    add(curve, "title", f"{end_text(link.producer)} → {end_text(link.consumer)}, {cob_id(link.identifier)}{unlike}")


Element = ElementTree.Element
#: maximum average width of a character, relative to its size
_WIDTH = 0.56
#: the same for bold characters
_BOLD = 0.68


def drawing(width: int, height: int, name: str, title: str) -> Element:
    """Return an empty drawing; *name* begins its ids, *title* is its text for screen readers."""
    root = Element(
        "svg", {"xmlns": "http://www.w3.org/2000/svg", "viewBox": f"0 0 {width} {height}", "width": str(width),
                "height": str(height), "class": "drawing", "role": "img", "aria-labelledby": safe(f"{name}-title")},
    )  # fmt: skip
    add(root, "title", title, id=f"{name}-title")
    return root


def add(parent: Element, tag: str, text: str | None = None, **attributes: str | float) -> Element:
    """Add a child to *parent*; `class_` is its class, `_` in names becomes `-`."""
    named = {key.rstrip("_").replace("_", "-"): safe(str(value)) for key, value in attributes.items()}
    child = ElementTree.SubElement(parent, tag, named)
    child.text = None if text is None else safe(text)
    return child


def clipped(text: str, room: float, size: float = 13) -> str:
    """Cut *text* to *room*, with `…` at the end."""
    most = max(1, int(room / (_WIDTH * size)))
    shown = safe(text)
    return shown if len(shown) <= most else f"{shown[: most - 1].rstrip()}…"


def clipped_name(text: str, room: float, size: float) -> str:
    """Cut bold *text* in the middle, because similar names often differ at their ends only."""
    most = max(1, int(room / (_BOLD * size)))
    shown = safe(text)
    if len(shown) <= most:
        return shown
    head = most // 2
    tail = most - 1 - head
    return f"{shown[:head].rstrip()}…{shown[len(shown) - tail :].lstrip()}"


def markup(root: Element) -> str:
    """The drawing as text."""
    return ElementTree.tostring(root, encoding="unicode")


def style(*names: str) -> str:
    """Return the style sheets *names*, stored beside this file."""
    return "\n".join((files(__package__) / name).read_text("utf-8") for name in names)


def alone(root: Element) -> bytes:
    """Return the drawing as a file of its own, with its colours."""
    sheet = Element("style")
    sheet.text = style("palette.css", "drawing.css")
    root.insert(0, sheet)
    return f'<?xml version="1.0" encoding="UTF-8"?>\n{markup(root)}\n'.encode()


#: special characters in a record's label
_SPECIAL = '\\"{}|<> '


def graphviz(picture: NetworkPicture) -> bytes:
    """A directed graph: a record for each node with its enabled PDOs as ports, an edge for each link."""
    return ("\n".join(_lines(picture)) + "\n").encode()


def _lines(picture: NetworkPicture) -> Iterator[str]:
    yield f"digraph {_quoted(picture.title)} {{"
    yield "  rankdir=LR;"
    yield '  node [shape=record, fontname="Helvetica", fontsize=11];'
    yield '  edge [fontname="Helvetica", fontsize=9];'
    for node in _from_below(picture):
        yield f'  n{node.node_id} [label="{_record(node)}"];'
    for link in picture.links:
        unlike = "" if link.fits else ', style=dashed, color="#b3261e"'
        label = cob_id(link.identifier)
        yield f'  {_record_port(link.producer)}:e -> {_record_port(link.consumer)}:w [label="{label}"{unlike}];'
    yield "}"


def _from_below(picture: NetworkPicture) -> list[PictureNode]:
    """Sort nodes for Graphviz, which stacks unlinked nodes from below, so that the first is on top."""
    linked = {end.node_id for link in picture.links for end in (link.producer, link.consumer)}
    alone = [node for node in picture.nodes if node.node_id not in linked]
    return [*reversed(alone), *(node for node in picture.nodes if node.node_id in linked)]


def _record(node: PictureNode) -> str:
    hears, sends = (_ports(node.enabled(is_tpdo=is_tpdo)) for is_tpdo in (False, True))
    parts = [f"{{{hears}}}" if hears else "", _escaped(title_of(node)), f"{{{sends}}}" if sends else ""]
    return "{" + "|".join(filter(None, parts)) + "}"


def _ports(pdos: tuple[PicturePdo, ...]) -> str:
    texts = ((pdo, f"{pdo.end.pdo.label} {cob_id(pdo.identifier)}, {byte_count(pdo)}") for pdo in pdos)
    return "|".join(f"<{pdo.end.pdo}> {_escaped(text)}" for pdo, text in texts)


def _record_port(end: Endpoint) -> str:
    return f"n{end.node_id}:{end.pdo}"


def _escaped(text: str) -> str:
    return "".join(f"\\{char}" if char in _SPECIAL else char for char in safe(text))


def _quoted(text: str) -> str:
    shown = safe(text).replace("\\", "\\\\").replace('"', '\\"')
    return f'"{shown}"'


_MOST_WORDS = 6


def cob_id(identifier: Identifier) -> str:
    """Return `0x181`; a 29-bit CAN-ID with eight digits."""
    return identifier_text(identifier)


def end_text(end: Endpoint) -> str:
    """`5:TPDO1`."""
    return f"{end.node_id}:{end.pdo.label}"


def ends_text(ends: Iterable[Endpoint]) -> str:
    """`5:RPDO1, 6:RPDO2`."""
    return ", ".join(map(end_text, ends))


def node_text(picture: NetworkPicture, node_id: int | None) -> str:
    """`5 feeder`: a node-ID with the node's name."""
    if node_id is None:
        return "-"
    node = picture.node(node_id)
    return f"{node_id} {node.label}" if node is not None and node.label != f"node {node_id}" else str(node_id)


def title_of(node: PictureNode) -> str:
    """`node 5 feeder`."""
    return node.label if node.label == f"node {node.node_id}" else f"node {node.node_id} {node.label}"


def ms(time_us: Fraction | None) -> str:
    """A time in ms."""
    if time_us is None:
        return "-"
    value = float(time_us) / 1000
    return f"{value:.2f} ms" if value < 100 else f"{value:.0f} ms"


def percent(share: Fraction | float | None) -> str:
    """Return a share of the bus as text; `no limit` if unbounded."""
    return "no limit" if share is None else f"{100 * float(share):.2f} %"


def kbit(bit_rate: int) -> str:
    """A bit rate in kbit/s."""
    return f"{bit_rate / 1000:g} kbit/s"


def byte_count(pdo: PicturePdo) -> str:
    """How long a PDO's frame is."""
    if pdo.config.mpdo is not None:
        return "multiplexed"
    if not pdo.config.has_mapping:
        return "layout not known"
    count = (pdo.config.bits + 7) // 8
    return f"{count} byte{'' if count == 1 else 's'}"


def timing(pdo: PicturePdo) -> str:
    """When a PDO is sent or taken, and how often at most."""
    held = pdo.config.communication
    kind = held.transmission_type
    words = [] if kind is None else [f"{transmission_type_text(kind, pdo.end.pdo.direction)} (type {kind})"]
    words += [f"inhibit {held.inhibit_time / 10:g} ms"] if held.inhibit_time else []
    words += [f"event timer {held.event_timer} ms"] if held.event_timer else []
    words += [f"SYNC start {held.sync_start_value}"] if held.sync_start_value else []
    return ", ".join(words)


def bit_range(field: PictureField) -> str:
    """Return a field's bits in the frame: `0–15`."""
    return f"{field.start_bit}–{field.end_bit - 1}" if field.bits > 1 else str(field.start_bit)


def object_text(field: PictureField) -> str:
    """`6041:00 Statusword`."""
    return f"{field.object} {field.name}".rstrip()


def meaning_text(meaning: Scaling) -> str:
    """Return the meaning of a raw value in a few words: `1/256 V`, `0 off, 1 on`, names of bits."""
    if meaning.has_number:
        return meaning.scale
    words = [f"{raw} {word}" for raw, word in sorted(meaning.values.items())]
    words += [state.text for state in meaning.states]
    words += [f"bit {bit} {name}" for bit, name in sorted(meaning.bits.items())]
    more = f" and {len(words) - _MOST_WORDS} more" if len(words) > _MOST_WORDS else ""
    return ", ".join(words[:_MOST_WORDS]) + more
