"""What is known of one node of a network, and what was heard of it."""

from __future__ import annotations

import pytest

from dvtcli.domain.cob_id import CobId
from dvtcli.domain.network.network_state import NodeState
from dvtcli.domain.network.received_traffic import ReceivedTraffic
from dvtcli.domain.pdo import Pdo, PdoCommunicationParameter, PdoConfig, PdoMappingEntry
from dvtcli.domain.ports import Frame

ENTRY = PdoMappingEntry(0x6041, 0, 16)
NODE = NodeState(
    5,
    pdos={Pdo.parse("tpdo1"): PdoConfig(PdoCommunicationParameter(CobId(0x185), 254, 100, 50, 3), (ENTRY,))},
    numbers={(0x1017, 0): 500, (0x1801, 1): 0x285, (0x1800, 2): 1},
)


@pytest.mark.parametrize(
    ("index", "sub_index", "held"),
    [
        (0x1800, 1, 0x185), (0x1800, 2, 254), (0x1800, 3, 100), (0x1800, 5, 50), (0x1800, 6, 3), (0x1800, 4, None),
        (0x1A00, 0, 1), (0x1A00, 1, ENTRY.raw), (0x1A00, 2, None),
        (0x1801, 1, 0x285), (0x1801, 2, None), (0x1017, 0, 500), (0x1018, 1, None),
    ],
)  # fmt: skip
def test_of_a_pdo_that_is_known_its_parameters_are_and_of_others_what_objects_hold(
    index: int, sub_index: int, held: int | None
) -> None:
    assert NODE.holds(index, sub_index) == held


def test_emergencies_are_counted_by_node_and_code() -> None:
    traffic = ReceivedTraffic(1.0, 0)
    for can_id, data in ((0x085, "10 82 11"), (0x085, "10 82 11"), (0x085, "00 00"), (0x089, "30 81")):
        traffic.add(Frame(can_id, bytes.fromhex(data)))
    assert {node: dict(codes) for node, codes in traffic.emergencies.items()} == {
        5: {0x8210: 2, 0: 1},
        9: {0x8130: 1},
    }
