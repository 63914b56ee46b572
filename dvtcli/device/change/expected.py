"""The values expected at a store: this session's changes and the PDOs read beside them.

Each change was verified, but a reset, another writer or the device may have undone it since. Writes nothing.
"""

from __future__ import annotations

from collections.abc import Collection, Iterable, Iterator, Mapping
from dataclasses import dataclass, field
from typing import TYPE_CHECKING

from dvtcli.domain.hint import Action, Hint, verbatim
from dvtcli.domain.pdo import Pdo, PdoConfig
from dvtcli.domain.text import value_text
from dvtcli.errors import SafetyRefusal

if TYPE_CHECKING:
    from dvtcli.device.node_parts import ReadableNode
    from dvtcli.device.target_config import Difference, TargetConfig
    from dvtcli.domain.plan import Change


@dataclass(slots=True, eq=False, repr=False)
class Expected:
    """PDOs and single objects, by index and sub-index, as last read back."""

    pdos: dict[Pdo, PdoConfig] = field(default_factory=dict)
    values: dict[tuple[int, int], bytes] = field(default_factory=dict)
    #: whether every PDO that lay beside a change was read
    is_whole: bool = False

    def seen(self, others: Mapping[Pdo, PdoConfig], *, whole: bool = False) -> None:
        """Record *others*, read beside a change (with *whole* all PDOs); the first known value of a PDO counts."""
        for pdo, config in others.items():
            self.pdos.setdefault(pdo, config)
        self.is_whole = self.is_whole or (whole and bool(others))

    def changed(self, change: Change) -> None:
        """Record *change* as read back."""
        from dvtcli.domain.plan import PdoChange

        if isinstance(change, PdoChange):
            self._drop_values(change.pdo)
            self.pdos[change.pdo] = change.after
        elif change.step.before is not None:  # a write-only object cannot be read again
            pdo = Pdo.at(change.step.index)
            if pdo is not None:  # no longer equal to the whole read-back
                self.pdos.pop(pdo, None)
            self.values[change.step.index, change.step.sub_index] = change.step.after

    def _drop_values(self, pdo: Pdo) -> None:
        """Drop single values of *pdo*, read back as a whole."""
        for place in [place for place in self.values if Pdo.at(place[0]) == pdo]:
            del self.values[place]

    def clear(self) -> None:
        """Expect nothing after a requested reset, whose losses were reported."""
        self.pdos.clear()
        self.values.clear()
        self.is_whole = False

    def require(self, node: ReadableNode, who_else: str) -> None:
        """Read everything again; raise SafetyRefusal, naming *who_else* as a possible cause, on a difference."""
        if not self.pdos and not self.values:
            return
        found = node.observed(lambda: list(self._differences(node)))
        if found:
            raise SafetyRefusal(
                f"node {node.node_id} is not stored: {found[0][0]} differs from its verified value",
                node=node.node_id,
                place=found[0][1],
                why="; ".join(text for *_, text in found),
                hint=Hint(
                    Action.STORE,
                    {"force": True},
                    f"{verbatim(who_else)}, or it corrects written values, or altered this with a change of "
                    "another object: set it again and store again; {} stores the present values",
                ),
            )

    def lost(self, node: ReadableNode, labels: Collection[str]) -> list[str]:
        """The differences between *node*, read again now, and the changes called *labels*."""
        from dvtcli.device.target_config import TargetConfig, config_differences

        pdos = {pdo: wanted for pdo, wanted in self.pdos.items() if pdo.label in labels}
        values = {place: data for place, data in self.values.items() if f"{place[0]:04X}:{place[1]:02X}" in labels}
        if not pdos and not values:
            return []
        return [
            f"{label} {text}" for label, text in config_differences(node, still_there(node, TargetConfig(pdos, values)))
        ]

    def _differences(self, node: ReadableNode) -> Iterator[tuple[str, str, str]]:
        """Each difference as label, object and description."""
        from dvtcli.device.target_config import differences

        held = node.pdos() if self.pdos else {}
        for pdo, wanted in self.pdos.items():
            texts = ["it is gone"] if pdo not in held else differences(pdo, wanted, held[pdo])
            for text in texts:
                yield pdo.label, f"{pdo.communication_index:04X}:01", f"{pdo.label}: {text}"
        for (index, sub_index), value in self.values.items():
            if moves(node, index, sub_index):
                continue
            data = node.upload(index, sub_index)
            if data != value:
                place = f"{index:04X}:{sub_index:02X}"
                yield f"0x{place}", place, f"0x{place} is {value_text(data)}, was set to {value_text(value)}"


def no_longer_held(node: ReadableNode, changes: Iterable[Change]) -> tuple[Difference, ...]:
    """The results of *changes* lost by *node*, read again."""
    from dvtcli.device.target_config import TargetConfig, config_differences

    expected = Expected()
    for change in changes:
        expected.changed(change)
    return config_differences(node, still_there(node, TargetConfig(expected.pdos, expected.values)))


def still_there(node: ReadableNode, target: TargetConfig) -> TargetConfig:
    """*target* without commands and target values of the machine, which change all the time."""
    from dvtcli.device.target_config import TargetConfig

    return TargetConfig(
        target.pdos, {place: value for place, value in target.values.items() if not moves(node, *place)}
    )


def moves(node: ReadableNode, index: int, sub_index: int) -> bool:
    """True if an object is process data, changed by the machine all the time; false without a file."""
    from dvtcli.device.process_data import is_process_data

    return node.dictionary is not None and is_process_data(node, (index, sub_index))
