"""Read a network file: every node's configuration, or all errors with their places.

Reads dcfgen's files unchanged. Opens only the file itself.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping
from dataclasses import replace
from pathlib import Path

from dvtcli.domain.network.network_config import Endpoint, LinkConfig, Mark, MasterRole, NetworkConfig, NodeConfig
from dvtcli.domain.pdo import Direction, Pdo
from dvtcli.errors import InputFileError
from dvtcli.files.input_file import read_input
from dvtcli.files.network.file_log import FileLog
from dvtcli.files.network.key_values import belongs_to, integer, is_slip, read_keys, shown, unknown_key
from dvtcli.files.network.network_keys import INSTEAD, OF, Where
from dvtcli.files.network.read_node import Surroundings, read_node
from dvtcli.files.network.yaml_tree import Branch, Leaf, Tree, YamlList, overlaid, read_tree


def read_links(row: YamlList, node_ids: Mapping[str, int], log: FileLog) -> Iterator[LinkConfig]:
    """Read the links of *row*; *node_ids* are the file's nodes by name."""
    received: dict[Endpoint, int] = {}
    for tree in row.items:
        if not isinstance(tree, Branch):
            log.complain(tree.mark, f"from and to belong here, not {shown(tree)}")
            continue
        found = read_keys(tree, Where.LINK, "a link", log)
        producer = _endpoint(found["from"], Direction.TPDO, node_ids, log) if "from" in found else None
        to = found.get("to")
        trees = to.items if isinstance(to, YamlList) else () if to is None else (to,)
        if to is not None and not trees:
            log.complain(to.mark, "a link needs an RPDO that receives it")
        consumers = []
        for endpoint in trees:
            consumer = _endpoint(endpoint, Direction.RPDO, node_ids, log)
            if consumer is not None and consumer in received:
                log.complain(
                    endpoint.mark, f"{shown(endpoint)} receives another TPDO already (line {received[consumer]})"
                )
            elif consumer is not None:
                received[consumer] = endpoint.mark.line
                consumers.append(consumer)
        if producer is not None and consumers:
            yield LinkConfig(producer, tuple(consumers), found.get("heartbeat"), tree.mark)


def _endpoint(tree: Tree, direction: Direction, node_ids: Mapping[str, int], log: FileLog) -> Endpoint | None:
    """Read `NODE:tpdo1`, with the node's name or its node-ID."""
    if not isinstance(tree, Leaf) or tree.kind != "str":
        log.complain(tree.mark, f"NODE:{direction}N is expected here, not {shown(tree)}")
        return None
    name, _, word = tree.text.rpartition(":")
    if not name:
        log.complain(tree.mark, f"NODE:{direction}N is expected here, not {shown(tree)}")
        return None
    try:
        pdo = Pdo.parse(word)
    except ValueError as wrong:
        log.complain(tree.mark, str(wrong))
        return None
    if pdo.direction is not direction:
        log.complain(tree.mark, f"a link goes from a TPDO to RPDOs: {direction}N is expected here, not {word[:40]}")
        return None
    node_id = node_ids.get(name)
    if node_id is None and name.isdecimal() and int(name[:4]) in node_ids.values():
        node_id = int(name[:4])
    if node_id is None:
        near = log.nearest(name, node_ids)
        meant = "" if near is None else f", did you mean {near!r}?"
        log.complain(tree.mark, f"this file has no node {name[:40]!r}{meant}")
        return None
    return Endpoint(node_id, pdo)


#: default heartbeat multiplier (dcfgen's)
_MULTIPLIER = 3.0
_MOST_NODES = 127
#: maximum size (bytes), more than a complete network file of 127 nodes has
MOST_BYTES = 1 << 20
_NODE_ID = OF[Where.NODE]["node_id"]
#: returns why a key's word names nothing, empty if valid
WhyNot = Callable[[str], str]
#: returns why a node cannot have its modules, empty if it can, or nobody knows
WhyNoModules = Callable[[NodeConfig], str]
Named = dict[str, tuple[Leaf, Branch]]


def read_network_file(
    path: Path, why_not: Mapping[str, WhyNot] | None = None, why_no_modules: WhyNoModules | None = None
) -> NetworkConfig:
    """Read the configuration in the file *path*.

    *why_not* has, for `dcf` and `profile`, a function from a word to the reason why it names nothing (empty if valid);
    *why_no_modules* gives the reason why a node cannot have its modules. Raises InputFileError with all errors, OSError
    if the file cannot be read.
    """
    return read_network(network_text(path), str(path), why_not, why_no_modules)


def network_text(path: Path | str) -> str:
    """Read the text of the network file *path*.

    Raises InputFileError if it is no UTF-8 or too large, OSError if absent.
    """
    try:
        return read_input(path, MOST_BYTES, "network file").decode("utf-8-sig")
    except UnicodeDecodeError as wrong:
        raise InputFileError(f"{path}: not UTF-8 (byte {wrong.start})", place=str(path)) from wrong


def read_network(
    text: str,
    file: str,
    why_not: Mapping[str, WhyNot] | None = None,
    why_no_modules: WhyNoModules | None = None,
) -> NetworkConfig:
    """Read the configuration in *text*; *file* is its name for messages, the others are as in `read_network_file`.

    Raises InputFileError with all errors.
    """
    log = FileLog(file, text)
    tree = read_tree(text, log)
    config = _network(tree, log) if isinstance(tree, Branch) else NetworkConfig()
    for key, mark, word in sorted({named for node in config.nodes for named in _named(node)}):
        if why_not is not None and key in why_not and (reason := why_not[key](word)):
            log.complain(mark, reason)
    _complain_of_modules(config, why_no_modules, log)
    if not isinstance(tree, Branch) and log.is_silent:
        log.complain(tree.mark if tree else Mark(1, 1), "a network is written as keys and values")
    log.end()
    return config


def _complain_of_modules(config: NetworkConfig, why_no_modules: WhyNoModules | None, log: FileLog) -> None:
    """Complain about modules that the file of a node does not have, once that file is right."""
    if why_no_modules is None or not log.is_silent:
        return
    for node in config.nodes:
        if node.modules is not None and (reason := why_no_modules(node)):
            log.complain(node.modules_mark, reason)


def _named(node: NodeConfig) -> Iterator[tuple[str, Mark, str]]:
    """Iterate over words of *node* that name a file or a family, each with its key and place."""
    if node.dcf is not None:
        yield "dcf", node.dcf.mark, node.dcf.text
    if node.profile is not None:
        yield "profile", node.profile_mark, node.profile


def _network(root: Branch, log: FileLog) -> NetworkConfig:
    known = {name: pair for name, pair in root.items.items() if name in OF[Where.FILE]}
    found = read_keys(Branch(root.mark, known), Where.FILE, "this file", log)
    defaults = found.get("defaults") or Branch(root.mark, {})
    if "node_id" in defaults.items:
        log.complain(defaults.items["node_id"][0].mark, "a node-ID is each node's own, no default")
    options = read_keys(found["options"], Where.OPTIONS, "options", log) if "options" in found else {}
    said = options.get("heartbeat_multiplier")
    master, multiplier = _master(found.get("master"), _MULTIPLIER if said is None else said, log)
    own = _nodes(root, found, log)
    if len(own) > _MOST_NODES:  # each gets a copy of the defaults
        log.complain(root.mark, f"{len(own)} nodes are in this file, and a network has {_MOST_NODES}")
        log.end()
    named = {name: (leaf, overlaid(defaults, branch, INSTEAD)) for name, (leaf, branch) in own.items()}
    node_ids = _node_ids(named, master, log)
    around = Surroundings(node_ids, master, multiplier)
    nodes = tuple(_read_all(named, around, log))
    if not named and log.is_silent:
        log.complain(root.mark, "no node is in this file")
    links = tuple(read_links(found["links"], node_ids, log)) if "links" in found else ()
    return NetworkConfig(tuple(sorted(nodes, key=lambda node: node.node_id)), links, master, said, log.notes())


def _read_all(named: Named, around: Surroundings, log: FileLog) -> Iterator[NodeConfig]:
    for name, (leaf, branch) in named.items():
        node = read_node(name, branch, around, log)
        if node is not None:
            yield replace(node, mark=leaf.mark)


def _nodes(root: Branch, found: dict[str, Branch], log: FileLog) -> Named:
    """Return every node by name: those of `nodes`, and dcfgen's at the top level."""
    nodes: Named = {}
    listed = found.get("nodes")
    for leaf, value in listed.items.values() if listed else ():
        _take(leaf, value, nodes, log)
    for name, (leaf, value) in root.items.items():
        if name not in OF[Where.FILE] and not name.startswith("."):
            _top_level(leaf, value, nodes, log, only_nodes=listed is None)
    return nodes


def _top_level(leaf: Leaf, value: Tree, nodes: Named, log: FileLog, *, only_nodes: bool) -> None:
    """Sort a foreign key at the top level: a node, a slip, a misplaced key, or another tool's."""
    has_id = isinstance(value, Branch) and "node_id" in value.items
    if has_id and _is_master(leaf.text, log):
        log.complain(leaf.mark, f"unknown key {leaf.text[:40]!r} in this file, did you mean 'master'? "
                     "A node with this name belongs below `nodes`")  # fmt: skip
    elif has_id or (
        only_nodes
        and isinstance(value, Branch)
        and not is_slip(leaf.text, Where.FILE, log)
        and not belongs_to(leaf.text, Where.FILE)
    ):
        _take(leaf, value, nodes, log)
    else:
        unknown_key(leaf, Where.FILE, "this file", log)


def _is_master(name: str, log: FileLog) -> bool:
    """Whether *name*, a mapping with a node-ID, is a slip of `master`; `master2` is a node's name."""
    return not name[-1:].isdigit() and log.nearest(name, ("master",), 1.0) is not None


def _take(leaf: Leaf, value: Tree, nodes: Named, log: FileLog) -> None:
    if not isinstance(value, Branch):
        log.complain(value.mark, f"keys and values of node {leaf.text[:40]} belong here, not {shown(value)}")
    elif leaf.text.isdecimal():
        log.complain(leaf.mark, f"{leaf.text[:40]!r} is not a name: give the node a name and node_id: {leaf.text[:40]}")
    elif not leaf.text.strip() or ":" in leaf.text:
        log.complain(leaf.mark, f"{leaf.text[:40]!r} is not a name: a node is called by a word without a colon")
    elif leaf.text in nodes:
        log.complain(leaf.mark, f"node {leaf.text[:40]} occurs twice (first at line {nodes[leaf.text][0].mark.line})")
    else:
        nodes[leaf.text] = (leaf, value)


def _master(branch: Branch | None, multiplier: float, log: FileLog) -> tuple[MasterRole | None, float]:
    """Read the master, and its heartbeat multiplier."""
    if branch is None:
        return None, multiplier
    found = read_keys(branch, Where.MASTER, "master", log)
    log.note(branch.mark, "master is a role: nothing of it is written")
    node_id = found.get("node_id")
    kbit_per_s = found.get("baudrate")
    role = MasterRole(
        None if node_id == 255 else node_id,
        found.get("sync_period"),
        found.get("heartbeat_producer"),
        None if kbit_per_s is None else 1000 * kbit_per_s,
        branch.mark,
    )
    return role, found.get("heartbeat_multiplier", multiplier)


def _node_ids(named: Named, master: MasterRole | None, log: FileLog) -> dict[str, int]:
    """Return node-IDs by name; complains about duplicates. The node's own reader reports invalid node-IDs."""
    silent = FileLog(log.file, "")
    owners = {master.node_id: "the master"} if master and master.node_id else {}
    ids: dict[str, int] = {}
    for name, (_, branch) in named.items():
        leaf = branch.items.get("node_id", (None, None))[1]
        node_id = integer(leaf, _NODE_ID, silent) if leaf is not None else None
        if leaf is None or node_id is None:
            continue
        if node_id in owners:
            log.complain(leaf.mark, f"node-ID {node_id} is that of {owners[node_id]} already")
        ids[name] = node_id
        owners.setdefault(node_id, name)
    return ids
