"""The key `physical` of a node: the meaning of its objects' values, in the form of a profile."""

from __future__ import annotations

import json
from collections.abc import Iterable, Iterator
from typing import TYPE_CHECKING

from dvtcli.errors import InputFileError
from dvtcli.files.network import leaves
from dvtcli.files.network.file_log import FileLog
from dvtcli.files.network.yaml_tree import Branch, Leaf, Tree, YamlList

if TYPE_CHECKING:
    from dvtcli.domain.network.network_config import NodeConfig
    from dvtcli.domain.object_scalings import Rules


def read_physical(branch: Branch, log: FileLog) -> Iterator[tuple[str, str]]:
    """Read objects with their meaning as JSON; complains if a profile could not have it."""
    for name, (leaf, tree) in branch.items.items():
        said = _plain(tree, log)
        try:
            _rules({name: said}, log.file)
        except InputFileError as wrong:
            log.complain(leaf.mark, wrong.text)
        else:
            yield name, json.dumps(said, ensure_ascii=False)


def rules_of(physical: Iterable[tuple[str, str]]) -> Rules:
    """Return the meanings of a node's objects in the form of a profile."""
    return _rules({name: json.loads(text) for name, text in physical}, "")


def rules_by_node(nodes: Iterable[NodeConfig]) -> dict[int, Rules]:
    """Return `rules_of` for each of *nodes*, by node-ID."""
    return {node.node_id: rules_of(node.physical) for node in nodes}


def _rules(said: dict[str, object], file: str) -> Rules:
    from dvtcli.files.profile.toml import physical_rules
    from dvtcli.files.toml_item import Item

    return physical_rules(Item(said, ("physical",), file, {}))


def _plain(tree: Tree, log: FileLog) -> object:
    """*tree* as TOML would have it; a real number stays a text, and exact."""
    if isinstance(tree, Branch):
        return {name: _plain(value, log) for name, (_, value) in tree.items.items()}
    if isinstance(tree, YamlList):
        return [_plain(item, log) for item in tree.items]
    return _number(tree, log) if tree.kind == "int" else tree.text


def _number(leaf: Leaf, log: FileLog) -> object:
    number = leaves.as_number(leaf, log)
    return leaf.text if number is None else number
