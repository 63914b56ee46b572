"""A line's parts in the columns that there are."""

from __future__ import annotations

from dvtcli.cli.prompt.status import StatusPart, fitted

PARTS = [
    StatusPart(3, "", ("socketcan:can0", "can0")),
    StatusPart(9, "bad", ("NO HEARTBEAT",)),
    StatusPart(1, "", ("F1 help", "")),
]


def shown(width: int) -> list[str]:
    return [text for _, text in fitted(PARTS, width)]


def test_the_least_important_part_gives_way_first() -> None:
    assert shown(80) == ["socketcan:can0", "NO HEARTBEAT", "F1 help"]
    assert shown(39) == ["socketcan:can0", "NO HEARTBEAT"]
    assert shown(25) == ["can0", "NO HEARTBEAT"]
    assert shown(3) == ["can0", "NO HEARTBEAT"]
    assert fitted([], 80) == []
