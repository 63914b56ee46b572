"""Imports run one way, in the order of the rooms that `draw` has, and in no circle; libraries stay in their rooms."""

from __future__ import annotations

import sys

from tests.house.draw import ROOMS, House, room_of
from tests.house.source import PACKAGE, modules

HOUSE = House(PACKAGE)

#: libraries that only some files may touch
ONLY_IN: dict[str, tuple[str, ...]] = {
    "can": ("bus/", "simulator/network/", "files/recording.py"),
    "canopen": ("bus/",),
    "prompt_toolkit": ("cli/prompt/", "cli/monitor/app.py"),
    "rich": ("cli/view/",),
    "click": ("cli/",),
}


def test_imports_run_in_the_order_of_the_rooms() -> None:
    outward = HOUSE.outward()
    assert not outward, "\n".join(map(str, outward))


def test_no_files_import_one_another_in_a_circle() -> None:
    assert HOUSE.circles() == []


def test_the_strict_device_knows_the_vocabulary_only() -> None:
    for arrow in HOUSE.arrows:
        if arrow.source.startswith("simulator/device/") and not arrow.target.startswith("simulator/device/"):
            assert arrow.target.startswith("domain/"), arrow
            assert not arrow.target.startswith(("domain/rules/", "domain/plan.py")), arrow


def test_every_file_has_a_room() -> None:
    assert {room_of(file) for file in HOUSE.files} <= set(ROOMS)
    assert not list((PACKAGE / "families").glob("**/*.py")), "families are data"


def test_libraries_stay_in_their_rooms() -> None:
    for module in modules():
        for name, line, typing_only in module.imports():
            places = ONLY_IN.get(name.partition(".")[0])
            if places is not None and not typing_only:
                assert module.name.startswith(places), f"{module.name}:{line} imports {name}; only {places} may"


def test_the_ground_floors_need_the_standard_library_only() -> None:
    for module in modules():
        if module.name.startswith(("domain/", "device/", "simulator/device/", "errors.py")):
            foreign = {name.partition(".")[0] for name, _, typing_only in module.imports() if not typing_only}
            assert not foreign - {*sys.stdlib_module_names, "dvtcli"}, module.name
