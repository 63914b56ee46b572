"""What the tests of plans share: random PDOs, and a device of the standard's rules in a few lines."""

from __future__ import annotations

from collections.abc import Iterable

from hypothesis import strategies as st

from dvtcli.domain.cob_id import CobId
from dvtcli.domain.pdo import Direction, Pdo, PdoCommunicationParameter, PdoConfig, PdoMappingEntry
from dvtcli.domain.plan import Step

Memory = dict[tuple[int, int], bytes]

cob_ids = st.one_of(
    st.integers(0, 0xFFFF_FFFF),
    st.sampled_from([0x201, 0x8000_0201, 0x4000_0181, 0xC000_0181, 0x8000_0181]),
).map(CobId.from_raw)
entries = st.builds(PdoMappingEntry.from_raw, st.integers(0, 0xFFFF_FFFF))
mappings = st.lists(entries, max_size=8).map(tuple)
pdos = st.builds(Pdo, st.sampled_from(Direction), st.integers(1, 512))


@st.composite
def config_pairs(draw: st.DrawFn) -> tuple[PdoConfig, PdoConfig]:
    """Two configurations of one PDO: both have the same optional sub-indices, and share what chance wants."""
    present = [draw(st.booleans()) for _ in range(4)]

    def config() -> PdoConfig:
        limits = (0xFF, 0xFFFF, 0xFFFF, 0xFF)
        values = [draw(st.integers(0, top)) if there else None for top, there in zip(limits, present, strict=True)]
        return PdoConfig(PdoCommunicationParameter(draw(cob_ids), *values), draw(mappings))

    a, b = config(), config()
    communication = PdoCommunicationParameter(
        *(
            getattr(a.communication if draw(st.booleans()) else b.communication, name)
            for name in ("cob_id", "transmission_type", "inhibit_time", "event_timer", "sync_start_value")
        )
    )
    return a, PdoConfig(communication, a.mapping if draw(st.booleans()) else b.mapping)


configs = config_pairs().map(lambda pair: pair[0])


def memory_of(pdo: Pdo, config: PdoConfig) -> Memory:
    """The objects that a device in this configuration holds."""
    communication, index = config.communication, pdo.communication_index
    rows = (
        (1, 4, communication.cob_id.raw),
        (2, 1, communication.transmission_type),
        (3, 2, communication.inhibit_time),
        (5, 2, communication.event_timer),
        (6, 1, communication.sync_start_value),
    )
    memory = {(index, sub): value.to_bytes(size, "little") for sub, size, value in rows if value is not None}
    memory[pdo.mapping_index, 0] = bytes([len(config.mapping)])
    for number, entry in enumerate(config.mapping, 1):
        memory[pdo.mapping_index, number] = entry.raw.to_bytes(4, "little")
    return memory


class ModelDevice:
    """One PDO that accepts exactly what CiA 301 does; a step against the rules is an AssertionError."""

    def __init__(self, pdo: Pdo, config: PdoConfig) -> None:
        self.pdo = pdo
        self.memory = memory_of(pdo, config)

    @property
    def valid(self) -> bool:
        return not self.memory[self.pdo.communication_index, 1][3] & 0x80

    @property
    def count(self) -> int:
        return self.memory[self.pdo.mapping_index, 0][0]

    def run(self, steps: Iterable[Step]) -> None:
        for step in steps:
            self.write(step)

    def write(self, step: Step) -> None:
        key = (step.index, step.sub_index)
        assert step.before in (None, self.memory.get(key)), f"{step.object} does not hold what the step says"
        if step.index == self.pdo.mapping_index:
            assert not self.valid, "the mapping of a valid PDO is frozen"
            assert step.sub_index == 0 or self.count == 0, "entries change only with count 0"
        else:
            assert key in self.memory, f"there is no {step.object}"
            if step.sub_index == 1 and self.valid and not step.after[3] & 0x80:
                assert step.after == self.memory[key], "the COB-ID of a valid PDO is frozen"
            assert not (self.valid and step.sub_index in (3, 6)), "inhibit time and SYNC start need a disabled PDO"
        self.memory[key] = step.after

    def holds(self, config: PdoConfig) -> bool:
        """Whether everything that counts reads as in *config*; entries past the count are ignored."""
        return all(self.memory.get(key) == value for key, value in memory_of(self.pdo, config).items())
