"""The lengths of the PDO mappings that SDO writes make (CiA 301, 7.5.2.36)."""

from __future__ import annotations

from collections import defaultdict
from collections.abc import Callable
from dataclasses import dataclass, field

from dvtcli.domain.frame import byte_length
from dvtcli.domain.pdo import Pdo, is_mpdo
from dvtcli.domain.text import plural
from dvtcli.watch.recording_checks.problems import Moment
from dvtcli.watch.sdo_transfers import SdoStep

#: a node's PDO: node-ID and label
_NodePdo = tuple[int, str]


@dataclass(slots=True)
class WrittenMappings:
    """Knows when SDO writes completed the mapping of a PDO, and the frame length (bytes) that it gives."""

    _entries: dict[_NodePdo, dict[int, int]] = field(default_factory=lambda: defaultdict(dict))
    #: the completed mappings of each PDO in order; a length of None is unknown
    _lengths: dict[_NodePdo, list[tuple[Moment, int | None]]] = field(default_factory=lambda: defaultdict(list))

    def start(self, moment: Moment, node_id: int) -> None:
        """Node *node_id* starts: its mappings are those that it stored."""
        for key in [key for key in self._lengths if key[0] == node_id]:
            self._lengths[key].append((moment, None))
        for key in [key for key in self._entries if key[0] == node_id]:
            del self._entries[key]

    def take(self, moment: Moment, node_id: int, step: SdoStep) -> None:
        """Look at a *step* of an SDO transfer of *node_id*: it may have written a mapping."""
        if not step.is_write or not step.has_whole_value or step.place is None:
            return
        index, sub_index = step.place
        pdo = Pdo.at(index)
        if pdo is None or index != pdo.mapping_index:
            return
        key, value = (node_id, pdo.label), int.from_bytes(step.data, "little")
        if sub_index:
            self._entries[key][sub_index] = value & 0xFF
        elif value:
            bits = [self._entries[key].get(number) for number in range(1, value + 1)]
            known = [entry_bits for entry_bits in bits if entry_bits is not None]
            is_known = len(known) == len(bits) and not is_mpdo(value)
            self._lengths[key].append((moment, byte_length(sum(known)) if is_known else None))

    def cause(self, node_id: int, label: str, moment: Moment, mapped: int, fits: Callable[[int], bool]) -> str:
        """Say when SDO writes changed the mapping, if that is why a frame at *moment* has not *mapped* bytes.

        *fits* tells whether the frame fits a mapping of a length (bytes). Empty if the writes do not explain it.
        """
        lengths = self._lengths.get((node_id, label), [])
        before = [(written, length) for written, length in lengths if written < moment]
        if before and (length := before[-1][1]) is not None and length != mapped and fits(length):
            return _words(label, length, "in", before[-1][0])
        later = (written for written, length in lengths[len(before) :] if length == mapped)
        written = next(later, None)
        return "" if written is None else _words(label, mapped, "only in", written)


def _words(label: str, length: int, when: str, written: Moment) -> str:
    return f"the mapping of {label}: SDO writes changed it to {plural(length, 'byte')} {when} frame {written.number}"
