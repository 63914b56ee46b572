"""The house keeps its laws, and every file has its room; `test_laws` sees that they bite."""

from __future__ import annotations

import pytest

from tests.house.draw import ROOMS, room_of
from tests.house.laws import LAWS
from tests.house.laws.source_tree import SourceTree
from tests.house.source import PACKAGE

pytestmark = [pytest.mark.together, pytest.mark.quick]

HOUSE = SourceTree.of_the_package()


@pytest.mark.parametrize("law", LAWS)
def test_the_house_keeps_it(law: str) -> None:
    assert list(LAWS[law](HOUSE)) == []


def test_every_file_has_a_room() -> None:
    assert {room_of(file) for file in HOUSE.texts} <= set(ROOMS)
    assert not list((PACKAGE / "families").glob("**/*.py")), "families are data"
