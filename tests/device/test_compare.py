"""How one configuration of a PDO differs from another, in words."""

from __future__ import annotations

from dataclasses import replace

import pytest

from dvtcli.device.target_config import differences
from dvtcli.domain.cob_id import CobId
from dvtcli.domain.pdo import Pdo, PdoCommunicationParameter, PdoConfig, PdoMappingEntry

TPDO1 = Pdo.parse("tpdo1")
STATUSWORD, POSITION = PdoMappingEntry(0x6041, 0, 16), PdoMappingEntry(0x6064, 0, 32)
COB_ID, COUNT, THIRD = ((0x1800, 1),), ((0x1A00, 0),), ((0x1A00, 3),)
WANTED = PdoConfig(PdoCommunicationParameter(CobId(0x181), 255, 10, 20, 1), (STATUSWORD, POSITION))


def held(**parameters: object) -> PdoConfig:
    return WANTED.with_parameters(**parameters)  # type: ignore[arg-type]


@pytest.mark.parametrize(
    ("wanted", "found", "texts"),
    [
        (WANTED, WANTED, []),
        (WANTED, held(cob_id=CobId(0x182)), ["COB-ID is 0x00000182, expected 0x00000181"]),
        (WANTED, held(transmission_type=1, inhibit_time=None),
         ["transmission type is 1, expected 255", "inhibit time is None, expected 10"]),
        (WANTED, held(event_timer=21, sync_start_value=0),
         ["event timer is 21, expected 20", "SYNC start value is 0, expected 1"]),
        (WANTED, replace(WANTED, unread=COB_ID), ["its COB-ID 0x1800:01 cannot be read"]),
        (WANTED, replace(WANTED, unread=COUNT), ["its mapping 0x1A00:00 cannot be read"]),
        (WANTED, replace(WANTED, unread=(*COB_ID, *COUNT)),
         ["its COB-ID 0x1800:01 cannot be read", "its mapping 0x1A00:00 cannot be read"]),
        (replace(WANTED, unread=COB_ID), held(event_timer=21), []),
        (replace(WANTED, unread=COUNT), replace(WANTED, mapping=()), []),
        (WANTED, replace(WANTED, mapping=(POSITION,)), ["0x1A00 is 6064:00/32, expected 6041:00/16 6064:00/32"]),
        (replace(WANTED, mapping=()), WANTED, ["0x1A00 is 6041:00/16 6064:00/32, expected nothing"]),
        (WANTED, replace(WANTED, held_count=3, unread=THIRD), ["0x1A00:00 (count) is 3, expected 2"]),
        (replace(WANTED, held_count=3, unread=THIRD), replace(WANTED, held_count=4, unread=THIRD),
         ["0x1A00:00 (count) is 4, expected 3"]),
        (replace(WANTED, held_count=3, unread=THIRD), replace(WANTED, held_count=3, unread=THIRD), []),
        (replace(WANTED, held_count=3, unread=THIRD), WANTED, ["0x1A00:00 (count) is 2, expected 3"]),
    ],
)  # fmt: skip
def test_what_differs_is_said_with_both_sides(wanted: PdoConfig, found: PdoConfig, texts: list[str]) -> None:
    assert differences(TPDO1, wanted, found) == texts
