"""Prove a store: compare the values after a reset with those before, and tell whether that proves anything.

Compared are PDOs, and single objects that dvtcli wrote.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping
from contextlib import contextmanager
from dataclasses import dataclass, field
from typing import TYPE_CHECKING, NamedTuple

from dvtcli.device.process_data import is_no_setting
from dvtcli.device.read_pdos import UNREADABLE
from dvtcli.device.resets import return_to
from dvtcli.device.store.canary import AnyPlace, Canary, choose_canary
from dvtcli.device.store.pending import COMMUNICATION, EVERYTHING, GROUPS
from dvtcli.device.store.store_parameters import StoreAnswer, chosen, word_of
from dvtcli.device.target_config import ValueFormatter, value_differences, value_in_hex
from dvtcli.device.target_config import differences as pdo_differences
from dvtcli.domain.hint import Action, Hint, as_hint
from dvtcli.domain.objects import STORE_PARAMETERS
from dvtcli.domain.pdo import Pdo, PdoConfig
from dvtcli.domain.plan import Plan, ValueChange, plan_pdo
from dvtcli.domain.profile import ObjectAddress
from dvtcli.domain.rules.raw_write import why_unreadable
from dvtcli.domain.store import POWER, Proof
from dvtcli.domain.text import join_some
from dvtcli.errors import DeviceRefused, DvtcliError, InputFileError, LeftChanged, SdoAborted

if TYPE_CHECKING:
    from dvtcli.device.node import Node
    from dvtcli.device.node_parts import NodeDescription, ReadableNode


#: What to do if a value cannot be read for a moment.
AGAIN = as_hint("once more: what refuses to be read for a moment is read then")
#: bit of 0x1010 and 0x1011 by which a device says that it saves without being told (CiA 301, 7.5.2.13)
_BY_ITSELF = 2
#: What finds out what a reset cannot, and what to do where a power cycle was none.
_POWER = Hint(Action.PROVE_POWER, why="finds out")
_ALL = Hint(Action.PROVE_STORE, {"what": "all"}, "takes and compares them")
#: Why no value could be changed in RAM.
_NO_PLACE = "it has nothing that can be changed harmlessly to test the reset: no timer, no heartbeat, no PDO"
_OFF_FOR_LONGER = Hint(Action.PROVE_POWER, why="switch it off until all its lights are off, then {} again")


Pdos = Mapping[Pdo, PdoConfig]


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
def acknowledged(node: ReadableNode, answer: StoreAnswer) -> Iterator[None]:
    """A block that proves the acknowledged *answer*; errors in the block say that the write happened."""
    try:
        yield
    except DvtcliError as failed:
        _add_acknowledged(node, answer, failed)
        raise
    except KeyboardInterrupt as torn:
        stopped = node.cancellation.interrupted("stopped at once", node=node.node_id, state="unknown")
        _add_acknowledged(node, answer, stopped)
        raise stopped from torn


def _add_acknowledged(node: NodeDescription, answer: StoreAnswer, failed: DvtcliError) -> None:
    word = word_of(answer.index)
    failed.details.insert(0, (word, f"0x{answer.place} acknowledged it before; it is not proved"))
    text = f"0x{answer.place} acknowledged the {word}, which is not proved; read back what node {node.node_id} holds"
    if failed.state == "left_changed":
        failed.state_text = f"LEFT CHANGED: see above; {text}"
    else:
        failed.state, failed.state_text = "unknown", f"unknown: {text}"


def uncovered_group(sub_index: int) -> str:
    """Why a proof says nothing about the group *sub_index* of 0x1010 or 0x1011; empty if the group covers PDOs."""
    if sub_index in (EVERYTHING, COMMUNICATION):
        return ""
    return f"PDOs are compared, but it is unknown whether group {sub_index} has them"


def unread_of(held: Snapshot, answer: StoreAnswer, after: Mapping[Pdo, PdoConfig] | None = None) -> str:
    """The values of *held* left out of the comparison because unreadable; empty if all were read.

    For the PDOs *after* a restart: the values unreadable both before and after.
    """
    objects = held.unread_of_group(answer.sub_index)
    parameters = [
        f"0x{index:04X}:{sub_index:02X} cannot be read"
        for pdo, config in (after or {}).items()
        for index, sub_index in config.untold
        if pdo in held.pdos and (index, sub_index) in held.pdos[pdo].untold
    ]
    unread = join_some([*parameters, *filter(None, [objects])])
    return unread and f"not compared: {unread}"


def prepare_proof(node: Node, before: Snapshot, sub_index: int | None, restart: Restart) -> AnyPlace | None:
    """Check before the store that a proof will be possible: values to compare, and a value to change as a test.

    *sub_index* is that of `write_signature`. Tries the change and rolls back; None if a power cycle needs no test.
    Raises DeviceRefused if the proof would be impossible or the node altered other values with the test (rolled back),
    LeftChanged if the roll-back failed. Nothing is stored in either case.
    """
    answer = refuse_unprovable(node, sub_index, certain=restart.certain)
    if unread := unread_of(before, answer, before.pdos):
        raise _unprovable(node, unread, AGAIN)
    if _saves_itself(answer):
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
    where, capability = chosen(node.access, node.profile.store, STORE_PARAMETERS, sub_index, node.dictionary)
    answer = StoreAnswer(STORE_PARAMETERS, where, 0.0, capability)
    if uncovered := uncovered_group(where):
        raise _unprovable(node, uncovered, _ALL)
    if (by_itself := _saves_itself(answer)) and not certain:
        raise _unprovable(node, by_itself, _POWER)
    if not certain:
        refuse_deaf_to_reset(node, _POWER)
    return answer


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


def _saves_itself(answer: StoreAnswer) -> str:
    """The reason that nothing is in RAM only, for a device that saves autonomously; else empty."""
    if answer.capability is None or not answer.capability & _BY_ITSELF:
        return ""
    return f"0x{answer.place} is {answer.capability}: the device saves by itself, too"


def prove_store(
    node: Node,
    before: Snapshot,
    answer: StoreAnswer,
    restart: Restart,
    place: AnyPlace | None,
    format_value: ValueFormatter = value_in_hex,
) -> Proof:
    """Restart *node* and compare it with *before*, read ahead of the acknowledged store.

    The canary at *place*, changed after the store, shows whether the restart cleared RAM. Errors mention the
    acknowledged store; LeftChanged if the canary could not be rolled back.
    """
    covered, policy = before.of_group(answer.sub_index), node.profile.store
    values = {address: value for address, value in covered.items() if policy.needed_for(address[0])}
    with acknowledged(node, answer):
        found = node.access.state()
        canary, unproved = _canary(node, place, answer)
        after, lost, kept = _restarted(node, restart, canary)
        unlike = [f"{label}: {text}" for label, text in value_differences(node, values, format_value)]
        return_to(node.access, found)
    hint = _POWER
    if kept is not None:
        after = kept.without(after)
        unproved = "RAM is kept over a reset, or the device stored on its own"
        if restart.certain:
            unproved, hint = (
                "RAM was kept, so this was not a power cycle, or the device stored on its own",
                _OFF_FOR_LONGER,
            )
    elif restart.certain:
        unproved = ""
    uncovered, unread = uncovered_group(answer.sub_index), unread_of(before, answer, after)
    return Proof(
        by=restart.by,
        compared=len(before.pdos),
        against="what was stored",
        differences=(*_differences(before.pdos, after), *unlike),
        unproved=uncovered or unread or unproved,
        canary="" if canary is None else canary.place.text,
        lost=lost,
        objects=len(values),
        hint=_ALL if uncovered else AGAIN if unread else hint if unproved else "",
        put_back="" if kept is None else kept.rolled_back_text,
        notes=before.notes,
    )


def _canary(node: Node, place: AnyPlace | None, answer: StoreAnswer) -> tuple[Canary | None, str]:
    """The canary, or the reason for its absence."""
    if place is None:
        return None, _saves_itself(answer) or _NO_PLACE
    canary = Canary(node, place)
    return (canary, "") if canary.write() else (None, f"it refused {place.name} after the store, and took it before")


def _restarted(
    node: Node, restart: Restart, canary: Canary | None
) -> tuple[dict[Pdo, PdoConfig], tuple[str, ...], AnyPlace | None]:
    """The PDOs after the restart, the lost changes, and the canary's place if it is still there."""
    try:
        restart.run()
        lost = node.was_reset(communication=restart.communication)
        node.gate.renew()
        after = node.pdos()
        is_kept = canary is not None and canary.is_still_there(after)
    except BaseException as fault:
        if canary is not None:
            canary.roll_back_after(fault)
        raise
    if canary is None:
        return after, lost, None
    if not is_kept:
        canary.close_journal()
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


@dataclass(frozen=True, slots=True)
class Snapshot:
    """A node's PDOs, and the single objects written by this session or an earlier session.

    *unread* are objects temporarily unreadable, each with the reason; *notes* describe other omissions.
    """

    pdos: Mapping[Pdo, PdoConfig]
    values: Mapping[ObjectAddress, bytes]
    notes: tuple[str, ...] = ()
    unread: Mapping[ObjectAddress, str] = field(default_factory=dict)

    @classmethod
    def now(cls, node: Node) -> Snapshot:
        """Read the node, without write-only objects and objects that move the machine."""
        written, notes = _written(node)
        values: dict[ObjectAddress, bytes] = {}
        unread: dict[ObjectAddress, str] = {}
        commands = [place for place in written if is_no_setting(node, place)]
        for place in (place for place in written if place not in commands):
            try:
                values[place] = node.sdo.upload(*place)
            except SdoAborted as aborted:
                if aborted.code in UNREADABLE:
                    notes += (f"not compared: {aborted.text}",)
                else:
                    unread[place] = aborted.text
        if commands:
            names = join_some(f"0x{index:04X}:{sub:02X}" for index, sub in commands)
            notes += (f"not compared: {names}, since a command or a target is not a setting",)
        blind = [f"0x{index:04X}:{sub:02X} {why_unreadable(index)}" for index, sub in node.unreadable_values]
        notes += (f"not compared: {join_some(blind)}",) if blind else ()
        return cls(node.pdos(), values, notes, unread)

    def of_group(self, sub_index: int) -> dict[ObjectAddress, bytes]:
        """The objects covered by group *sub_index* of 0x1010 or 0x1011; empty for a manufacturer group."""
        return {place: value for place, value in self.values.items() if _is_in(place, sub_index)}

    def unread_of_group(self, sub_index: int) -> str:
        """The unreadable objects of the group with their reasons; empty if all were read."""
        return join_some(text for place, text in self.unread.items() if _is_in(place, sub_index))


def _is_in(place: ObjectAddress, sub_index: int) -> bool:
    low, high = GROUPS.get(sub_index, (1, 0))
    return low <= place[0] <= high


def _written(node: Node) -> tuple[list[ObjectAddress], tuple[str, ...]]:
    """The single objects written by any process, and messages if the list may be incomplete."""
    places, notes = dict.fromkeys(node.wanted_values), ()
    if node.guard is None:
        return list(places), notes
    try:
        history = node.guard.history.all_of(node.node_id, node.identity())
    except InputFileError as damaged:
        return list(places), (f"objects that an earlier command wrote are not compared: {damaged.text}",)
    for entry in history:
        places |= dict.fromkeys(_values_of(entry.plan, node.saves))
    return list(places), notes


def _values_of(plan: Plan, saves: Callable[[ObjectAddress], bool]) -> Iterator[ObjectAddress]:
    for change in plan.changes:
        if isinstance(change, ValueChange) and change.step.before is not None:
            place = (change.step.index, change.step.sub_index)
            if Pdo.at(place[0]) is None and not saves(place):
                yield place
