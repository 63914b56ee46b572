"""No regular expression of the package takes more than linear time, whatever a stranger repeats in a text.

Texts are made of what a pattern itself accepts in front of each of its repetitions, of what is repeated, and of an end
that it may not like. They grow step by step, so that a pattern that takes cubic or exponential time is told while its
text is short.
"""

from __future__ import annotations

import ast
import re
from collections.abc import Iterator
from collections.abc import Set as AbstractSet
from dataclasses import dataclass
from functools import partial
from importlib import import_module
from pathlib import Path
from time import process_time
from typing import Any

import pytest

import dvtcli

PACKAGE = Path(dvtcli.__file__).parent
#: functions of `re`, with the place of their flags
CALLS = {"compile": 1, "search": 2, "match": 2, "fullmatch": 2, "split": 3, "findall": 2, "finditer": 2, "sub": 4}
FILES = [
    path.relative_to(PACKAGE).as_posix()
    for path in sorted(PACKAGE.rglob("*.py"))
    if re.search(rf"\bre\.(?:{'|'.join(CALLS)})\(", path.read_text("utf-8"))
]
REPEATED = (
    *(" ", "\n", "\t", "[", "]", "(", "<", "a", "A", "0", "_", ".", ":", "=", ",", '"', "'"),
    *("a ", "0 ", "a,", " \n", "a\n", "::", "-a", '" ', " '"),
)
#: what one of stands for a set of characters
CHARACTERS = ("a", "A", *map(chr, range(128)), "é", "…", "\u2500")
ENDS = ("", "!", "\n", "0", "\x00")
#: how often it is repeated, step by step, and the CPU time (s) from which on a step is compared with the steps before
STEPS, SLOW_S = (18, 100, 500, 2000), 0.005
#: A text of double length takes twice the time, or four times where time grows with the square.
TOO_MUCH = 3
#: files whose texts have been bounded to so many characters when a pattern sees them
LONGEST = {"domain/typed_frame.py": 400, "files/recordings/formats.py": 400, "files/recordings/pasted.py": 400}
PARSER, COMPILER = import_module("re._parser"), import_module("re._compiler")


@dataclass(frozen=True)
class Used:
    """A *pattern* at a *place* of the package, and the functions that are *asked* of it."""

    place: str
    pattern: re.Pattern[Any]
    asked: AbstractSet[str]

    def took_s(self, text: str) -> float:
        """CPU time (s) of the ways in which the pattern is used on *text*."""
        typed = text.encode() if isinstance(self.pattern.pattern, bytes) else text
        begun_s = process_time()
        if "match" in self.asked:
            self.pattern.match(typed)
        if "fullmatch" in self.asked:
            self.pattern.fullmatch(typed)
        if self.asked - {"match", "fullmatch"}:
            self.pattern.sub(typed[:0], typed)
        return process_time() - begun_s


def grows(used: Used) -> str | None:
    """The text for which a pattern takes more than linear time, in words; None if there is none."""
    before, own = parts(used.pattern)
    longest = LONGEST.get(used.place.partition(":")[0], STEPS[-1])
    for first in before:
        for repeated in dict.fromkeys((*REPEATED, *own)):
            for end in ENDS:
                text = partial(_text, first, repeated, end)
                slow = next((step for step in STEPS if step <= longest and used.took_s(text(step)) > SLOW_S), None)
                if slow is not None and (how := _growth(used, [text(slow // 4), text(slow // 2), text(slow)])):
                    return f"{first!r} + {repeated!r} * {slow} + {end!r}: {how}"
    return None


def _text(first: str, repeated: str, end: str, times: int) -> str:
    return first + repeated * times + end


def _growth(used: Used, texts: list[str]) -> str:
    """The times for *texts*, each of double length, if both steps are too large in the best of three tries."""
    least, middle, most = (min(used.took_s(text) for _ in range(3)) for text in texts)
    if most < SLOW_S or most < TOO_MUCH * middle or most < TOO_MUCH**2 * least:
        return ""
    return f"{least:.4f}, {middle:.4f}, {most:.4f} s"


def parts(pattern: re.Pattern[Any]) -> tuple[list[str], list[str]]:
    """Texts up to and behind each endless repetition of *pattern*, the empty one first; what they are made of."""
    before: dict[str, None] = {"": None}
    own: dict[str, None] = {}
    tree = PARSER.parse(pattern.pattern, pattern.flags)

    def walk(items: Any, text: str) -> str:
        """*text*, and behind it a text that *items* accept."""
        for code, value in items:
            match str(code):
                case "LITERAL":
                    text += chr(value)
                case "NOT_LITERAL" | "IN" | "ANY":
                    one = COMPILER.compile(PARSER.SubPattern(tree.state, [(code, value)]))
                    text += next(
                        character
                        for character in CHARACTERS
                        if one.match(character.encode() if isinstance(pattern.pattern, bytes) else character)
                    )
                case "BRANCH":
                    text = next(iter([walk(branch, text) for branch in value[1]]))
                case "SUBPATTERN" | "ATOMIC_GROUP":
                    text = walk(value[-1] if str(code) == "SUBPATTERN" else value, text)
                case "MAX_REPEAT" | "MIN_REPEAT" | "POSSESSIVE_REPEAT":
                    least, most, body = value
                    start = text
                    text = walk(body, text)
                    if most is PARSER.MAXREPEAT:
                        before.update(dict.fromkeys((start, text)))
                        own.update(dict.fromkeys((text[len(start) :], text)))
                    text += text[len(start) :] * (least - 1)
        return text

    whole = walk(tree, "")
    own.update(dict.fromkeys(text + end for text in (whole, *before) if text for end in ("", "\n")))
    return list(before), [text for text in own if text]


def used_in(file: str) -> Iterator[Used]:
    """Each pattern of one *file* of the package; what a function puts into one when it runs is an `a` here."""
    module = import_module(".".join((dvtcli.__name__, *Path(file).with_suffix("").parts)).removesuffix(".__init__"))
    tree = ast.parse((PACKAGE / file).read_text("utf-8"))
    asked = _asked(tree)
    every = {node.attr for node in ast.walk(tree) if isinstance(node, ast.Attribute)} & {*CALLS} - {"compile"}
    every = every or {*CALLS}  # it is asked elsewhere
    names = dict(
        each for node in ast.walk(tree) if isinstance(node, ast.Assign | ast.AnnAssign) for each in _named(node)
    )
    for node in ast.walk(tree):
        match node:
            case ast.Call(ast.Attribute(ast.Name("re"), function), [said, *_]) if function in CALLS:
                pattern = _value(said, vars(module))
                if isinstance(pattern, re.Pattern):  # `re.sub` of a compiled pattern
                    continue
                how = {function} if function != "compile" else asked.get(names.get(id(node), ""), {"?"})
                compiled = re.compile(pattern, _flags(node, CALLS[function]))
                yield Used(f"{file}:{node.lineno}", compiled, how & {*CALLS} | (set() if how <= {*CALLS} else every))


def _value(node: ast.expr, names: dict[str, Any]) -> Any:
    """What *node* is in its module."""
    if isinstance(node, ast.JoinedStr):
        return "".join(str(_value(part, names)) for part in node.values)
    if isinstance(node, ast.FormattedValue):
        return _value(node.value, names)
    try:
        return eval(compile(ast.Expression(node), "pattern", "eval"), dict(names))  # noqa: S307 - the package's own text
    except NameError:
        return "a"


def _named(node: ast.Assign | ast.AnnAssign) -> Iterator[tuple[int, str]]:
    """Each value that *node* gives a name, by its identity."""
    target = node.targets[0] if isinstance(node, ast.Assign) else node.target
    pairs = [(target, node.value)]
    if isinstance(target, ast.Tuple) and isinstance(node.value, ast.Tuple):
        pairs = list(zip(target.elts, node.value.elts, strict=True))
    yield from ((id(value), name.id) for name, value in pairs if isinstance(name, ast.Name))


def _asked(tree: ast.Module) -> dict[str, set[str]]:
    """What each name of a module is asked: the attributes that are taken of it, `?` if it is handed on."""
    nodes = list(ast.walk(tree))
    found: dict[str, set[str]] = {}
    taken = set()
    for node in nodes:
        if isinstance(node, ast.Attribute) and isinstance(node.value, ast.Name):
            found.setdefault(node.value.id, set()).add(node.attr)
            taken.add(id(node.value))
    for node in nodes:
        if isinstance(node, ast.Name) and isinstance(node.ctx, ast.Load) and id(node) not in taken:
            found.setdefault(node.id, set()).add("?")
    return found


def _flags(node: ast.Call, place: int) -> int:
    said = [keyword.value for keyword in node.keywords if keyword.arg == "flags"] + node.args[place : place + 1]
    names = {each.attr for flags in said for each in ast.walk(flags) if isinstance(each, ast.Attribute)}
    return int(sum(re.RegexFlag[name] for name in names if name in re.RegexFlag.__members__))


@pytest.mark.drawn(2)
@pytest.mark.parametrize(
    ("pattern", "asked", "is_bad"),
    [
        (r"\s*\n\s*x", "search", True),
        (r"target(_?(left|\d+))*$", "search", True),
        (r"1\s*[^\d,]*", "fullmatch", True),
        (r"^list = \[[^\]]*\]", "search", True),
        (r"^[ \t]*x", "search", False),
        (r"\s*x", "match", False),
        (r"target(_?(left|\d))*+$", "search", False),
    ],
)
def test_what_grows_is_noticed(pattern: str, asked: str, is_bad: bool) -> None:
    assert (grows(Used("", re.compile(pattern, re.M), {asked})) is not None) == is_bad


@pytest.mark.drawn(3)
@pytest.mark.parametrize("file", FILES)
def test_no_pattern_of_the_package_grows_worse_than_its_text(file: str) -> None:
    found = {used.place: f"{used.pattern.pattern}   {how}" for used in used_in(file) if (how := grows(used))}
    assert found == {}
