"""The change of a bus with every node on it to another bit rate by LSS, and the way back. Asks nobody.

Does not know who is on the bus (`lss_on_bus`), nor how an interface is opened again.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from typing import TYPE_CHECKING

from dvtcli.device.lss_master import LssMaster
from dvtcli.domain.hint import Action, Hint
from dvtcli.domain.nmt import UNCONFIGURED
from dvtcli.domain.several import join_some
from dvtcli.errors import DeviceRefused, DvtcliError, LeftChanged, NoAnswer, SafetyRefusal
from dvtcli.operations.lss.lss_find import lss_bus, selected
from dvtcli.operations.lss.lss_identity import require_on
from dvtcli.operations.lss.lss_node_id import told_id
from dvtcli.operations.lss.lss_store_all import store_again
from dvtcli.operations.results.lss_nodes import LssGiven

if TYPE_CHECKING:
    from dvtcli.errors import State
    from dvtcli.operations.session.session import Session

#: How long nodes and we take to switch, and how long all are silent after that (ms): CiA 305's switch delay.
DELAY_MS = 1000
#: the same where nobody has to open an interface again
_SIMULATED_MS = 50
#: what we wait beyond that (s), and how often who is not heard is looked for
_MARGIN_S, _LOOKS = 0.1, 3


class RateChange:
    """The change of *bus* with *nodes* from the bit rate *before* to *after* (bit/s), and the way back."""

    def __init__(self, session: Session, master: LssMaster, nodes: Sequence[LssGiven], before: int, after: int) -> None:
        self.session, self.master, self.nodes = session, master, nodes
        self.before, self.after = before, after
        self.bus = lss_bus(session)
        self.delay_ms = _SIMULATED_MS if self.bus.simulated else DELAY_MS

    def make(self) -> None:
        """Change it; raises once all are back, or LeftChanged."""
        self._configure()
        try:
            self.switch(self.after)
            missing = self.missing(self.nodes)
            if missing:
                raise NoAnswer(f"at {self.after} bit/s {names(missing)} did not come back")
        except DvtcliError as failed:
            raise self.back(failed) from failed

    def _configure(self) -> None:
        """Tell each node the new bit rate, which nobody runs at before it is activated."""
        for number, slave in enumerate(self.nodes):
            try:
                self.tell(slave, self.after)
            except DvtcliError as failed:
                failed.details.append(_said_by(slave))
                refused = isinstance(failed, DeviceRefused)
                self._forget(self.nodes[: number + (not refused)], failed, "unchanged")
                raise

    def _forget(self, told: Sequence[LssGiven], failed: DvtcliError, state: State) -> None:
        """Tell those that were *told* the new bit rate the old one, at which they run; *failed* says the *state*."""
        left = [slave for slave in told if not self._takes(slave, self.before)]
        failed.state = "unknown" if left else state
        failed.state_text = f"all nodes run at {self.before} bit/s as before, nothing is stored" + (
            f"; {names(left)} may keep {self.after} if told to store" if left else ""
        )

    def _takes(self, one: LssGiven, bit_rate: int) -> bool:
        try:
            self.tell(one, bit_rate)
        except DvtcliError:
            return False
        return True

    def tell(self, one: LssGiven, bit_rate: int) -> None:
        """Let *one*, alone, have *bit_rate* (bit/s) once that is activated; DeviceRefused, NoAnswer."""
        selected(self.master, one.address)
        self.master.configure_bit_rate(bit_rate)

    def switch(self, bit_rate: int) -> None:
        """Let all who were told switch, and switch as well; nobody says a word before two delays are over."""
        self.session.tell.progress(f"LSS: all switch to {bit_rate} bit/s", 0, 0)
        began_s = self.bus.now_s()
        self.master.activate_bit_rate(self.delay_ms)
        self.bus.sleep(self.delay_ms / 1000)
        self.go_to(bit_rate)
        self.bus.sleep(began_s + 2 * self.delay_ms / 1000 + _MARGIN_S - self.bus.now_s())
        self.master.let_wait()

    def go_to(self, bit_rate: int) -> None:
        """Set our interface to *bit_rate* (bit/s)."""
        if self.bus.runs_at != bit_rate:
            self.bus.set_bit_rate(bit_rate)
            self.session.take_bit_rate(bit_rate)

    def missing(self, nodes: Sequence[LssGiven]) -> list[LssGiven]:
        """Those of *nodes* that do not say who they are, by LSS and, with a node-ID, by SDO."""
        missing = list(nodes)
        for _ in range(_LOOKS):
            missing = [slave for slave in missing if not self.is_there(slave)]
            if not missing:
                break
        return missing

    def is_there(self, one: LssGiven) -> bool:
        """Whether *one* says who it is where we are, by LSS and, with a node-ID, by SDO."""
        try:
            if selected(self.master, one.address) != one.node_id:
                return False
            if one.node_id != UNCONFIGURED:
                require_on(self.bus, one.address, one.node_id)
            return True
        except (NoAnswer, SafetyRefusal):
            return False
        finally:
            self.master.let_wait()

    def fetch(self, nodes: Sequence[LssGiven]) -> None:
        """Bring *nodes*, which are at the old bit rate again, to the new one, where the others are; else NoAnswer."""
        self.go_to(self.before)
        for node in nodes:
            self.tell(node, self.after)
        self.switch(self.after)
        if missing := self.missing(self.nodes):
            raise NoAnswer(f"at {self.after} bit/s {names(missing)} did not come back")

    def back(self, failed: DvtcliError) -> DvtcliError:
        """*failed*, once all run at the old bit rate again; LeftChanged where one does not."""
        missing: Sequence[LssGiven] = self.nodes
        try:
            for _ in range(2):  # who answered too late to be brought along is brought the second time
                self.go_to(self.after)
                for slave in missing:
                    if self.is_there(slave):
                        self.tell(slave, self.before)
                self.switch(self.before)
                missing = self.missing(self.nodes)
                if not missing:
                    self._forget(self.nodes, failed, "rolled_back")
                    self.bus.disturbances()  # error frames of two bit rates are of this try, and no news
                    failed.hint = f"does its manual know {self.after} bit/s? lss bitrate may be tried again"
                    return failed
        except DvtcliError as stuck:
            return self._left(failed, missing, stuck.text)
        return self._left(failed, missing, f"at {self.before} bit/s {names(missing)} did not come back either")

    def _left(self, failed: DvtcliError, missing: Sequence[LssGiven], why: str) -> LeftChanged:
        error = LeftChanged(
            f"{failed.text}, and not all could be brought back to {self.before} bit/s",
            why=why,
            state="left_changed",
            hint=Hint(
                Action.GIVE_BIT_RATE,
                {"rate": self.before},
                "nothing new is stored: switch all nodes off and on, then open the bus with {}",
            ),
        )
        error.details += [("node", f"{told_id(slave.node_id)}, {slave.address}") for slave in missing]
        return error

    def store(self) -> list[LssGiven]:
        """Let every node store it; raises once all have the old one, stored and in use, or LeftChanged."""
        for number, slave in enumerate(self.nodes, 1):
            try:
                if self.before == self.after:
                    self.tell(slave, self.after)  # it may have been told another one that was never activated
                self._store(slave)
            except DvtcliError as failed:
                failed.details.append(_said_by(slave))
                if self.before == self.after:
                    raise self._partly_stored(self.nodes[: number - 1], self.nodes[number - 1 :], failed) from failed
                raise self.unstored(self.nodes[:number], failed) from failed
        return [replace(node, stored=True) for node in self.nodes]

    def _store(self, one: LssGiven) -> None:
        selected(self.master, one.address)
        self.master.store()

    def _partly_stored(
        self, stored: Sequence[LssGiven], others: Sequence[LssGiven], failed: DvtcliError
    ) -> DvtcliError:
        """*failed* where all run at what was to be stored already: what they had stored before is not known."""
        if not stored and isinstance(failed, DeviceRefused):
            failed.state_text = f"all nodes run at {self.after} bit/s as before, nothing new is stored"
            return failed
        told = [f"{names(stored)} stored {self.after} bit/s"] if stored else []
        return _with_details(
            LeftChanged(
                failed.text,
                why="; ".join([*told, f"{names(others)} may come back at another one", failed.why or "-"]),
                state="left_changed",
                hint=store_again(
                    [other.node_id for other in others],
                    f"all run at {self.after} bit/s now; before the power goes: the same words again, or",
                ),
            ),
            failed,
        )

    def unstored(self, stored: Sequence[LssGiven], failed: DvtcliError) -> DvtcliError:
        """*failed*, once those that may have *stored* have stored the old bit rate, and all run at that."""
        left, again = [], []
        for slave in stored:
            try:
                self.tell(slave, self.before)
                self._store(slave)
                again.append(slave)
            except DvtcliError as stuck:
                if isinstance(failed, DeviceRefused) and slave is stored[-1]:
                    continue  # it stores neither
                left.append(f"{names([slave])} may have {self.after} bit/s stored: {stuck.text}")
        error = self.back(failed)
        if error is not failed:
            return error
        if not left:
            kept = f"; {names(again)} stored that again" if again else ""
            error.state_text = f"all nodes run at {self.before} bit/s as before{kept}; nobody has {self.after} stored"
            error.hint = Hint(
                Action.LSS_BIT_RATE, {"rate": self.after}, "does it without storing: it is lost with the power"
            )
            return error
        return _with_details(
            LeftChanged(
                failed.text,
                why="; ".join(left),
                state="left_changed",
                hint=store_again(
                    [stored_slave.node_id for stored_slave in stored],
                    f"all run at {self.before} bit/s now; before the power goes:",
                ),
            ),
            failed,
        )


def _said_by(one: LssGiven) -> tuple[str, str]:
    """Who refused or was silent, as a line of an error."""
    return "node", f"{told_id(one.node_id)}, {one.address}"


def _with_details(error: LeftChanged, failed: DvtcliError) -> LeftChanged:
    error.details += failed.details
    return error


def names(nodes: Sequence[LssGiven]) -> str:
    """Who *nodes* are, in words."""
    return join_some([str(node.address) if node.node_id == UNCONFIGURED else f"node {node.node_id}" for node in nodes])
