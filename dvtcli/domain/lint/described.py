"""A described device as the subject of rules: its PDOs at power-on, their findings, and the place of a finding."""

from __future__ import annotations

from collections.abc import Iterable, Iterator
from dataclasses import dataclass
from functools import cached_property

from dvtcli.domain.cob_id import CobId, is_channel_place, taken_by_services
from dvtcli.domain.object_dictionary import ObjectDictionary, ObjectType, OdEntry, OdObject
from dvtcli.domain.objects import COB_ID_EMCY, COB_ID_SYNC
from dvtcli.domain.pdo import MAX_ENTRIES, Pdo, PdoCommunicationParameter, PdoConfig, PdoMappingEntry, is_mpdo
from dvtcli.domain.profile import GENERIC, DeviceProfile, Severity
from dvtcli.domain.rules import Proposal, check_pdo
from dvtcli.domain.rules.finding import Finding, disabled_and_empty

#: Object types with several sub-indices.
OF_MANY = (ObjectType.DEFSTRUCT, ObjectType.ARRAY, ObjectType.RECORD)


@dataclass(frozen=True, slots=True)
class Spot:
    """Place of a finding: an object, a sub-index, or a *section* (lower case); empty for the whole file.

    *key* (lower case) narrows it; with several keys, separated by `|`, the first existing key counts.
    """

    index: int | None = None
    sub_index: int | None = None
    key: str = ""
    section: str = ""

    @property
    def object(self) -> str:
        """The object as printed, empty for none."""
        return "" if self.index is None else object_text(self.index, self.sub_index)


def object_text(index: int, sub_index: int | None) -> str:
    """An object as printed, `6C01:01`, or a whole object, `6C01`."""
    return f"{index:04X}" if sub_index is None else f"{index:04X}:{sub_index:02X}"


#: The key of an object's value at power-on: ParameterValue, else DefaultValue.
HELD = "parametervalue|defaultvalue"
#: Findings of a rule: place and text.
Found = Iterator[tuple[Spot, str]]


def at(entry: OdEntry, key: str = "") -> Spot:
    """The spot of *entry*, narrowed to *key*."""
    return Spot(entry.index, entry.sub_index, key)


@dataclass(frozen=True)
class DescribedDevice:
    """A device described by a file: *dictionary*, with values for *node_id* (1..127).

    *configured*: the file is a DCF, so that configured values count, not only defaults. *any_node*: the
    node-ID is unknown. PDOs are judged as on a device of *profile*.
    """

    dictionary: ObjectDictionary
    node_id: int = 1
    configured: bool = False
    any_node: bool = False
    profile: DeviceProfile = GENERIC
    #: indices that modules may add, which an EDS does not say
    added: frozenset[int] = frozenset()

    @property
    def node_ids(self) -> range:
        """Every possible node-ID."""
        return range(1, 128) if self.any_node else range(self.node_id, self.node_id + 1)

    @cached_property
    def entries(self) -> tuple[OdEntry, ...]:
        """Every entry of every object."""
        return tuple(self.dictionary.entries())

    @cached_property
    def objects(self) -> tuple[OdObject, ...]:
        """Every object."""
        return tuple(self.dictionary.values())

    @cached_property
    def pdos(self) -> tuple[DefaultPdo, ...]:
        """Every PDO with any description, TPDOs first."""
        return default_pdos(self.dictionary, self.node_id)

    @cached_property
    def judged(self) -> tuple[Finding, ...]:
        """Findings of the `map` rules about the PDOs."""
        return tuple(judged(self.dictionary, self.pdos, self.node_id, self.profile))

    def number(self, index: int, sub_index: int = 0) -> int | None:
        """Value of an object at power-on, as an unsigned number; None if the file does not give it."""
        entry = self.dictionary.entry(index, sub_index)
        data = None if entry is None else entry.initial(self.node_id)
        return None if data is None else int.from_bytes(data, "little")


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
        pdo=pdo,
        has_communication=pdo.communication_index in dictionary,
        has_mapping=pdo.mapping_index in dictionary,
        cob_id=cob_id,
        count=count,
        entries=entries,
        config=PdoConfig(communication, mapping, mpdo),
    )


def _up_to_the_first_gap(entries: dict[int, int | None]) -> Iterator[int]:
    for word in entries.values():
        if not word:
            return
        yield word


def judged(
    dictionary: ObjectDictionary, pdos: Iterable[DefaultPdo], node_id: int, profile: DeviceProfile
) -> Iterator[Finding]:
    """Errors and warnings about *pdos* on node *node_id* with *profile*, set up one after the other."""
    sync, emcy = (_cob_id(dictionary, index, 0, node_id) for index in (COB_ID_SYNC, COB_ID_EMCY))
    indices = dictionary.indices_among(range(0x1201, 0x1341))
    places = ((index, sub) for index in indices for sub in dictionary[index].entries if is_channel_place(index, sub))
    channels = {place: held for place in places if (held := _cob_id(dictionary, *place, node_id)) is not None}
    taken = taken_by_services(node_id, sync, emcy, channels)
    before: dict[Pdo, PdoConfig] = {}
    for pdo in pdos:
        if not (pdo.has_communication and pdo.has_mapping):
            continue
        proposal = Proposal(
            node_id=node_id,
            pdo=pdo.pdo,
            now=disabled_and_empty(pdo.config),
            want=pdo.config,
            others=before,
            profile=profile,
            dictionary=dictionary,
            services=lambda: taken,
        )
        yield from (finding for finding in check_pdo(proposal) if finding.severity is not Severity.NOTE)
        before = {**before, pdo.pdo: pdo.config}


def _cob_id(dictionary: ObjectDictionary, index: int, sub_index: int, node_id: int) -> int | None:
    entry = dictionary.entry(index, sub_index)
    data = None if entry is None else entry.at_power_on(node_id)
    return None if data is None else int.from_bytes(data, "little")
