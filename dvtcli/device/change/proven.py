"""Proving a store: what a node holds after it was reset, and whether that shows anything.

Nothing is proven by a value that could be there anyway: a reset must be seen to take what was in RAM only. Does not
know screens, and asks nobody.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from dataclasses import replace
from typing import TYPE_CHECKING

from dvtcli.device.canary import Canary, Place, harmless_places
from dvtcli.device.change.proving import AGAIN, Restart, acknowledged, uncovered_group, unread_of
from dvtcli.device.compare import differences as pdo_differences
from dvtcli.device.held import Held
from dvtcli.device.resets import return_to
from dvtcli.device.store_parameters import Signed
from dvtcli.device.wish import Says, unlike_values, value_in_hex
from dvtcli.domain.pdo import Pdo, PdoConfig
from dvtcli.domain.proof import Proof

if TYPE_CHECKING:
    from dvtcli.device.node import Node

Pdos = Mapping[Pdo, PdoConfig]
#: bit of 0x1010 and 0x1011 by which a device says that it saves without being told (CiA 301, 7.5.2.13)
_BY_ITSELF = 2
#: What finds out what a reset cannot, and what to do where a power cycle was none.
_POWER = "store --prove power finds out"
_OFF_FOR_LONGER = "switch it off until nothing of it is lit, and `store --prove power` again"


def prepare_proof(node: Node, before: Pdos) -> None:
    """Ask now what the proof would have to ask later, when the store is done: the canary needs the gate."""
    if next(harmless_places(node, before), None) is not None:
        node.gate.enter()


def prove_store(node: Node, before: Held, signed: Signed, restart: Restart, says: Says = value_in_hex) -> Proof:
    """Restart *node* and compare it with *before*, read ahead of the store that the device acknowledged.

    Values are said as *says* does. A canary, changed after the store, shows whether the restart took what was in RAM.
    Errors say that the store was acknowledged; LeftChanged where the canary could not be put back.
    """
    covered, policy = before.of_group(signed.sub_index), node.profile.store
    values = {place: value for place, value in covered.items() if policy.needed_for(place[0])}
    with acknowledged(node, signed):
        found = node.access.state()
        canary, blind = _canary(node, before.pdos, signed)
        after, lost, survived = _restarted(node, restart, canary)
        unlike = [f"{place}: {text}" for place, text in unlike_values(node, values, says)]
        return_to(node.access, found)
    hint = _POWER
    if survived is not None:
        after = {**after, survived.pdo: _without(survived, after[survived.pdo])}
        blind = "RAM is kept over a reset, or it was saved by itself"
        if restart.certain:
            blind, hint = "RAM was kept, so this was no power cycle, or it was saved by itself", _OFF_FOR_LONGER
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
        "store all --prove takes and compares them" if uncovered else AGAIN if unread else hint if blind else "",
        "" if survived is None else survived.put_back_text,
        notes=before.notes,
    )


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
