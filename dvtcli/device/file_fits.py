"""Check whether a file describes the connected device, and a family's rules match the file. Reads nothing."""

from __future__ import annotations

from dataclasses import replace
from typing import TYPE_CHECKING

from dvtcli.domain.hint import Action, Hint
from dvtcli.domain.objects import IDENTITY, STORE_PARAMETERS
from dvtcli.errors import SafetyRefusal

if TYPE_CHECKING:
    from dvtcli.device.change.plan_document import Identity
    from dvtcli.domain.object_dictionary import ObjectDictionary
    from dvtcli.domain.profile import DeviceProfile


def unlike_before(before: Identity, now: Identity) -> str:
    """The difference between the identities (0x1018) *before* and *now*; empty if equal."""
    return ", ".join(
        f"{name} {_shown(now.get(name))}, was {_shown(known)}"
        for name, known in before.items()
        if now.get(name) != known
    )


def another_device(node_id: int, unlike: str) -> SafetyRefusal:
    """The error for continuing on another device, with the difference *unlike*."""
    return SafetyRefusal(
        f"node {node_id} is not the device that it was before the bus was lost",
        node=node_id,
        place="1018",
        why=unlike,
        hint=Hint(
            Action.SHOW_NODE, {"node": node_id}, "check that it is the right file; {} uses it and starts again with it"
        ),
    )


def _shown(value: int | None) -> str:
    return "none" if value is None else f"0x{value:08X}"


_PARTS = (("vendor", 1), ("product", 2))


def unlike_file(node_id: int, dictionary: ObjectDictionary, identity: tuple[int | None, int | None]) -> str:
    """The difference between *identity* (vendor and product of 0x1018) and *dictionary*; empty if they may match.

    0 means unknown in a file and in a device. A file may give its product twice, as ProductNumber and as default of
    0x1018:02; one match is enough.
    """
    info = dictionary.info
    file_numbers = {1: info.vendor_id, 2: info.product_code}
    for (name, sub_index), held in zip(_PARTS, identity, strict=True):
        described = {file_numbers[sub_index], _default(dictionary, sub_index, node_id)} - {None, 0}
        if held and described and held not in described:
            expected = " or ".join(f"0x{number:08X}" for number in sorted(filter(None, described)))
            return f"{dictionary.source or 'the EDS'} is about {name} {expected}, node {node_id} is {name} 0x{held:08X}"
    return ""


def _default(dictionary: ObjectDictionary, sub_index: int, node_id: int) -> int | None:
    entry = dictionary.entry(IDENTITY, sub_index)
    data = None if entry is None else entry.initial(node_id)
    return None if data is None else int.from_bytes(data, "little")


def refuse_unlike_file(node_id: int, unlike: str, *, force: bool, hint: Hint | None = None) -> None:
    """Raise SafetyRefusal if *unlike* (from `unlike_file`) names a difference, except with *force*.

    *hint* is what to do instead of forcing it; None: give this device's file.
    """
    if unlike and not force:
        raise SafetyRefusal(
            f"the EDS is another device's: {unlike}",
            node=node_id,
            place="1018:01" if "vendor" in unlike else "1018:02",
            hint=(hint or Hint(Action.GIVE_EDS, why="{} of this device; without an EDS fewer rules are checked"))
            + Hint(Action.FORCE, why="uses this file"),
        )


def as_file_says(profile: DeviceProfile, dictionary: ObjectDictionary | None) -> DeviceProfile:
    """*profile*, corrected if it denies the device a store (0x1010) listed in its file."""
    if dictionary is None or profile.store.sub_indices or STORE_PARAMETERS not in dictionary:
        return profile
    entries = dictionary[STORE_PARAMETERS].entries
    subs = tuple(sub for sub, entry in entries.items() if sub and entry.access.writable)
    return replace(profile, store=replace(profile.store, sub_indices=subs, instead="")) if subs else profile
