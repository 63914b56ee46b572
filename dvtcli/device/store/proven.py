"""Prove a store or a restore: compare the values after a reset, and tell whether the comparison proves anything."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping
from contextlib import contextmanager
from dataclasses import replace
from typing import TYPE_CHECKING, NamedTuple

from dvtcli.device.described_node import Defaults
from dvtcli.device.quirks import in_standard_order
from dvtcli.device.resets import return_to
from dvtcli.device.store.canary import AnyPlace, Canary, choose_canary
from dvtcli.device.store.pending import COMMUNICATION, EVERYTHING
from dvtcli.device.store.snapshot import Snapshot
from dvtcli.device.store.store_parameters import STORE, StoreAnswer, chosen, word_of
from dvtcli.device.target_config import ValueFormatter, value_differences, value_in_hex
from dvtcli.device.target_config import differences as pdo_differences
from dvtcli.domain.hint import Action, Hint, as_hint
from dvtcli.domain.object_dictionary import ObjectDictionary
from dvtcli.domain.pdo import Pdo, PdoConfig
from dvtcli.domain.plan import EVENT_TIMER, INHIBIT_TIME, SYNC_START, TRANSMISSION_TYPE, Plan, plan_pdo
from dvtcli.domain.ports import SdoTransport
from dvtcli.domain.profile import DeviceProfile
from dvtcli.domain.store import POWER, Proof
from dvtcli.domain.text import join_some
from dvtcli.errors import DeviceRefused, DvtcliError, LeftChanged, SdoAborted

if TYPE_CHECKING:
    from dvtcli.device.node import Node
    from dvtcli.device.node_parts import NodeDescription, ReadableNode

#: What to do where a proof shows nothing of PDOs, or of some objects.
RESTORE_ALL = Hint(Action.PROVE_RESTORE, {"what": "all"}, "takes and compares them")
AGAIN = as_hint("once more: what refuses to be read for a moment is read then")


class Restart(NamedTuple):
    """A way to clear the RAM of a node, *by* a method of `domain.store`; *run* returns after the boot-up message."""

    by: str
    run: Callable[[], object]
    communication: bool = False

    @property
    def certain(self) -> bool:
        """True if RAM was without power: afterwards it holds stored values only."""
        return self.by == POWER


@contextmanager
def acknowledged(node: ReadableNode, signed: StoreAnswer) -> Iterator[None]:
    """A block that proves the acknowledged *signed*; errors in the block say that the write happened."""
    try:
        yield
    except DvtcliError as failed:
        _say_acknowledged(node, signed, failed)
        raise
    except KeyboardInterrupt as torn:
        stopped = node.cancellation.interrupted("stopped at once", node=node.node_id, state="unknown")
        _say_acknowledged(node, signed, stopped)
        raise stopped from torn


def _say_acknowledged(node: NodeDescription, signed: StoreAnswer, failed: DvtcliError) -> None:
    word = word_of(signed.index)
    failed.details.insert(0, (word, f"0x{signed.place} acknowledged it before; it is not proved"))
    said = f"0x{signed.place} acknowledged the {word}, which is not proved; read back what node {node.node_id} holds"
    if failed.state == "left_changed":
        failed.state_text = f"LEFT CHANGED: see above; {said}"
    else:
        failed.state, failed.state_text = "unknown", f"unknown: {said}"


def uncovered_group(sub_index: int) -> str:
    """Why a proof says nothing about the group *sub_index* of 0x1010 or 0x1011; empty if the group covers PDOs."""
    if sub_index in (EVERYTHING, COMMUNICATION):
        return ""
    return f"PDOs are compared, but it is unknown whether group {sub_index} has them"


def unread_of(held: Snapshot, signed: StoreAnswer, after: Mapping[Pdo, PdoConfig] | None = None) -> str:
    """The values of *held* left out of the comparison because unreadable; empty if all were read.

    For the PDOs *after* a restart: the values unreadable both before and after.
    """
    objects = held.unread_of_group(signed.sub_index)
    untold = [
        f"0x{index:04X}:{sub_index:02X} cannot be read"
        for pdo, config in (after or {}).items()
        for index, sub_index in config.untold
        if pdo in held.pdos and (index, sub_index) in held.pdos[pdo].untold
    ]
    unread = join_some([*untold, *filter(None, [objects])])
    return unread and f"not compared: {unread}"


Pdos = Mapping[Pdo, PdoConfig]
#: bit of 0x1010 and 0x1011 by which a device says that it saves without being told (CiA 301, 7.5.2.13)
_BY_ITSELF = 2
#: What finds out what a reset cannot, and what to do where a power cycle was none.
_POWER = Hint(Action.PROVE_POWER, why="finds out")
_ALL = Hint(Action.PROVE_STORE, {"what": "all"}, "takes and compares them")
#: Why no value could be changed in RAM.
_NO_PLACE = "it has nothing that can be changed harmlessly to test the reset: no timer, no heartbeat, no PDO"
_OFF_FOR_LONGER = Hint(Action.PROVE_POWER, why="switch it off until all its lights are off, then {} again")


def prepare_proof(node: Node, before: Snapshot, sub_index: int | None, restart: Restart) -> AnyPlace | None:
    """Check before the store that a proof will be possible: values to compare, and a value to change as a test.

    *sub_index* is that of `write_signature`. Tries the change and rolls back; None if a power cycle needs no test.
    Raises DeviceRefused if the proof would be impossible or the node altered other values with the test (rolled back),
    LeftChanged if the roll-back failed. Nothing is stored in either case.
    """
    signed = refuse_unprovable(node, sub_index, certain=restart.certain)
    if unread := unread_of(before, signed, before.pdos):
        raise _unprovable(node, unread, AGAIN)
    if _saves_itself(signed):
        return None
    place = choose_canary(node, before.pdos)
    if node.cancellation.requested:
        raise node.cancellation.interrupted("stopped before the store", node=node.node_id)
    if place is None and not restart.certain:
        raise _unprovable(node, _NO_PLACE, _POWER)
    if place is not None:
        _refuse_altered(node, before, place)
    return place


def _refuse_altered(node: Node, before: Snapshot, place: AnyPlace) -> None:
    """Raise DeviceRefused if the tried and rolled back change at *place* left the node different from *before*."""
    held = node.pdos()
    altered = _unlike(node, before, held)
    if not altered:
        return
    text = f"node {node.node_id} altered {join_some(altered)} when {place.name} was changed to test the reset"
    hint = as_hint("these depend on each other in this device: see its manual") + Hint(
        Action.STORE, why="{} alone stores without a proof"
    )
    changes = tuple(
        plan_pdo(pdo, held[pdo], config)
        for pdo, config in before.pdos.items()
        if pdo in held and held[pdo] != config and config.has_cob_id and not config.lacking
    )
    try:
        if changes:
            node.apply(Plan(node.node_id, changes), remembered=False)
        left = _unlike(node, before, node.pdos())
    except DvtcliError as failed:
        left = [failed.text]
    if left:
        raise LeftChanged(
            f"{text}: nothing was stored", node=node.node_id, why=join_some(left), hint=hint, state="left_changed"
        )
    refused = DeviceRefused(f"{text}: nothing was stored", node=node.node_id, hint=hint, state="rolled_back")
    refused.state_text = "its changes are rolled back, read back equal; nothing was stored"
    raise refused


def _unlike(node: ReadableNode, before: Snapshot, pdos: Pdos) -> list[str]:
    """The differences between *node*, whose *pdos* were just read, and *before*, in words."""
    values = (f"{place}: {text}" for place, text in value_differences(node, before.values))
    return [*_differences(before.pdos, pdos), *values]


def refuse_unprovable(node: ReadableNode, sub_index: int | None, *, certain: bool) -> StoreAnswer:
    """The signature to write for a store. Raises DeviceRefused if no restart could prove the store.

    *certain* stands for a power cycle. Uses known facts only; writes nothing and reads no configuration.
    """
    where, capability = chosen(node.access, node.profile.store, STORE, sub_index, node.dictionary)
    signed = StoreAnswer(STORE, where, 0.0, capability)
    if uncovered := uncovered_group(where):
        raise _unprovable(node, uncovered, _ALL)
    if (by_itself := _saves_itself(signed)) and not certain:
        raise _unprovable(node, by_itself, _POWER)
    if not certain:
        refuse_deaf_to_reset(node, _POWER)
    return signed


def refuse_deaf_to_reset(node: ReadableNode, hint: Hint | str) -> None:
    """Raise DeviceRefused, with *hint*, if *node* is an NMT master, which obeys no NMT reset."""
    if node.access.is_master():
        place = node.profile.master_object
        at = "" if place is None else f"{place[0]:04X}:{place[1]:02X}"
        raise DeviceRefused(
            f"node {node.node_id} ignores the NMT reset: nothing was stored or restored",
            node=node.node_id, place=at, why=f"0x{at} makes it an NMT master", hint=hint,
        )  # fmt: skip


def _unprovable(node: NodeDescription, why: str, hint: Hint) -> DeviceRefused:
    """The error: nothing was stored, as a restart could not prove that *node* keeps the values."""
    text = f"node {node.node_id} is not stored: that it keeps it could not be proved"
    return DeviceRefused(
        text, node=node.node_id, why=why, hint=hint + Hint(Action.STORE, why="alone stores without a proof")
    )


def _saves_itself(signed: StoreAnswer) -> str:
    """The reason that nothing is in RAM only, for a device that saves autonomously; else empty."""
    if signed.capability is None or not signed.capability & _BY_ITSELF:
        return ""
    return f"0x{signed.place} is {signed.capability}: the device saves by itself, too"


def prove_store(
    node: Node,
    before: Snapshot,
    signed: StoreAnswer,
    restart: Restart,
    place: AnyPlace | None,
    format_value: ValueFormatter = value_in_hex,
) -> Proof:
    """Restart *node* and compare it with *before*, read ahead of the acknowledged store.

    The canary at *place*, changed after the store, shows whether the restart cleared RAM. Errors mention the
    acknowledged store; LeftChanged if the canary could not be rolled back.
    """
    covered, policy = before.of_group(signed.sub_index), node.profile.store
    values = {place: value for place, value in covered.items() if policy.needed_for(place[0])}
    with acknowledged(node, signed):
        found = node.access.state()
        canary, blind = _canary(node, place, signed)
        after, lost, survived = _restarted(node, restart, canary)
        unlike = [f"{place}: {text}" for place, text in value_differences(node, values, format_value)]
        return_to(node.access, found)
    hint = _POWER
    if survived is not None:
        after = survived.without(after)
        blind = "RAM is kept over a reset, or the device stored on its own"
        if restart.certain:
            blind, hint = (
                "RAM was kept, so this was not a power cycle, or the device stored on its own",
                _OFF_FOR_LONGER,
            )
    elif restart.certain:
        blind = ""
    uncovered, unread = uncovered_group(signed.sub_index), unread_of(before, signed, after)
    return Proof(
        restart.by,
        len(before.pdos),
        "what was stored",
        (*_differences(before.pdos, after), *unlike),
        uncovered or unread or blind,
        "" if canary is None else canary.place.text,
        lost,
        len(values),
        _ALL if uncovered else AGAIN if unread else hint if blind else "",
        "" if survived is None else survived.put_back_text,
        notes=before.notes,
    )


def _canary(node: Node, place: AnyPlace | None, signed: StoreAnswer) -> tuple[Canary | None, str]:
    """The canary, or the reason for its absence."""
    if place is None:
        return None, _saves_itself(signed) or _NO_PLACE
    canary = Canary(node, place)
    return (canary, "") if canary.plant() else (None, f"it refused {place.name} after the store, and took it before")


def _restarted(
    node: Node, restart: Restart, canary: Canary | None
) -> tuple[dict[Pdo, PdoConfig], tuple[str, ...], AnyPlace | None]:
    """The PDOs after the restart, the lost changes, and the canary's place if the canary survived."""
    try:
        restart.run()
        lost = node.was_reset(communication=restart.communication)
        node.gate.renew()
        after = node.pdos()
        survived = canary is not None and canary.survived(after)
    except BaseException as fault:
        if canary is not None:
            canary.roll_back_after(fault)
        raise
    if canary is None:
        return after, lost, None
    if not survived:
        canary.gone()
        return after, lost, None
    canary.roll_back()
    return after, lost, canary.place


def _differences(before: Pdos, after: Pdos) -> list[str]:
    """Every changed parameter of a PDO, in words."""
    differences = []
    for pdo, config in before.items():
        if pdo not in after:
            differences.append(f"{pdo.label} is gone")
        else:
            differences += [f"{pdo.label}: {text}" for text in _unread_before(config, after[pdo])]
            differences += [f"{pdo.label}: {text}" for text in pdo_differences(pdo, config, after[pdo])]
    return differences


def _unread_before(before: PdoConfig, after: PdoConfig) -> Iterator[str]:
    """The parameters readable now but unreadable *before*, hence not comparable."""
    for index, sub_index in before.lacking:
        if (index, sub_index) not in after.lacking:
            yield f"0x{index:04X}:{sub_index:02X} could not be read before"


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


#: What to do where the EDS tells no defaults.
_MANUAL = Hint(Action.SHOW_PDOS, why="shows its present values; its manual may tell the defaults")


def _is_otherwise(before: PdoConfig, after: PdoConfig | None) -> bool:
    """True if a PDO, read as completely as *before*, has another value."""
    return after is not None and after.lacking == before.lacking and after != before


def restart_and_read(node: Node, restart: Restart) -> tuple[Snapshot, tuple[str, ...]]:
    """Restart *node* and return its snapshot and the labels of lost changes."""
    restart.run()
    lost = node.was_reset(communication=restart.communication)
    node.gate.renew()
    return Snapshot.now(node), lost


def prove_restore(
    node: Node, signed: StoreAnswer, restart: Restart, before: Snapshot | None,
    lost_before: tuple[str, ...] = (), format_value: ValueFormatter = value_in_hex,
) -> Proof:  # fmt: skip
    """Restart *node* after an acknowledged restore and compare its values with the defaults of the EDS.

    Compares PDOs and the single objects written by dvtcli. *before* is the snapshot ahead of the restore. Without an
    EDS, or with the EDS of another device, a PDO must differ from *before* after a restart that lost *lost_before*.
    """
    with acknowledged(node, signed):
        after, lost = restart_and_read(node, restart)
    lost = (*lost_before, *lost)
    if node.dictionary is not None and not node.unlike_file:
        return _against_defaults(node, node.dictionary, signed, restart, before, after, lost, format_value)
    uncovered = uncovered_group(signed.sub_index)
    changed = sum(_is_otherwise(config, after.pdos.get(pdo)) for pdo, config in (before.pdos if before else {}).items())
    who = "the EDS is another device's" if node.unlike_file else "no EDS has the defaults"
    unproved = f"{who}, and nothing differs from what was stored before"
    return Proof(
        restart.by, changed, "what was stored before", (), uncovered or ("" if changed else unproved), lost=lost,
        hint=RESTORE_ALL if uncovered else Hint(Action.GIVE_EDS, why="tells its defaults"), notes=after.notes,
    )  # fmt: skip


def _against_defaults(
    node: NodeDescription,
    dictionary: ObjectDictionary,
    signed: StoreAnswer,
    restart: Restart,
    before: Snapshot | None,
    after: Snapshot,
    lost: tuple[str, ...],
    format_value: ValueFormatter,
) -> Proof:
    uncovered, against = uncovered_group(signed.sub_index), f"the defaults of {dictionary.source or 'the EDS'}"

    def look(held: Snapshot) -> Proof:
        pdos = differing_from_defaults(dictionary, node.profile, node.node_id, {} if uncovered else held.pdos)
        objects = values_unlike_defaults(dictionary, node.node_id, held.of_group(signed.sub_index), format_value)
        not_compared = join_some((*pdos.not_compared, *objects.not_compared))
        said = (
            (f"not compared: {not_compared}, of which the EDS has no default or the node no value",)
            if not_compared
            else ()
        )
        return Proof(
            restart.by, pdos.compared, against, (*pdos.differences, *objects.differences), objects=objects.compared,
            notes=(*held.notes, *said),
        )  # fmt: skip

    found = look(after)
    told, unread = found.compared or found.objects, unread_of(after, signed)
    differed = set() if before is None else set(look(before).differing) - set(lost)  # a reset takes those anyway
    return replace(
        found,
        unproved=uncovered or unread or ("" if told else "the EDS has no defaults of its PDOs"),
        lost=lost,
        hint=RESTORE_ALL if uncovered else AGAIN if unread else _MANUAL,
        already=not differed,
    )
