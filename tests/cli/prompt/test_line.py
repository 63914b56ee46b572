"""What a typed line means before a command sees it."""

from __future__ import annotations

import pytest

from dvtcli.cli.prompt.line import Destination, checked, cut, expanded
from dvtcli.cli.prompt.status import syntax
from dvtcli.errors import UsageError


@pytest.mark.parametrize(
    ("line", "command", "destination"),
    [
        ("pdo --all", "pdo --all", None),
        ("pdo | grep 0x181 | wc -l", "pdo ", Destination("|", "grep 0x181 | wc -l")),
        ("pdo >file", "pdo ", Destination(">", "file")),
        ("pdo >> a file", "pdo ", Destination(">>", "a file")),
        ('read "a | b > c"', 'read "a | b > c"', None),
        ("read driver's > f", "read driver's ", Destination(">", "f")),
        ("read a|b c>d", "read a|b c>d", None),
        ("pdo # | grep", "pdo # | grep", None),
        ("", "", None),
    ],
)
def test_a_line_is_cut_where_its_results_leave(line: str, command: str, destination: Destination | None) -> None:
    assert cut(line) == (command, destination)


def test_a_destination_is_one_file_or_a_program() -> None:
    assert checked(Destination(">", '"my file"'), programs=False) == Destination(">", "my file")
    assert checked(Destination("|", "grep x"), programs=True) == Destination("|", "grep x")
    for wrong, programs in [
        (Destination(">", ""), True),
        (Destination(">", "a b"), True),
        (Destination("|", ""), True),
    ]:
        with pytest.raises(UsageError):
            checked(wrong, programs=programs)
    with pytest.raises(UsageError, match="--no-shell"):
        checked(Destination("|", "grep x"), programs=False)


def test_only_the_first_word_is_an_alias_and_only_once() -> None:
    aliases = {"v": "read 606C", "read": "pdo"}
    assert expanded("v --json", aliases) == "read 606C --json"
    assert expanded("  v", aliases) == "read 606C"
    assert expanded("pdo v", aliases) == "pdo v"
    assert expanded("vv", aliases) == "vv"
    assert expanded("", aliases) == ""


def test_the_syntax_is_cut_between_its_parts() -> None:
    whole = syntax("map ", 500, {})
    assert whole is not None
    assert whole[0] == "map"
    assert whole[1].startswith("PDO OBJECT... [--cob-id ID] [--type N]")
    assert "[--rtr|--no-rtr]" in whole[1]
    for width in range(30, 200):
        found = syntax("map ", width, {})
        assert found is not None
        assert len(f"{found[0]} {found[1]}") <= width
        assert found[1].removesuffix(" …") == whole[1][: len(found[1].removesuffix(" …"))]
    assert syntax("ma", 80, {}) is None
    assert syntax("nosuch ", 80, {}) is None
    alias = syntax("m tpdo1 ", 80, {"m": "map"})
    assert alias is not None
    assert alias[0] == "map"
