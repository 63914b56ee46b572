"""The NMT state of a device, the pre-operational gate, and the device's reasons for an abort."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, field

from dvtcli.device.read_pdos import ABSENT, read_optional
from dvtcli.domain.abort import Abort
from dvtcli.domain.nmt import NmtCommand, NmtState
from dvtcli.domain.ports import CanopenBus
from dvtcli.domain.profile import DeviceProfile, ObjectAddress, PreOperational
from dvtcli.domain.text import join_some
from dvtcli.errors import DeviceRefused, DvtcliError, NoAnswer, SdoAborted, SdoProtocolError, stopped_node

#: How long a node may take to confirm a state change, in seconds.
CONFIRM_TIMEOUT_S = 2.0


@dataclass(slots=True, eq=False, repr=False)
class NodeAccess:
    """State and abort reasons of one node, read according to its *profile*."""

    bus: CanopenBus
    node_id: int
    profile: DeviceProfile

    def state(self, timeout_s: float = 0.0) -> NmtState | None:
        """The NMT state, from the node's state object if any, else from heartbeats; None if unknown."""
        if self.profile.state_object is None:
            return self.bus.nmt_state(self.node_id, timeout_s)
        received = self.bus.nmt_state(self.node_id)
        if received is NmtState.STOPPED:
            return received
        try:
            data = self.bus.sdo(self.node_id).upload(*self.profile.state_object)
        except SdoAborted as aborted:
            if aborted.code not in ABSENT:
                raise
            return received if received is not None else self.bus.nmt_state(self.node_id, timeout_s)
        value = int.from_bytes(data, "little")
        return NmtState(value) if value in list(NmtState) else None

    def explain(self, aborted: SdoAborted) -> None:
        """Add the device's own reason to a general abort (0x08000000), if the profile has a source."""
        if aborted.code != Abort.GENERAL or self.profile.extended_error is None:
            return
        index, sub_index = self.profile.extended_error
        try:
            reason = int.from_bytes(self.bus.sdo(self.node_id).upload(index, sub_index), "little")
        except DvtcliError as failed:
            aborted.why = f"the device's reason at 0x{index:04X}:{sub_index:02X} could not be read: {failed.text}"
            return
        text = self.profile.reasons.get(reason, "a reason that is not in the profile")
        aborted.why = f"the device says {reason} at 0x{index:04X}:{sub_index:02X}: {text}"

    def request(self, state: NmtState) -> None:
        """Bring the node to PRE-OPERATIONAL or OPERATIONAL and confirm. Raises DeviceRefused if the state stays.

        An NMT master takes its state from its own object, a slave from NMT. A master remembers the request even without
        power: a request not obeyed is withdrawn (the published Gen4 manual).
        """
        if self.profile.state_request is None or not self.is_master():
            command = NmtCommand.ENTER_PRE_OPERATIONAL if state is NmtState.PRE_OPERATIONAL else NmtCommand.START
            self.bus.send_nmt(command, self.node_id)
            self._confirm(state)
            return
        self._force(self.profile.state_request, state)
        try:
            self._confirm(state)
        except DeviceRefused:
            if state is NmtState.PRE_OPERATIONAL:
                self._force(self.profile.state_request, NmtState.OPERATIONAL)
            raise

    def _force(self, place: ObjectAddress, state: NmtState) -> None:
        index, sub_index = place
        value = 1 if state is NmtState.PRE_OPERATIONAL else 0
        try:
            self.bus.sdo(self.node_id).download(index, sub_index, bytes([value]))
        except SdoAborted as aborted:
            self.explain(aborted)
            raise

    def insist(self, state: NmtState) -> None:
        """As `request`, with retries for a while if the node is silent or aborts: it may be rebooting.

        Repeats the request as well if the node restarted after it.
        """
        from dvtcli.device.change.roll_back import PATIENCE_S, RETRY_S

        deadline_s = self.bus.now_s() + PATIENCE_S
        while True:
            disturbance_count = self.bus.disturbance_count(self.node_id)
            try:
                self.request(state)
            except (NoAnswer, SdoProtocolError, SdoAborted, DeviceRefused) as failed:
                stays = (
                    isinstance(failed, DeviceRefused) and self.bus.disturbance_count(self.node_id) == disturbance_count
                )
                if stays or self.bus.now_s() >= deadline_s:
                    raise
                self.bus.sleep(RETRY_S)
            else:
                return

    def is_master(self) -> bool:
        """True if the node reports to be an NMT master, which obeys no NMT command."""
        if self.profile.master_object is None:
            return False
        return bool(read_optional(self.bus.sdo(self.node_id), *self.profile.master_object, 1))  # none: not one

    def confirmed(self, wanted: NmtState, timeout_s: float) -> NmtState | None:
        """The state reported within *timeout_s*, as soon as it is *wanted*; None without a report.

        A stopped node answers no SDO: STOPPED is known from heartbeats only.
        """
        deadline_s = self.bus.now_s() + timeout_s
        state = None
        while (left_s := deadline_s - self.bus.now_s()) > 0:
            received_only = wanted is NmtState.STOPPED or self.profile.state_object is None
            state = self.bus.nmt_state(self.node_id, left_s) if received_only else self.state()
            if state is wanted:
                return state
            self.bus.sleep(0.005)
        return state

    def _confirm(self, wanted: NmtState) -> None:
        state = self.confirmed(wanted, CONFIRM_TIMEOUT_S)
        if state is wanted or state is None:
            return
        raise DeviceRefused(
            f"node {self.node_id} did not reach {wanted.label}",
            node=self.node_id,
            why=f"it says {state.label} after {CONFIRM_TIMEOUT_S:.0f} s",
            hint="a vehicle that is active may refuse; stop it and try again",
        )


@dataclass(slots=True, eq=False, repr=False)
class Gate:
    """Keeps a node PRE-OPERATIONAL during work on it, if its profile requires.

    *consent* is called before a node leaves OPERATIONAL, and returns or raises.
    """

    access: NodeAccess
    consent: Callable[[str], None]
    found: NmtState | None = None
    entered: bool = False
    #: changes of the node since the gate was entered, in words: they stay if the node does not come back
    done: list[str] = field(default_factory=list)
    #: the question before the node leaves OPERATIONAL for a change taken only in PRE-OPERATIONAL, whatever its
    #: profile; None: the profile alone counts
    wanted: Callable[[str], None] | None = None
    #: whether the node will be reset before it goes back
    resets: bool = False
    _vanished: bool = False

    def enter(self) -> None:
        """Make PDO writes possible and remember the initial state."""
        if self.wanted is not None:
            self._enter(self.wanted)
        elif self.access.profile.pre_operational_gate is PreOperational.REQUIRED:
            self._enter(self.consent)

    @property
    def question(self) -> str:
        """The question to the user before the node leaves OPERATIONAL."""
        reset = ", reset it" if self.resets else ""
        what = f"take it to PRE-OPERATIONAL for this change{reset}, and back?"
        return f"node {self.access.node_id} is OPERATIONAL; {what}"

    def enter_agreed(self) -> None:
        """Enter PRE-OPERATIONAL regardless of the profile, after the user agreed."""
        self._enter(lambda _question: None)

    def enter_to_test(self) -> None:
        """Enter PRE-OPERATIONAL regardless of the profile; asks before a node leaves OPERATIONAL.

        A node in an unknown state is commanded as well: it is restarted after the test anyway.
        """
        if not self.entered and self.access.state() is None:
            self.access.bus.send_nmt(NmtCommand.ENTER_PRE_OPERATIONAL, self.access.node_id)
        self._enter(self.consent)

    def _enter(self, consent: Callable[[str], None]) -> None:
        if self.entered:
            return
        node_id = self.access.node_id
        state = self.access.state()
        if state is NmtState.STOPPED:
            raise stopped_node(node_id)
        if state is NmtState.OPERATIONAL:
            consent(self.question)
            self.found = state  # recorded before leaving: a fault must not hide the initial state
            self.access.request(NmtState.PRE_OPERATIONAL)
        self.entered = True

    def leave(self) -> None:
        """Return to the initial state; call only if the node is as planned or rolled back.

        An error mentions the completed changes.
        """
        if self.found is NmtState.OPERATIONAL:
            try:
                self.access.insist(NmtState.OPERATIONAL)
            except DvtcliError as failed:
                self._vanished = isinstance(failed, NoAnswer)
                before = f"{join_some(self.done)} before that; " if self.done else ""
                failed.state = "unknown"
                failed.state_text = f"unknown: {before}it was not seen to be OPERATIONAL again"
                raise
        self.found, self.entered = None, False
        self.done.clear()

    def renew(self) -> None:
        """Enter PRE-OPERATIONAL again if the node has left it, as by a reboot during a change."""
        if self.entered and self.access.state() is NmtState.OPERATIONAL:
            self.access.request(NmtState.PRE_OPERATIONAL)

    def abandon(self) -> str | None:
        """Forget the initial state; a message if the node was OPERATIONAL and stays PRE-OPERATIONAL."""
        found, self.found, self.entered = self.found, None, False
        vanished, self._vanished = self._vanished, False
        self.done.clear()
        if found is not NmtState.OPERATIONAL:
            return None
        node_id = self.access.node_id
        if vanished:
            return f"node {node_id} was OPERATIONAL, but does not answer now; after it is repaired: nmt start {node_id}"
        return f"node {node_id} was OPERATIONAL and is PRE-OPERATIONAL now; when it is right: nmt start {node_id}"
