"""How a device says that it saves (0x1010, 0x1011), what is asked of it, and what its answers mean. Pure; asks nobody.

Source: CiA 301, 7.5.2.13 and 7.5.2.14. Nothing is concluded that was not read or answered: whether what was saved is
there after a reset, nobody knows who does not reset.
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field

from dvtcli.domain.abort import abort_text
from dvtcli.domain.learning.learnt_value import Learnt
from dvtcli.domain.learning.probe import Probe, ProbeAnswer, ProbeCondition, ProbeWrite, Stand

STORE, RESTORE = 0x1010, 0x1011
#: Bits of 0x1010:s: saves on command, saves by itself.
_ON_COMMAND, _BY_ITSELF = 1, 2
_SIGNATURE, _WRONG_SIGNATURE = b"save", bytes(4)
#: Names of the probes: what must be refused is asked first.
WRONG_SIGNATURE, SAVE = "wrong signature", "save"


@dataclass(frozen=True, slots=True)
class Storage:
    """What 0x1010 and 0x1011 read, by sub-index: *save* and *load*; empty where the device has no such object.

    *unreadable* is the abort code of 0x1010:01 where it is there and cannot be read.
    """

    save: Mapping[int, int] = field(default_factory=dict)
    load: Mapping[int, int] = field(default_factory=dict)
    unreadable: int = 0

    @property
    def wears(self) -> str:
        """What every write may do to the device's memory, in words; empty where it saves on command only."""
        if self.unreadable:
            return f"0x1010:01 cannot be read ({abort_text(self.unreadable)}), so it may save each write by itself"
        if not self.save:
            return "it has no 0x1010, so it may save each write by itself"
        by_itself = [sub for sub, said in self.save.items() if said & _BY_ITSELF]
        if not by_itself:
            return ""
        place = f"0x1010:{by_itself[0]:02X}"
        return f"{place} is {self.save[by_itself[0]]}: it saves by itself, so each write wears its memory"

    def chosen(self, preferred: Iterable[int]) -> int | None:
        """The sub-index of 0x1010 that takes the signature, of those *preferred* the first; None where none does."""
        able = [sub for sub, said in self.save.items() if said & _ON_COMMAND]
        return next((sub for sub in (*preferred, *able) if sub in able), None)

    def probes(self, preferred: Iterable[int]) -> list[Probe]:
        """What is asked, each once: a wrong signature, then the right one. None where no sub-index takes it."""
        sub = self.chosen(preferred)
        if sub is None:
            return []
        return [
            Probe(None, name, sense, Stand.BACK, (ProbeWrite(STORE, sub, data),), where=ProbeCondition.STORE)
            for name, sense, data in (
                (WRONG_SIGNATURE, "a wrong signature is taken", _WRONG_SIGNATURE),
                (SAVE, 'it saves when told to ("save")', _SIGNATURE),
            )
        ]


def not_asked(storage: Storage, why: str) -> list[ProbeAnswer]:
    """The same questions where they are not asked, each with *why*."""
    return [ProbeAnswer(probe, None, why=why) for probe in storage.probes(())]


def storage_for_profile(
    storage: Storage, answers: Sequence[ProbeAnswer], preferred: Iterable[int], seconds: float
) -> Iterator[Learnt]:
    """Which sub-indices of 0x1010 save: what the profile has *preferred* stays in its order. *seconds* it took."""
    if not storage.save and not storage.unreadable:
        yield Learnt("store.sub_indices", [], "0x1010:01 is not there")
        return
    saved = next((answer for answer in answers if answer.probe.name == SAVE and answer.accepted), None)
    if saved is not None:
        own = saved.probe.asked.sub_index
        others = [sub for sub in preferred if sub != own and storage.save.get(sub, 0) & _ON_COMMAND]
        yield Learnt("store.sub_indices", [own, *others], f"{saved.text}, in {seconds:.2f} s")


def storage_for_family(storage: Storage, answers: Sequence[ProbeAnswer]) -> Iterator[Learnt]:
    """What a simulated device reads there, and how it answers signatures."""
    for key, index, said in (("store_capability", STORE, storage.save), ("restore_capability", RESTORE, storage.load)):
        if said:
            evidence = ", ".join(f"0x{index:04X}:{sub:02X} is {value}" for sub, value in said.items())
            yield Learnt(key, next(iter(said.values())), evidence)
    for answer in answers:
        key = {WRONG_SIGNATURE: "wrong_signature", SAVE: "save_answer"}[answer.probe.name]
        if answer.code is not None:
            yield Learnt(key, answer.code, answer.text)
