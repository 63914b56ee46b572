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
from dvtcli.device.eds_defaults import differing_from_defaults
from dvtcli.device.store_parameters import Signed, return_to, word_of
from dvtcli.domain.pdo import Pdo, PdoConfig
from dvtcli.domain.proof import Proof
from dvtcli.errors import DvtcliError

if TYPE_CHECKING:
    from dvtcli.device.node import Node

Pdos = Mapping[Pdo, PdoConfig]
#: bit of 0x1010 and 0x1011 by which a device says that it saves without being told (CiA 301, 7.5.2.13)
_BY_ITSELF = 2


@dataclass(frozen=True, slots=True)
class Restart:
    """A way to make a node forget its RAM, *by* one of `domain.proof`: *run* returns once its boot-up was heard.

    *certain* says that RAM had no power, so that nothing can be in it that was not stored.
    """

    by: str
    run: Callable[[], None]
    certain: bool = False
    communication: bool = False


def prepare_proof(node: Node, before: Pdos) -> None:
    """Ask now what the proof would have to ask later, when the store is done: the canary needs the gate."""
    if next(harmless_places(node, before), None) is not None:
        node.gate.enter()


def prove_store(node: Node, before: Pdos, signed: Signed, restart: Restart) -> Proof:
    """Restart *node* and compare its PDOs with *before*, read ahead of the store that the device acknowledged.

    A canary, changed after the store, shows whether the restart took what was in RAM. Errors say that the store was
    acknowledged; LeftChanged where the canary could not be put back.
    """
    with _acknowledged(node, signed):
        found = node.access.state()
        canary, blind = _canary(node, before, signed)
        after, lost, survived = _restarted(node, restart, canary)
        return_to(node.access, found)
    if survived is not None:
        after = {**after, survived.pdo: _without(survived, after[survived.pdo])}
        blind = "RAM is kept over a reset, or it was saved by itself"
        if restart.certain:
            blind = "RAM was kept, so this was no power cycle, or it was saved by itself"
    elif restart.certain:
        blind = ""
    unproved = _uncovered(signed.sub_index) or blind
    text = "" if canary is None else canary.place.text
    return Proof(restart.by, len(before), "what was stored", tuple(_differences(before, after)), unproved, text, lost)


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
    return (
        canary,
        "" if canary is not None else "no PDO is off, so nothing could be changed harmlessly to test the reset",
    )


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


def _differences(before: Pdos, after: Pdos) -> list[str]:
    """Every parameter of a PDO that is not what it was, in words."""
    differences = []
    for pdo, config in before.items():
        if pdo not in after:
            differences.append(f"{pdo.label} is gone")
        else:
            differences += [f"{pdo.label}: {text}" for text in pdo_differences(pdo, config, after[pdo])]
    return differences


def restart_and_read(node: Node, restart: Restart) -> tuple[dict[Pdo, PdoConfig], tuple[str, ...]]:
    """Restart *node*; its PDOs then, and the labels of the changes that this took."""
    restart.run()
    lost = node.was_reset(communication=restart.communication)
    node.gate.renew()
    return node.pdos(), lost


def prove_restore(node: Node, signed: Signed, restart: Restart, earlier: Pdos | None) -> Proof:
    """Restart *node*, whose restore was acknowledged, and compare its PDOs with the defaults of the EDS.

    Without an EDS something must differ from *earlier*, read after a restart ahead of the restore.
    """
    with _acknowledged(node, signed):
        after, lost = restart_and_read(node, restart)
    uncovered = _uncovered(signed.sub_index)
    if node.dictionary is not None:
        compared, found = differing_from_defaults(node.dictionary, node.profile, node.node_id, after)
        unproved = uncovered or ("" if compared else "the EDS tells no defaults of its PDOs")
        against = f"the defaults of {node.dictionary.source or 'the EDS'}"
        return Proof(restart.by, compared, against, () if uncovered else tuple(found), unproved, "", lost)
    changed = sum(after.get(pdo) != config for pdo, config in (earlier or {}).items())
    unproved = "no EDS tells the defaults, and nothing differs from what was stored before"
    return Proof(
        restart.by, changed, "what was stored before", (), uncovered or ("" if changed else unproved), "", lost
    )
