"""What is known of a node's PDOs: what was read of them, and what this session last set them to.

Reads, and says how old that is. Does not judge, and does not write.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping
from contextlib import suppress
from dataclasses import dataclass, field

from dvtcli.device.came_up import CameUp
from dvtcli.device.missing import no_pdo
from dvtcli.device.reached import Reached
from dvtcli.device.read_pdos import WHATEVER, present_pdos, read_pdo
from dvtcli.domain.pdo import Pdo, PdoConfig
from dvtcli.errors import BusUnavailable, SdoAborted


@dataclass(slots=True)
class KnownPdos(Reached):
    """A node, its PDOs as they are read, and as they were last read or set."""

    #: the wanted state of what this session changed: what `verify` compares with
    wanted: dict[Pdo, PdoConfig] = field(default_factory=dict)
    #: the same of single objects that are no part of a PDO and can be read back
    wanted_values: dict[tuple[int, int], bytes] = field(default_factory=dict)
    #: what it came up with, for `store --if-changed`
    came_up: CameUp = field(default_factory=CameUp)
    #: the other nodes that this session knows
    neighbours: Callable[[], Iterable[KnownPdos]] = tuple
    _pdos: dict[Pdo, PdoConfig] = field(default_factory=dict, init=False)
    _present: list[Pdo] | None = field(default=None, init=False)
    _boot_ups: int = field(default=0, init=False)

    def present(self) -> list[Pdo]:
        """The PDOs the node has, TPDOs first."""
        if self._present is None:
            self._present = present_pdos(self.sdo, self.dictionary)
        return self._present

    def pdos(self) -> dict[Pdo, PdoConfig]:
        """Every PDO as the device holds it now, in one life of it; one that the EDS lists and it lacks is left out.

        One of which something cannot be read is inconsistent, and among them.
        """
        boot_ups = self.bus.boot_ups(self.node_id)
        self._pdos = self.observed(self._read_pdos)
        if self.bus.boot_ups(self.node_id) == boot_ups:
            self.came_up.read(boot_ups, self._pdos)
        return dict(self._pdos)

    def _read_pdos(self) -> dict[Pdo, PdoConfig]:
        found: dict[Pdo, PdoConfig] = {}
        for pdo in self.present():
            with suppress(SdoAborted):  # it has neither COB-ID nor mapping: no such PDO
                found[pdo] = read_pdo(self.sdo, pdo, WHATEVER)
        return found

    def pdo(self, pdo: Pdo) -> PdoConfig:
        """One PDO as the device holds it now; UsageError where the node has no such PDO."""
        try:
            config = self.observed(lambda: read_pdo(self.sdo, pdo))
        except SdoAborted as aborted:
            raise no_pdo(self.node_id, pdo, self.present(), aborted) from aborted
        self._pdos[pdo] = config
        return config

    def known_pdos(self) -> Mapping[Pdo, PdoConfig]:
        """The node's PDOs as last read; read anew once a boot-up was seen, since a reset changes them."""
        boot_ups = self.bus.boot_ups(self.node_id)
        if boot_ups != self._boot_ups or not self._pdos.keys() >= set(self.present()):
            self._boot_ups = boot_ups
            self.pdos()
        return self._pdos

    @property
    def last_read(self) -> Mapping[Pdo, PdoConfig]:
        """What was last read of the PDOs; reads nothing."""
        return self._pdos

    def present_known(self) -> list[Pdo]:
        """The PDOs that are known without asking the node: those of the EDS, or those that were read."""
        return self._present or list(self._pdos)

    def tpdos_known(self) -> list[PdoConfig]:
        """The TPDOs as this session set or last read them; reads nothing."""
        return [config for pdo, config in {**self._pdos, **self.wanted}.items() if pdo.is_tpdo]

    def is_dynamic(self, pdo: Pdo) -> bool:
        """Whether the EDS lets the mapping of *pdo* be changed; True where there is none."""
        entry = self.dictionary.entry(pdo.mapping_index, 0) if self.dictionary else None
        return entry is None or entry.access.writable

    def read_anew(self) -> None:
        """What was read may be old: the next question is asked of the node."""
        self._pdos.clear()

    def forget(self) -> None:
        """Drop what was read: the device was written, or may hold something else now."""
        self.read_anew()
        with suppress(BusUnavailable):  # a dead bus stays dead: nothing will be stored over it
            self.came_up.wrote(self.bus.boot_ups(self.node_id))

    def commanded(self) -> None:
        """An NMT command was sent by hand: the gate no longer knows the state, and what was read may be old."""
        self._gate = None
        self.read_anew()
