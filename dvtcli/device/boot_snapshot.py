"""Tell whether RAM still equals what the node booted with, to spare the EEPROM an unnecessary store."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field

from dvtcli.domain.pdo import Pdo, PdoConfig
from dvtcli.domain.text import join_some


@dataclass(slots=True)
class BootSnapshot:
    """The PDOs as first read after boot-up number *boot_ups* (0: none received), before any write."""

    boot_ups: int = 0
    pdos: dict[Pdo, PdoConfig] = field(default_factory=dict)
    written: bool = False
    #: the number of writes, across restarts
    writes: int = 0

    def _follow(self, boot_ups: int) -> None:
        if boot_ups != self.boot_ups:
            self.boot_ups, self.pdos, self.written = boot_ups, {}, False

    def read(self, boot_ups: int, found: Mapping[Pdo, PdoConfig]) -> None:
        """Record *found*, read completely after boot-up number *boot_ups*."""
        self._follow(boot_ups)
        if not self.written:
            for pdo, config in found.items():
                self.pdos.setdefault(pdo, config)

    def wrote(self, boot_ups: int) -> None:
        """Record a write, or a possible write, to the node."""
        self._follow(boot_ups)
        self.written = True
        self.writes += 1

    def why_not(self, boot_ups: int, now: Mapping[Pdo, PdoConfig]) -> str:
        """Why *now* may differ from the stored values; empty if equal to the boot values with no write since."""
        if not boot_ups:
            return "no boot-up of the node was heard"
        if boot_ups != self.boot_ups:
            return "its PDOs were not read after its last boot-up"
        if self.written:
            return "it was written since its last boot-up"
        if now.keys() - self.pdos.keys():
            return "not all its PDOs were read after its last boot-up"
        gone = [pdo.label for pdo in self.pdos if pdo not in now]
        if gone:
            return f"{join_some(gone)} came up with it and cannot be read any more"
        if any(config.untold for config in now.values()):
            return "not all of its PDOs could be read"
        return "" if self.pdos == now else "it is not what came up"
