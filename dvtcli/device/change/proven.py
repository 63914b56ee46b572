"""Proving a store or a restore: what a node holds after it was reset, and whether that shows anything.

Nothing is proven by a value that could be there anyway: a reset must be seen to take what was in RAM only. Does not
know screens, and asks nobody.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping
from contextlib import contextmanager
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING

from dvtcli.device.canary import Canary, Place, harmless_places
from dvtcli.device.change.pending import COMMUNICATION, EVERYTHING
from dvtcli.device.compare import differences as pdo_differences
from dvtcli.device.eds_defaults import differing_from_defaults, values_unlike_defaults
from dvtcli.device.held import Held
from dvtcli.device.store_parameters import Signed, return_to, word_of
from dvtcli.device.wish import unlike_values
from dvtcli.domain.pdo import Pdo, PdoConfig
from dvtcli.domain.proof import POWER, Proof
from dvtcli.domain.several import several
from dvtcli.errors import DvtcliError

if TYPE_CHECKING:
    from dvtcli.device.node import Node
    from dvtcli.domain.object_dictionary import ObjectDictionary

Pdos = Mapping[Pdo, PdoConfig]
#: bit of 0x1010 and 0x1011 by which a device says that it saves without being told (CiA 301, 7.5.2.13)
_BY_ITSELF = 2
#: What finds out what a reset cannot, and what to do where a power cycle was none.
_POWER = "store --prove power finds out"
_RESTORE_ALL = "restore all --prove takes and compares them"
_MANUAL = "`pdo` shows what it holds; its manual may tell the defaults"
_AGAIN = "once more with --prove: what refuses to be read for a moment is read then"
_OFF_FOR_LONGER = "switch it off until nothing of it is lit, and `store --prove power` again"


@dataclass(frozen=True, slots=True)
class Restart:
    """A way to make a node forget its RAM, *by* one of `domain.proof`: *run* returns once its boot-up was heard."""

    by: str
    run: Callable[[], None]
    communication: bool = False

    @property
    def certain(self) -> bool:
        """Whether RAM had no power, so that nothing can be in it that was not stored."""
        return self.by == POWER


def prepare_proof(node: Node, before: Pdos) -> None:
    """Ask now what the proof would have to ask later, when the store is done: the canary needs the gate."""
    if next(harmless_places(node, before), None) is not None:
        node.gate.enter()


def prove_store(node: Node, before: Held, signed: Signed, restart: Restart) -> Proof:
    """Restart *node* and compare it with *before*, read ahead of the store that the device acknowledged.

    A canary, changed after the store, shows whether the restart took what was in RAM. Errors say that the store was
    acknowledged; LeftChanged where the canary could not be put back.
    """
    covered, policy = before.of_group(signed.sub_index), node.profile.store
    values = {place: value for place, value in covered.items() if policy.needed_for(place[0])}
    with _acknowledged(node, signed):
        found = node.access.state()
        canary, blind = _canary(node, before.pdos, signed)
        after, lost, survived = _restarted(node, restart, canary)
        unlike = [f"{place}: {text}" for place, text in unlike_values(node, values)]
        return_to(node.access, found)
    hint = _POWER
    if survived is not None:
        after = {**after, survived.pdo: _without(survived, after[survived.pdo])}
        blind = "RAM is kept over a reset, or it was saved by itself"
        if restart.certain:
            blind, hint = "RAM was kept, so this was no power cycle, or it was saved by itself", _OFF_FOR_LONGER
    elif restart.certain:
        blind = ""
    uncovered, unread = _uncovered(signed.sub_index), _unread(before, signed, after)
    return Proof(
        restart.by,
        len(before.pdos),
        "what was stored",
        (*_differences(before.pdos, after), *unlike),
        uncovered or unread or blind,
        "" if canary is None else canary.place.text,
        lost,
        len(values),
        "store all --prove takes and compares them" if uncovered else _AGAIN if unread else hint if blind else "",
        "" if survived is None else survived.put_back_text,
        notes=before.notes,
    )


@contextmanager
def _acknowledged(node: Node, signed: Signed) -> Iterator[None]:
    """A block that proves what *signed*; a failure in it must not read as if nothing had been written."""
    try:
        yield
    except DvtcliError as failed:
        word = word_of(signed.index)
        failed.details.insert(0, (word, f"0x{signed.place} acknowledged it before; it is not proved"))
        said = (
            f"0x{signed.place} acknowledged the {word}, which is not proved; read back what node {node.node_id} holds"
        )
        if failed.state == "left_changed":
            failed.state_text = f"LEFT CHANGED: see above; {said}"
        else:
            failed.state, failed.state_text = "unknown", f"unknown: {said}"
        raise


def _canary(node: Node, before: Pdos, signed: Signed) -> tuple[Canary | None, str]:
    """The canary, or why there is none."""
    if signed.capability is not None and signed.capability & _BY_ITSELF:
        return None, f"0x{signed.place} is {signed.capability}: the device saves by itself, too"
    canary = Canary.planted(node, before)
    return canary, "" if canary is not None else _why_none(node, before)


def _why_none(node: Node, before: Pdos) -> str:
    """Why no value could be changed in RAM."""
    if all(config.enabled for config in before.values()):
        return "no PDO is off, so nothing could be changed harmlessly to test the reset"
    if next(harmless_places(node, before), None) is None:
        return "no PDO that is off has a timer or a type that may be changed to test the reset"
    return "it refused every harmless change of a PDO that is off, so the reset could not be tested"


def _restarted(
    node: Node, restart: Restart, canary: Canary | None
) -> tuple[dict[Pdo, PdoConfig], tuple[str, ...], Place | None]:
    """The PDOs after the restart, the changes that it took, and the canary's place where the canary survived."""
    try:
        restart.run()
        lost = node.was_reset(communication=restart.communication)
        node.gate.renew()
        after = node.pdos()
    except BaseException as fault:
        if canary is not None:
            canary.put_back_after(fault)
        raise
    if canary is None:
        return after, lost, None
    if not canary.survived(after):
        canary.gone()
        return after, lost, None
    canary.put_back()
    return after, lost, canary.place


def _without(place: Place, held: PdoConfig) -> PdoConfig:
    """*held* with the canary's value as it was before: it has been put back."""
    value = getattr(place.before.communication, place.field)
    return replace(held, communication=replace(held.communication, **{place.field: value}))


def _uncovered(sub_index: int) -> str:
    if sub_index in (EVERYTHING, COMMUNICATION):
        return ""
    return f"PDOs are what is compared, and nobody says that group {sub_index} has them"


def _unread(held: Held, signed: Signed, after: Pdos | None = None) -> str:
    """What of *held* could not be compared, since it could not be read at that moment; empty where all could.

    Of the PDOs *after* a restart that is what they told neither before it.
    """
    objects = held.unread_of_group(signed.sub_index)
    untold = [
        f"0x{index:04X}:{sub_index:02X} cannot be read"
        for pdo, config in (after or {}).items()
        for index, sub_index in config.untold
        if pdo in held.pdos and (index, sub_index) in held.pdos[pdo].untold
    ]
    unread = several([*untold, *filter(None, [objects])])
    return unread and f"not compared: {unread}"


def _differences(before: Pdos, after: Pdos) -> list[str]:
    """Every parameter of a PDO that is not what it was, in words."""
    differences = []
    for pdo, config in before.items():
        if pdo not in after:
            differences.append(f"{pdo.label} is gone")
        else:
            differences += [f"{pdo.label}: {text}" for text in _unread_before(config, after[pdo])]
            differences += [f"{pdo.label}: {text}" for text in pdo_differences(pdo, config, after[pdo])]
    return differences


def _unread_before(before: PdoConfig, after: PdoConfig) -> Iterator[str]:
    """What the device tells now and did not tell *before*: nobody can say that it is the same."""
    for index, sub_index in before.lacking:
        if (index, sub_index) not in after.lacking:
            yield f"0x{index:04X}:{sub_index:02X} could not be read before"


def _is_otherwise(before: PdoConfig, after: PdoConfig | None) -> bool:
    """Whether a PDO of which as much is told as *before* holds something else."""
    return after is not None and after.lacking == before.lacking and after != before


def restart_and_read(node: Node, restart: Restart) -> tuple[Held, tuple[str, ...]]:
    """Restart *node*; what it holds then, and the labels of the changes that this took."""
    restart.run()
    lost = node.was_reset(communication=restart.communication)
    node.gate.renew()
    return Held.now(node), lost


def prove_restore(
    node: Node, signed: Signed, restart: Restart, before: Held | None, lost_before: tuple[str, ...] = ()
) -> Proof:
    """Restart *node*, whose restore was acknowledged, and compare what it holds with the defaults of the EDS.

    That are its PDOs, and the single objects that dvtcli wrote. *before* is what it held ahead of the restore.
    Without an EDS, or with that of another device, a PDO must differ from *before*, read after a restart that took
    *lost_before*.
    """
    with _acknowledged(node, signed):
        after, lost = restart_and_read(node, restart)
    lost = (*lost_before, *lost)
    if node.dictionary is not None and not node.unlike_file:
        return _against_defaults(node, node.dictionary, signed, restart, before, after, lost)
    uncovered = _uncovered(signed.sub_index)
    changed = sum(_is_otherwise(config, after.pdos.get(pdo)) for pdo, config in (before.pdos if before else {}).items())
    who = "the EDS is another device's" if node.unlike_file else "no EDS tells the defaults"
    unproved = f"{who}, and nothing differs from what was stored before"
    return Proof(
        restart.by, changed, "what was stored before", (), uncovered or ("" if changed else unproved), lost=lost,
        hint=_RESTORE_ALL if uncovered else "--eds FILE tells its defaults", notes=after.notes,
    )  # fmt: skip


def _against_defaults(
    node: Node,
    dictionary: ObjectDictionary,
    signed: Signed,
    restart: Restart,
    before: Held | None,
    after: Held,
    lost: tuple[str, ...],
) -> Proof:
    uncovered, against = _uncovered(signed.sub_index), f"the defaults of {dictionary.source or 'the EDS'}"

    def look(held: Held) -> Proof:
        pdos = differing_from_defaults(dictionary, node.profile, node.node_id, {} if uncovered else held.pdos)
        objects = values_unlike_defaults(dictionary, node.node_id, held.of_group(signed.sub_index))
        untold = several((*pdos.untold, *objects.untold))
        said = (f"not compared: {untold}, of which the EDS tells no default or the node no value",) if untold else ()
        return Proof(
            restart.by, pdos.compared, against, (*pdos.differences, *objects.differences), objects=objects.compared,
            notes=(*held.notes, *said),
        )  # fmt: skip

    found = look(after)
    told, unread = found.compared or found.objects, _unread(after, signed)
    differed = set() if before is None else set(look(before).differing) - set(lost)  # a reset takes those anyway
    return replace(
        found,
        unproved=uncovered or unread or ("" if told else "the EDS tells no defaults of its PDOs"),
        lost=lost,
        hint=_RESTORE_ALL
        if uncovered
        else _AGAIN
        if unread
        else "`pdo` shows what it holds; its manual may tell the defaults",
        already=not differed,
    )
