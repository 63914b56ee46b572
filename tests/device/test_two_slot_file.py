"""A file that is replaced in place needs no space; if its file system wants some all the same, that is said."""

from __future__ import annotations

import ctypes
import os
from pathlib import Path

import pytest

from dvtcli.device.change.journal import content_of, create_two_slot_file, replace_content
from tests.small_disk import empty, fill, on_small_disk

_KEEP_SIZE_AND_PUNCH_HOLE, _PAGE = 3, 4096


def _said(path: Path) -> str:
    return content_of(path.read_bytes()).decode().rstrip()


def _replaced_on_a_full_disk(disk: Path) -> None:
    path = disk / "state" / "kept"
    create_two_slot_file(path, "first", 20_000)
    fill(disk)
    for number in range(5):
        assert replace_content(path, "x" * 20_000 if number % 2 else f"short {number}")
        assert _said(path) == ("x" * 20_000 if number % 2 else f"short {number}")
    assert not replace_content(path, "x" * 20_001)
    assert not replace_content(path, "x" * 19_991, room=10)
    assert _said(path) == "short 4"


def test_it_needs_no_space(tmp_path: Path) -> None:
    if wrong := on_small_disk(tmp_path / "disk", lambda: _replaced_on_a_full_disk(tmp_path / "disk"), size=200_000):
        pytest.fail(wrong)


def _without_its_space(disk: Path) -> None:
    """The second line's pages are given back, as if the file system wrote each elsewhere."""
    path = disk / "state" / "kept"
    create_two_slot_file(path, "first", 20_000)
    with path.open("rb+") as file:
        start, length = ctypes.c_longlong(6 * _PAGE), ctypes.c_longlong(2 * _PAGE)
        assert ctypes.CDLL(None).fallocate(file.fileno(), _KEEP_SIZE_AND_PUNCH_HOLE, start, length) == 0
    fill(disk)
    with pytest.raises(OSError, match="for what has its space: this file system copies on write") as told:
        replace_content(path, "second " * 1000)
    assert told.value.filename == os.fspath(path)
    assert _said(path) == "first", "it is as it was"
    empty(disk)
    assert replace_content(path, "third")
    assert _said(path) == "third"


def test_a_file_system_that_wants_space_all_the_same_is_named(tmp_path: Path) -> None:
    if wrong := on_small_disk(tmp_path / "disk", lambda: _without_its_space(tmp_path / "disk"), size=200_000):
        pytest.fail(wrong)
