"""The `links` of a network file. Does not know whether the PDOs fit together."""

from __future__ import annotations

from collections.abc import Iterator, Mapping

from dvtcli.domain.network.wanted_state import Endpoint, LinkWish
from dvtcli.domain.pdo import Direction, Pdo
from dvtcli.files.network import leaves
from dvtcli.files.network.file_log import FileLog
from dvtcli.files.network.known_keys import read_keys
from dvtcli.files.network.network_keys import Where
from dvtcli.files.network.yaml_tree import Branch, Leaf, Tree, YamlList


def read_links(row: YamlList, node_ids: Mapping[str, int], log: FileLog) -> Iterator[LinkWish]:
    """The links of *row*; *node_ids* are the file's nodes by name."""
    heard: dict[Endpoint, int] = {}
    for tree in row.items:
        if not isinstance(tree, Branch):
            log.complain(tree.mark, f"from and to belong here, not {leaves.shown(tree)}")
            continue
        found = read_keys(tree, Where.LINK, "a link", log)
        producer = _endpoint(found["from"], Direction.TPDO, node_ids, log) if "from" in found else None
        to = found.get("to")
        trees = to.items if isinstance(to, YamlList) else () if to is None else (to,)
        if to is not None and not trees:
            log.complain(to.mark, "a link needs an RPDO that hears it")
        consumers = []
        for endpoint in trees:
            consumer = _endpoint(endpoint, Direction.RPDO, node_ids, log)
            if consumer is not None and consumer in heard:
                log.complain(
                    endpoint.mark, f"{leaves.shown(endpoint)} hears another TPDO already (line {heard[consumer]})"
                )
            elif consumer is not None:
                heard[consumer] = endpoint.mark.line
                consumers.append(consumer)
        if producer is not None and consumers:
            yield LinkWish(producer, tuple(consumers), found.get("heartbeat"), tree.mark)


def _endpoint(tree: Tree, direction: Direction, node_ids: Mapping[str, int], log: FileLog) -> Endpoint | None:
    """`NODE:tpdo1`, with the node's name or its node-ID."""
    if not isinstance(tree, Leaf) or tree.kind != "str":
        log.complain(tree.mark, f"NODE:{direction}N belongs here, not {leaves.shown(tree)}")
        return None
    name, _, word = tree.text.rpartition(":")
    if not name:
        log.complain(tree.mark, f"NODE:{direction}N belongs here, not {leaves.shown(tree)}")
        return None
    try:
        pdo = Pdo.parse(word)
    except ValueError as wrong:
        log.complain(tree.mark, str(wrong))
        return None
    if pdo.direction is not direction:
        log.complain(tree.mark, f"a link goes from a TPDO to RPDOs: {direction}N belongs here, not {word[:40]}")
        return None
    node_id = node_ids.get(name)
    if node_id is None and name.isdecimal() and int(name[:4]) in node_ids.values():
        node_id = int(name[:4])
    if node_id is None:
        log.complain(tree.mark, f"no node {name[:40]!r} is in this file")
        return None
    return Endpoint(node_id, pdo)
