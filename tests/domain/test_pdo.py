from __future__ import annotations

import pytest
from hypothesis import given
from hypothesis import strategies as st

from dvtcli.domain.cob_id import CobId
from dvtcli.domain.pdo import (
    Direction,
    Pdo,
    PdoCommunicationParameter,
    PdoConfig,
    PdoMappingEntry,
    is_mpdo,
    transmission_type_text,
)

TPDO, RPDO = Direction.TPDO, Direction.RPDO
pdos = st.builds(Pdo, st.sampled_from(Direction), st.integers(1, 512))


@pytest.mark.parametrize(
    ("text", "pdo"),
    [("tpdo1", Pdo(TPDO, 1)), ("RPDO512", Pdo(RPDO, 512)), ("TxPdo3", Pdo(TPDO, 3)), (" rpdo2 ", Pdo(RPDO, 2))],
)
def test_parse(text: str, pdo: Pdo) -> None:
    assert Pdo.parse(text) == pdo


@pytest.mark.parametrize("text", ["tpdo0", "rpdo513", "tpdo", "pdo1", "xpdo1", "tpdo-1", "tpdo1x", "", "tpdo¹", "1"])
def test_what_is_no_pdo_is_refused(text: str) -> None:
    with pytest.raises(ValueError, match="512"):
        Pdo.parse(text)


@given(pdos)
def test_what_is_shown_can_be_typed(pdo: Pdo) -> None:
    assert Pdo.parse(str(pdo)) == Pdo.parse(pdo.label) == pdo


@given(pdos)
def test_indices_lead_back(pdo: Pdo) -> None:
    assert Pdo.at(pdo.communication_index) == Pdo.at(pdo.mapping_index) == pdo


@pytest.mark.parametrize("index", [0x13FF, 0x1BFF + 1, 0x6000, 0])
def test_no_pdo_elsewhere(index: int) -> None:
    assert Pdo.at(index) is None


@pytest.mark.parametrize(
    ("text", "communication", "mapping", "can_id"),
    [
        ("rpdo1", 0x1400, 0x1600, 0x205),
        ("rpdo2", 0x1401, 0x1601, 0x305),
        ("rpdo3", 0x1402, 0x1602, 0x405),
        ("rpdo4", 0x1403, 0x1603, 0x505),
        ("rpdo5", 0x1404, 0x1604, None),
        ("rpdo512", 0x15FF, 0x17FF, None),
        ("tpdo1", 0x1800, 0x1A00, 0x185),
        ("tpdo2", 0x1801, 0x1A01, 0x285),
        ("tpdo3", 0x1802, 0x1A02, 0x385),
        ("tpdo4", 0x1803, 0x1A03, 0x485),
        ("tpdo512", 0x19FF, 0x1BFF, None),
    ],
)
def test_objects_and_default_can_ids(text: str, communication: int, mapping: int, can_id: int | None) -> None:
    pdo = Pdo.parse(text)
    assert (pdo.communication_index, pdo.mapping_index) == (communication, mapping)
    assert pdo.default_can_id(5) == can_id


@pytest.mark.parametrize(
    ("value", "tpdo", "rpdo"),
    [
        (0, "acyclic, synchronous", "synchronous"),
        (1, "every SYNC", "synchronous"),
        (240, "every 240 SYNCs", "synchronous"),
        (241, "reserved", "reserved"),
        (251, "reserved", "reserved"),
        (252, "on RTR, synchronous", "reserved"),
        (253, "on RTR", "reserved"),
        (254, "event-driven", "immediate"),
        (255, "event-driven", "immediate"),
    ],
)
def test_transmission_types(value: int, tpdo: str, rpdo: str) -> None:
    assert (transmission_type_text(value, TPDO), transmission_type_text(value, RPDO)) == (tpdo, rpdo)


def test_count_and_bits() -> None:
    entries = (PdoMappingEntry(0x6041, 0, 16), PdoMappingEntry(0x6061, 0, 8))
    config = PdoConfig(PdoCommunicationParameter(CobId(0x181)), entries)
    assert (config.count, config.bits, config.enabled) == (2, 24, True)
    assert PdoConfig(config.communication, (), mpdo=0xFE).count == 0xFE
    assert [count for count in (0, 64, 0xFD, 0xFE, 0xFF) if is_mpdo(count)] == [0xFE, 0xFF]
