"""A room of many files stands in folders by theme, and these too have an order: none import one another in a circle."""

from __future__ import annotations

from collections.abc import Iterator

from tests.house.draw import strongly_connected
from tests.house.laws.source_tree import SourceTree

_ROOM = "operations/"


def operations_stand_in_folders(tree: SourceTree) -> Iterator[str]:
    """No operation stands beside the folders, and the arrows between two folders have one direction."""
    for file in tree.texts:
        if file.startswith(_ROOM) and file.count("/") == 1 and file != f"{_ROOM}__init__.py":
            yield f"beside the folders: {file}"
    arrows = [arrow for arrow in tree.house.arrows if _folder(arrow.source) and _folder(arrow.target)]
    edges: dict[str, set[str]] = {_folder(file): set() for file in tree.texts}
    for arrow in arrows:
        edges[_folder(arrow.source)].add(_folder(arrow.target))
    for circle in strongly_connected(edges):
        for arrow in arrows:
            ends = {_folder(arrow.source), _folder(arrow.target)}
            if len(ends) == 2 and ends <= set(circle):
                yield f"folders in a circle: {arrow}"


def _folder(file: str) -> str:
    """The folder of operations that a file stands in, or nothing."""
    return file.removeprefix(_ROOM).rpartition("/")[0] if file.startswith(_ROOM) else ""
