"""A described device as the subject of rules, and the place of a finding."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from functools import cached_property

from dvtcli.domain.lint.default_pdos import DefaultPdo, default_pdos
from dvtcli.domain.lint.map_judgement import judged
from dvtcli.domain.object_dictionary import ObjectDictionary, ObjectType, OdEntry, OdObject
from dvtcli.domain.profile import GENERIC, DeviceProfile
from dvtcli.domain.rules import Finding

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
