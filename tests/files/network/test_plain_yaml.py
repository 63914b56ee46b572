"""The quick reader of YAML: what it reads is what the general one makes of the same text; the rest it leaves to it."""

from __future__ import annotations

import random
import re
from pathlib import Path

import pytest
from hypothesis import example, given
from hypothesis import strategies as st

from dvtcli.errors import InputFileError
from dvtcli.files.network.file_log import FileLog
from dvtcli.files.network.yaml_tree import (
    Branch,
    Leaf,
    OtherYamlError,
    PlainYaml,
    Tree,
    YamlList,
    _general_tree,
    read_tree,
)
from examples.many_nodes import network
from tests.surroundings import ROOT

LINE = (ROOT / "examples" / "line.yaml").read_text("utf-8")
#: pieces that files consist of, and pieces that look like them
PIECES = (
    *("a", "b:", "a: ", "'c'", '"d e"', "- ", "-", "-1", "0x1A", "1.5", ".5", "_1", "1e3", "true", "null", "Null", "~"),
    *("[", "]", "{", "}", ", ", ",", ": ", ":", " #", "#", "# x", " ", "  ", "\n", "\n", "\n  ", "\n    ", "\n- "),
    *("6C01:01", "dummy/8", "$NODEID+1", "a b", "2020-01-01", "...", "---", "\n...", "&x ", "*x", "!t ", "| ", "> "),
    *("''", "'a''b'", '"\\n"', "\t", "é", "\u2028", "\ufeff", "=", "(x)", "a:b", "[]", "{}", "-a", "- - a", "x: y\n"),
    *("<<: ", "\n  - ", "? ", "%", "z:\n"),
)


def general(text: str) -> tuple[Tree | None, list[str]]:
    return _received(text, _general_tree)


def _received(text: str, read: object) -> tuple[Tree | None, list[str]]:
    log = FileLog("x.yaml", text)
    tree = read(text, log)  # type: ignore[operator]
    try:
        log.end()
    except InputFileError as error:
        return tree, [str(one) for one in error.complaints]
    return tree, []


def agree(text: str) -> bool:
    """Whether the quick reader takes *text*; then both say the same."""
    try:
        PlainYaml(text).tree()
    except OtherYamlError:
        return False
    assert _received(text, read_tree) == general(text), text
    return True


@pytest.mark.parametrize(
    "text",
    [
        LINE, network(3), "a: 1\n", "a:\n  b:\n", "a: # c\nb: 'x' # d\n", "a:\n- 1\n- b: 2\n  c: [1, {d: e}]\nf: []\n",
        "a: 1\na: 2\nb: {c: 1, c: 2}\n", "  a: b c  \n  d: -5\n", "- a\n- b:\n    c\n" [:4], "a: {}\nb: [  x , y ]\n",
        'a: "b"\n"c d": 1\n', "a: x#y\nb: c:d, e [f]\n", "a: _1\nb: +_\nc: 0o17\nd: 1_0\ne: .inf\nf: 0x_F\n",
    ],
)  # fmt: skip
def test_what_files_are_written_in_is_read_alike(text: str) -> None:
    assert agree(text)


@pytest.mark.parametrize(
    "text",
    [
        "", "# x\n", "a",
        "a: &x 1\n", "a: *x\n", "a: !t 1\n", "a: |\n  x\n", "a: b\n  c\n", "a: [1,\n 2]\n", "a: {b}\n",
        "a: 'b''c'\n",
        'a: "\\n"\n', "? a\n", "---\na: 1\n", "a: 1\n...\n", "... a: 1\n", "a: [1, ]\n", "a:\n b: 1\n  c: 2\n",
        "a:\n   b: 1\n  c: 2\n", "a: 2020-01-01\n", "<<: {a: 1}\n", "a:\tb\n", "- - a\n", "a: b: c\n", "a: [b: c]\n",
        "a: 1\r\n", "a: '\n'\n", "a: " + "[" * 40 + "]" * 40 + "\n", f"{'k' * 300}: 1\n", "a\u2028b: 1\n",
    ],
)  # fmt: skip
def test_other_yaml_is_left_to_the_general_reader(text: str) -> None:
    assert not agree(text)


@pytest.mark.counted
def test_pieces_in_any_order_are_read_alike_or_left(request: pytest.FixtureRequest) -> None:
    """And files in which a piece was put or lost."""
    drawn, taken = random.Random(request.config.getoption("randomly_seed", 1)), 0
    count = max(2_000, min(request.config.getoption("--fuzz"), 20_000))
    small = network(1).split("\n")
    for _ in range(count):
        if drawn.random() < 0.5:
            text = "".join(drawn.choices(PIECES, k=drawn.randrange(1, 9)))
        else:
            text = "\n".join(drawn.sample(small, 6) if drawn.random() < 0.3 else small[:6])
            at = drawn.randrange(len(text))
            text = text[:at] + drawn.choice(PIECES) + text[at + drawn.randrange(3) :]
        taken += agree(text)
    assert taken > count / 50


@given(st.text(st.sampled_from("ab1-:.#,[]{}'\" \n_$0x+ef"), max_size=24))
@example("a: -\n")
def test_any_letters_are_read_alike_or_left(text: str) -> None:
    agree(text)


@pytest.mark.parametrize("file", sorted(ROOT.glob("examples/**/*.yaml")), ids=lambda path: path.name)
def test_each_example_is_plain(file: Path) -> None:
    assert agree(file.read_text("utf-8"))


def test_network_files_of_the_documentation_are_plain() -> None:
    """Those that the pages show, as people write them."""
    pages = [*ROOT.glob("docs/**/*.md"), ROOT / "README.md"]
    blocks = [block for page in pages for block in re.findall(r"```yaml\n(.*?)```", page.read_text("utf-8"), re.DOTALL)]
    assert sum(map(agree, blocks)) >= len(blocks) / 2


@pytest.mark.parametrize(
    "text",
    [
        "a: 1\t# c\n", "a: 1 \t # c\n", "a:\t# c\n  b: 2\n", "a: 'x'\t# c\n", "\t# c\na: 1\n", "a: {b: 1}\t# c\n",
        "a: [1,\t# c\n 2]\n", "- 1\t# c\n- x y\t# c\n", "a: 1\n \t# c\n\t\nb: 2\t\n", "---\t# c\na: 1\n", "a: 1\t#",
        "a: &x 1\t# c\nb: *x\t# c\n", "a: x\n  y\t# c\n", "a: 1\t# c\td\r\n",
    ],
)  # fmt: skip
def test_a_tab_in_front_of_a_comment_or_the_end_of_a_line_is_white_space(text: str) -> None:
    """YAML 1.2, 6.6: a comment is behind white space, of which a tab is a part."""
    tree, complaints = _received(text, read_tree)
    assert tree is not None
    assert not complaints
    assert tree == general(text.replace("\t", " "))[0]


@pytest.mark.parametrize(
    "text",
    [
        "a:\t1\n", "a: \t1\n", "a:\t\t'x'\n", "a:\n  b:\t1\n  c: 2\n", "a: {b:\t1,\tc: [1,\t2\t]\t}\n", "a\t: 1\n",
        "a:\t&x 1\nb:\t*x\n", "- a:\t1\n  b:\t2\n", "a:\t1\t# c\r\n",
    ],
)  # fmt: skip
def test_a_tab_between_a_key_and_its_value_is_white_space(text: str) -> None:
    """YAML 1.2, 6.2: separation spaces; only an indentation has none."""
    tree, complaints = _received(text, read_tree)
    assert tree is not None
    assert not complaints
    assert without_marks(tree) == without_marks(general(text.replace("\t", " "))[0])


def without_marks(tree: object) -> object:
    """*tree* without the places of its values."""
    if isinstance(tree, Leaf):
        return tree.text, tree.kind
    if isinstance(tree, YamlList):
        return [without_marks(item) for item in tree.items]
    assert isinstance(tree, Branch)
    return {key: without_marks(value) for key, (_name, value) in tree.items.items()}


def test_a_tab_in_quotes_is_a_letter_and_one_that_indents_is_refused() -> None:
    tree, complaints = _received('a: "x\t# y"\t# c\n', read_tree)
    assert isinstance(tree, Branch)
    assert isinstance(value := tree.items["a"][1], Leaf)
    assert (value.text, complaints) == ("x\t# y", [])
    for text in ("a:\n\tb: 1\n", "\ta: 1\n", "a: 1\n\tb: 2\n", "-\ta: 1\n", "- \t- 1\n", "a:\n - 1\n \t- 2\n"):
        said = _received(text, read_tree)[1][0]
        assert "not YAML: use spaces in place of this tab" in said, text
