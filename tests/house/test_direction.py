"""Every file has its room; `test_laws` holds imports to the order of the rooms, and libraries to theirs."""

from __future__ import annotations

from tests.house.draw import ROOMS, House, room_of
from tests.house.source import PACKAGE

HOUSE = House(PACKAGE)


def test_every_file_has_a_room() -> None:
    assert {room_of(file) for file in HOUSE.files} <= set(ROOMS)
    assert not list((PACKAGE / "families").glob("**/*.py")), "families are data"
