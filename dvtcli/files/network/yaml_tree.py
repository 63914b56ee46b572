"""YAML as a tree of values that know their place; as they are written, with the type that YAML 1.2 gives them."""

from __future__ import annotations

import re
from collections.abc import Callable
from contextlib import suppress
from functools import lru_cache
from typing import TYPE_CHECKING, NamedTuple

from dvtcli.domain.network.network_config import Mark

if TYPE_CHECKING:
    from ruamel.yaml import YAML
    from ruamel.yaml.error import MarkedYAMLError
    from ruamel.yaml.nodes import MappingNode, Node, ScalarNode

    from dvtcli.files.network.file_log import FileLog


class Leaf(NamedTuple):
    """A value: its *text*, and its *kind*: int, float, bool, null or str (also for quoted values)."""

    mark: Mark
    text: str
    kind: str

    @property
    def is_null(self) -> bool:
        """Whether the value is null."""
        return self.kind == "null"


class YamlList(NamedTuple):
    """A list."""

    mark: Mark
    items: tuple[Tree, ...]


class Branch(NamedTuple):
    """A mapping: by the text of each key, the key itself and its value."""

    mark: Mark
    items: dict[str, tuple[Leaf, Tree]]


Tree = Leaf | YamlList | Branch


def overlaid(base: Branch, own: Branch, instead: dict[str, str]) -> Branch:
    """Merge *own* over *base*, key by key at every depth; a key of *own* also replaces its *instead*."""
    items = {key: pair for key, pair in base.items.items() if instead.get(key) not in own.items}
    for key, (name, value) in own.items.items():
        below = items[key][1] if key in items else None
        both = isinstance(below, Branch) and isinstance(value, Branch)
        items[key] = (name, overlaid(below, value, instead) if both else value)  # type: ignore[arg-type]
    return Branch(own.mark, items)


#: a file for 127 nodes with all their PDOs has less than half of this
MOST_CHARACTERS = 1_000_000
#: lines, commas and brackets in all: each takes a reader some 60 µs, and no file for 127 nodes has half as many
MOST_ENTRIES = 80_000
#: values in all, those counted that aliases repeat
MOST_VALUES = 400_000
#: white space in a line, and the begin of a comment or an end of the line
_BLANKS, _BEHIND_BLANKS = " \t", "#\n\r\0\x85\u2028\u2029"
_TAB_INDENTS = "use spaces in place of this tab"
_TAG = "tag:yaml.org,2002:"
_TYPES = {"int", "float", "bool", "null", "str"}


def read_tree(text: str, log: FileLog) -> Tree | None:
    """The tree of *text*; None where it is empty, or no YAML, which *log* hears."""
    if len(text) > MOST_CHARACTERS:
        log.complain(Mark(1, 1), f"{len(text)} characters are too many for a network file")
        return None
    entries = sum(map(text.count, "\n,[]{}"))
    if entries > MOST_ENTRIES:
        log.complain(
            Mark(1, 1), f"{entries} lines, commas and brackets are too many for a network file: at most {MOST_ENTRIES}"
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
        mark, said = wrong.problem_mark or wrong.context_mark, yaml_problem(wrong)
        if "<stream end>" in said and wrong.context_mark is not None:  # the place to mend is where it begins
            mark, said = wrong.context_mark, "a bracket or brace is not closed"
        log.complain(Mark(mark.line + 1, mark.column + 1) if mark else Mark(1, 1), f"not YAML: {said}")
    except (YAMLError, RecursionError, ValueError) as wrong:
        said = "nested too deep" if isinstance(wrong, RecursionError) else f"{wrong} ".splitlines()[0].strip()
        log.complain(Mark(1, 1), f"not YAML: {said}")
    return None


def yaml_problem(wrong: MarkedYAMLError) -> str:
    """Say what is *wrong* at its place."""
    said = str(wrong.problem or wrong.context)
    return "use spaces in place of this tab" if said.startswith(r"found character '\t'") else said


def count_aliases(text: str) -> int:
    """Count the aliases (`*NAME`) of *text*, valid YAML."""
    if "*" not in text:
        return 0
    from ruamel.yaml.tokens import AliasToken

    return sum(isinstance(token, AliasToken) for token in _yaml().scan(text))


def _yaml() -> YAML:
    """Make ruamel's reader, with tabs as white space where YAML 1.2 has them so (6.2 and 6.6): not in indentation."""
    from ruamel.yaml import YAML
    from ruamel.yaml.scanner import Scanner, ScannerError

    class TabScanner(Scanner):
        def scan_to_next_token(self) -> None:
            """Go on to the next token."""
            super().scan_to_next_token()
            while self.reader.peek() == "\t":
                blanks = 1
                while self.reader.peek(blanks) in _BLANKS:
                    blanks += 1
                if self.reader.peek(blanks) not in _BEHIND_BLANKS and self._indents():
                    raise ScannerError(None, None, _TAB_INDENTS, self.reader.get_mark())
                self.reader.forward(blanks)
                super().scan_to_next_token()

        def _indents(self) -> bool:
            """Tell whether a tab here is part of an indentation: of a line, or of what `-` or `?` begins."""
            reader = self.reader
            before = reader.buffer[reader.pointer - reader.column : reader.pointer].rstrip(_BLANKS)
            return not before or before[-1] in "-?"

    yaml = YAML(typ="safe", pure=True)
    yaml.Scanner = TabScanner
    return yaml


@lru_cache(maxsize=4)
def _composed(text: str) -> Node | None:
    """ruamel's node of *text*, which nobody changes: `plan`, `apply` and `verify` of a session read the same file."""
    yaml = _yaml()
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
                self.log.complain(_mark(node), f"the tag {str(node.tag)[:40]} has no meaning here")
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
            self.log.complain(_mark(node), "<< needs mappings")
        return branches


def _mark(node: Node) -> Mark:
    start, end = node.start_mark, node.end_mark
    one_line = isinstance(node.value, str) and end.line == start.line
    return Mark(start.line + 1, start.column + 1, max(1, end.column - start.column) if one_line else 1)


#: maximum nesting of mappings and lists
_DEEPEST = 30
#: YAML 1.2 allows more; of these each is one column wide, and ends no line
_CHARACTERS = re.compile(r"[\n -~\u00a1-\u1fff]*")
#: words outside of brackets may have nearly any character, words inside only those of names and numbers
_WORD = r"(?:[A-Za-z0-9_./+$(]|-(?=[^\s:#-]))(?:[^\s:#]|(?<=[^\s:]):(?=[^\s:])|(?<=[^\s])#| +(?=[^\s:#]))*"
_FLOW_WORD = r"(?:[A-Za-z0-9_./+$(]|-(?=\w))(?:[\w./+-]|:(?=\w)| +(?=[\w./+-]))*"
_QUOTED = r"\"[^\"\\\n]*\"|'[^'\n]*'(?!')"
_KEY = re.compile(rf"({_QUOTED}|{_WORD}):(?: +|$)")
_VALUE = re.compile(rf"{_QUOTED}|{_WORD}")
_END = re.compile(r"(?: +#.*| *)")
_FLOW = re.compile(rf" *(?:([\[\]{{}},])|({_QUOTED}|{_FLOW_WORD})(:(?= ))?)")
_DASH = re.compile(r"- +")
_BOOL = re.compile(r"true|True|TRUE|false|False|FALSE")
_FLOAT = re.compile(
    r"[-+]?[0-9][0-9_]*(?:\.[0-9_]*(?:[eE][-+]?[0-9]+)?|[eE][-+]?[0-9]+)|[-+]?\.[0-9_]+(?:[eE][-+][0-9]+)?"
    r"|[-+]?\.(?:inf|Inf|INF)|\.(?:nan|NaN|NAN)"
)
_INT = re.compile(r"[-+]?(?:0b[01_]+|0o?[0-7_]+|[0-9_]+|0x[0-9a-fA-F_]+)")
_NULL = re.compile(r"null|Null|NULL")
#: types of words in YAML 1.2 (10.3.2), with ruamel's underscores in numbers
_IS_KIND = {"bool": _BOOL.fullmatch, "float": _FLOAT.fullmatch, "int": _INT.fullmatch, "null": _NULL.fullmatch}
_LONGEST_KEY = 200
#: a key and its value
Pair = tuple[Leaf, Tree]


class OtherYamlError(ValueError):
    """The text is YAML of another kind, or no YAML."""


@lru_cache(maxsize=4096)
def _kind(word: str) -> str:
    if re.match(r"\d{4}-\d", word):
        raise OtherYamlError  # a date
    kinds = ("float", "int") if word[0] in "+-.0123456789" else ("bool", "null")
    return next((kind for kind in kinds if _IS_KIND[kind](word)), "str")


class PlainYaml:
    """Parses a text; *twice* collects each repeated key with the line of its first occurrence."""

    def __init__(self, text: str) -> None:
        self.twice: list[tuple[Leaf, int]] = []
        if not _CHARACTERS.fullmatch(text):
            raise OtherYamlError
        #: number, indentation and text of each non-empty line
        self._lines: list[tuple[int, int, str]] = []
        lines = text.split("\n")
        self._end = len(lines), len(lines[-1])
        for number, line in enumerate(lines, 1):
            said = line.lstrip(" ")
            if line.startswith("..."):
                raise OtherYamlError  # no key: the end of a document
            if said and said[0] != "#":
                self._lines.append((number, len(line) - len(said), said))
        self._at = 0

    def tree(self) -> Tree:
        """Return the tree of the text. Raises OtherYamlError if the text is not plain."""
        if not self._lines:
            raise OtherYamlError
        tree = self._block(_DEEPEST)
        if self._at < len(self._lines):
            raise OtherYamlError
        return tree

    def _block(self, deeper: int) -> Tree:
        """Parse the list or mapping that begins in this line."""
        if deeper == 0:
            raise OtherYamlError
        number, indent, said = self._lines[self._at]
        return self._list(number, indent, deeper) if _is_item(said) else self._mapping(number, indent, deeper)

    def _list(self, first: int, indent: int, deeper: int) -> YamlList:
        items: list[Tree] = []
        lines = self._lines
        while self._at < len(lines) and lines[self._at][1] == indent and _is_item(lines[self._at][2]):
            number, _, said = lines[self._at]
            dash = _DASH.match(said)
            if dash is None or dash.end() == len(said):
                raise OtherYamlError
            column, rest = indent + dash.end(), said[dash.end() :]
            if _KEY.match(rest):
                lines[self._at] = (number, column, rest)
                items.append(self._mapping(number, column, deeper - 1))
                continue
            self._at += 1
            items.append(self._value(number, column, rest, indent))
        return YamlList(Mark(first, indent + 1), tuple(items))

    def _mapping(self, first: int, indent: int, deeper: int) -> Branch:
        if deeper == 0:
            raise OtherYamlError
        items: dict[str, Pair] = {}
        lines = self._lines
        while self._at < len(lines) and lines[self._at][1] == indent and not _is_item(lines[self._at][2]):
            number, _, said = lines[self._at]
            key = _KEY.match(said)
            if key is None or key.end(1) > _LONGEST_KEY:
                raise OtherYamlError
            self._at += 1
            name = _leaf(number, indent, key[1])
            self._name(name, items)
            rest = said[key.end() :]
            if not rest or rest[0] == "#":
                value = self._below(indent, deeper)
            else:
                value = self._value(number, indent + key.end(), rest, indent)
            items.setdefault(name.text, (name, value))
        return Branch(Mark(first, indent + 1), items)

    def _name(self, name: Leaf, items: dict[str, Pair]) -> None:
        if name.text in items:
            self.twice.append((name, items[name.text][0].mark.line))

    def _below(self, indent: int, deeper: int) -> Tree:
        """Parse the lines below a key at *indent*; null gets the place of the following content."""
        number, below = self._end
        if self._at < len(self._lines):
            number, below, said = self._lines[self._at]
            if below > indent or (below == indent and _is_item(said)):
                return self._block(deeper - 1)
        return Leaf(Mark(number, below + 1), "", "null")

    def _value(self, number: int, column: int, text: str, indent: int) -> Tree:
        """Parse the value *text* at *column* to its end; it must not continue on the next line."""
        if text[0] in "[{":
            brackets = _Brackets(text, number, column, self._name)
            value, end = brackets.value(_DEEPEST), brackets.end
        else:
            word = _VALUE.match(text)
            if word is None:
                raise OtherYamlError
            value, end = _leaf(number, column, word[0]), word.end()
        if not _END.fullmatch(text, end) or (self._at < len(self._lines) and self._lines[self._at][1] > indent):
            raise OtherYamlError
        return value


class _Brackets:
    """Parses the bracketed part of *text* at *column*; calls *name* for each key with the earlier items."""

    def __init__(self, text: str, number: int, column: int, name: Callable[[Leaf, dict[str, Pair]], None]) -> None:
        self._text, self._number, self._column, self._name = text, number, column, name
        self.end = 0

    def value(self, deeper: int) -> Tree:
        """Parse the list or mapping that begins here."""
        return self._value(self._next(), deeper)

    def _next(self) -> re.Match[str]:
        found = _FLOW.match(self._text, self.end)
        if found is None:
            raise OtherYamlError
        self.end = found.end()
        return found

    def _leaf(self, found: re.Match[str]) -> Leaf:
        return _leaf(self._number, self._column + found.start(2), found[2])

    def _value(self, found: re.Match[str], deeper: int) -> Tree:
        sign, word, colon = found.groups()
        if word is not None and not colon:
            return self._leaf(found)
        if deeper == 0 or sign not in ("[", "{"):
            raise OtherYamlError
        mark = Mark(self._number, self._column + found.start(1) + 1)
        return self._list(mark, deeper - 1) if sign == "[" else self._mapping(mark, deeper - 1)

    def _list(self, mark: Mark, deeper: int) -> YamlList:
        items: list[Tree] = []
        found = self._next()
        while found[1] != "]" or items:
            items.append(self._value(found, deeper))
            if self._is_over("]"):
                break
            found = self._next()
        return YamlList(mark, tuple(items))

    def _mapping(self, mark: Mark, deeper: int) -> Branch:
        items: dict[str, Pair] = {}
        found = self._next()
        while found[1] != "}" or items:
            if not found[3]:
                raise OtherYamlError
            name = self._leaf(found)
            self._name(name, items)
            items.setdefault(name.text, (name, self._value(self._next(), deeper)))
            if self._is_over("}"):
                break
            found = self._next()
        return Branch(mark, items)

    def _is_over(self, bracket: str) -> bool:
        """Whether the closing *bracket* is next, and not a comma."""
        sign = self._next()[1]
        if sign not in (bracket, ","):
            raise OtherYamlError
        return sign == bracket


def _is_item(said: str) -> bool:
    return said[0] == "-" and said[1:2] in ("", " ")


def _leaf(number: int, column: int, word: str) -> Leaf:
    """Build a leaf from *word* at *column* (from 0) of a line."""
    mark = Mark(number, column + 1, len(word))
    return Leaf(mark, word[1:-1], "str") if word[0] in "\"'" else Leaf(mark, word, _kind(word))
