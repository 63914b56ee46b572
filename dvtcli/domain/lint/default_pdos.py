"""The PDOs in a file at power-on: described parameters, default values, and missing parts."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass

from dvtcli.domain.cob_id import CobId
from dvtcli.domain.mapping import MAX_ENTRIES, PdoMappingEntry
from dvtcli.domain.object_dictionary import ObjectDictionary
from dvtcli.domain.pdo import Pdo, PdoCommunicationParameter, PdoConfig, is_mpdo

_DISABLED = CobId(0, valid=False)
_WORD = 0xFFFF_FFFF


@dataclass(frozen=True, slots=True)
class DefaultPdo:
    """A PDO at power-on: *config* is its known configuration, an unknown COB-ID counting as disabled.

    *cob_id* and *count* are the raw values, None if missing in the file; *entries* the raw words by sub-index up to
    the count, None for an entry without description or value. The config's mapping ends before the first None.
    """

    pdo: Pdo
    has_communication: bool
    has_mapping: bool
    cob_id: int | None
    count: int | None
    entries: dict[int, int | None]
    config: PdoConfig


def default_pdos(dictionary: ObjectDictionary, node_id: int) -> tuple[DefaultPdo, ...]:
    """Every PDO with a parameter in *dictionary*, as at power-on of node *node_id*; TPDOs first, each by number."""
    pdos = {pdo for pdo in map(Pdo.at, dictionary) if pdo is not None}
    ordered = sorted(pdos, key=lambda pdo: (not pdo.is_tpdo, pdo.number))
    return tuple(_default_pdo(dictionary, pdo, node_id) for pdo in ordered)


def _default_pdo(dictionary: ObjectDictionary, pdo: Pdo, node_id: int) -> DefaultPdo:
    def held(index: int, sub_index: int) -> int | None:
        entry = dictionary.entry(index, sub_index)
        data = None if entry is None else entry.initial(node_id)
        return None if data is None else int.from_bytes(data, "little") & _WORD

    cob_id, count = held(pdo.communication_index, 1), held(pdo.mapping_index, 0)
    communication = PdoCommunicationParameter(
        _DISABLED if cob_id is None else CobId.from_raw(cob_id),
        *(held(pdo.communication_index, sub_index) for sub_index in (2, 3, 5, 6)),
    )
    mpdo = count if count is not None and is_mpdo(count) else None
    mapped = 0 if mpdo is not None or count is None else min(count, MAX_ENTRIES)
    entries = {number: held(pdo.mapping_index, number) for number in range(1, mapped + 1)}
    mapping = tuple(PdoMappingEntry.from_raw(word) for word in _up_to_the_first_gap(entries))
    return DefaultPdo(
        pdo,
        pdo.communication_index in dictionary,
        pdo.mapping_index in dictionary,
        cob_id,
        count,
        entries,
        PdoConfig(communication, mapping, mpdo),
    )


def _up_to_the_first_gap(entries: dict[int, int | None]) -> Iterator[int]:
    for word in entries.values():
        if not word:
            return
        yield word
