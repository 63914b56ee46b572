"""Drawings as SVG: elements whose texts are safe, and cut where there is no room. Knows no network."""

from __future__ import annotations

from importlib.resources import files
from xml.etree import ElementTree

from dvtcli.domain.safe_text import safe

Element = ElementTree.Element
#: how wide a character of the drawings is at most, on average, in units of its size
_WIDTH = 0.56
#: the same of bold ones
_BOLD = 0.68


def drawing(width: int, height: int, name: str, title: str) -> Element:
    """An empty drawing; *name* goes before its ids, *title* is what it shows, for who cannot see it."""
    root = Element(
        "svg", {"xmlns": "http://www.w3.org/2000/svg", "viewBox": f"0 0 {width} {height}", "width": str(width),
                "height": str(height), "class": "drawing", "role": "img", "aria-labelledby": safe(f"{name}-title")},
    )  # fmt: skip
    add(root, "title", title, id=f"{name}-title")
    return root


def add(parent: Element, tag: str, text: str | None = None, **attributes: str | float) -> Element:
    """A child of *parent*; `class_` is its class, `_` in a name is `-`."""
    named = {key.rstrip("_").replace("_", "-"): safe(str(value)) for key, value in attributes.items()}
    child = ElementTree.SubElement(parent, tag, named)
    child.text = None if text is None else safe(text)
    return child


def clipped(text: str, room: float, size: float = 13) -> str:
    """*text* as far as *room* reaches, `…` where it is cut."""
    most = max(1, int(room / (_WIDTH * size)))
    shown = safe(text)
    return shown if len(shown) <= most else f"{shown[: most - 1].rstrip()}…"


def clipped_name(text: str, room: float, size: float) -> str:
    """*text* in bold, cut in its middle: names of one kind often differ at their ends alone."""
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
    """The style sheets of that names, which stand beside this file."""
    return "\n".join((files(__package__) / name).read_text("utf-8") for name in names)


def alone(root: Element) -> bytes:
    """The drawing as a file of its own, with its colours."""
    sheet = Element("style")
    sheet.text = style("palette.css", "drawing.css")
    root.insert(0, sheet)
    return f'<?xml version="1.0" encoding="UTF-8"?>\n{markup(root)}\n'.encode()
