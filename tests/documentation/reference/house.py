"""Which room imports which, for the documentation: as a table and as a drawing. Not what they are for."""

from __future__ import annotations

from collections.abc import Iterator

from tests.documentation.reference.markdown import code, table
from tests.house.draw import ROOMS, House, svg
from tests.house.laws.askers import ASKED_BY
from tests.house.laws.senders import MAY_SEND
from tests.house.source import PACKAGE
from tests.surroundings import ROOT

DRAWING = ROOT / "docs/explanation/house.svg"


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
    """The same as a picture."""
    return svg(House(PACKAGE), counted=False)
