"""Signs that we are not alone, or that a node is there twice. Counts what others saw; reads nothing itself."""

from __future__ import annotations

from collections import Counter
from collections.abc import Callable, Iterator, Mapping
from dataclasses import dataclass, field, replace
from time import monotonic
from typing import TYPE_CHECKING

from dvtcli.domain.nmt import NmtCommand

if TYPE_CHECKING:
    from dvtcli.bus.sdo.sdo_link import DroppedAnswers

#: One doubled answer may be the bus's; from this many on they mean a second node.
SECOND_ANSWERS = 3
#: How long after a reset boot-ups may be its answers, in seconds.
_RESETTING_S = 5.0


@dataclass(slots=True)
class Oddities:
    """What was told already, so that each sign is told once; *now_s* tells the bus's time in seconds."""

    now_s: Callable[[], float] = monotonic
    _dropped: dict[int, DroppedAnswers] = field(default_factory=dict)
    _boot_ups: Counter[int] = field(default_factory=Counter)
    _resets: Counter[int] = field(default_factory=Counter)
    _doubled: Counter[int] = field(default_factory=Counter)
    _double_boot_ups: Counter[int] = field(default_factory=Counter)
    _reset_s: dict[int, float] = field(default_factory=dict)

    def commanded(self, command: NmtCommand, node_id: int, boot_ups: Mapping[int, int]) -> None:
        """An NMT command is sent, or heard of another master: a reset makes a boot-up expected of *node_id* (0: all).

        *boot_ups* were seen before it, and are no answer to it.
        """
        if command.is_reset:
            if not self._resets:
                self._boot_ups = Counter(boot_ups)
            elif not (self._resets[node_id] or self._resets[0]):
                self._boot_ups[node_id] = boot_ups.get(node_id, 0)
            self._resets[node_id] += 1
            self._reset_s[node_id] = self.now_s()

    def news(
        self, dropped: Mapping[int, DroppedAnswers], boot_ups: Mapping[int, int], double_boot_ups: Mapping[int, int]
    ) -> list[str]:
        """What is new since the last call, in words; *double_boot_ups* came right after another one."""
        found = [text for node_id, now in dropped.items() for text in self._of_channel(node_id, now)]
        found += [text for node_id, count in dict(boot_ups).items() for text in self._of_boot_ups(node_id, count)]
        found += [text for node_id, count in dict(double_boot_ups).items() for text in self._of_doubles(node_id, count)]
        self._resets.clear()
        return found

    def _of_channel(self, node_id: int, now: DroppedAnswers) -> Iterator[str]:
        before = self._dropped.get(node_id)
        self._dropped[node_id] = replace(now)
        others = now.other_client - (before.other_client if before else 0)
        if others > 0:
            yield (
                f"another SDO client talks to node {node_id}: {others} frames on its SDO channel were not ours; a "
                "dvtcli beside this one is such a client, too, also if it only monitors"
            )
            self._doubled[node_id] = now.doubled  # the answers to what it asked may look like second ones to us
        doubled = now.doubled - self._doubled[node_id]
        if doubled >= SECOND_ANSWERS:
            self._doubled[node_id] = now.doubled
            yield f"{doubled} answers came twice: are there two nodes with node-ID {node_id}?"

    def _of_boot_ups(self, node_id: int, count: int) -> Iterator[str]:
        new = count - self._boot_ups[node_id]
        self._boot_ups[node_id] = count
        expected = self._resets[node_id] + self._resets[0]
        if expected and new > expected:
            yield (
                f"{new} boot-ups after {expected} reset{'' if expected == 1 else 's'}: are there two nodes with "
                f"node-ID {node_id}, or does it restart by itself?"
            )

    def _of_doubles(self, node_id: int, count: int) -> Iterator[str]:
        new = count - self._double_boot_ups[node_id]
        self._double_boot_ups[node_id] = count
        reset_s = max((self._reset_s[key] for key in (0, node_id) if key in self._reset_s), default=None)
        if new > 0 and (reset_s is None or self.now_s() - reset_s > _RESETTING_S):
            yield (
                f"two boot-ups within a second, and no reset was seen: are there two nodes with node-ID {node_id}, "
                "or does it restart by itself?"
            )
