"""Prove a restore: compare the values after a reset with the defaults of the EDS."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from dataclasses import replace
from typing import TYPE_CHECKING, NamedTuple

from dvtcli.device.described_node import Defaults
from dvtcli.device.quirks import in_standard_order
from dvtcli.device.store.prove_store import AGAIN, Restart, Snapshot, acknowledged, uncovered_group, unread_of
from dvtcli.device.store.store_parameters import StoreAnswer
from dvtcli.device.target_config import ValueFormatter, value_in_hex
from dvtcli.domain.hint import Action, Hint
from dvtcli.domain.object_dictionary import ObjectDictionary
from dvtcli.domain.pdo import Pdo, PdoConfig
from dvtcli.domain.plan import EVENT_TIMER, INHIBIT_TIME, SYNC_START, TRANSMISSION_TYPE
from dvtcli.domain.ports import SdoTransport
from dvtcli.domain.profile import DeviceProfile
from dvtcli.domain.store import Proof
from dvtcli.domain.text import join_some
from dvtcli.errors import SdoAborted

if TYPE_CHECKING:
    from dvtcli.device.node import Node
    from dvtcli.device.node_parts import NodeDescription

#: What to do if a proof shows nothing of PDOs.
_RESTORE_ALL = Hint(Action.PROVE_RESTORE, {"what": "all"}, "takes and compares them")
#: What to do where the EDS tells no defaults.
_MANUAL = Hint(Action.SHOW_PDOS, why="shows its present values; its manual may tell the defaults")


class AgainstDefaults(NamedTuple):
    """The number of PDOs or objects with a default in the file, the differing values in words, and *not_compared*.

    *not_compared* are PDOs and objects not compared, since the file has no default or the node returned no value.
    """

    compared: int
    differences: tuple[str, ...]
    not_compared: tuple[str, ...]


def differing_from_defaults(
    dictionary: ObjectDictionary, profile: DeviceProfile, node_id: int, held: Mapping[Pdo, PdoConfig]
) -> AgainstDefaults:
    """Compare the *held* PDOs with their defaults in the EDS."""
    channel = in_standard_order(Defaults(dictionary, node_id), profile)
    compared = 0
    differences: list[str] = []
    not_compared: list[str] = []
    for pdo, config in held.items():
        rows = list(_rows(channel, pdo, config))
        both = [(place, value, data) for place, value, data in rows if value is not None and data is not None]
        compared += bool(both)
        differences += (
            text for place, value, data in both if (text := _unlike_default(f"{pdo.label}: {place}", value, data))
        )
        differences += _lacking(channel, pdo, config)
        lacking = {f"0x{index:04X}:{sub:02X}" for index, sub in config.lacking}
        alone = [place for place, value, data in rows if (value is None) != (data is None) and place not in lacking]
        not_compared += alone if both else [pdo.label]
    return AgainstDefaults(compared, tuple(differences), tuple(not_compared))


def _rows(channel: SdoTransport, pdo: Pdo, config: PdoConfig) -> Iterator[tuple[str, int | None, bytes | None]]:
    """Each parameter of a PDO with object, present value and default; None if unknown."""
    for index, sub_index, value in _values(pdo, config):
        yield f"0x{index:04X}:{sub_index:02X}", value, _default(channel, index, sub_index)


def _default(channel: SdoTransport, index: int, sub_index: int) -> bytes | None:
    try:
        return channel.upload(index, sub_index)
    except SdoAborted:
        return None


def _lacking(channel: SdoTransport, pdo: Pdo, config: PdoConfig) -> Iterator[str]:
    """Unreadable parameters with a default (COB-ID or mapping count) that make the PDO incomplete."""
    for index, sub_index in config.lacking:
        default = _default(channel, index, sub_index)
        if default is not None:
            text = f"cannot be read, its default is 0x{default[::-1].hex().upper()}"
            yield f"{pdo.label}: 0x{index:04X}:{sub_index:02X} {text}"


def _unlike_default(place: str, value: int, default: bytes) -> str:
    """The difference between a parameter and its default, empty if equal."""
    if int.from_bytes(default, "little") == value:
        return ""
    return f"{place} is 0x{value:0{2 * len(default)}X}, its default is 0x{default[::-1].hex().upper()}"


def values_unlike_defaults(
    dictionary: ObjectDictionary,
    node_id: int,
    held: Mapping[tuple[int, int], bytes],
    format_value: ValueFormatter = value_in_hex,
) -> AgainstDefaults:
    """Compare the single objects in *held* with their defaults in the EDS, formatting values with *format_value*."""
    channel = Defaults(dictionary, node_id)
    compared = 0
    differences: list[str] = []
    not_compared: list[str] = []
    for (index, sub_index), data in held.items():
        place, default = f"{index:04X}:{sub_index:02X}", _default(channel, index, sub_index)
        if default is None:
            not_compared.append(f"0x{place}")
            continue
        compared += 1
        if data != default:
            present, expected = (format_value(index, sub_index, value) for value in (data, default))
            differences.append(f"{place}: is {present}, its default is {expected}")
    return AgainstDefaults(compared, tuple(differences), tuple(not_compared))


def _values(pdo: Pdo, config: PdoConfig) -> Iterator[tuple[int, int, int | None]]:
    """Index, sub-index and value of every parameter of a PDO; None if unreadable."""
    held = config.communication
    rows = (
        (1, held.cob_id.raw if config.has_cob_id else None),
        (TRANSMISSION_TYPE, held.transmission_type),
        (INHIBIT_TIME, held.inhibit_time),
        (EVENT_TIMER, held.event_timer),
        (SYNC_START, held.sync_start_value),
    )
    yield from ((pdo.communication_index, sub_index, value) for sub_index, value in rows)
    yield pdo.mapping_index, 0, config.count if config.has_mapping else None
    for number, entry in enumerate(config.mapping, 1):
        yield pdo.mapping_index, number, entry.raw


def _differs(before: PdoConfig, after: PdoConfig | None) -> bool:
    """True if a PDO, read as completely as *before*, has another value."""
    return after is not None and after.lacking == before.lacking and after != before


def restart_and_read(node: Node, restart: Restart) -> tuple[Snapshot, tuple[str, ...]]:
    """Restart *node* and return its snapshot and the labels of lost changes."""
    restart.run()
    lost = node.was_reset(communication=restart.communication)
    node.gate.renew()
    return Snapshot.now(node), lost


def prove_restore(
    node: Node, answer: StoreAnswer, restart: Restart, before: Snapshot | None,
    lost_before: tuple[str, ...] = (), format_value: ValueFormatter = value_in_hex,
) -> Proof:  # fmt: skip
    """Restart *node* after an acknowledged restore and compare its values with the defaults of the EDS.

    Compares PDOs and the single objects written by dvtcli. *before* is the snapshot ahead of the restore. Without an
    EDS, or with the EDS of another device, a PDO must differ from *before* after a restart that lost *lost_before*.
    """
    with acknowledged(node, answer):
        after, lost = restart_and_read(node, restart)
    lost = (*lost_before, *lost)
    if node.dictionary is not None and not node.unlike_file:
        return _against_defaults(node, node.dictionary, answer, restart, before, after, lost, format_value)
    uncovered = uncovered_group(answer.sub_index)
    changed = sum(_differs(config, after.pdos.get(pdo)) for pdo, config in (before.pdos if before else {}).items())
    who = "the EDS is another device's" if node.unlike_file else "no EDS has the defaults"
    unproved = f"{who}, and nothing differs from what was stored before"
    return Proof(
        restart.by, changed, "what was stored before", (), uncovered or ("" if changed else unproved), lost=lost,
        hint=_RESTORE_ALL if uncovered else Hint(Action.GIVE_EDS, why="tells its defaults"), notes=after.notes,
    )  # fmt: skip


def _against_defaults(
    node: NodeDescription,
    dictionary: ObjectDictionary,
    answer: StoreAnswer,
    restart: Restart,
    before: Snapshot | None,
    after: Snapshot,
    lost: tuple[str, ...],
    format_value: ValueFormatter,
) -> Proof:
    uncovered, against = uncovered_group(answer.sub_index), f"the defaults of {dictionary.source or 'the EDS'}"

    def look(held: Snapshot) -> Proof:
        pdos = differing_from_defaults(dictionary, node.profile, node.node_id, {} if uncovered else held.pdos)
        objects = values_unlike_defaults(dictionary, node.node_id, held.of_group(answer.sub_index), format_value)
        not_compared = join_some((*pdos.not_compared, *objects.not_compared))
        left_out = (
            (f"not compared: {not_compared}, of which the EDS has no default or the node no value",)
            if not_compared
            else ()
        )
        return Proof(
            restart.by, pdos.compared, against, (*pdos.differences, *objects.differences), objects=objects.compared,
            notes=(*held.notes, *left_out),
        )  # fmt: skip

    found = look(after)
    compared, unread = found.compared or found.objects, unread_of(after, answer)
    differed = set() if before is None else set(look(before).differing) - set(lost)  # a reset takes those anyway
    return replace(
        found,
        unproved=uncovered or unread or ("" if compared else "the EDS has no defaults of its PDOs"),
        lost=lost,
        hint=_RESTORE_ALL if uncovered else AGAIN if unread else _MANUAL,
        already=not differed,
    )
