"""Export a node, or a file about a node, as a node of a network file. Writes nothing to a node."""

from __future__ import annotations

import re
from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from typing import TYPE_CHECKING, Protocol

from dvtcli.device.read_pdos import read_optional
from dvtcli.domain.mapping import MAX_PDO_BITS
from dvtcli.domain.network.wanted_state import FileWord, NodeWish, PdoWish, PinWish, WantedIdentity
from dvtcli.domain.object_dictionary import normalised
from dvtcli.domain.object_syntax import MappedObject, resolve_entry
from dvtcli.domain.profile import BitPolicy
from dvtcli.domain.text import join_some
from dvtcli.errors import SdoAborted
from dvtcli.operations.exchange.exported_objects import Said, exported_objects, exported_values, exported_watches

if TYPE_CHECKING:
    from dvtcli.domain.mapping import PdoMappingEntry
    from dvtcli.domain.object_dictionary import ObjectDictionary
    from dvtcli.domain.pdo import Pdo, PdoConfig
    from dvtcli.domain.ports import SdoReader
    from dvtcli.domain.profile import DeviceProfile, VpdoGroup


def exported_pins(values: SdoReader, groups: Mapping[str, VpdoGroup]) -> Iterator[PinWish]:
    """Yield the pins of each of *groups* by name, up to the last connected pin."""
    for name, group in sorted(groups.items()):
        try:
            held = list(_held(values, group))
        except SdoAborted:
            continue  # what cannot be read is not compared either
        while held and held[-1] == group.none:
            held.pop()
        for pin, value in enumerate(held, 1):
            yield PinWish(name, pin, None if value == group.none else FileWord(f"{value:04X}"))


def _held(values: SdoReader, group: VpdoGroup) -> Iterator[int]:
    for pin in range(1, (read_optional(values, group.index, 0, 1) or 0) + 1):
        value = read_optional(values, group.index, pin, 2)
        if value is None:
            return
        yield value


class NamedNode(Protocol):
    """A node with object names."""

    @property
    def node_id(self) -> int:
        """The node-ID."""
        ...

    @property
    def title(self) -> str:
        """The device's name."""
        ...

    @property
    def dictionary(self) -> ObjectDictionary | None:
        """The object dictionary."""
        ...

    @property
    def profile(self) -> DeviceProfile:
        """The family's profile."""
        ...


class PdoHolder(NamedNode, Protocol):
    """A holder of PDOs: a node, or a file with its values."""

    def identity(self) -> dict[str, int | None]:
        """The identity (0x1018)."""
        ...


@dataclass(frozen=True, slots=True)
class Exported:
    """A node for a network file: its PDOs, remarks on words, and PDOs left out."""

    wish: NodeWish
    remarks: dict[tuple[int, str], str]
    left_out: tuple[str, ...]

    @property
    def left_out_note(self) -> str:
        """Report what was left out; empty if nothing."""
        if not self.left_out:
            return ""
        verb = "is no whole PDO" if len(self.left_out) == 1 else "are no whole PDOs"
        return f"left out: {join_some(self.left_out)} {verb}, or multiplexed; the PDOs of the node show what is held"


def exported(holder: PdoHolder, held: Mapping[Pdo, PdoConfig], values: SdoReader, said: Said) -> Exported:
    """Convert the PDOs *held* of *holder*, and the objects in *values*, for a network file.

    Usual values are included if *said*.
    """
    remarks: dict[str, str] = {}
    wishes = tuple(_pdo(holder, pdo, config, remarks) for pdo, config in held.items() if is_whole(config))
    found = exported_objects(values, holder.dictionary, said)
    objects = sorted(found, key=lambda entry: (entry.index, entry.sub_index))
    watches = tuple(exported_watches(values))
    others = dict(exported_values(values, holder.dictionary, watches, holder.node_id, said))
    remarks |= {other_pin.object.text: sense for other_pin, sense in others.items()}
    wish = NodeWish(
        title_word(holder), holder.node_id, _identity(holder), pdos=wishes, objects=tuple(objects),
        values=tuple(others), watches=watches, pins=tuple(exported_pins(values, holder.profile.vpdo)),
    )  # fmt: skip
    left_out = tuple(pdo.label for pdo, config in held.items() if not is_whole(config))
    return Exported(wish, {(holder.node_id, word): text for word, text in remarks.items()}, left_out)


def is_whole(config: PdoConfig) -> bool:
    """Tell whether a network file can have it: no MPDO, nothing unknown, each entry has a length."""
    has_bits = all(1 <= entry.bits <= MAX_PDO_BITS for entry in config.mapping)
    return config.mpdo is None and not config.inconsistency and has_bits


def title_word(holder: NamedNode) -> str:
    """Name the node in the file: device name and node-ID, to be unique."""
    word = re.sub(r"[^a-z0-9_]", "", normalised(holder.title).replace(".", "_"))
    return f"{word}_{holder.node_id}" if word and word[0].isalpha() else f"node_{holder.node_id}"


def _identity(holder: PdoHolder) -> WantedIdentity:
    """Return the kind of device, as the file may serve another of the same kind."""
    found = holder.identity()
    return WantedIdentity(found["vendor"] or None, found["product"] or None)


def _pdo(holder: PdoHolder, pdo: Pdo, config: PdoConfig, remarks: dict[str, str]) -> PdoWish:
    held = config.communication
    cob_id = held.cob_id
    named = bool(cob_id.can_id)  # a COB-ID of 0 that is off is no CAN-ID
    unlike_others = cob_id.rtr_allowed and holder.profile.rtr_bit[pdo.direction] is BitPolicy.SET
    return PdoWish(
        pdo,
        enabled=cob_id.valid,
        cob_id=cob_id.can_id if named else None,
        extended=cob_id.extended and named,
        rtr_allowed=cob_id.rtr_allowed if not cob_id.rtr_allowed or unlike_others else None,
        transmission_type=held.transmission_type,
        inhibit_time=held.inhibit_time if pdo.is_tpdo else None,
        event_timer=held.event_timer,
        sync_start_value=held.sync_start_value if pdo.is_tpdo else None,
        mapping=tuple(mapped_word(holder, entry, remarks) for entry in config.mapping),
    )


def mapped_word(holder: NamedNode, entry: PdoMappingEntry, remarks: dict[str, str]) -> FileWord:
    """Name the entry by object name if unique, else by number; the other is the remark."""
    name = "" if holder.dictionary is None else holder.dictionary.display_name(entry.index, entry.sub_index)
    word = "" if entry.is_dummy else _named(holder, name, entry)
    remarks[word or str(entry)] = f"skips {entry.bits} bits" if entry.is_dummy else str(entry) if word else name
    return FileWord(word or str(entry))


def _named(holder: NamedNode, name: str, entry: PdoMappingEntry) -> str:
    """Return the name as one word, if the EDS resolves it to the object with the mapped length."""
    word = normalised(name)
    if not re.fullmatch(r"[a-z_][a-z0-9_]*", word) or holder.dictionary is None:
        return ""
    try:
        found = resolve_entry(word, holder.dictionary, holder.profile.aliases)
    except ValueError:
        return ""  # the name of several objects
    alone = found == MappedObject(entry.index, entry.sub_index)
    described = holder.dictionary.entry(entry.index, entry.sub_index)
    return word if alone and described is not None and described.bits == entry.bits else ""
