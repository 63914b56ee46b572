"""A changeable node: its safety checks, unstored changes, and the values expected at a store."""

from __future__ import annotations

import math
from collections.abc import Callable, Collection, Iterable, Iterator, Mapping
from contextlib import suppress
from dataclasses import dataclass, field
from typing import TYPE_CHECKING

from dvtcli.device.known_pdos import KnownPdos
from dvtcli.device.observe import InitialState
from dvtcli.device.seen_state import present_state
from dvtcli.device.store.pending import Pending
from dvtcli.domain.hint import Action, Hint, verbatim
from dvtcli.domain.nmt import NmtState
from dvtcli.domain.pdo import Pdo, PdoConfig
from dvtcli.domain.profile import PreOperational
from dvtcli.domain.text import value_text
from dvtcli.errors import BusUnavailable, SafetyRefusal

if TYPE_CHECKING:
    from dvtcli.device.change.applied import Progress
    from dvtcli.device.change.change_guard import ChangeGuard
    from dvtcli.device.change.plan_document import Identity
    from dvtcli.device.habits import Habits
    from dvtcli.device.node_parts import ReadableNode
    from dvtcli.device.target_config import Difference, TargetConfig
    from dvtcli.domain.plan import Change


@dataclass(slots=True, eq=False, repr=False)
class Expected:
    """PDOs and single objects, by index and sub-index, as last read back."""

    pdos: dict[Pdo, PdoConfig] = field(default_factory=dict)
    values: dict[tuple[int, int], bytes] = field(default_factory=dict)
    #: whether every PDO that lay beside a change was read
    is_complete: bool = False

    def seen(self, others: Mapping[Pdo, PdoConfig], *, complete: bool = False) -> None:
        """Record *others*, read beside a change (with *complete* all PDOs); the first known value of a PDO counts."""
        for pdo, config in others.items():
            self.pdos.setdefault(pdo, config)
        self.is_complete = self.is_complete or (complete and bool(others))

    def changed(self, change: Change) -> None:
        """Record *change* as read back."""
        from dvtcli.domain.plan import PdoChange

        if isinstance(change, PdoChange):
            self._drop_values(change.pdo)
            self.pdos[change.pdo] = change.after
        elif change.step.before is not None:  # a write-only object cannot be read again
            pdo = Pdo.at(change.step.index)
            if pdo is not None:  # no longer equal to the whole read-back
                self.pdos.pop(pdo, None)
            self.values[change.step.index, change.step.sub_index] = change.step.after

    def _drop_values(self, pdo: Pdo) -> None:
        """Drop single values of *pdo*, read back as a whole."""
        for place in [place for place in self.values if Pdo.at(place[0]) == pdo]:
            del self.values[place]

    def clear(self) -> None:
        """Expect nothing after a requested reset, whose losses were reported."""
        self.pdos.clear()
        self.values.clear()
        self.is_complete = False

    def require(self, node: ReadableNode, who_else: str) -> None:
        """Read everything again; raise SafetyRefusal, naming *who_else* as a possible cause, on a difference."""
        if not self.pdos and not self.values:
            return
        found = node.observed(lambda: list(self._differences(node)))
        if found:
            raise SafetyRefusal(
                f"node {node.node_id} is not stored: {found[0][0]} differs from its verified value",
                node=node.node_id,
                place=found[0][1],
                why="; ".join(text for *_, text in found),
                hint=Hint(
                    Action.STORE,
                    {"force": True},
                    f"{verbatim(who_else)}, or it corrects written values, or altered this with a change of "
                    "another object: set it again and store again; {} stores the present values",
                ),
            )

    def lost(self, node: ReadableNode, labels: Collection[str]) -> list[str]:
        """The differences between *node*, read again now, and the changes called *labels*."""
        from dvtcli.device.target_config import TargetConfig, config_differences

        pdos = {pdo: wanted for pdo, wanted in self.pdos.items() if pdo.label in labels}
        values = {place: data for place, data in self.values.items() if f"{place[0]:04X}:{place[1]:02X}" in labels}
        if not pdos and not values:
            return []
        return [
            f"{label} {text}" for label, text in config_differences(node, still_there(node, TargetConfig(pdos, values)))
        ]

    def _differences(self, node: ReadableNode) -> Iterator[tuple[str, str, str]]:
        """Each difference as label, object and description."""
        from dvtcli.device.target_config import differences

        held = node.pdos() if self.pdos else {}
        for pdo, wanted in self.pdos.items():
            texts = ["it is gone"] if pdo not in held else differences(pdo, wanted, held[pdo])
            for text in texts:
                yield pdo.label, f"{pdo.communication_index:04X}:01", f"{pdo.label}: {text}"
        for (index, sub_index), value in self.values.items():
            if moves(node, index, sub_index):
                continue
            data = node.upload(index, sub_index)
            if data != value:
                place = f"{index:04X}:{sub_index:02X}"
                yield f"0x{place}", place, f"0x{place} is {value_text(data)}, was set to {value_text(value)}"


@dataclass(slots=True, init=False, eq=False, repr=False)
class Changeable(KnownPdos):
    """A node with known PDOs and the tools to change them safely."""

    #: unstored changes, and reasons not to store now
    pending: Pending = field(default_factory=Pending)
    #: lock, backup and journal; None for simulated nodes and twins, which nothing can interrupt half-way
    guard: ChangeGuard | None = None
    #: true if this process makes one change and ends, without a later store of untouched PDOs
    is_last_change: Callable[[], bool] = lambda: False
    #: values expected in RAM at a store: changed by this session, or read beside a change
    expected: Expected = field(default_factory=Expected)
    #: control words of the last change reading back neither the written nor the former value, as `6040:00`
    differing_control_words: dict[str, bytes] = field(default_factory=dict)
    #: called after every accepted step of a change
    on_step: Callable[[Progress], None] = lambda _progress: None
    #: the identity (0x1018) of the device about to store
    storing_identity: Identity = field(default_factory=dict)
    #: whether it can be told to store, None: not looked at yet
    takes_store: bool | None = None
    #: true if the user was told of a restart during this line
    has_reported_restart: bool = False
    _habits: Habits | None = None

    @property
    def habits(self) -> Habits:
        """Learned write requirements of this device type, on a real bus also from earlier processes."""
        if self._habits is None:
            from dvtcli.device.habits import Habits

            guard = self.guard
            self._habits = Habits() if guard is None else Habits(guard.locks.parent / "habits", guard.warn)
        return self._habits

    @property
    def is_pre_operational_wanted(self) -> bool:
        """True if PDO writes need PRE-OPERATIONAL, by the profile or as learned from this device type."""
        required = self.profile.pre_operational_gate is PreOperational.REQUIRED
        return required or self.is_found_to_want_pre_operational

    @property
    def is_found_to_want_pre_operational(self) -> bool:
        """True if this device type was seen often enough to take PDO writes only in PRE-OPERATIONAL."""
        return self.habits.are_there and self.habits.is_pre_operational_wanted(self.identity())

    def open_gate(self) -> None:
        """Make PDO writes possible, also on a device type learned to accept them only in PRE-OPERATIONAL."""
        if self.is_found_to_want_pre_operational and present_state(self.access) is NmtState.OPERATIONAL:
            self.gate.wanted = self.gate.consent
        try:
            self.gate.enter()
        finally:
            self.gate.wanted = None

    def begin_change(self, *, ignores_restarts: bool = False) -> InitialState:
        """Lock the node until the line ends, invalidate the read cache, and return the initial state.

        Raises SafetyRefusal if another dvtcli holds the node or was interrupted, or if the node restarted since the
        last read. With *ignores_restarts* (a roll-back) a restart does not matter.
        """
        if self.guard is not None:
            self.guard.lock_or_refuse()
        if not ignores_restarts:
            self.require_not_restarted()
        self.read_anew()
        boot_ups, disturbance_count = self.bus.boot_ups(self.node_id), self.bus.disturbance_count(self.node_id)
        # a restart while the state is read came later
        return InitialState(self.access.state(), boot_ups, disturbance_count, ignores_restarts)

    def require_not_restarted(self, initial_state: InitialState | None = None) -> None:
        """Raise SafetyRefusal if the node restarted unexpectedly since it was read, or since *initial_state*.

        Called before the first write of a line: earlier reads and lines belong to the time before the restart.
        """
        if initial_state is not None and initial_state.ignores_restarts:
            return
        restarted = self.restarts_at_read is not None and self.bus.restarts(self.node_id) != self.restarts_at_read
        if restarted or (initial_state is not None and self.bus.boot_ups(self.node_id) != initial_state.boot_ups):
            from dvtcli.device.observe import restarted_since_read

            self.has_reported_restart = True
            raise restarted_since_read(self.node_id, self.pending.unstored)

    def await_restart(self) -> None:
        """Expect a restart by the user at any time: no line is refused for that restart."""
        self.bus.order_restart(self.node_id, math.inf)

    def await_no_restart(self) -> None:
        """Report the next restart, also if one was ordered before: it loses what was changed since."""
        with suppress(BusUnavailable):  # the change is recorded all the same
            self.bus.order_restart(self.node_id, -math.inf)

    def forget_restart(self, *, failed: bool = False) -> bool:
        """End a line that read the node, or *failed*: the next line may write even after a restart.

        True if the restart is still to be reported: not if the line was refused for, or failed by, that restart.
        """
        reported, self.has_reported_restart = self.has_reported_restart, False
        if self.restarts_at_read is None:
            return False
        try:
            restarts, read = self.bus.restarts(self.node_id), self.read_cache.is_of_now()
        except BusUnavailable:
            return False
        if self.restarts_at_read == restarts or not (reported or read or failed):
            return False
        self.restarts_at_read = restarts
        return not reported

    def release_lock(self) -> None:
        """Release the lock after a change; changes by others are read before the next change."""
        if self.guard is not None:
            self.guard.lock.release()


def no_longer_held(node: ReadableNode, changes: Iterable[Change]) -> tuple[Difference, ...]:
    """The results of *changes* lost by *node*, read again."""
    from dvtcli.device.target_config import TargetConfig, config_differences

    expected = Expected()
    for change in changes:
        expected.changed(change)
    return config_differences(node, still_there(node, TargetConfig(expected.pdos, expected.values)))


def still_there(node: ReadableNode, target: TargetConfig) -> TargetConfig:
    """*target* without commands and target values of the machine, which change all the time."""
    from dvtcli.device.target_config import TargetConfig

    return TargetConfig(
        target.pdos, {place: value for place, value in target.values.items() if not moves(node, *place)}
    )


def moves(node: ReadableNode, index: int, sub_index: int) -> bool:
    """True if an object is process data, changed by the machine all the time; false without a file."""
    from dvtcli.device.process_data import is_process_data

    return node.dictionary is not None and is_process_data(node, (index, sub_index))
