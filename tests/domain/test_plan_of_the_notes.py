"""The vendors' worked examples: what must be written, and how the objects read afterwards."""

from __future__ import annotations

from dataclasses import replace

import pytest
from hypothesis import given
from hypothesis import strategies as st

from dvtcli.domain.cob_id import CobId
from dvtcli.domain.pdo import Pdo, PdoCommunicationParameter, PdoConfig, PdoMappingEntry
from dvtcli.domain.plan import plan_pdo
from tests.domain.configs import ModelDevice, configs

Row = tuple[int, int, int, int]


def config(cob_id: int, *words: int, **parameters: int) -> PdoConfig:
    entries = tuple(PdoMappingEntry.from_raw(word) for word in words)
    return PdoConfig(PdoCommunicationParameter(CobId.from_raw(cob_id), **parameters), entries)


@pytest.mark.parametrize(
    ("pdo", "before", "after", "rows"),
    [
        pytest.param(
            "rpdo3",
            config(0x4000_0401, 0x6040_0010),
            config(0x4000_0401, 0x607A_0020, 0x2703_0120),
            [
                (0x1402, 1, 0xC0000401, 4),
                (0x1602, 0, 0x00, 1),
                (0x1602, 1, 0x607A0020, 4),
                (0x1602, 2, 0x27030120, 4),
                (0x1602, 0, 0x02, 1),
                (0x1402, 1, 0x40000401, 4),
            ],
            id="Trinamic AN076, example 4.1",
        ),
        pytest.param(
            "tpdo1",
            config(0x4000_0181, 0x6041_0010),
            config(0x4000_0181, 0x6041_0010, 0x6061_0008, 0x6064_0020),
            [
                (0x1800, 1, 0xC0000181, 4),
                (0x1A00, 0, 0x00, 1),
                (0x1A00, 1, 0x60410010, 4),
                (0x1A00, 2, 0x60610008, 4),
                (0x1A00, 3, 0x60640020, 4),
                (0x1A00, 0, 0x03, 1),
                (0x1800, 1, 0x40000181, 4),
            ],
            id="Trinamic AN076, example 4.2",
        ),
        pytest.param(
            "tpdo1",
            config(0x181, 0x6041_0010, transmission_type=255, inhibit_time=0, event_timer=0),
            config(0x201, 0x6C01_0110, 0x606C_0020, 0x6041_0010, transmission_type=1, inhibit_time=0, event_timer=0),
            [
                (0x1800, 1, 0x80000181, 4),
                (0x1800, 2, 1, 1),
                (0x1A00, 0, 0, 1),
                (0x1A00, 1, 0x6C010110, 4),
                (0x1A00, 2, 0x606C0020, 4),
                (0x1A00, 3, 0x60410010, 4),
                (0x1A00, 0, 3, 1),
                (0x1800, 1, 0x201, 4),
            ],
            id="Sevcon PDO Fundamentals, 3.1 and 3.2, from the factory's TPDO1",
        ),
        pytest.param(
            "rpdo1",
            config(0x8000_0201, transmission_type=255),
            config(0x201, 0x0003_0010, 0x2020_0420, 0x2020_0210, transmission_type=255),
            [
                (0x1600, 1, 0x00030010, 4),
                (0x1600, 2, 0x20200420, 4),
                (0x1600, 3, 0x20200210, 4),
                (0x1600, 0, 3, 1),
                (0x1400, 1, 0x201, 4),
            ],
            id="Sevcon PDO Fundamentals, 4.1 and 4.2, from a disabled and empty RPDO1",
        ),
    ],
)
def test_downloads_of_the_notes(pdo: str, before: PdoConfig, after: PdoConfig, rows: list[Row]) -> None:
    steps = plan_pdo(Pdo.parse(pdo), before, after).steps
    assert [(s.index, s.sub_index, int.from_bytes(s.after, "little"), len(s.after)) for s in steps] == rows


@pytest.mark.parametrize(
    ("pdo", "wanted", "rows", "frame_length"),
    [
        pytest.param(
            "tpdo1",
            config(0x201, 0x6C01_0110, 0x606C_0020, 0x6041_0010, transmission_type=1, inhibit_time=0, event_timer=0),
            [
                (0x1A00, 0, 0x03, 1),
                (0x1A00, 1, 0x6C010110, 4),
                (0x1A00, 2, 0x606C0020, 4),
                (0x1A00, 3, 0x60410010, 4),
                (0x1800, 1, 0x00000201, 4),
                (0x1800, 2, 0x01, 1),
                (0x1800, 3, 0x0000, 2),
                (0x1800, 5, 0x0000, 2),
            ],
            8,
            id="Sevcon PDO Fundamentals, 3.1 and 3.2",
        ),
        pytest.param(
            "rpdo1",
            config(0x201, 0x0003_0010, 0x2020_0420, 0x2020_0210, transmission_type=255),
            [
                (0x1600, 0, 0x03, 1),
                (0x1600, 1, 0x00030010, 4),
                (0x1600, 2, 0x20200420, 4),
                (0x1600, 3, 0x20200210, 4),
                (0x1400, 1, 0x00000201, 4),
                (0x1400, 2, 0xFF, 1),
            ],
            8,
            id="Sevcon PDO Fundamentals, 4.1 and 4.2",
        ),
        pytest.param(
            "tpdo1",
            config(0x4000_0181, 0x2100_0110, 0x2100_0210, 0x210D_0110, 0x210F_0108),
            [
                (0x1A00, 0, 0x04, 1),
                (0x1A00, 1, 0x21000110, 4),
                (0x1A00, 2, 0x21000210, 4),
                (0x1A00, 3, 0x210D0110, 4),
                (0x1A00, 4, 0x210F0108, 4),
            ],
            7,
            id="RoboteQ, PDO mapping",
        ),
        pytest.param(
            "tpdo1",
            config(0x181, 0x6401_0110, 0x6401_0210, 0x6000_0108),
            [(0x1A00, 1, 0x64010110, 4), (0x1A00, 2, 0x64010210, 4), (0x1A00, 3, 0x60000108, 4)],
            5,
            id="ByteMe, producer",
        ),
    ],
)
@given(data=st.data())
def test_end_states_of_the_notes_from_anywhere(
    data: st.DataObject, pdo: str, wanted: PdoConfig, rows: list[Row], frame_length: int
) -> None:
    """Whatever the PDO held before, the note's objects read as printed afterwards; sub 4 is never touched."""
    start, where = data.draw(configs), Pdo.parse(pdo)
    kept = {
        name: None if getattr(wanted.communication, name) is None else getattr(start.communication, name) or 0
        for name in ("transmission_type", "inhibit_time", "event_timer", "sync_start_value")
    }
    start = replace(start, communication=PdoCommunicationParameter(start.communication.cob_id, **kept))
    steps = plan_pdo(where, start, wanted).steps
    device = ModelDevice(where, start)
    device.run(steps)
    assert [device.memory[i, sub] for i, sub, _, _ in rows] == [v.to_bytes(n, "little") for _, _, v, n in rows]
    assert not [step for step in steps if step.object in ("1800:04", "1400:04")]
    assert (wanted.bits + 7) // 8 == frame_length
