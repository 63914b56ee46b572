"""Which room imports which, for the documentation: as a table and as a drawing. Not what they are for."""

from __future__ import annotations

from collections.abc import Iterator

from tests.documentation.reference.markdown import code, table
from tests.house.draw import ROOMS, House
from tests.house.laws.askers import ASKED_BY
from tests.house.laws.senders import MAY_SEND
from tests.house.source import PACKAGE
from tests.surroundings import ROOT

DRAWING = ROOT / "docs/explanation/house.svg"
_WIDTH, _BOX, _STEP, _HIGH = 860, 380, 78, 50


def rooms() -> Iterator[str]:
    """Each room, its roof first, with those that its files import."""
    arrows = {arrow.rooms for arrow in House(PACKAGE).arrows}
    below = {room: [one for one in reversed(ROOMS) if one != room and (room, one) in arrows] for room in ROOMS}
    return table(("room", "imports"), ((code(room), ", ".join(map(code, below[room]))) for room in reversed(ROOMS)))


def senders() -> Iterator[str]:
    """Each file that may put something on a bus, what it sends, and who may ask it for that."""
    rows = ((code(file), what, ", ".join(map(code, ASKED_BY.get(file, ())))) for file, what in MAY_SEND.items())
    return table(("file", "sends", "for"), rows)


def drawing() -> str:
    """The same as a picture (SVG)."""
    return svg(House(PACKAGE))


def svg(house: House) -> str:
    """Return the drawing: the roof at the top, imports in the order on the right, others in red on the left.

    It has no numbers, so it changes only where an arrow comes or goes.
    """
    order = list(ROOMS)
    rooms = [*reversed(order)]
    top = {room: 20 + _STEP * place for place, room in enumerate(rooms)}
    left = (_WIDTH - _BOX) // 2
    parts = [
        f'<svg xmlns="http://www.w3.org/2000/svg" viewBox="0 0 {_WIDTH} {20 + _STEP * len(rooms)}" '
        'font-family="sans-serif">',
        f'<rect width="{_WIDTH}" height="{20 + _STEP * len(rooms)}" fill="#fff"/>',
    ]
    for source, target in sorted({arrow.rooms for arrow in house.arrows}):
        if source != target:
            against = order.index(target) > order.index(source)
            edge, way = (left, -1) if against else (left + _BOX, 1)
            begin, end = top[source] + _HIGH * 0.65, top[target] + _HIGH * 0.35
            bow = edge + way * (24 + 17 * abs(rooms.index(source) - rooms.index(target)))
            colour = "#c62828" if against else "#78909c"
            parts.append(
                f'<path d="M{edge},{begin} C{bow},{begin} {bow},{end} {edge},{end}" fill="none" stroke="{colour}" '
                f'stroke-width="2.0" opacity="0.7"><title>{source} imports {target}'
                f'</title></path><circle cx="{edge}" cy="{end}" r="3" fill="{colour}"/>'
            )
    for room, about in reversed(ROOMS.items()):
        parts += [
            f'<rect x="{left}" y="{top[room]}" width="{_BOX}" height="{_HIGH}" rx="6" fill="#eceff1" '
            'stroke="#455a64"/>',
            f'<text x="{left + 12}" y="{top[room] + 21}" font-size="15" font-weight="bold">{room}</text>',
            f'<text x="{left + 12}" y="{top[room] + 40}" font-size="12" fill="#37474f">{about}</text>',
        ]
    return "\n".join([*parts, "</svg>\n"])
