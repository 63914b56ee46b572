"""Ways through the code are counted where the tests run, in workers, too, also when a variable asks for it."""

from __future__ import annotations

import subprocess
import sys
from collections.abc import Iterator
from pathlib import Path

import pytest

from tests.harness.branch_report import gone, left, rooms, runners
from tests.harness.branches import marked
from tests.harness.sample import heavy
from tests.process import ROOT, environment

CODE = '''
def f(x: int, parts: list[int]) -> object:
    """Its words stay."""
    if x == 1:
        return "one"
    elif x == 2:
        pass
    for part in parts:
        if part:
            break
    while x > 5:
        x -= 1
    try:
        x = 1 // x
    except ZeroDivisionError:
        x = 0
    match parts:
        case [1]:
            x = 7
        case [_, *_]:
            x = 8
    return x

def never() -> None:
    class Inner:
        def method(self) -> int:
            return 1
'''


def went(*calls: tuple[int, list[int]]) -> set[str]:
    """The ways of CODE that *calls* of its function go, as `line kind`."""
    code, there = marked(CODE.encode(), "code.py")
    marks = bytearray(len(there))
    names: dict[str, object] = {"__ways_gone__": marks}
    exec(code, names)  # noqa: S102 - it stands above
    function = names["f"]
    assert callable(function)
    assert function.__doc__ == "Its words stay."
    for x, parts in calls:
        assert function(x, parts) == plain()(x, parts)
    return {f"{way.line} {way.kind}" for way, mark in zip(there, marks, strict=True) if mark}


def plain() -> object:
    names: dict[str, object] = {}
    exec(CODE, names)  # noqa: S102 - it stands above
    return names["f"]


@pytest.mark.parametrize(("call", "expected"), [
    ((1, []), {"2 def", "4 if"}),
    ((2, []), {"2 def", "4 else", "6 if", "8 loop's end", "11 loop's end", "17 no case"}),
    ((0, [1]), {"2 def", "4 else", "6 else", "8 loop", "9 if", "11 loop's end", "15 except", "18 case"}),
    ((6, [0, 0]), {"2 def", "4 else", "6 else", "8 loop", "9 else", "8 loop's end", "11 loop", "11 loop's end",
                   "20 case"}),
], ids=["if", "elif", "except", "loops"])  # fmt: skip
def test_just_the_ways_that_are_gone_are_marked(call: tuple[int, list[int]], expected: set[str]) -> None:
    assert went(call) == expected


def test_what_is_not_called_is_a_way_that_nobody_went() -> None:
    _, there = marked(CODE.encode(), "code.py")
    assert {way.line for way in there if way.kind == "def"} == {2, 24, 26}
    assert not {"24 def", "26 def"} & went((0, [1]), (6, [0]))


@heavy
def test_every_file_of_the_product_can_be_marked_and_keeps_its_lines() -> None:
    for path in sorted((ROOT / "dvtcli" / "domain").rglob("*.py")):
        code, _ = marked(path.read_bytes(), str(path))
        assert set(lines(code)) <= set(range(path.read_bytes().count(b"\n") + 2)), path


def lines(code: object) -> Iterator[int]:
    assert hasattr(code, "co_lines")
    yield from (line for _, _, line in code.co_lines() if line is not None)


@pytest.mark.drawn(0)
def test_an_option_from_a_variable_counts_in_a_worker(tmp_path: Path) -> None:
    one = str(ROOT / "tests" / "domain" / "test_cob_id.py")
    ran = subprocess.run(
        [sys.executable, "-m", "pytest", "-n", "1", "-p", "no:cacheprovider", one],
        env=environment() | {"PYTEST_ADDOPTS": f"--branches {tmp_path / 'counted'}"},
        capture_output=True, encoding="utf-8", check=False,
    )  # fmt: skip
    assert ran.returncode == 0, ran.stdout + ran.stderr
    found = gone(tmp_path / "counted")
    assert len(found["domain/cob_id.py"]) > 5
    assert len(list(left(found, "domain/cob_id.py"))) < len(runners()["domain/cob_id.py"]) / 2
    words = [line.split()[0] for line in rooms(found)]
    assert words[0] == "room"
    assert "domain" in words
    assert words[-1] == "all"


def test_a_folder_without_counts_says_so(tmp_path: Path) -> None:
    assert list(rooms(gone(tmp_path))) == ["nothing was counted: there is nothing in this folder"]
