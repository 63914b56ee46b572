"""What the virtual PDOs of a node are tied to, as `vpdo` of a network file. Writes nothing.

Does not know PDOs on the bus.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from typing import TYPE_CHECKING

from dvtcli.device.read_pdos import read_optional
from dvtcli.domain.network.wanted_state import FileWord, PinWish
from dvtcli.errors import SdoAborted

if TYPE_CHECKING:
    from dvtcli.domain.ports import SdoReader
    from dvtcli.domain.profile import VpdoGroup


def exported_pins(values: SdoReader, groups: Mapping[str, VpdoGroup]) -> Iterator[PinWish]:
    """The active pins of each of *groups* by name, as far as the last one that is tied to something."""
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
