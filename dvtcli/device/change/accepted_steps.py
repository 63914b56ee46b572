"""What a device acknowledged of a plan, and whether it still holds that: a restart that nobody heard takes it.

Knows what was written. Does not know boot-up messages, and writes nothing.
"""

from __future__ import annotations

from dataclasses import dataclass, field

from dvtcli.domain.plan import Change, PdoChange, Step, ValueChange
from dvtcli.domain.ports import SdoTransport
from dvtcli.errors import DvtcliError, SdoAborted


@dataclass(slots=True)
class AcceptedSteps:
    """The last value of each object that the device took, where it can be read."""

    _values: dict[tuple[int, int], bytes] = field(default_factory=dict)
    #: objects that cannot be read back
    _unreadable: set[tuple[int, int]] = field(default_factory=set)

    def took(self, step: Step, change: Change) -> None:
        """The device acknowledged *step* of *change*."""
        place = step.index, step.sub_index
        if isinstance(change, PdoChange) or change.is_readable:
            self._values[place] = step.after
        else:
            self._unreadable.add(place)

    def was_taken(self, change: ValueChange) -> bool:
        """Whether the device acknowledged *change*, whose object cannot be read back."""
        return (change.step.index, change.step.sub_index) in self._unreadable

    def still_held(self, sdo: SdoTransport) -> bool:
        """Whether all of it is read back; not where there is nothing, or the device does not answer."""
        try:
            return bool(self._values) and all(self._is_held(sdo, *place) for place in self._values)
        except DvtcliError:
            return False

    def _is_held(self, sdo: SdoTransport, index: int, sub_index: int) -> bool:
        try:
            return sdo.upload(index, sub_index) == self._values[index, sub_index]
        except SdoAborted:  # an entry behind the count: it tells nothing
            return True
