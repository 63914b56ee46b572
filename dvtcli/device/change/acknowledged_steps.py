"""The values that a device acknowledged during a change, and whether it still holds them. Writes nothing."""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import TYPE_CHECKING

from dvtcli.domain.plan import Change, PdoChange, Step, ValueChange
from dvtcli.domain.ports import SdoTransport
from dvtcli.errors import DvtcliError, SdoAborted

if TYPE_CHECKING:
    pass


@dataclass(slots=True)
class AcknowledgedSteps:
    """The last acknowledged value of each readable object."""

    _values: dict[tuple[int, int], bytes] = field(default_factory=dict)
    #: unreadable objects
    _unreadable: set[tuple[int, int]] = field(default_factory=set)

    def took(self, step: Step, change: Change) -> None:
        """Record that the device acknowledged *step* of *change*."""
        place = step.index, step.sub_index
        if isinstance(change, PdoChange) or change.is_readable:
            self._values[place] = step.after
        else:
            self._unreadable.add(place)

    def was_taken(self, change: ValueChange) -> bool:
        """True if the device acknowledged *change* to an object without read access."""
        return (change.step.index, change.step.sub_index) in self._unreadable

    def still_held(self, sdo: SdoTransport) -> bool:
        """True if every value reads back equal; false without any value or answer."""
        try:
            return bool(self._values) and all(self._is_held(sdo, *place) for place in self._values)
        except DvtcliError:
            return False

    def _is_held(self, sdo: SdoTransport, index: int, sub_index: int) -> bool:
        try:
            return sdo.upload(index, sub_index) == self._values[index, sub_index]
        except SdoAborted:  # an entry behind the count: it tells nothing
            return True
