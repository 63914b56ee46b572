"""How much `plan` and `apply` read of each node of a network: once each before its first write, then what proves it.

What a PDO became is read whole before anything is enabled, and once more after the last write to any node, since only
that proves it; in between its COB-ID, where that was written.
"""

from __future__ import annotations

from collections import Counter
from pathlib import Path

import pytest

from dvtcli.domain.pdo import Pdo
from tests.harness.sample import heavy
from tests.operations.network.bench import Chain
from tests.operations.network.test_many_nodes import Unheard, many

PDOS = [Pdo.parse(f"{direction}{number}") for direction in ("tpdo", "rpdo") for number in range(1, 5)]


#: what the rules of networks look at beside PDOs (`node_state`): SYNC, guarding, TIME, EMCY, and heartbeats
TIMING = ("1005:00", "1006:00", "1007:00", "1019:00", "100C:00", "100D:00", "1012:00", "1014:00", "1015:00", "1016:00",
          "1016:01", "1017:00")  # fmt: skip
#: who it is, what it does after an error, and whether it is the NMT master: of whom is read of a master alone
JUDGED = ("1018:01", "1018:02", "1018:03", "1018:04", "1029:01", "1F80:00")
#: of a node that is written: whether a write makes its stamp void
STAMP = "1020:01"
ONCE = Counter((*TIMING, *JUDGED))


class Counted(Unheard):
    """Counts the SDO uploads of each node before its first download, and after it, by object."""

    counting = False

    def send_sdo(self, can_id: int, data: bytes) -> None:
        if self.counting:
            node_id, place = can_id & 0x7F, f"{int.from_bytes(data[1:3], 'little'):04X}:{data[3]:02X}"
            self.written[node_id] += data[0] >> 5 == 1
            if data[0] >> 5 == 2:
                (self.after if self.written[node_id] else self.before)[node_id][place] += 1
        super().send_sdo(can_id, data)

    def begin(self) -> None:
        """Count from here on."""
        self.counting = True
        self.written: Counter[int] = Counter()
        self.before: dict[int, Counter[str]] = {node.device.node_id: Counter() for node in self.nodes}
        self.after: dict[int, Counter[str]] = {node.device.node_id: Counter() for node in self.nodes}


def counted(chain: Chain, file: Path) -> Counted:
    """What `apply` of *file* reads."""
    bus = chain.bus
    assert isinstance(bus, Counted)
    bus.begin()
    assert chain.apply(file).plan.writes
    return bus


def of(pdos: list[Pdo], objects: Counter[str]) -> Counter[str]:
    indices = {f"{index:04X}" for pdo in pdos for index in (pdo.communication_index, pdo.mapping_index)}
    return Counter({place: count for place, count in objects.items() if place[:4] in indices})


def cob_ids(pdos: list[Pdo]) -> set[str]:
    return {f"{pdo.communication_index:04X}:01" for pdo in pdos}


@heavy
@pytest.mark.parametrize("count", [1, 4])
def test_where_all_pdos_change_each_is_read_whole_twice_after_that(tmp_path: Path, count: int) -> None:
    bus = counted(*many(tmp_path, count, bus=Counted))
    for node_id in range(1, count + 1):
        before, after, own = of(PDOS, bus.before[node_id]), of(PDOS, bus.after[node_id]), cob_ids(PDOS)
        assert set(before.values()) == {2}, "by the plan, and once more by who carries it out"
        assert bus.before[node_id] - before == ONCE + Counter([STAMP]), "what the rules of networks need, each once"
        assert {after[one] for one in set(after) - own} <= {1, 2}, "before it is enabled, and at the end"
        assert {after[one] for one in own} <= {2, 3, 4}, "off, written, on, and at the end"
        assert after.total() == bus.after[node_id].total(), "nothing else is of interest by then"


def test_the_others_are_told_by_their_cob_ids_around_each_part(tmp_path: Path) -> None:
    chain, _ = many(tmp_path, 2, bus=Counted)
    file = tmp_path / "one.yaml"
    file.write_text("a: {node_id: 1, tpdo: {1: {cob_id: 0x1A7, mapping: [6041]}}}\nb: {node_id: 2}\n")
    bus = counted(chain, file)
    others = [pdo for pdo in PDOS if pdo != PDOS[0]]
    after = of(others, bus.after[1])
    assert set(after) == cob_ids(others), "what another PDO has become is looked at on the wire, after the last write"
    before, own = of(PDOS, bus.before[2]), cob_ids(PDOS)
    enabled = {place for pdo in (PDOS[0], PDOS[1], PDOS[4], PDOS[5]) for place in of([pdo], before)}
    assert set(before) <= own | enabled, (
        "which CAN-IDs are in use, and what PDOs that are on send and take, for the rules"
    )
    assert set(before.values()) == {1}, "nobody carries anything out there"
    assert bus.before[2] - before == ONCE, "what the rules of networks need, each once"
    assert not bus.after[2]
