"""A device's store capability (0x1010, 0x1011): probes, and conclusions from the answers. Pure; sends nothing.

Source: CiA 301, 7.5.2.13 and 7.5.2.14. Without a reset it stays unknown whether the values were saved.
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field

from dvtcli.domain.abort import abort_text
from dvtcli.domain.learning.probe import Learnt, Probe, ProbeAnswer, ProbeCondition, ProbeWrite, Stand

STORE, RESTORE = 0x1010, 0x1011
#: Bits of 0x1010:s: saves on command, saves by itself.
_ON_COMMAND, _BY_ITSELF = 1, 2
_SIGNATURE, _WRONG_SIGNATURE = b"save", bytes(4)
#: Names of the probes: the signature to be refused comes first.
WRONG_SIGNATURE, SAVE = "wrong signature", "save"


@dataclass(frozen=True, slots=True)
class Storage:
    """Values of 0x1010 and 0x1011 by sub-index: *save* and *load*; empty if the device lacks the object.

    *unreadable* is the abort code of 0x1010:01 if it exists but cannot be read.
    """

    save: Mapping[int, int] = field(default_factory=dict)
    load: Mapping[int, int] = field(default_factory=dict)
    unreadable: int = 0

    @property
    def wears(self) -> str:
        """Risk of wear at every write, in words; empty if the device saves on command only."""
        if self.unreadable:
            return f"0x1010:01 cannot be read ({abort_text(self.unreadable)}), so it may store each write on its own"
        if not self.save:
            return "it has no 0x1010, so it may store each write on its own"
        by_itself = [sub for sub, said in self.save.items() if said & _BY_ITSELF]
        if not by_itself:
            return ""
        place = f"0x1010:{by_itself[0]:02X}"
        return f"{place} is {self.save[by_itself[0]]}: it stores on its own, so each write wears its memory"

    def chosen(self, preferred: Iterable[int]) -> int | None:
        """Sub-index of 0x1010 that accepts the signature, if possible from *preferred*; else None."""
        able = [sub for sub, said in self.save.items() if said & _ON_COMMAND]
        return next((sub for sub in (*preferred, *able) if sub in able), None)

    def probes(self, preferred: Iterable[int]) -> list[Probe]:
        """The probes, each sent once: a wrong signature, then the right one. Empty if no sub-index saves on command."""
        sub = self.chosen(preferred)
        if sub is None:
            return []
        return [
            Probe(None, name, sense, Stand.BACK, (ProbeWrite(STORE, sub, data),), where=ProbeCondition.STORE)
            for name, sense, data in (
                (WRONG_SIGNATURE, "a wrong signature is accepted", _WRONG_SIGNATURE),
                (SAVE, 'it stores on request ("save")', _SIGNATURE),
            )
        ]


def not_asked(storage: Storage, why: str) -> list[ProbeAnswer]:
    """The same probes, skipped, each with the reason *why*."""
    return [ProbeAnswer(probe, None, why=why) for probe in storage.probes(())]


def storage_for_profile(
    storage: Storage, answers: Sequence[ProbeAnswer], preferred: Iterable[int], seconds: float
) -> Iterator[Learnt]:
    """Sub-indices of 0x1010 that save, in *preferred* order; the store took *seconds*."""
    if not storage.save and not storage.unreadable:
        yield Learnt("store.sub_indices", [], "0x1010:01 does not exist")
        return
    saved = next((answer for answer in answers if answer.probe.name == SAVE and answer.accepted), None)
    if saved is not None:
        own = saved.probe.asked.sub_index
        others = [sub for sub in preferred if sub != own and storage.save.get(sub, 0) & _ON_COMMAND]
        yield Learnt("store.sub_indices", [own, *others], f"{saved.text}, in {seconds:.2f} s")


def storage_for_family(storage: Storage, answers: Sequence[ProbeAnswer]) -> Iterator[Learnt]:
    """A simulated device's capability values, and its answers to signatures."""
    for key, index, said in (("store_capability", STORE, storage.save), ("restore_capability", RESTORE, storage.load)):
        if said:
            evidence = ", ".join(f"0x{index:04X}:{sub:02X} is {value}" for sub, value in said.items())
            yield Learnt(key, next(iter(said.values())), evidence)
    for answer in answers:
        key = {WRONG_SIGNATURE: "wrong_signature", SAVE: "save_answer"}[answer.probe.name]
        if answer.code is not None:
            yield Learnt(key, answer.code, answer.text)
