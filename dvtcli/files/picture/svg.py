"""Draw SVG: elements with safe texts, cut to the available space."""

from __future__ import annotations

from importlib.resources import files
from xml.etree import ElementTree

from dvtcli.domain.text import safe

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
