"""The changes a node holds in RAM only, and whether RAM still equals what the node booted with."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field

from dvtcli.domain.pdo import Pdo, PdoConfig
from dvtcli.domain.text import join_some

#: Sub-index of 0x1010 and 0x1011 -> first and last index it covers (CiA 301, 7.5.2.13); 4 and up are the maker's.
GROUPS = {1: (0x0000, 0xFFFF), 2: (0x1000, 0x1FFF), 3: (0x6000, 0x9FFF)}
EVERYTHING, COMMUNICATION = 1, 2
#: Causes of a suspicion: what ends one does not end another.
CHANGE, VERIFY, REBOOT = "change", "verify", "reboot"


@dataclass(slots=True, eq=False, repr=False)
class Pending:
    """*unstored* maps the label of each unstored change to its index; *suspicions* maps causes to reasons."""

    unstored: dict[str, int] = field(default_factory=dict)
    suspicions: dict[str, str] = field(default_factory=dict)
    #: how many changes of this session were made before the last store
    stored_at: int = 0
    #: the number of stores, also intended and empty
    stores: int = 0
    #: a partial store happened since: no number of changes describes the stored values
    partly_stored: bool = False
    #: the number of changes at the last reset that cleared unstored changes
    lost_until: int = 0
    #: boot-ups when the node last had this session's changes; None before
    boot_ups: int | None = None

    def of_others(self, unstored: Mapping[str, int]) -> None:
        """Record *unstored* (labels with indices), changed by other processes and still present in the node."""
        own = {label: index for label, index in self.unstored.items() if label not in unstored}
        self.unstored = {**unstored, **own}

    def changed(self, label: str, index: int) -> None:
        """Record a change in RAM to the object at *index*, called *label*."""
        self.unstored[label] = index

    def covered(self, group: int) -> tuple[str, ...]:
        """Labels of the unstored changes covered by *group* (a sub-index of 0x1010); empty for a manufacturer group."""
        low, high = GROUPS.get(group, (1, 0))
        return tuple(label for label, index in self.unstored.items() if low <= index <= high)

    def forget(self, group: int) -> tuple[str, ...]:
        """Drop the changes covered by *group*, stored or lost, and return their labels."""
        labels = self.covered(group)
        for label in labels:
            del self.unstored[label]
        return labels

    def was_stored(self, group: int, changes: int) -> tuple[str, ...]:
        """Record a store of *group* after *changes* of this session and return the labels of changes now stored."""
        self.stores += 1
        labels = self.forget(group)
        if not self.unstored:
            self.stored_at, self.partly_stored = changes, False
        elif labels or group not in GROUPS:  # nobody says what a maker's own group took
            self.partly_stored = True
        return labels

    def was_not_kept(self, stored_at: int) -> None:
        """Record that the last store saved nothing: the stored state is from after *stored_at* changes."""
        self.stored_at = stored_at

    def was_restored(self, changes: int) -> None:
        """Record a restore of defaults (even a failed one) and a reset after *changes* of this session.

        These changes no longer count, and only a read tells the node's values.
        """
        self.stored_at, self.lost_until, self.partly_stored = 0, changes, True

    def is_as_stored(self, changes: int) -> bool:
        """True if a node with *changes* of this session equals the stored, or the initial, values."""
        return changes == self.stored_at and not self.partly_stored

    def was_reset(self, group: int, boot_ups: int) -> tuple[str, ...]:
        """Record a completed requested reset and return the losses. A full reset ends every suspicion."""
        self.boot_ups = boot_ups
        if group == EVERYTHING:
            self.suspicions.clear()
        return self.forget(group)

    def lost(self, labels: tuple[str, ...]) -> None:
        """Record *labels* as lost before they were stored: no automatic store from now on."""
        self.unstored = {label: index for label, index in self.unstored.items() if label not in labels}
        self.suspicions[REBOOT] = f"it lost unstored values ({join_some(labels)})"

    def rebooted(self, boot_ups: int) -> tuple[str, ...]:
        """Return the labels lost by an unexpected restart, and record why nothing may be stored."""
        known, self.boot_ups = self.boot_ups, boot_ups
        if known is None or known == boot_ups:
            return ()
        lost = self.forget(EVERYTHING)
        if lost:
            self.suspicions[REBOOT] = f"it restarted, and unstored values are lost ({join_some(lost)})"
        return lost


@dataclass(slots=True, eq=False, repr=False)
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
            return "no boot-up message was received"
        if boot_ups != self.boot_ups:
            return "its PDOs were not read after its last boot-up"
        if self.written:
            return "it was written since its last boot-up"
        if now.keys() - self.pdos.keys():
            return "not all its PDOs were read after its last boot-up"
        gone = [pdo.label for pdo in self.pdos if pdo not in now]
        if gone:
            return f"{join_some(gone)} had a value at boot and can no longer be read"
        if any(config.untold for config in now.values()):
            return "not all of its PDOs could be read"
        return "" if self.pdos == now else "its PDOs differ from their values at boot"
