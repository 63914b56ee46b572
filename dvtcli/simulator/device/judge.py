"""Whether a device takes an SDO download: existence, access, length, and what each of its services says to the value.

Knows the order in which they are asked. Does not know what any of them refuses, nor what a value does
(`strict_device`).
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import Protocol

from dvtcli.domain.abort import Abort
from dvtcli.domain.nmt import NmtState
from dvtcli.domain.object_dictionary import OdEntry
from dvtcli.domain.pdo import Pdo
from dvtcli.simulator.device.entry_guard import refuse
from dvtcli.simulator.device.family import Family
from dvtcli.simulator.device.gates import Gates
from dvtcli.simulator.device.limits import check_limits
from dvtcli.simulator.device.memory import Memory
from dvtcli.simulator.device.parameter_areas import ParameterAreas
from dvtcli.simulator.device.pdo_checks import limit_check
from dvtcli.simulator.device.pdo_guard import PdoGuard
from dvtcli.simulator.device.refusal import Refusal


class DeviceService(Protocol):
    """A part of the device with objects of its own, such as SYNC or EMCY."""

    def check(self, index: int, _sub_index: int, data: bytes, /) -> None:
        """Raise Refusal where *data* may not be written to one of them."""
        ...


class Judge:
    """Judges the downloads to one device; *services* are asked after the PDO rules and the file's limits."""

    def __init__(
        self, memory: Memory, family: Family, gates: Gates, store: ParameterAreas, services: Sequence[DeviceService]
    ) -> None:
        self._memory = memory
        self._family = family
        self._gates = gates
        self._store = store
        self._services = tuple(services)
        self._guard = PdoGuard(memory, family)

    def check_access(self, index: int, sub_index: int, size: int | None) -> None:
        """Raise Refusal for what is hopeless whatever the value; *size* is in bytes, None where it is not known."""
        self._memory.require(index, sub_index)
        entry = self._memory.entry(index, sub_index)
        if entry is not None and not entry.access.writable:
            raise Refusal(Abort.READ_ONLY)
        wanted = self._memory.size(index, sub_index)
        if wanted is None or size is None or size == wanted:
            return
        raise Refusal(Abort.TOO_LONG if size > wanted else Abort.TOO_SHORT)

    def check_value(self, index: int, sub_index: int, data: bytes, state: NmtState) -> None:
        """Raise Refusal for *data*; state and PDO rules come before the file's limits: their abort codes say more."""
        self._gates.check(index, state)
        if self._family.pdo_rules_always or state is NmtState.OPERATIONAL:
            self._guard.check(index, sub_index, data)
        entry = self._memory.entry(index, sub_index)
        if entry is not None and not self._store.handles(index, sub_index):
            self._check_limits(entry, data)
        for service in self._services:
            service.check(index, sub_index, data)
        self._gates.check_selection(index, sub_index, data)

    def _check_limits(self, entry: OdEntry, data: bytes) -> None:
        """The file's limits; of a PDO's parameter the family may have another answer, or none."""
        try:
            check_limits(entry, self._memory.node_id, data)
        except Refusal as outside:
            pdo = Pdo.at(entry.index)
            check = limit_check(entry.index, entry.sub_index, outside.code)
            if pdo is None or not check:
                raise
            refuse(self._family, pdo, check, outside.code)
