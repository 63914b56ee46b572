"""A network written as a page (HTML), a drawing (SVG) or a graph (Graphviz), by the suffix. Writes no node."""

from __future__ import annotations

from pathlib import PurePath
from typing import TYPE_CHECKING

from dvtcli.domain.hint import Action, Hint
from dvtcli.domain.text import plural
from dvtcli.errors import UsageError, ended_with
from dvtcli.operations.picture.gather import PictureOptions, network_picture
from dvtcli.operations.results import Facts
from dvtcli.operations.session.save_script import ask_before_overwriting, make_file, place_of

if TYPE_CHECKING:
    from dvtcli.domain.network.picture import NetworkPicture
    from dvtcli.operations.session.session import Session

SUFFIXES = (".html", ".htm", ".svg", ".dot", ".gv")


def draw_network(session: Session, target: str, file: str | None = None, wishes: PictureOptions | None = None) -> Facts:
    """Draw the network of *file*, or of the bus, to *target*; asks before overwriting. Raises as `network_picture`.

    Raises UsageError for another suffix, or if *target* cannot be written.
    """
    path = place_of(target, "NAME.html")
    if path.suffix.lower() not in SUFFIXES:
        raise UsageError(f"{target}: what format is that?", hint=Hint(Action.DRAW, why="{}, NAME.svg or NAME.dot"))
    picture = network_picture(session, file, wishes)
    data = drawn(picture, path)
    ask_before_overwriting(session, path)
    make_file(session, path, data)
    return _answer(target, picture, len(data))


def drawn(picture: NetworkPicture, path: PurePath) -> bytes:
    """Format *picture* by the suffix of *path*."""
    suffix = path.suffix.lower()
    if suffix == ".svg":
        from dvtcli.files.picture.svg import alone
        from dvtcli.files.picture.wiring import wiring

        return alone(wiring(picture))
    if suffix in (".dot", ".gv"):
        from dvtcli.files.picture.graphviz import graphviz

        return graphviz(picture)
    from dvtcli.files.picture.page import page

    return page(picture)


def _answer(target: str, picture: NetworkPicture, size: int) -> Facts:
    on = sum(pdo.config.enabled for _, pdo in picture.pdos)
    differing = None if picture.differences is None else len(picture.differences)
    counts = [plural(len(picture.nodes), "node"), plural(on, "PDO"), plural(len(picture.links), "link")]
    counts += [plural(len(picture.findings), "finding")]
    counts += (
        [plural(differing, "difference") + f" to {picture.compared}"]
        if picture.compared and differing is not None
        else []
    )
    label = "error" if picture.exit_code else "note"
    text = [f"{target}: {picture.title}, {', '.join(counts)}", *(f"{label}: {note}" for note in picture.notes)]
    rows = (
        ("file", target), ("from", picture.source), ("compared_with", picture.compared or None),
        ("nodes", len(picture.nodes)), ("pdos", on), ("links", len(picture.links)),
        ("findings", len(picture.findings)), ("differences", differing if picture.compared else None),
        ("bytes", size), ("notes", list(picture.notes)),
    )  # fmt: skip
    failure = ended_with(picture.exit_code, "; ".join(picture.notes)) if picture.exit_code else None
    return Facts("report", rows, tuple(text), failure)
