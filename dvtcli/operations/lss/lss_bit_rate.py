"""Change the bit rate of a bus and all its nodes by LSS, with consent: all change, or all are rolled back."""

from __future__ import annotations

from collections.abc import Collection, Sequence
from contextlib import suppress
from dataclasses import replace
from typing import TYPE_CHECKING

from dvtcli.device.lss_master import LssMaster
from dvtcli.domain.can_ids import EMCY_BASE, HEARTBEAT_BASE, LSS_RESPONSE_ID, SDO_RESPONSE_BASE
from dvtcli.domain.cob_id import can_id_text
from dvtcli.domain.hint import Action, Hint
from dvtcli.domain.lss_services import BIT_TIMINGS, PARTS, LssAddress
from dvtcli.domain.nmt import UNCONFIGURED, NmtState
from dvtcli.domain.text import join_some, plural
from dvtcli.errors import DeviceRefused, DvtcliError, LeftChanged, NoAnswer, SafetyRefusal, UsageError
from dvtcli.operations.lss.lss_find import Identity, lss_bus, require_on, scanned, selected, two_alike, who_is_there
from dvtcli.operations.lss.lss_node_id import BOOT_UP_S, forget, received_node_ids, store_again, told_id
from dvtcli.operations.results.lss_nodes import LssBitRate, LssGiven
from dvtcli.operations.session.consent import refuse_reset

if TYPE_CHECKING:
    from dvtcli.domain.ports import CanopenBus, Frame
    from dvtcli.errors import State
    from dvtcli.operations.session.session import Session, SessionNodes
    from dvtcli.operations.user.session_user import SessionUser


#: How long nodes and we take to switch, and how long all are silent after that (ms): CiA 305's switch delay.
DELAY_MS = 1000
#: the same without an interface to reopen
_SIMULATED_MS = 50
#: our additional wait (s), and the number of searches for missing nodes
_MARGIN_S, _LOOKS = 0.1, 3


class RateChange:
    """The change of *bus* with *nodes* from the bit rate *before* to *after* (bit/s), and the way back."""

    def __init__(self, session: Session, master: LssMaster, nodes: Sequence[LssGiven], before: int, after: int) -> None:
        self.session, self.master, self.nodes = session, master, nodes
        self.before, self.after = before, after
        self.bus = lss_bus(session)
        self.delay_ms = _SIMULATED_MS if self.bus.simulated else DELAY_MS

    def make(self) -> None:
        """Change it; raises after a roll-back of all, or LeftChanged."""
        self._configure()
        try:
            self.switch(self.after)
            missing = self.missing(self.nodes)
            if missing:
                raise NoAnswer(f"at {self.after} bit/s {node_names(missing)} did not answer")
        except DvtcliError as failed:
            raise self.back(failed) from failed

    def _configure(self) -> None:
        """Configure the new bit rate, not active yet, on each node."""
        for number, slave in enumerate(self.nodes):
            try:
                self.configure(slave, self.after)
            except DvtcliError as failed:
                failed.details.append(_said_by(slave))
                refused = isinstance(failed, DeviceRefused)
                self._forget(self.nodes[: number + (not refused)], failed, "unchanged")
                raise

    def _forget(self, told: Sequence[LssGiven], failed: DvtcliError, state: State) -> None:
        """Configure the old, active bit rate on the nodes *told*; *failed* gets the *state*."""
        left = [slave for slave in told if not self._takes(slave, self.before)]
        failed.state = "unknown" if left else state
        failed.state_text = f"all nodes run at {self.before} bit/s as before; nothing is stored" + (
            f"; {node_names(left)} may have {self.after} configured, and would store it on a store command"
            if left
            else ""
        )

    def _takes(self, one: LssGiven, bit_rate: int) -> bool:
        try:
            self.configure(one, bit_rate)
        except DvtcliError:
            return False
        return True

    def configure(self, one: LssGiven, bit_rate: int) -> None:
        """Configure *bit_rate* (bit/s) on the single node *one*; raises DeviceRefused, NoAnswer."""
        selected(self.master, one.address)
        self.master.configure_bit_rate(bit_rate)

    def switch(self, bit_rate: int) -> None:
        """Switch all configured nodes and this bus; nobody transmits before two delays are over."""
        self.session.reporter.progress(f"LSS: all switch to {bit_rate} bit/s", 0, 0)
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
        """Return *nodes* without an answer by LSS or, with a node-ID, by SDO."""
        missing = list(nodes)
        for _ in range(_LOOKS):
            missing = [slave for slave in missing if not self.is_there(slave)]
            if not missing:
                break
        return missing

    def is_there(self, one: LssGiven) -> bool:
        """Tell whether *one* answers at the current bit rate by LSS and, with a node-ID, by SDO."""
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
        """Switch *nodes*, back at the old bit rate, to the new one like the others; else raises NoAnswer."""
        self.go_to(self.before)
        for node in nodes:
            self.configure(node, self.after)
        self.switch(self.after)
        if missing := self.missing(self.nodes):
            raise NoAnswer(f"at {self.after} bit/s {node_names(missing)} did not answer")

    def back(self, failed: DvtcliError) -> DvtcliError:
        """Return *failed* after all are back at the old bit rate, or LeftChanged."""
        missing: Sequence[LssGiven] = self.nodes
        try:
            for _ in range(2):  # who answered too late to be brought along is brought the second time
                self.go_to(self.after)
                for slave in missing:
                    if self.is_there(slave):
                        self.configure(slave, self.before)
                self.switch(self.before)
                missing = self.missing(self.nodes)
                if not missing:
                    self._forget(self.nodes, failed, "rolled_back")
                    self.bus.disturbances()  # error frames of two bit rates are of this try, and no news
                    failed.hint = f"check in its manual that it supports {self.after} bit/s, then repeat lss bitrate"
                    return failed
        except DvtcliError as stuck:
            return self._left(failed, missing, stuck.text)
        return self._left(failed, missing, f"at {self.before} bit/s {node_names(missing)} did not answer either")

    def _left(self, failed: DvtcliError, missing: Sequence[LssGiven], why: str) -> LeftChanged:
        error = LeftChanged(
            f"{failed.text}, and not all nodes could be returned to {self.before} bit/s",
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
        """Store it on every node; raises after all have stored and use the old bit rate, or LeftChanged."""
        for number, slave in enumerate(self.nodes, 1):
            try:
                if self.before == self.after:
                    self.configure(slave, self.after)  # it may have been told another one that was never activated
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
        """Return *failed* if the bit rate was in use already: earlier stored bit rates are unknown."""
        if not stored and isinstance(failed, DeviceRefused):
            failed.state_text = f"all nodes run at {self.after} bit/s as before; nothing new is stored"
            return failed
        told = [f"{node_names(stored)} stored {self.after} bit/s"] if stored else []
        return _with_details(
            LeftChanged(
                failed.text,
                why="; ".join([*told, f"{node_names(others)} may start at another bit rate", failed.why or "-"]),
                state="left_changed",
                hint=store_again(
                    [other.node_id for other in others],
                    f"all nodes run at {self.after} bit/s now; before the next power-off repeat the command, or",
                ),
            ),
            failed,
        )

    def unstored(self, stored: Sequence[LssGiven], failed: DvtcliError) -> DvtcliError:
        """Return *failed* after those that may have *stored* stored the old bit rate, with all nodes at it."""
        left, again = [], []
        for slave in stored:
            try:
                self.configure(slave, self.before)
                self._store(slave)
                again.append(slave)
            except DvtcliError as stuck:
                if isinstance(failed, DeviceRefused) and slave is stored[-1]:
                    continue  # it stores neither
                left.append(f"{node_names([slave])} may have {self.after} bit/s stored: {stuck.text}")
        error = self.back(failed)
        if error is not failed:
            return error
        if not left:
            kept = f"; {node_names(again)} stored that again" if again else ""
            error.state_text = f"all nodes run at {self.before} bit/s as before{kept}; no node has stored {self.after}"
            error.hint = Hint(
                Action.LSS_BIT_RATE, {"rate": self.after}, "does not store it: it is lost at the next power-off"
            )
            return error
        return _with_details(
            LeftChanged(
                failed.text,
                why="; ".join(left),
                state="left_changed",
                hint=store_again(
                    [stored_slave.node_id for stored_slave in stored],
                    f"all nodes run at {self.before} bit/s now; before the next power-off:",
                ),
            ),
            failed,
        )


def _said_by(one: LssGiven) -> tuple[str, str]:
    """Name, as an error's line, the node that refused or was silent."""
    return "node", f"{told_id(one.node_id)}, {one.address}"


def _with_details(error: LeftChanged, failed: DvtcliError) -> LeftChanged:
    error.details += failed.details
    return error


def node_names(nodes: Sequence[LssGiven]) -> str:
    """Name *nodes* in words."""
    return join_some([str(node.address) if node.node_id == UNCONFIGURED else f"node {node.node_id}" for node in nodes])


#: frames of a node besides PDOs: EMCY, SDO, heartbeat (CiA 301, 7.3.5)
_OWN = (EMCY_BASE, SDO_RESPONSE_BASE, HEARTBEAT_BASE)


def all_on_bus(session: SessionNodes, master: LssMaster, file: str | None = None) -> list[LssGiven]:
    """Find every node on the bus, even without node-ID; with *file* exactly those of the network.

    Raises SafetyRefusal if another node is heard, a node of the file is missing, has an incomplete address, or is
    OPERATIONAL. Warns of nodes with unknown NMT state.
    """
    bus = lss_bus(session)
    frames: dict[int, Frame] = {}

    def note(frame: Frame, sent: bool) -> None:
        if not sent:
            frames.setdefault(frame.can_id, frame)

    stop = bus.tap(note)
    try:
        there = who_is_there(bus, received_node_ids(session))
    finally:
        stop()
    if file is not None:
        _refuse_others(file, there)
    _refuse_running(session, bus, there)
    _refuse_strangers(frames, there)
    nodes = [LssGiven(_address(node_id, identity), node_id, node_id) for node_id, identity in there.items()]
    waiting = scanned(session, master)
    if waiting and file is not None:
        raise SafetyRefusal(
            f"nodes without a node-ID are on the bus that are not in {file}", hint=Hint(Action.LSS_SCAN)
        )
    for node in waiting:
        if not node.confirmed:
            raise two_alike(node.address)
    return [*nodes, *(LssGiven(lss_node.address, UNCONFIGURED, UNCONFIGURED) for lss_node in waiting)]


def _refuse_others(file: str, there: Collection[int]) -> None:
    from dvtcli.operations.plans.read_network_config import read_network_config

    wanted = {config.node_id: config.name for config in read_network_config(file).nodes}
    if others := [f"node {node_id}" for node_id in there if node_id not in wanted]:
        raise SafetyRefusal(f"{join_some(others)} on the bus, and not in {file}", hint="take it off, or into the file")
    if missing := [f"{name} ({node_id})" for node_id, name in wanted.items() if node_id not in there]:
        raise SafetyRefusal(
            f"not on the bus, but in {file}: {join_some(missing)}",
            hint=Hint(Action.FIND_NODES, why="lists the nodes on the bus"),
        )


def _refuse_running(session: SessionUser, bus: CanopenBus, there: Collection[int]) -> None:
    states = {node_id: bus.nmt_state(node_id) for node_id in there}
    running = [f"node {node_id}" for node_id, state in states.items() if state is NmtState.OPERATIONAL]
    unknown = [f"node {node_id}" for node_id, state in states.items() if state is None]
    if unknown:
        session.reporter.warning(
            f"{join_some(unknown)}: no heartbeat shows whether it is OPERATIONAL; the machine must be at standstill"
        )
    if running:
        raise SafetyRefusal(
            f"OPERATIONAL: {join_some(running)}",
            hint=Hint(Action.ENTER_PRE_OPERATIONAL, {"node": "all"}, "{}, once the machine is at standstill"),
        )


def _refuse_strangers(frames: dict[int, Frame], there: Collection[int]) -> None:
    """Refuse frames that no node of *there* sends while PRE-OPERATIONAL."""
    theirs = {base + node_id for base in _OWN for node_id in there} | {LSS_RESPONSE_ID}
    strange = next((frame for frame in frames.values() if frame.extended or frame.can_id not in theirs), None)
    if strange is not None:
        can_id = can_id_text(strange.can_id, extended=strange.extended)
        raise SafetyRefusal(
            f"{can_id} was received, but no node that answers transmits it in PRE-OPERATIONAL",
            why="its sender would stay at the old bit rate, or produces SYNC or PDOs",
            hint=Hint(
                Action.ENTER_PRE_OPERATIONAL,
                {"node": "all"},
                "stops PDOs; 1006 = 0 stops SYNC; disconnect devices without CANopen",
            ),
        )


def _address(node_id: int, identity: Identity | None) -> LssAddress:
    told = [part for part in identity or () if part is not None]
    if len(told) != PARTS:
        raise SafetyRefusal(
            f"node {node_id} has no readable LSS address (0x1018:1..4): it would keep its bit rate", node=node_id,
            hint="disconnect it, and set its bit rate as its manual describes",
        )  # fmt: skip
    return LssAddress(*told)


def confirmed(master: LssMaster, nodes: Sequence[LssGiven]) -> list[LssGiven]:
    """Return *nodes* after each confirmed its node-ID by LSS; raises SafetyRefusal for a node without LSS."""
    for node in nodes:
        try:
            now = selected(master, node.address)
        except DvtcliError as failed:
            raise SafetyRefusal(
                f"node {told_id(node.node_id)} does not support LSS: it would keep its bit rate", why=failed.text,
                hint="disconnect it, and set its bit rate as its manual describes",
            ) from failed  # fmt: skip
        if now != node.node_id:
            raise SafetyRefusal(f"{node.address} has node-ID {told_id(now)} by LSS, and {told_id(node.node_id)} by SDO")
    master.let_wait()
    return list(nodes)


#: NMT: every node
_ALL = 0


def refuse_resets(session: SessionNodes, nodes: Sequence[LssGiven]) -> None:
    """Raises SafetyRefusal if a reset of *nodes* could release a drive's motor."""
    refuse_reset(session, [node.node_id for node in nodes if node.node_id != UNCONFIGURED])


def prove_by_resets(session: SessionNodes, change: RateChange, stored: Sequence[LssGiven]) -> list[LssGiven]:
    """Reset all nodes of the bus, and verify that those that *stored* return at the new bit rate.

    A node without node-ID sends no boot-up: it is found, but not proved. If a node returns at the old bit rate, all go
    back to and store the old bit rate; LeftChanged if this fails. Raises DeviceRefused if no boot-up message was
    received.
    """
    named = [stored_slave for stored_slave in stored if stored_slave.node_id != UNCONFIGURED]
    seen = {named_slave.node_id: change.bus.boot_ups(named_slave.node_id) for named_slave in named}
    session.reporter.progress("LSS: all are reset", 0, 0)
    change.master.let_wait()
    change.master.reset_node(_ALL)
    until_s = change.bus.now_s() + BOOT_UP_S
    booted = {
        named_slave.node_id
        for named_slave in named
        if change.bus.wait_boot_up(
            named_slave.node_id, seen[named_slave.node_id], max(0.0, until_s - change.bus.now_s())
        )
    }
    for slave in named:
        forget(session, slave)
    missing = change.missing(stored)
    if missing:
        raise _not_kept(change, missing)
    silent = [named_slave for named_slave in named if named_slave.node_id not in booted]
    if silent:
        raise DeviceRefused(
            f"{node_names(silent)}: no boot-up message was received after the reset, so the store is not proved",
            state="unknown",
            why=f"all answer at {change.after} bit/s and confirmed the store",
            hint=Hint(Action.FIND_NODES, why="switch them off and on, then {}"),
        )
    return [replace(stored_slave, proved=stored_slave.node_id in booted) for stored_slave in stored]


def _not_kept(change: RateChange, missing: Sequence[LssGiven]) -> DvtcliError:
    """Make the error for *missing* nodes, after all returned to the old bit rate, if possible."""
    text = f"{node_names(missing)} confirmed the store of {change.after} bit/s, but did not answer at it after a reset"
    if change.before == change.after:
        return LeftChanged(
            text,
            why="its stored bit rate before is unknown",
            state="left_changed",
            hint=Hint(
                Action.LISTEN_BIT_RATE,
                why="finds its bit rate: run it with only this node on the bus, and switch the node on",
            ),
        )
    failed = DeviceRefused(text, why=f"it answers at {change.before} bit/s")
    try:
        change.fetch(missing)
    except DvtcliError as lost:
        with suppress(DvtcliError):  # where the others are; that it fails is not what there is to say
            change.go_to(change.after)
        return LeftChanged(
            text,
            why=f"it does not answer at {change.before} bit/s either: {lost.text}",
            state="left_changed",
            hint=Hint(
                Action.LISTEN_BIT_RATE,
                why=f"the others run at {change.after} bit/s and confirmed the store; {{}} finds its bit rate",
            ),
        )
    error = change.unstored(change.nodes, failed)
    if error is failed:
        error.hint = Hint(
            Action.LSS_BIT_RATE,
            {"rate": change.after},
            f"does not store it: after the next power-off it is {change.before} bit/s again",
        )
    return error


def lss_bit_rate(
    session: Session, bit_rate: int, file: str | None = None, *, stores: bool = False, prove: bool = False
) -> LssBitRate:
    """Change the bus and all its nodes to *bit_rate* (bit/s, a standard value).

    Asks first. The nodes are those of the network *file*, None: all found; raises SafetyRefusal if another node is
    heard, a node has no LSS or is OPERATIONAL, or the interface's bit rate cannot be set. Succeeds once each node is
    identified at the new bit rate; otherwise all are rolled back. *stores* then stores it on each node, even if the bus
    uses it already. *prove* then resets all nodes at once and checks them; refused if a drive may move. Raises
    DeviceRefused, NoAnswer with state `rolled_back`; LeftChanged. A dry run checks the interface and the file, and
    sends nothing.
    """
    if bit_rate not in BIT_TIMINGS:
        known = join_some([str(rate) for rate in BIT_TIMINGS])
        raise UsageError(f"LSS has no bit rate {bit_rate}", hint=f"the standard's are {known}")
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
            raise NoAnswer(
                "no node is on the bus",
                hint=Hint(Action.LISTEN_BIT_RATE, why="listens for the bit rate in use"),
            )
        if prove:
            refuse_resets(session, nodes)
        _agree(session, nodes, before, bit_rate, stores=stores, prove=prove)
        with session.cancellation.deferred():
            change = RateChange(session, master, nodes, before, bit_rate)
            if before != bit_rate:
                change.make()
            nodes = change.store() if stores else nodes
            nodes = prove_by_resets(session, change, nodes) if prove else nodes
    return LssBitRate(bit_rate, before, tuple(nodes))


def _way_back(bus: CanopenBus, bit_rate: int) -> int:
    """Return the bus's bit rate (bit/s) to return to; raises SafetyRefusal if not possible."""
    bus.require_settable(bit_rate)
    before = bus.runs_at
    if before is None:
        raise SafetyRefusal(
            f"the bit rate of {bus.name} is unknown, so it could not be restored",
            hint=Hint(Action.GIVE_BIT_RATE, why="gives it") + Hint(Action.LISTEN_BIT_RATE, why="finds it"),
        )
    if before not in BIT_TIMINGS:
        raise SafetyRefusal(f"{bus.name} runs at {before} bit/s, which LSS could not restore")
    return before


def _require_readable(file: str | None) -> None:
    """Raises InputFileError if the network *file* is invalid."""
    if file is not None:
        from dvtcli.operations.plans.read_network_config import read_network_config

        read_network_config(file)


def _agree(
    session: SessionUser, nodes: Sequence[LssGiven], before: int, bit_rate: int, *, stores: bool, prove: bool
) -> None:
    """Report the nodes and ask."""
    then = ", and reset all of them" if prove else ""
    if before == bit_rate:
        who = f"{plural(len(nodes), 'node')}: {node_names(nodes)}"
        session.consent(f"store {bit_rate} bit/s, at which this bus runs already, in {who}{then}?")
        return
    for node in nodes:
        session.reporter.note(f"plan: node-ID {told_id(node.node_id)}, {node.address}: {before} -> {bit_rate} bit/s")
    session.consent(
        f"change the bit rate of this bus and of {plural(len(nodes), 'node')} from {before} to {bit_rate} bit/s"
        f"{', and store it' if stores else ''}{then}? Nothing else may be on it"
    )
