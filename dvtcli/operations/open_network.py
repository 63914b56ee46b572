"""The bus and the nodes on it, put together from the options: which file, which profile, which simulator.

The only place where buses, simulator and files meet. Does not know lines or screens.
"""

from __future__ import annotations

import re
from collections.abc import Callable, Iterable
from contextlib import suppress
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import TYPE_CHECKING

from dvtcli.device.change.cancellation import Cancellation
from dvtcli.device.change.progress import Progress
from dvtcli.device.change.safekeeping import Keeper
from dvtcli.device.change.whole import Whole
from dvtcli.device.node import Node
from dvtcli.device.past import Past
from dvtcli.device.read_pdos import read_identity
from dvtcli.domain.object_dictionary import ObjectDictionary, normalised
from dvtcli.domain.pdo import Pdo
from dvtcli.domain.plan import Plan
from dvtcli.domain.ports import CanopenBus, Frame
from dvtcli.domain.profile import GENERIC, DeviceProfile
from dvtcli.domain.sdo_frame import sdo_value_of
from dvtcli.domain.several import several
from dvtcli.errors import InputFileError, NoAnswer, SafetyRefusal, SdoProtocolError, UsageError
from dvtcli.files.profile.library import load_profile, own_names, passcode_objects, profile_for_identity, profile_names
from dvtcli.operations.options import Options
from dvtcli.operations.simulated_nodes import (
    Simulated,
    family_named,
    read_dictionary,
    simulated_device,
    simulated_faults,
    simulated_nodes,
    simulated_signals,
)

if TYPE_CHECKING:
    from dvtcli.device.change.journal import Journal
    from dvtcli.simulator.device.strict_device import StrictDevice


#: Opens the bus that options name.
OpenBus = Callable[[Options], CanopenBus]


@dataclass(slots=True)
class Network:
    """An open bus with its nodes; a node is looked at when it is first asked for."""

    bus: CanopenBus
    options: Options
    cancellation: Cancellation
    consent: Callable[[str], None]
    simulated: tuple[Simulated, ...] = ()
    #: show a message that is no result, and one that nobody may miss
    say: Callable[[str], None] = lambda _text: None
    warn: Callable[[str], None] = lambda _text: None
    #: what is being done now, for another dvtcli that finds the node's lock taken
    doing: Callable[[], str] = str
    #: whether changes get lock, backup and journal: not where the nodes die with this process, nor on twins
    guarded: bool = False
    nodes: dict[int, Node] = field(default_factory=dict)
    #: node-IDs of the changes that this session made and can undo, oldest first
    order: list[int] = field(default_factory=list)
    #: what the changes that are made now belong to
    whole: Whole = field(default_factory=Whole)
    #: the changes of a node that were made before it was met here: of a twin, those of the node itself
    done_before: Callable[[int], list[Plan]] = lambda _node_id: []
    #: node-IDs that were met elsewhere: where these are twins, on the bus itself
    met: Callable[[], Iterable[int]] = tuple
    #: EDS and profile of single nodes, where somebody chose them
    own_eds: dict[int, Path] = field(default_factory=dict)
    own_profile: dict[int, str] = field(default_factory=dict)
    #: told of every step of a change that a node took
    on_step: Callable[[Progress], None] = lambda _progress: None

    @classmethod
    def opened(
        cls,
        options: Options,
        cancellation: Cancellation,
        consent: Callable[[str], None],
        say: Callable[[str], None] = lambda _text: None,
        warn: Callable[[str], None] = lambda _text: None,
        *,
        doing: Callable[[], str] = str,
        open_bus: OpenBus | None = None,
    ) -> Network:
        """Open the bus that *options* name, or with *open_bus*; BusUnavailable, UsageError or InputFileError."""
        if options.eds:
            read_dictionary(Path(options.eds))  # a wrong file is said before a bus is touched
        simulated = simulated_nodes(options.sim)
        if simulated and (options.interface or options.channel):
            raise UsageError(
                "--sim and an interface exclude each other: a simulated node lives on no real bus",
                hint="leave one out",
            )
        faults = simulated_faults(options.fault, simulated)
        signals = simulated_signals(options.signal, simulated)
        bus: CanopenBus
        if simulated:
            from dvtcli.simulator.network.in_process_bus import simulate

            devices = [simulated_device(one) for one in simulated]
            bus = simulate(devices, faults=faults, signals=signals, timeout_s=options.timeout)
        else:
            bus = (open_bus or open_real_bus)(options)
        return cls(bus, options, cancellation, consent, simulated, say, warn, doing, guarded=not simulated)

    @property
    def simulated_ids(self) -> tuple[int, ...]:
        """Node-IDs of the simulated nodes, in the order they were given."""
        return tuple(one.node_id for one in self.simulated)

    def node(self, node_id: int) -> Node:
        """The node with *node_id*, its dictionary and profile found from its identity where not given."""
        if node_id not in self.nodes:
            boot_ups = self.bus.boot_ups(node_id)
            profile, dictionary = self._profile(node_id), self._dictionary(node_id)
            keeper = self._keeper(node_id, dictionary) if self.guarded else None
            node = Node(
                self.bus, node_id, dictionary, profile, self.cancellation, self.consent,
                history=self.done_before(node_id), order=self.order, keeper=keeper,
                neighbours=lambda: self._others(node_id), on_step=self.on_step,
                reads_are_free=node_id in self.simulated_ids,
            )  # fmt: skip
            node.pending.boot_ups = boot_ups  # from first contact on a restart is noticed
            self.nodes[node_id] = node
        return self.nodes[node_id]

    def _others(self, node_id: int) -> list[Node]:
        """The nodes that were met besides *node_id*; of twins, those of the nodes that were met."""
        for other in set(self.met()) - self.nodes.keys():
            with suppress(NoAnswer, SdoProtocolError):  # it was met, and is gone
                self.node(other)
        return [node for other, node in sorted(self.nodes.items()) if other != node_id]

    def _keeper(self, node_id: int, dictionary: ObjectDictionary | None) -> Keeper:
        """Lock, backup and journal of a node; says so where a change of it was interrupted."""

        def is_fixed(pdo: Pdo) -> bool:
            entry = dictionary.entry(pdo.communication_index, 1) if dictionary else None
            return entry is not None and not entry.access.writable

        folder, locks = state_folder(self.options), state_folder(None) / "locks"
        keeper = Keeper(folder, locks, self.bus.name, node_id, self.say, is_fixed, self.warn, self.doing, self.whole)
        keeper.past.selected = self.options.node
        try:
            journal = keeper.interrupted()
        except (InputFileError, SafetyRefusal) as damaged:
            self.warn(f"{damaged.text}: {damaged.why or damaged.place}; {damaged.hint}")
            return keeper
        if journal is not None:
            self.say(_interrupted(journal))
        return keeper

    def interrupted(self, node_id: int) -> str:
        """What to say of a change of the node that was interrupted and not finished; empty where there is none.

        Of a node that was not met yet it is said to the user, too, as it is when it is met.
        """
        if not self.guarded:
            return ""
        node = self.nodes.get(node_id)
        keeper = self._keeper(node_id, None) if node is None else node.keeper
        try:
            journal = None if keeper is None else keeper.interrupted()
        except (InputFileError, SafetyRefusal) as damaged:
            return f"{damaged.text}: {damaged.why or damaged.place}; {damaged.hint}"
        return "" if journal is None else _interrupted(journal)

    def past(self) -> Past:
        """The changes on this bus that are remembered."""
        return Past(state_folder(None) / "changes", self.bus.name, self.say)

    def close(self) -> None:
        """Leave the bus and let others write to its nodes."""
        self.bus.close()
        for node in self.nodes.values():
            if node.keeper is not None:
                node.keeper.lock.release()

    def _dictionary(self, node_id: int) -> ObjectDictionary | None:
        if node_id in self.own_eds:
            return read_dictionary(self.own_eds[node_id])
        if self.options.eds:
            return read_dictionary(Path(self.options.eds))
        for one in self.simulated:
            if one.node_id == node_id:
                return read_dictionary(one.eds)
        return self._from_library(node_id)

    def _from_library(self, node_id: int) -> ObjectDictionary | None:
        """The dictionary that `eds add` keeps for the node's identity."""
        from dvtcli.files.eds.own_files import find, folder

        if not folder().is_dir():
            return None
        vendor, product, revision = (read_identity(self.bus.sdo(node_id), sub) for sub in (1, 2, 3))
        path = None if vendor is None or product is None else find(vendor, product, revision)
        return None if path is None else read_dictionary(path)

    def _profile(self, node_id: int) -> DeviceProfile:
        if node_id in self.own_profile:
            return load_profile(self.own_profile[node_id])
        if self.options.profile:
            return load_profile(self.options.profile)
        for one in self.simulated:
            if one.node_id == node_id and one.family in profile_names():
                return self._simulated_profile(node_id, one.family)
        sdo = self.bus.sdo(node_id)
        vendor, product = read_identity(sdo, 1), read_identity(sdo, 2)
        if not vendor:  # a device that does not say who it is (0 is nobody's number): its file does
            return profile_of(self._dictionary(node_id))
        return profile_for_identity(vendor, product or 0)

    def _simulated_profile(self, node_id: int, family: str) -> DeviceProfile:
        """The user's own profile where it names the identity that a simulated node's file tells, else the family's."""
        if own := own_names():
            found = profile_of(self._dictionary(node_id))
            if found.name in own:
                return found
        return load_profile(family)


def open_real_bus(options: Options) -> CanopenBus:
    """Open the interface that *options* name, else the one that python-can's own settings do; BusUnavailable."""
    from dvtcli.bus.opening import open_transport

    extra = dict(pair.split("=", 1) for pair in options.bus_kwargs)
    return open_transport(options.interface, options.channel, options.bitrate, extra, timeout_s=options.timeout)


def _interrupted(journal: Journal) -> str:
    """What to say of a change that was interrupted, and of how it is finished."""
    labels, node_id = several(change.label for change in journal.plan.changes), journal.plan.node_id
    if journal.part.whole is None:
        return f"a change of {labels} of node {node_id} was interrupted: `recover` puts the old configuration back"
    return (
        f"{journal.part.name} was interrupted, which changed {labels} of node {node_id}: `recover` takes every line of "
        "it back, on all nodes"
    )


def profile_of(dictionary: ObjectDictionary | None) -> DeviceProfile:
    """The profile for the device that a file describes (`[DeviceInfo]`), the generic one where it does not say."""
    if dictionary is None or dictionary.info.vendor_id is None:
        return GENERIC
    return profile_for_identity(dictionary.info.vendor_id, dictionary.info.product_code or 0)


@dataclass(frozen=True, slots=True)
class Secrets:
    """The objects that take a passcode, of every profile: what is written there is shown and recorded nowhere."""

    objects: frozenset[tuple[int, int]]

    @classmethod
    def known(cls) -> Secrets:
        """Those of all profiles; InputFileError where one of the user's own is wrong."""
        return cls(passcode_objects())

    def in_frame(self, frame: Frame) -> bool:
        """Whether *frame* is an SDO that carries a passcode."""
        return sdo_value_of(frame) in self.objects

    def in_line(self, line: str, dictionaries: Iterable[ObjectDictionary] = ()) -> bool:
        """Whether a typed *line* names an object that takes a passcode, and so may hold one.

        By number in any notation, or by one of the names that *dictionaries* have for it.
        """
        words = line.lower().replace("0x", "").replace(":", " ").replace("-", " ")
        if any(re.search(rf"\b(?:{index:04x}|{index})\s+0*{sub:x}\b", words) for index, sub in self.objects):
            return True
        found = (one.entry(*place) for one in dictionaries for place in self.objects)
        return any(normalised(entry.name) in normalised(line) for entry in found if entry is not None)


def state_folder(options: Options | None) -> Path:
    """Where journals and backups are kept: --journal, else the user's state folder (which None asks for)."""
    if options is not None and options.journal:
        return Path(options.journal)
    import platformdirs

    return Path(platformdirs.user_state_dir("dvtcli"))


def twin_of(network: Network) -> Network:
    """A network of copy-on-write twins of *network*'s nodes: what is written there never reaches the bus.

    What was done to the nodes, and in which order, is known to the twins: `undo` is tried on it.
    """
    from dvtcli.simulator.device.reversed import ReversedDevice
    from dvtcli.simulator.device.strict_device import StrictDevice
    from dvtcli.simulator.network.twin_bus import TwinBus

    def device_for(node_id: int, backing: Callable[[int, int], bytes]) -> StrictDevice:
        node = network.node(node_id)
        kind = ReversedDevice if node.profile.reversed_entries else StrictDevice
        family = replace(family_named(node.profile.name), filler=node.profile.filler or 0)
        return kind(node.dictionary or ObjectDictionary({}), family, node_id, backing=backing)

    bus = TwinBus(network.bus, device_for)

    def done_before(node_id: int) -> list[Plan]:
        return list(network.nodes[node_id].history) if node_id in network.nodes else []

    return Network(
        bus, network.options, network.cancellation, network.consent, network.simulated,
        order=list(network.order), done_before=done_before, met=lambda: list(network.nodes),
        own_eds=network.own_eds, own_profile=network.own_profile, on_step=network.on_step,
    )  # fmt: skip


def offline_dictionaries(options: Options) -> list[tuple[ObjectDictionary, dict[str, str]]]:
    """Dictionaries, with the aliases of their profile, that are known before any bus is opened."""
    paths = [Path(options.eds)] if options.eds else []
    found = []
    paths += [] if paths else [one.eds for one in simulated_nodes(options.sim)]
    for dictionary in map(read_dictionary, paths):
        profile = load_profile(options.profile) if options.profile else profile_of(dictionary)
        found.append((dictionary, profile.aliases))
    return found
