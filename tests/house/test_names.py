"""One name, one thing: no two files of the product have the same name."""

from __future__ import annotations

from collections import defaultdict

import pytest

from tests.house.source import modules

pytestmark = pytest.mark.together

#: rooms whose things a command may be named after: its file bears the word that a user types
NAMESAKES = ("domain/", "device/")


def test_no_two_files_have_the_same_name() -> None:
    places: defaultdict[str, list[str]] = defaultdict(list)
    for module in modules():
        if module.path.name not in ("__init__.py", "__main__.py"):
            places[module.path.name].append(module.name)
    for name, files in places.items():
        commands = [file for file in files if file == f"cli/commands/{name}"]
        things = [file for file in files if file not in commands]
        assert len(things) <= 1, f"one name, one thing; rename all but one of {files}"
        clashing = [file for file in things if commands and not file.startswith(NAMESAKES)]
        assert not clashing, f"rename {clashing}: of that name is the command's file, {commands[0]}"
