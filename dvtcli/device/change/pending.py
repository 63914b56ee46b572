"""What a node holds in RAM only, and why it must not be stored now. Knows labels and reasons; reads no device."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field

from dvtcli.domain.several import join_some

#: Sub-index of 0x1010 and 0x1011 -> first and last index it covers (CiA 301, 7.5.2.13); 4 and up are the maker's.
GROUPS = {1: (0x0000, 0xFFFF), 2: (0x1000, 0x1FFF), 3: (0x6000, 0x9FFF)}
EVERYTHING, COMMUNICATION = 1, 2

#: Causes of a suspicion: what ends one does not end another.
CHANGE, VERIFY, REBOOT = "change", "verify", "reboot"


@dataclass(slots=True)
class Pending:
    """*unstored* has the label of each unstored change with its object's index; *suspicions* a reason by cause."""

    unstored: dict[str, int] = field(default_factory=dict)
    suspicions: dict[str, str] = field(default_factory=dict)
    #: how many changes of this session were made before the last store
    stored_at: int = 0
    #: how often it stored, or was about to, whatever there was to store
    stores: int = 0
    #: a part was stored since then, so that no number of changes stands for what is stored
    partly_stored: bool = False
    #: how many had been made when a reset took what was not stored of them
    lost_until: int = 0
    #: boot-up messages seen when the node was last known to hold what this session set; None before that
    boot_ups: int | None = None

    def of_others(self, unstored: Mapping[str, int]) -> None:
        """Other processes changed *unstored*, labels with their indices, and the node still holds it."""
        own = {label: index for label, index in self.unstored.items() if label not in unstored}
        self.unstored = {**unstored, **own}

    def changed(self, label: str, index: int) -> None:
        """The object at *index*, called *label*, was changed in RAM."""
        self.unstored[label] = index

    def covered(self, group: int) -> tuple[str, ...]:
        """Labels of the unstored changes that *group* (a sub-index of 0x1010) covers; none of a maker's own group."""
        low, high = GROUPS.get(group, (1, 0))
        return tuple(label for label, index in self.unstored.items() if low <= index <= high)

    def forget(self, group: int) -> tuple[str, ...]:
        """What *group* covers is stored, or lost: it is no longer pending. Returns its labels."""
        labels = self.covered(group)
        for label in labels:
            del self.unstored[label]
        return labels

    def was_stored(self, group: int, changes: int) -> tuple[str, ...]:
        """*group* was stored after *changes* of this session. Returns the labels of what was pending of it."""
        self.stores += 1
        labels = self.forget(group)
        if not self.unstored:
            self.stored_at, self.partly_stored = changes, False
        elif labels or group not in GROUPS:  # nobody says what a maker's own group took
            self.partly_stored = True
        return labels

    def was_not_kept(self, stored_at: int) -> None:
        """The last store kept nothing of what it took: what is stored is what was after *stored_at* changes."""
        self.stored_at = stored_at

    def was_restored(self, changes: int) -> None:
        """Its defaults were restored, or not, and it was reset, after *changes* of this session: none of them counts.

        What it holds then is what was read, and no number of changes stands for that.
        """
        self.stored_at, self.lost_until, self.partly_stored = 0, changes, True

    def is_as_stored(self, changes: int) -> bool:
        """Whether a node on which *changes* of this session are left holds what is stored, or what was found."""
        return changes == self.stored_at and not self.partly_stored

    def was_reset(self, group: int, boot_ups: int) -> tuple[str, ...]:
        """The node was reset on purpose and is back: returns what is lost. A whole reset ends every suspicion."""
        self.boot_ups = boot_ups
        if group == EVERYTHING:
            self.suspicions.clear()
        return self.forget(group)

    def lost(self, labels: tuple[str, ...]) -> None:
        """The node does not hold *labels* any more, which were not stored: nothing may be stored by itself then."""
        self.unstored = {label: index for label, index in self.unstored.items() if label not in labels}
        self.suspicions[REBOOT] = f"it does not hold any more what was not stored ({join_some(labels)})"

    def rebooted(self, boot_ups: int) -> tuple[str, ...]:
        """Whether the node restarted by itself: returns what is lost, and remembers why nothing may be stored then."""
        known, self.boot_ups = self.boot_ups, boot_ups
        if known is None or known == boot_ups:
            return ()
        lost = self.forget(EVERYTHING)
        if lost:
            self.suspicions[REBOOT] = f"it restarted, and what was not stored is lost ({join_some(lost)})"
        return lost
