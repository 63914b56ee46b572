"""Another bit rate for a bus and every node on it, by LSS: all are seen at the new one, or brought back.

Does not know who is on the bus (`lss_on_bus`), nor how an interface is opened again.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from typing import TYPE_CHECKING

from dvtcli.device.lss_master import LssMaster
from dvtcli.domain.lss_services import BIT_TIMINGS
from dvtcli.domain.nmt import UNCONFIGURED
from dvtcli.domain.several import plural, several
from dvtcli.errors import DeviceRefused, DvtcliError, LeftChanged, NoAnswer, SafetyRefusal, UsageError
from dvtcli.operations.lss_find import lss_bus, selected
from dvtcli.operations.lss_identity import require_on
from dvtcli.operations.lss_node_id import told_id
from dvtcli.operations.lss_on_bus import all_on_bus, confirmed
from dvtcli.operations.results.lss_nodes import LssBitRate, LssGiven

if TYPE_CHECKING:
    from dvtcli.domain.ports import CanopenBus
    from dvtcli.errors import State
    from dvtcli.operations.session import Session

#: How long nodes and we take to switch, and how long all are silent after that (ms): CiA 305's switch delay.
DELAY_MS = 1000
#: the same where nobody has to open an interface again
_SIMULATED_MS = 50
#: what we wait beyond that (s), and how often who is not heard is looked for
_MARGIN_S, _LOOKS = 0.1, 3


def lss_bit_rate(session: Session, bit_rate: int, file: str | None = None, *, stores: bool = False) -> LssBitRate:
    """Let the bus and every node on it run at *bit_rate* (bit/s, one of the standard's).

    Asks first. The nodes of the network *file*, None: all that are found; SafetyRefusal where anybody else is heard,
    one does not take part in LSS or is OPERATIONAL, or the bit rate of the interface cannot be set from here. Done once
    each node says at the new bit rate who it is; where one does not all go back. With *stores* each stores it then,
    also where the bus runs at it already; without, no node is asked then. DeviceRefused, NoAnswer with state
    `rolled_back`; LeftChanged. A dry run looks at the interface and the file, and sends nothing.
    """
    if bit_rate not in BIT_TIMINGS:
        known = several([str(rate) for rate in BIT_TIMINGS])
        raise UsageError(f"LSS knows no bit rate {bit_rate}", hint=f"the standard's are {known}")
    bus = lss_bus(session)
    before = _way_back(bus, bit_rate)
    if session.dry_run:
        _require_readable(file)
        return LssBitRate(bit_rate, dry_run=True)
    if before == bit_rate and not stores:
        return LssBitRate(bit_rate, before)
    with LssMaster(bus) as master:
        nodes = confirmed(master, all_on_bus(session, master, file))
        if not nodes:
            raise NoAnswer("no node is on the bus that could be told", hint="bitrate listens for the bit rate in use")
        _agree(session, nodes, before, bit_rate, stores=stores)
        with session.cancellation.guard():
            change = _Change(session, master, nodes, before, bit_rate)
            if before != bit_rate:
                change.make()
            nodes = change.store() if stores else nodes
    return LssBitRate(bit_rate, before, tuple(nodes))


def _way_back(bus: CanopenBus, bit_rate: int) -> int:
    """What the bus runs at (bit/s), to which it could be set back; SafetyRefusal where that is not so."""
    bus.require_settable(bit_rate)
    before = bus.runs_at
    if before is None:
        raise SafetyRefusal(
            f"the bit rate of {bus.name} is not known, so that there is no way back to it",
            hint="-b/--bitrate says it; bitrate listens for it",
        )
    if before not in BIT_TIMINGS:
        raise SafetyRefusal(f"{bus.name} runs at {before} bit/s, to which LSS knows no way back")
    return before


def _require_readable(file: str | None) -> None:
    """InputFileError where the network *file* cannot be used."""
    if file is not None:
        from dvtcli.operations.network_wish import read_wish

        read_wish(file)


def _agree(session: Session, nodes: Sequence[LssGiven], before: int, bit_rate: int, *, stores: bool) -> None:
    """Tell who is told, and ask."""
    if before == bit_rate:
        session.consent(
            f"store {bit_rate} bit/s, at which this bus runs already, in {plural(len(nodes), 'node')}: {_names(nodes)}?"
        )
        return
    for one in nodes:
        session.tell.note(f"plan: node-ID {told_id(one.node_id)}, {one.address}: {before} -> {bit_rate} bit/s")
    session.consent(
        f"change the bit rate of this bus and of {plural(len(nodes), 'node')} from {before} to {bit_rate} bit/s"
        f"{', and store it' if stores else ''}? Nothing else may be on it"
    )


class _Change:
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
            self._switch(self.after)
            missing = self._missing(self.nodes)
            if missing:
                raise NoAnswer(f"at {self.after} bit/s {_names(missing)} did not come back")
        except DvtcliError as failed:
            raise self.back(failed) from failed

    def _configure(self) -> None:
        """Tell each node the new bit rate, which nobody runs at before it is activated."""
        for number, one in enumerate(self.nodes):
            try:
                self._tell(one, self.after)
            except DvtcliError as failed:
                failed.details.append(_said_by(one))
                refused = isinstance(failed, DeviceRefused)
                self._forget(self.nodes[: number + (not refused)], failed, "unchanged")
                raise

    def _forget(self, told: Sequence[LssGiven], failed: DvtcliError, state: State) -> None:
        """Tell those that were *told* the new bit rate the old one, at which they run; *failed* says the *state*."""
        left = [one for one in told if not self._takes(one, self.before)]
        failed.state = "unknown" if left else state
        failed.state_text = f"all nodes run at {self.before} bit/s as before, nothing is stored" + (
            f"; {_names(left)} may keep {self.after} if told to store" if left else ""
        )

    def _takes(self, one: LssGiven, bit_rate: int) -> bool:
        try:
            self._tell(one, bit_rate)
        except DvtcliError:
            return False
        return True

    def _tell(self, one: LssGiven, bit_rate: int) -> None:
        selected(self.master, one.address)
        self.master.configure_bit_rate(bit_rate)

    def _switch(self, bit_rate: int) -> None:
        """Let all who were told switch, and switch as well; nobody says a word before two delays are over."""
        self.session.tell.progress(f"LSS: all switch to {bit_rate} bit/s", 0, 0)
        began_s = self.bus.now_s()
        self.master.activate_bit_rate(self.delay_ms)
        self.bus.sleep(self.delay_ms / 1000)
        self._go_to(bit_rate)
        self.bus.sleep(began_s + 2 * self.delay_ms / 1000 + _MARGIN_S - self.bus.now_s())
        self.master.let_wait()

    def _go_to(self, bit_rate: int) -> None:
        if self.bus.runs_at != bit_rate:
            self.bus.set_bit_rate(bit_rate)
            self.session.take_bit_rate(bit_rate)

    def _missing(self, nodes: Sequence[LssGiven]) -> list[LssGiven]:
        """Those of *nodes* that do not say who they are, by LSS and, with a node-ID, by SDO."""
        missing = list(nodes)
        for _ in range(_LOOKS):
            missing = [one for one in missing if not self._is_there(one)]
            if not missing:
                break
        return missing

    def _is_there(self, one: LssGiven) -> bool:
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

    def back(self, failed: DvtcliError) -> DvtcliError:
        """*failed*, once all run at the old bit rate again; LeftChanged where one does not."""
        missing: Sequence[LssGiven] = self.nodes
        try:
            for _ in range(2):  # who answered too late to be brought along is brought the second time
                self._go_to(self.after)
                for one in missing:
                    if self._is_there(one):
                        self._tell(one, self.before)
                self._switch(self.before)
                missing = self._missing(self.nodes)
                if not missing:
                    self._forget(self.nodes, failed, "rolled_back")
                    self.bus.disturbances()  # error frames of two bit rates are of this try, and no news
                    failed.hint = f"does its manual know {self.after} bit/s? lss bitrate may be tried again"
                    return failed
        except DvtcliError as stuck:
            return self._left(failed, missing, stuck.text)
        return self._left(failed, missing, f"at {self.before} bit/s {_names(missing)} did not come back either")

    def _left(self, failed: DvtcliError, missing: Sequence[LssGiven], why: str) -> LeftChanged:
        error = LeftChanged(
            f"{failed.text}, and not all could be brought back to {self.before} bit/s", why=why, state="left_changed",
            hint=f"nothing new is stored: switch all nodes off and on, then open the bus with -b {self.before}",
        )  # fmt: skip
        error.details += [("node", f"{told_id(one.node_id)}, {one.address}") for one in missing]
        return error

    def store(self) -> list[LssGiven]:
        """Let every node store it; raises once all have the old one, stored and in use, or LeftChanged."""
        for number, one in enumerate(self.nodes, 1):
            try:
                if self.before == self.after:
                    self._tell(one, self.after)  # it may have been told another one that was never activated
                self._store(one)
            except DvtcliError as failed:
                failed.details.append(_said_by(one))
                if self.before == self.after:
                    raise self._partly_stored(self.nodes[: number - 1], self.nodes[number - 1 :], failed) from failed
                raise self._unstored(self.nodes[:number], failed) from failed
        return [replace(one, stored=True) for one in self.nodes]

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
        told = [f"{_names(stored)} stored {self.after} bit/s"] if stored else []
        return _with_details(LeftChanged(
            failed.text, why="; ".join([*told, f"{_names(others)} may come back at another one", failed.why or "-"]),
            state="left_changed",
            hint=f"all run at {self.after} bit/s now; before the power goes: the same words again, or lss store NODE",
        ), failed)  # fmt: skip

    def _unstored(self, stored: Sequence[LssGiven], failed: DvtcliError) -> DvtcliError:
        """*failed*, once those that may have *stored* have stored the old bit rate, and all run at that."""
        left, again = [], []
        for one in stored:
            try:
                self._tell(one, self.before)
                self._store(one)
                again.append(one)
            except DvtcliError as stuck:
                if isinstance(failed, DeviceRefused) and one is stored[-1]:
                    continue  # it stores neither
                left.append(f"{_names([one])} may have {self.after} bit/s stored: {stuck.text}")
        error = self.back(failed)
        if error is not failed:
            return error
        if not left:
            kept = f"; {_names(again)} stored that again" if again else ""
            error.state_text = f"all nodes run at {self.before} bit/s as before{kept}; nobody has {self.after} stored"
            error.hint = "lss bitrate without --store; lss store NODE says again why it is not stored"
            return error
        return _with_details(LeftChanged(
            failed.text, why="; ".join(left), state="left_changed",
            hint=f"all run at {self.before} bit/s now; lss store NODE for these, before the power goes",
        ), failed)  # fmt: skip


def _said_by(one: LssGiven) -> tuple[str, str]:
    """Who refused or was silent, as a line of an error."""
    return "node", f"{told_id(one.node_id)}, {one.address}"


def _with_details(error: LeftChanged, failed: DvtcliError) -> LeftChanged:
    error.details += failed.details
    return error


def _names(nodes: Sequence[LssGiven]) -> str:
    """Who *nodes* are, in words."""
    return several([str(one.address) if one.node_id == UNCONFIGURED else f"node {one.node_id}" for one in nodes])
