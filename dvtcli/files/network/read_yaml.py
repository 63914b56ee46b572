"""Read YAML into a tree; keys that stand twice, tags and aliases without end are complaints. Knows no key."""

from __future__ import annotations

from contextlib import suppress
from functools import lru_cache
from typing import TYPE_CHECKING

from dvtcli.domain.network.wanted_state import Mark
from dvtcli.files.network.plain_yaml import OtherYamlError, PlainYaml
from dvtcli.files.network.yaml_tree import Branch, Leaf, Tree, YamlList

if TYPE_CHECKING:
    from ruamel.yaml.nodes import MappingNode, Node, ScalarNode

    from dvtcli.files.network.file_log import FileLog

#: a file for 127 nodes with all their PDOs has less than half of this
MOST_CHARACTERS = 1_000_000
#: lines, commas and brackets in all: each takes a reader some 60 µs, and no file for 127 nodes has half as many
MOST_ENTRIES = 80_000
#: values in all, those counted that aliases repeat
MOST_VALUES = 400_000
_TAG = "tag:yaml.org,2002:"
_TYPES = {"int", "float", "bool", "null", "str"}


def read_tree(text: str, log: FileLog) -> Tree | None:
    """The tree of *text*; None where it is empty, or no YAML, which *log* hears."""
    if len(text) > MOST_CHARACTERS:
        log.complain(Mark(1, 1), f"{len(text)} characters are no network file")
        return None
    entries = sum(map(text.count, "\n,[]{}"))
    if entries > MOST_ENTRIES:
        log.complain(
            Mark(1, 1), f"{entries} lines, commas and brackets are no network file: it has at most {MOST_ENTRIES}"
        )
        return None
    with suppress(OtherYamlError):
        plain = PlainYaml(text)
        tree = plain.tree()
        for name, first in plain.twice:
            _complain_twice(log, name, first)
        return tree
    return _general_tree(text, log)


def _complain_twice(log: FileLog, name: Leaf, first: int) -> None:
    log.complain(name.mark, f"{name.text[:40]!r} occurs twice (first at line {first})")


def _general_tree(text: str, log: FileLog) -> Tree | None:
    """The tree of *text*, whatever YAML it is."""
    from ruamel.yaml.error import MarkedYAMLError, YAMLError

    try:
        root = _composed(text)
        return None if root is None else _Grower(log).tree(root)
    except MarkedYAMLError as wrong:
        mark = wrong.problem_mark or wrong.context_mark
        said = str(wrong.problem or wrong.context)
        log.complain(Mark(mark.line + 1, mark.column + 1) if mark else Mark(1, 1), f"no YAML: {said}")
    except (YAMLError, RecursionError, ValueError) as wrong:
        said = "nested too deep" if isinstance(wrong, RecursionError) else f"{wrong} ".splitlines()[0].strip()
        log.complain(Mark(1, 1), f"no YAML: {said}")
    return None


@lru_cache(maxsize=4)
def _composed(text: str) -> Node | None:
    """ruamel's node of *text*, which nobody changes: `plan`, `apply` and `verify` of a session read the same file."""
    from ruamel.yaml import YAML

    yaml = YAML(typ="safe", pure=True)
    yaml.composer.warn_double_anchors = False  # YAML 1.2, 3.2.2.2: an anchor may be set again
    root: Node | None = yaml.compose(text)
    return root


class _Grower:
    """Makes the tree out of ruamel's nodes; what an alias repeats is counted each time."""

    def __init__(self, log: FileLog) -> None:
        self.log = log
        self.left = MOST_VALUES
        self.above: set[int] = set()

    def tree(self, node: Node) -> Tree:
        from ruamel.yaml.nodes import MappingNode, ScalarNode

        self.left -= 1
        if id(node) in self.above:
            return self._wrong(node, "an alias stands inside of what it repeats")
        if self.left <= 0:
            return self._wrong(node, f"more than {MOST_VALUES} values")
        if isinstance(node, ScalarNode):
            return self._leaf(node)
        self.above.add(id(node))
        grown = self._branch(node) if isinstance(node, MappingNode) else self._row(node)
        self.above.discard(id(node))
        return grown

    def _wrong(self, node: Node, text: str) -> Leaf:
        self.log.complain(_mark(node), text)
        return Leaf(_mark(node), "", "null")

    def _leaf(self, node: ScalarNode) -> Leaf:
        kind = str(node.tag).removeprefix(_TAG)
        if kind not in _TYPES:
            if kind != "merge":
                self.log.complain(_mark(node), f"the tag {str(node.tag)[:40]} means nothing here")
            kind = "str"
        return Leaf(_mark(node), str(node.value), kind)

    def _row(self, node: Node) -> YamlList:
        return YamlList(_mark(node), tuple(self.tree(item) for item in node.value))

    def _branch(self, node: MappingNode) -> Branch:
        own: dict[str, tuple[Leaf, Tree]] = {}
        merged: list[Branch] = []
        for key, value in node.value:
            if str(key.tag) == f"{_TAG}merge":
                merged += self._merged(value)
                continue
            if key.id != "scalar":
                self.log.complain(_mark(key), "a key is one word")
                continue
            name = self._leaf(key)
            if name.text in own:
                _complain_twice(self.log, name, own[name.text][0].mark.line)
            own.setdefault(name.text, (name, self.tree(value)))
        items: dict[str, tuple[Leaf, Tree]] = {}
        for branch in reversed(merged):  # the first one wins, and what is written here wins over all
            items |= branch.items
        return Branch(_mark(node), items | own)

    def _merged(self, node: Node) -> list[Branch]:
        """The mappings behind `<<`, as YAML 1.1 has it: files for other tools share what is common so."""
        tree = self.tree(node)
        found = tree.items if isinstance(tree, YamlList) else (tree,)
        branches = [branch for branch in found if isinstance(branch, Branch)]
        if len(branches) != len(found):
            self.log.complain(_mark(node), "behind << belong mappings")
        return branches


def _mark(node: Node) -> Mark:
    start, end = node.start_mark, node.end_mark
    one_line = isinstance(node.value, str) and end.line == start.line
    return Mark(start.line + 1, start.column + 1, max(1, end.column - start.column) if one_line else 1)
