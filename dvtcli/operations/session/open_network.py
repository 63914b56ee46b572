"""Open the bus of the options, simulated or real; and the nodes on it, each identified at its first use."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator, Sequence
from contextlib import contextmanager, suppress
from dataclasses import dataclass, field
from time import monotonic, time
from typing import TYPE_CHECKING, Protocol, TypeVar

from dvtcli.device.cancellation import Cancellation
from dvtcli.device.change.change_group import ChangeGroup, OrderedChange
from dvtcli.device.file_fits import as_file_says
from dvtcli.device.known_pdos import ReadProgress
from dvtcli.device.node import Node
from dvtcli.domain.hint import Action, Hint, verbatim
from dvtcli.domain.nmt import UNCONFIGURED
from dvtcli.domain.pdo import Pdo
from dvtcli.domain.ports import CanopenBus
from dvtcli.domain.text import join_some
from dvtcli.errors import BusUnavailable, NoAnswer, SafetyRefusal, SdoAborted, SdoProtocolError, UsageError
from dvtcli.operations.session.device_files import DeviceFiles
from dvtcli.operations.session.simulated_nodes import (
    Simulated,
    file_or_family,
    read_dictionary,
    simulated_device,
    simulated_faults,
    simulated_nodes,
    simulated_signals,
)
from dvtcli.operations.user.options import Options

if TYPE_CHECKING:
    from dvtcli.device.change.applied import Progress
    from dvtcli.device.change.plan_document import Identity
    from dvtcli.domain.nmt import NmtState
    from dvtcli.domain.object_dictionary import ObjectDictionary
    from dvtcli.domain.plan import Plan
    from dvtcli.domain.profile import DeviceProfile
    from dvtcli.operations.results.frames import BusEvent
    from dvtcli.operations.user.change_files import ChangeFiles
    from dvtcli.operations.user.session_user import SessionUser
    from dvtcli.simulator.device.simulated_faults import Fault
    from dvtcli.simulator.device.strict_device import StrictDevice
    from dvtcli.simulator.network.signals import SimulatedSignal


def step_progress(progress: Progress) -> tuple[str, int, int]:
    """Describe a step: words, its number, the total."""
    from dvtcli.device.change.failed_change import step_line

    text = f"node {progress.node}: step {progress.done} of {progress.total}  {step_line(progress.step)}"
    is_last = progress.done == progress.total
    return f"{text}; reading back" if is_last else text, progress.done, progress.total


def look_progress(looking: ReadProgress) -> tuple[str, int, int]:
    """Describe a read: words, number of PDOs read, the total."""
    pdo = Pdo.at(looking.index)
    whose = "" if pdo is None else f" of {pdo.label}"
    parts = f", PDO {looking.done + 1} of {looking.total}" if looking.total else ""
    text = f"node {looking.node}: reading 0x{looking.index:04X}:{looking.sub_index:02X}{whose}{parts}"
    return text, looking.done, looking.total


def network_on_bus(
    session: SessionUser,
    bus: CanopenBus,
    simulated: tuple[Simulated, ...],
    *,
    is_last_change: Callable[[], bool],
    comes_back: bool,
    group: ChangeGroup,
) -> Network:
    """Return the nodes of *bus*, including *simulated* nodes; messages go to the session's user.

    *is_last_change*: the process makes a single change and ends; *comes_back*: a lost bus is waited for; changes
    belong to *group*.
    """
    return Network(
        bus, DeviceFiles(bus, session.base, simulated), session.cancellation, session.consent,
        None if simulated or (bus.simulated and session.base.sim) else _change_files(session, bus, group),
        is_last_change=is_last_change, on_look=lambda looking: session.reporter.progress(*look_progress(looking)),
        on_step=lambda progress: session.reporter.progress(*step_progress(progress)),
        warn=session.reporter.warning, note=session.reporter.note, comes_back=comes_back and not bus.simulated,
        consent_anew=session.consent_anew, group=group,
    )  # fmt: skip


def _change_files(session: SessionUser, bus: CanopenBus, group: ChangeGroup) -> ChangeFiles:
    """Return the change files, kept only for nodes that outlive this process."""
    from dvtcli.operations.user.change_files import ChangeFiles, state_folder

    return ChangeFiles(
        bus.name, state_folder(session.base), session.base.one_node, session.reporter.note, session.reporter.warning,
        session.doing, group,
    )  # fmt: skip


@dataclass(slots=True, eq=False, repr=False)
class Network:
    """An open *bus* with its nodes and their *files*."""

    bus: CanopenBus
    files: DeviceFiles
    cancellation: Cancellation
    #: asks a question about a node
    consent: Callable[[str, int], None]
    #: lock, backup and journal of each node; None if the nodes end with this process, and for twins
    change_files: ChangeFiles | None = None
    nodes: dict[int, Node] = field(default_factory=dict)
    #: this session's changes for undo, oldest first
    change_order: list[OrderedChange] = field(default_factory=list)
    #: the current change group of the session
    group: ChangeGroup = field(default_factory=ChangeGroup)
    #: a node's changes before it was met here: for a twin, those of its node
    done_before: Callable[[int], list[Plan]] = lambda _node_id: []
    #: node-IDs met elsewhere: for twins, on the bus itself
    met: Callable[[], Iterable[int]] = tuple
    #: whether this process makes a single change and ends
    is_last_change: Callable[[], bool] = lambda: False
    #: node-IDs found by the last scan
    scanned: tuple[int, ...] = ()
    #: called for every object read before a change or for a list
    on_look: Callable[[ReadProgress], None] = lambda _looking: None
    #: shows a warning
    warn: Callable[[Hint | str], None] = lambda _text: None
    #: shows a note
    note: Callable[[str], None] = lambda _text: None
    #: called for every step of a change
    on_step: Callable[[Progress], None] = lambda _progress: None
    #: whether a lost bus is waited for, so that each node must be identified first
    comes_back: bool = False
    #: identities of the nodes, if used
    identities: dict[int, Identity] = field(default_factory=dict)
    #: the nodes as they were when the bus was gone, until each is met anew
    left: dict[int, Node] = field(default_factory=dict)
    #: boot-ups and NMT state of each at its last identification in the current line
    asked_again: dict[int, tuple[int, NmtState | None]] = field(default_factory=dict)

    #: like *consent*, even inside `agreed`; None: *consent*
    consent_anew: Callable[[str, int], None] | None = None

    @property
    def simulated_ids(self) -> tuple[int, ...]:
        """Return the node-IDs of simulated nodes, in the order given."""
        return tuple(simulated.node_id for simulated in self.files.simulated)

    def node(self, node_id: int) -> Node:
        """Return the node with *node_id*; unless given, dictionary and profile are found by its identity.

        Raises SafetyRefusal if another device has the node-ID since the bus was lost.
        """
        if node_id not in self.nodes:
            boot_ups, restarts = self.bus.boot_ups(node_id), self.bus.restarts(node_id)
            try:
                profile, dictionary = self.files.profile(node_id), self.files.dictionary(node_id)
            except (NoAnswer, SdoProtocolError):  # its interrupted change is reported all the same
                self.interrupted(node_id)
                raise
            guard = None if self.change_files is None else self.change_files.guard(node_id, dictionary)
            node = Node(
                self.bus, node_id, dictionary, as_file_says(profile, dictionary), self.cancellation,
                lambda question: self.consent(question, node_id),
                history=self.done_before(node_id), change_order=self.change_order, group=self.group, guard=guard,
                neighbours=lambda: self._others(node_id), on_step=self.on_step, on_look=self.on_look,
                is_last_change=lambda: self.is_last_change() and node_id not in self.simulated_ids,
                unlike_file=self.files.unlike(node_id, dictionary),
                consent_anew=lambda question: (self.consent_anew or self.consent)(question, node_id),
            )  # fmt: skip
            node.boot_ups_at_contact, node.restarts_at_read = boot_ups, restarts
            node.read_cache.learn(self.files.read_cache(node_id))
            self._remark(node_id)
            if node.unlike_file:
                self.warn(
                    Hint(
                        Action.FORCE,
                        why=f"{verbatim(node.unlike_file)}: the file may be wrong about this node; changes need {{}}",
                    )
                )
            if self.comes_back:
                self._identify(node)
            node.pending.boot_ups = boot_ups  # from first contact on a restart is noticed
            self.nodes[node_id] = node
        return self.nodes[node_id]

    def _remark(self, node_id: int) -> None:
        """Remark, once, that the node's file may not match exactly."""
        text, doubtful = self.files.remark(node_id)
        if text:
            (self.warn if doubtful else self.note)(text)
        if (remark := self.files.module_remark(node_id)) is not None:
            self.warn(remark)
        if self.files.has_given_file(node_id):
            from dvtcli.operations.session.cut_file import cut_remark

            if (cut := cut_remark(self.files, node_id)) is not None:
                self.warn(cut)

    def describe(self, node_id: int) -> None:
        """Update the node's EDS: found since its identification, or newly chosen."""
        node = self.nodes[node_id]
        if node.dictionary is not None and node_id not in self.files.own_eds:
            return
        dictionary = self.files.dictionary(node_id)
        if dictionary is not None and dictionary is not node.dictionary:
            profile = as_file_says(self.files.profile(node_id), dictionary)
            self._describe(node, dictionary, profile, self.files.unlike(node_id, dictionary))
            self._remark(node_id)

    def _describe(
        self, node: Node, dictionary: ObjectDictionary | None, profile: DeviceProfile, unlike_file: str
    ) -> None:
        node.describe(dictionary)
        node.profile, node.unlike_file = profile, unlike_file
        if self.change_files is not None and node.guard is not None:
            node.guard.is_fixed = self.change_files.is_fixed(dictionary)

    @contextmanager
    def as_it_was_if_refused(self) -> Iterator[None]:
        """Undo changed descriptions of nodes, and drop new nodes, if the block raises."""
        files, left = self.files.chosen(), dict(self.left)
        described = [(node, node.dictionary, node.profile, node.unlike_file) for node in self.nodes.values()]
        try:
            yield
        except BaseException:
            self.files.choose(files)
            for before in described:
                self._describe(*before)
            for node_id in self.nodes.keys() - {node.node_id for node, *_ in described}:
                self.nodes.pop(node_id).release_lock()
            self.left = left
            raise

    def _identify(self, node: Node) -> None:
        """Identify *node*; raises SafetyRefusal if it was another device before."""
        now, before = node.identity(), self.left.get(node.node_id)
        if before is not None:
            from dvtcli.device.file_fits import another_device, unlike_before

            unlike = unlike_before(self.identities[node.node_id], now)
            if unlike:
                raise another_device(node.node_id, unlike)
            node.continue_from(before)
            with suppress(SdoAborted, UsageError):  # what cannot be read is not called lost
                if lost := node.lost_during_gap():
                    self.warn(f"node {node.node_id} has lost unstored values: {join_some(lost)}; it may have restarted")
            self.left.pop(node.node_id, None)
        self.identities[node.node_id] = now

    def meet_again(self) -> None:
        """Identify the nodes changed before the loss of the bus; silent or different nodes follow later.

        Each is asked once until `asked_again` is cleared, and again if it has transmitted since.
        """
        for node_id, before in tuple(self.left.items()):
            if before.wanted or before.wanted_values or before.unreadable_values or before.unstored or before.history:
                received = self.bus.boot_ups(node_id), self.bus.nmt_state(node_id)
                if self.asked_again.get(node_id) != received:
                    self.asked_again[node_id] = received
                    with suppress(NoAnswer, SdoProtocolError, SafetyRefusal):
                        self.node(node_id)

    def accept(self, node_id: int) -> None:
        """Accept whichever device has *node_id* now as new, with a message."""
        if self.left.pop(node_id, None) is not None:
            from dvtcli.device.file_fits import unlike_before

            self.files.forget(node_id)
            before, now = self.identities.pop(node_id), self.node(node_id).identity()
            if unlike := unlike_before(before, now):
                self.warn(f"node {node_id} is not the device that it was before the bus was lost: {unlike}")

    def leave(self) -> None:
        """Keep the changes of all nodes while the bus is gone."""
        self.close()
        self.left |= {node_id: node for node_id, node in self.nodes.items() if node_id in self.identities}

    def continue_from(self, before: Network) -> None:
        """Be the same bus as *before*, opened again."""
        self.left, self.identities, self.change_order = before.left, before.identities, before.change_order
        self.files.continue_from(before.files)

    def _others(self, node_id: int) -> list[Node]:
        """List the met or simulated nodes except *node_id*; of twins, those of met nodes."""
        for other in {*self.met(), *self.simulated_ids} - self.nodes.keys():
            with suppress(NoAnswer, SdoProtocolError):  # it was met, and is gone
                self.node(other)
        return [node for other, node in sorted(self.nodes.items()) if other != node_id]

    def interrupted(self, node_id: int) -> Hint | str:
        """Report an interrupted and unfinished change of the node; empty if none."""
        if self.change_files is None:
            return ""
        node = self.nodes.get(node_id)
        return self.change_files.interrupted(node_id, None if node is None else node.guard)

    def close(self) -> None:
        """Leave the bus and release its nodes for other writers."""
        self.bus.close()
        for node in self.nodes.values():
            node.release_lock()


#: Opens the bus of options.
OpenBus = Callable[[Options], CanopenBus]


class StartSimulation(Protocol):
    """Starts simulated devices on their own bus and joins it."""

    def __call__(
        self,
        devices: Sequence[StrictDevice],
        *,
        faults: Sequence[Fault],
        signals: Sequence[SimulatedSignal],
        timeout_s: float,
        bit_rate: int,
    ) -> CanopenBus:
        """Return the bus of *devices*, which boot now, with *faults* and *signals*, at *bit_rate* (bit/s)."""
        ...


def bus_of(
    options: Options, open_bus: OpenBus | None = None, simulate: StartSimulation | None = None
) -> tuple[CanopenBus, tuple[Simulated, ...]]:
    """Open the bus of *options*, or with *open_bus*; also returns its simulated nodes with their node-IDs.

    Simulated nodes are on the bus of *simulate*, None: the bus in this process.

    Raises BusUnavailable, UsageError or InputFileError.
    """
    if options.eds:
        read_dictionary(file_or_family(options.eds), options.chosen_modules)  # said at once
    simulated = simulated_nodes(options.sim, options.modules)
    if simulated and (options.interface or options.channel):
        raise UsageError(
            "a simulated node has its own bus, but an interface was given, too",
            given={"nodes": None},
            hint="leave one out",
        )
    faults = simulated_faults(options.fault, simulated)
    signals = simulated_signals(options.signal, simulated)
    if not simulated:
        return (open_bus or open_real_bus)(options), ()
    from dvtcli.simulator.network import in_process_bus

    devices, rate = (
        [simulated_device(simulated_node) for simulated_node in simulated],
        options.bitrate or in_process_bus.BIT_RATE,
    )
    start = simulate or in_process_bus.simulate
    return start(devices, faults=faults, signals=signals, timeout_s=options.timeout, bit_rate=rate), tuple(
        simulated_node for simulated_node in simulated if simulated_node.node_id != UNCONFIGURED
    )


def open_real_bus(options: Options) -> CanopenBus:
    """Open the interface of *options*, else of python-can's settings; raises BusUnavailable."""
    from dvtcli.bus.opening import open_transport

    return open_transport(
        options.interface, options.channel, options.bitrate, options.adapter_settings, timeout_s=options.timeout
    )


def listening_bus(options: Options, bit_rate: int, *, listen_only: bool) -> CanopenBus:
    """Open the interface of *options* at *bit_rate* (bit/s), silent if *listen_only*.

    Raises SafetyRefusal if silence is not guaranteed or the bit rate cannot be set; BusUnavailable.
    """
    from dvtcli.bus.opening import open_listening

    return open_listening(
        options.interface, options.channel, bit_rate, options.adapter_settings, listen_only=listen_only
    )


B = TypeVar("B")
OnBusEvent = Callable[["BusEvent"], None]


def gone(name: str, failed: BusUnavailable) -> BusEvent:
    """Make the event of the bus *name* that *failed*."""
    from dvtcli.operations.results.frames import BusEvent

    reason = failed.why or failed.text
    return BusEvent(name, time(), f"{reason}; {failed.hint}" if failed.hint else reason)


def first_bus(opened: Callable[[], B], options: Options, on_bus_event: OnBusEvent) -> B:
    """Call *opened*(); with the option `reconnect`, wait for a missing bus until Ctrl-C."""
    try:
        return opened()
    except BusUnavailable as failed:
        if not (options.reconnect and failed.may_come) or options.no_reconnect:
            raise
        name = failed.text.removeprefix("cannot open ")
        bus = waited_for(opened, name, failed, lambda: False, on_bus_event)
    assert bus is not None  # noqa: S101 - nothing stops it but an exception
    return bus


def waited_for(
    opened: Callable[[], B], name: str, failed: BusUnavailable, stopping: Callable[[], bool], on_bus_event: OnBusEvent
) -> B | None:
    """Call *opened*() until it succeeds after the bus *name* has *failed*; None as soon as *stopping*()."""
    from dvtcli.bus.opening import wait_for_bus
    from dvtcli.operations.results.frames import BusEvent

    began_s = monotonic()
    on_bus_event(gone(name, failed))
    bus = wait_for_bus(opened, stopping)
    if bus is not None:
        on_bus_event(BusEvent(name, time(), after_s=monotonic() - began_s))
    return bus
