"""One name, one thing: no two files of the product have the same name, nor a file and a folder of two things."""

from __future__ import annotations

from collections import defaultdict

import pytest

from tests.house.source import PACKAGE, modules

pytestmark = pytest.mark.together

#: rooms whose things a command may be named after: its file bears the word that a user types
NAMESAKES = ("domain/", "device/")
#: files that bear another thing's name on purpose: a command's, an answer's
NAMED_AFTER = ("cli/commands/", "operations/results/", "results.py")
#: a name that files and folders of several rooms share -> the one thing that it is in all of them
ONE_THING = {
    "change": "a change: of one device, safely; and of all that a line is about",
    "device": "a device: the node behind the bus, and the simulated one",
    "device_library": "the EDS files that the user keeps, and the calls for it",
    "gateway": "the gateway of CiA 309-3: its lines, and what they do",
    "lint": "what `eds check` looks at: objects, and the text",
    "meanings": "what raw values mean, and where that is looked up",
    "network": "a CANopen network: its plan, its file, what is done with it, and a simulated one",
    "opening": "opening a bus: by python-can, and by what the options say",
    "picture": "the picture of a network: what it says, how it is gathered, and its file",
    "profile": "a device family's profile, and its file",
    "session": "the session, and what it stands on",
}


def test_no_two_files_have_the_same_name() -> None:
    places: defaultdict[str, list[str]] = defaultdict(list)
    for module in modules():
        if module.path.name not in ("__init__.py", "__main__.py"):
            places[module.path.stem.lstrip("_")].append(module.name)
    for name, files in places.items():
        commands = [file for file in files if file == f"cli/commands/{name}.py"]
        things = [file for file in files if file not in commands]
        assert len(things) <= 1, f"one name, one thing; rename all but one of {files}"
        clashing = [file for file in things if commands and not file.startswith(NAMESAKES)]
        assert not clashing, f"rename {clashing}: of that name is the command's file, {commands[0]}"


def test_folders_that_share_a_name_are_about_one_thing() -> None:
    """Also with files; a command, its folder and what it answers may be called alike."""
    shared = {name for name, places in folders_and_files().items() if len(places) > 1 and any(map(is_folder, places))}
    assert shared == ONE_THING.keys(), "rename one of them; where both are about one thing say so in ONE_THING"


def folders_and_files() -> dict[str, set[str]]:
    """What bears each name, but commands' own files and what is answered about a theme."""
    found: defaultdict[str, set[str]] = defaultdict(set)
    for module in modules():
        if module.path.name not in ("__init__.py", "__main__.py") and not module.name.startswith(NAMED_AFTER):
            found[module.path.stem.lstrip("_")].add(module.name)
        for folder in module.path.relative_to(PACKAGE).parents:
            if folder.name:
                found[folder.name].add(f"{folder.as_posix()}/")
    return found


def is_folder(place: str) -> bool:
    return place.endswith("/")
