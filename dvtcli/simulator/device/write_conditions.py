"""Conditions of a simulated device for downloads beyond CiA 301: access level, NMT state, selected objects.

Also the NMT state that a download forces, and the reasons of refusals in the family's own object.
"""

from __future__ import annotations

from dvtcli.domain.abort import Abort
from dvtcli.domain.nmt import NmtState
from dvtcli.domain.profile import within
from dvtcli.simulator.device.family import Family, Login
from dvtcli.simulator.device.memory import Memory, Refusal

LEVEL, PASSCODE, USER_ID = 1, 2, 3
NOT_PRE_OPERATIONAL, LEVEL_TOO_LOW, LOGIN_FAILED, VALUE_INVALID = 4, 8, 9, 12


class WriteConditions:
    """Conditions of one device for a download beyond CiA 301."""

    def __init__(self, memory: Memory, family: Family) -> None:
        self._memory = memory
        self._family = family
        self.reset(communication_only=False)

    @property
    def is_master(self) -> bool:
        """True if the node is the NMT master and ignores NMT commands."""
        master = self._family.master_object
        return master is not None and self._memory.number(*master) == 1

    def check(self, index: int, state: NmtState) -> None:
        """Raise Refusal if the access level or *state* does not allow a download to *index*."""
        login = self._family.login
        if login is not None and within(index, login.writes) and self._level(login) < login.level:
            raise Refusal(Abort.GENERAL, LEVEL_TOO_LOW)
        if state is not NmtState.PRE_OPERATIONAL and within(index, self._family.pre_operational_writes):
            raise self._wrong_state()

    def check_selection(self, index: int, sub_index: int, data: bytes) -> None:
        """Raise Refusal if a virtual PDO would name an object missing in the node."""
        if sub_index == 0 or index not in self._selectors:
            return
        selected = int.from_bytes(data, "little")
        if selected & 0xFF != 0xFF and selected not in self._memory.dictionary and self._memory.backing is None:
            raise Refusal(Abort.GENERAL, VALUE_INVALID)

    @property
    def _selectors(self) -> set[int]:
        motors = self._family.motors
        return {each.selector for each in self._family.pins} | ({motors.selector} if motors else set())

    def _wrong_state(self) -> Refusal:
        if self._family.extended_error is None:
            return Refusal(self._family.wrong_state)
        return Refusal(Abort.GENERAL, NOT_PRE_OPERATIONAL)

    def _level(self, login: Login) -> int:
        return self._memory.number(login.index, LEVEL)

    def reset(self, *, communication_only: bool) -> None:
        """Set the family's initial access level; a communication reset keeps the login."""
        login = self._family.login
        if login is not None and login.start is not None and not communication_only:
            self._memory.write(login.index, LEVEL, bytes([login.start]))

    def is_passcode(self, index: int, sub_index: int) -> bool:
        """True if a download to the object is a login or logout."""
        return self._family.login is not None and (index, sub_index) == (self._family.login.index, PASSCODE)

    def log_in(self, data: bytes) -> None:
        """Set the access level of the passcode in *data*. Raises Refusal (08000000) for an unknown passcode.

        A twin of a real device (with a backing) cannot know its passcodes and accepts any.
        """
        login = self._family.login
        if login is None:
            return
        passcode = int.from_bytes(data, "little")
        unknown = max(login.passcodes.values()) if self._memory.backing is not None else 0
        level = login.passcodes.get(passcode, unknown) if passcode else 0
        if not self._memory.number(login.index, USER_ID):
            level = 0
        self._memory.write(login.index, LEVEL, bytes([level]))
        if passcode and not level:
            raise Refusal(Abort.GENERAL, LOGIN_FAILED)

    def forced_state(self, index: int, sub_index: int) -> NmtState | None:
        """The state forced by a download just made to the object, None for none."""
        if (index, sub_index) != self._family.state_request or not self.is_master:
            return None
        forced = self._memory.number(index, sub_index)
        return NmtState.PRE_OPERATIONAL if forced else NmtState.OPERATIONAL

    def granted(self, wanted: NmtState | None, now: NmtState) -> NmtState:
        """The new state of a device in *now* after a request for *wanted*, None for none."""
        stays = self._family.stays_operational and now is NmtState.OPERATIONAL
        return now if stays or wanted is None else wanted

    def explained(self, refusal: Refusal) -> Refusal:
        """The refusal in this family's form, with its reason in the extended error object."""
        place = self._family.extended_error
        if place is None:
            return refusal
        reason = self._family.reasons.get(refusal.code, refusal.reason)
        if reason is None:
            return refusal
        self._memory.write(*place, reason.to_bytes(self._memory.size(*place) or 2, "little"))
        return Refusal(Abort.GENERAL, reason)
