"""The wiring of a network as a graph for Graphviz (`dot -Tsvg x.dot`). Reads nothing."""

from __future__ import annotations

from collections.abc import Iterator

from dvtcli.domain.network.network_config import Endpoint
from dvtcli.domain.network.picture import NetworkPicture, PictureNode, PicturePdo
from dvtcli.domain.text import safe
from dvtcli.files.picture.picture_words import byte_count, cob_id, title_of

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
        yield f'  {_port(link.producer)}:e -> {_port(link.consumer)}:w [label="{label}"{unlike}];'
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


def _port(end: Endpoint) -> str:
    return f"n{end.node_id}:{end.pdo}"


def _escaped(text: str) -> str:
    return "".join(f"\\{char}" if char in _SPECIAL else char for char in safe(text))


def _quoted(text: str) -> str:
    shown = safe(text).replace("\\", "\\\\").replace('"', '\\"')
    return f'"{shown}"'
