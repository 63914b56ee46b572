"""Learn what a device accepts: tested with consent, rolled back, saved as a profile and a simulated family."""

from __future__ import annotations

import itertools
import time
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING

from dvtcli.device.access_level import level_finding
from dvtcli.device.change.applied import refuse
from dvtcli.device.learn.read_device import absences
from dvtcli.device.learn.safely import Terms, ask_safely
from dvtcli.device.learn.saving import read_storage
from dvtcli.device.learn.subjects import mapped_subjects, subjects
from dvtcli.device.store.unstored import mark_stored, require_storable
from dvtcli.domain.hint import Action, Hint
from dvtcli.domain.learning.conclusions import conclude, forecast, most_until_refused, most_writes
from dvtcli.domain.learning.probe import Conclusions
from dvtcli.domain.learning.read_dictionary import absent_for_family
from dvtcli.domain.learning.storage import not_asked, storage_for_family, storage_for_profile
from dvtcli.domain.nmt import NmtState
from dvtcli.domain.text import join_some
from dvtcli.errors import DeviceRefused, stopped_node
from dvtcli.operations.known_devices.keep_learnt import (
    differences,
    profile_to_compare,
    refuse_name,
    refuse_other,
    save_learnt,
    values_found,
)
from dvtcli.operations.results import LearnForecast, LearntDevice

if TYPE_CHECKING:
    from dvtcli.device.learn.safely import Asked
    from dvtcli.device.learn.saving import SignatureAnswers
    from dvtcli.device.node import Node
    from dvtcli.device.node_parts import NodeDescription, ReadableNode
    from dvtcli.device.observe import InitialState
    from dvtcli.domain.learning.probe import Probe, ProbeAnswer, ProbedPdo
    from dvtcli.domain.learning.read_dictionary import Absence
    from dvtcli.domain.learning.storage import Storage
    from dvtcli.domain.pdo import Pdo, PdoConfig
    from dvtcli.operations.session.session_nodes import SessionNodes
    from dvtcli.operations.user.session_user import SessionUser

#: How long the bus is listened to for CAN-IDs in use, in seconds.
LISTEN_S = 1.5


@dataclass(frozen=True, slots=True)
class _Prepared:
    """The tests of a node as *found*, at most *limit* writes; *saves* are tests of 0x1010.

    *instead* are tested if a mapping of *subjects* cannot be restored. *pdos* are all PDOs of the node, *isolated* says
    that nothing else is on its bus.
    """

    node: Node
    found: InitialState
    pdos: Mapping[Pdo, PdoConfig]
    subjects: list[ProbedPdo]
    instead: list[ProbedPdo]
    probes: list[Probe]
    limit: int
    storage: Storage
    isolated: bool
    saves: tuple[Probe, ...] = ()

    @property
    def names(self) -> tuple[str, ...]:
        return tuple(str(subject.pdo) for subject in self.subjects)

    def forecast(self) -> LearnForecast:
        """Estimate the number of writes on the node's twin, without stores."""
        terms = Terms(self.limit, self.isolated)
        likely = ask_safely(self.node, [*self.subjects, *self.instead], self.pdos, self.found, terms).writes
        probes = [*self.probes, *self.saves]
        return LearnForecast(self.node.node_id, self.names, probes, self.limit, likely, self.storage.wears)

    def ask(self, told: Callable[[], None]) -> Asked:
        """Run all tests and roll back; *told* is called at each write."""
        terms = Terms(self.limit, self.isolated, self.saves)
        return ask_safely(self.node, [*self.subjects, *self.instead], self.pdos, self.found, terms, told)


def learn(
    session: SessionNodes,
    node_id: int | None = None,
    *,
    save: str | None = None,
    compare: str | None = None,
    isolated: bool = False,
    with_store: bool = False,
) -> LearntDevice | LearnForecast:
    """Learn what the node *node_id* (None: the selected node) accepts, and roll back.

    *save* is the name of the profile and folder to write, *compare* a profile's name or such a folder's path;
    *isolated* asserts that nothing else is on the bus; *with_store* allows stores, at most two writes to 0x1010. Raises
    SafetyRefusal without consent, if the node's values must not be stored, and without force if *save* was learnt from
    another device; DeviceRefused if no PDO can be tested, UsageError if *save* names another's folder.
    """
    node = session.node(node_id)
    if save is not None:
        refuse_name(save)
    known = None if compare is None else profile_to_compare(compare)
    if save is not None and not session.options.force:
        refuse_other(save, node)
    prepared = _prepared(session, node, isolated=isolated, with_store=with_store)
    if session.dry_run:
        return prepared.forecast()
    _consent(session, prepared)
    started = time.monotonic()  # nobody's thinking counts
    lacking = absences(node, [*prepared.subjects, *prepared.instead], _looked(session, node))
    values = {} if save is None else values_found(session, node)
    asked = prepared.ask(_told(session, prepared))
    _note_saved(node, asked.saved)
    learnt = _concluded(node, asked, prepared.storage, lacking)
    return LearntDevice(
        node.node_id, node.title, tuple(str(known_pdo.subject.pdo) for known_pdo in asked.known),
        _answers(asked, prepared.storage),
        learnt, asked.writes, asked.saved.writes, time.monotonic() - started,
        () if save is None else save_learnt(session, node, save, learnt, prepared.pdos, asked.known, values),
        None if known is None else (compare or "", differences(known, learnt)),
        save is None or bool(node.identity().get("vendor")),
    )  # fmt: skip


def _claimed(node: Node) -> InitialState:
    """Claim the node, locked against other dvtcli processes; raises SafetyRefusal if it cannot be tested."""
    found = node.begin_change()
    if found.state is NmtState.STOPPED:
        raise stopped_node(node.node_id)
    refuse(level_finding(node.access), "nothing was asked", node.node_id, force=False)
    return found


def _told(session: SessionUser, prepared: _Prepared) -> Callable[[], None]:
    """Return a callback that reports each write; the total depends on the answers."""
    count, node_id = itertools.count(1), prepared.node.node_id

    def wrote() -> None:
        session.tell.progress(f"node {node_id}: learning, write {next(count)} of {prepared.limit} at most", 0, 0)

    return wrote


def _looked(session: SessionUser, node: NodeDescription) -> Callable[[int, int], None]:
    """Return a callback that reports the search for missing objects."""
    text = f"node {node.node_id}: which objects of its EDS are there"
    return lambda done, total: session.tell.progress(f"{text}, {done + 1} of {total}", done, total)


def _heard(session: SessionNodes) -> frozenset[int]:
    """Return the CAN-IDs in use; if the bus carries no frames, they are unknown and no PDO is enabled."""
    if not session.bus.carries_frames:
        return frozenset(range(0x800))
    session.tell.progress(f"listening for {LISTEN_S} s to which CAN-IDs are in use", 0, 0)
    return frozenset(frame.can_id for frame in session.bus.receive(LISTEN_S))


def _prepared(session: SessionNodes, node: Node, *, isolated: bool, with_store: bool) -> _Prepared:
    """Prepare the tests of *node*, which is locked; raises DeviceRefused if there are none."""
    found = _claimed(node)
    pdos = node.pdos()
    asked = subjects(node, pdos, frozenset() if session.dry_run else _heard(session))
    if not asked:
        raise DeviceRefused(
            f"node {node.node_id} has no PDO that could be asked",
            node=node.node_id,
            why="none has a mapping and a COB-ID that can be written, and a configuration that it accepts again",
            hint=Hint(Action.SHOW_PDOS, {"all": True}, "shows them; clear one"),
        )
    instead = mapped_subjects(node, pdos, asked)
    operational = found.state is NmtState.OPERATIONAL
    probes, limit = [], 0
    for subject in asked:
        own = forecast(subject, isolated=isolated, operational=operational)
        probes += own
        limit += max([most_writes(subject, own), *_most_instead(subject, instead, isolated=isolated)])
    storage = read_storage(node)
    saves = storage.probes(node.profile.store.sub_indices) if with_store else []
    return _Prepared(node, found, pdos, asked, instead, probes, limit, storage, isolated, tuple(saves))


def _most_instead(subject: ProbedPdo, instead: Sequence[ProbedPdo], *, isolated: bool) -> list[int]:
    """Return the maximum numbers of downloads if another PDO of the direction replaces *subject*."""
    others = [pdo for pdo in instead if pdo.pdo.direction is subject.pdo.direction]
    return [most_writes(other, forecast(other, isolated=isolated)) + most_until_refused(subject) for other in others]


def _consent(session: SessionUser, prepared: _Prepared) -> None:
    """Ask, naming all acts on the node; raises SafetyRefusal if its values must not be stored."""
    node, isolated = prepared.node, prepared.isolated
    is_operational = prepared.found.state is NmtState.OPERATIONAL
    if prepared.saves:
        require_storable(node, force=session.options.force)
    labels = join_some(subject.pdo.label for subject in prepared.subjects)
    enabled = [subject.pdo.label for subject in prepared.subjects if subject.held.enabled]
    verb = "is" if len(enabled) == 1 else "are"
    others = [subject.pdo.label for subject in prepared.instead]
    while_off = ", off meanwhile" if any(subject.held.enabled for subject in prepared.instead) else ""
    parts = [
        f"{labels} of node {node.node_id} will be written up to {prepared.limit} times and rolled back",
        f"{join_some(others)} instead{while_off}, if an entry of 0 cannot be rolled back" if others else "",
        f"{join_some(enabled)} {verb} enabled, and off meanwhile" if enabled else "",
        prepared.storage.wears,
        _saving_text(prepared),
        "the node is OPERATIONAL, will be PRE-OPERATIONAL meanwhile, and OPERATIONAL again after that"
        if is_operational
        else "",
        "PDOs that are off are written in OPERATIONAL, too" if isolated and is_operational else "",
        "nothing else is on the bus, as was said" if isolated else "",
    ]
    session.consent(f"{'; '.join(part for part in parts if part)}; learn?")


def _saving_text(prepared: _Prepared) -> str:
    """Describe what --with-store does; empty without it."""
    if not prepared.saves:
        return ""
    unstored = join_some(prepared.node.pending.unstored)
    what = f"what it holds now, {unstored} with it," if unstored else "what it holds now"
    place = prepared.saves[0].label
    return f'0x{place} is written twice: a wrong signature, then "save": {what} is what it boots with after that'


def _note_saved(node: Node, saved: SignatureAnswers) -> None:
    """Clear pending changes of this session that were stored."""
    if saved.sub_index is not None:
        mark_stored(node, node.pending.was_stored(saved.sub_index, len(node.history)))


def _answers(asked: Asked, storage: Storage) -> list[ProbeAnswer]:
    """Return the node's answers about PDOs, and about stores, if tested."""
    about_pdos = [answer for known in asked.known for answer in known.answers.values()]
    return [*about_pdos, *(asked.saved.answers or not_asked(storage, "only if a store is allowed"))]


def _concluded(node: ReadableNode, asked: Asked, storage: Storage, lacking: Sequence[Absence]) -> Conclusions:
    known = {known_pdo.subject.pdo.direction: known_pdo for known_pdo in asked.known}
    most = 0
    if node.dictionary is not None:
        there = node.dictionary.without([absence.place for absence in lacking])
        mappings = [there[pdo.mapping_index] for pdo in node.present() if pdo.mapping_index in there]
        most = max((max(mapping.entries, default=0) for mapping in mappings), default=0)
    found, saved = conclude(known, most), asked.saved
    preferred = node.profile.store.sub_indices
    return Conclusions(
        (*found.profile, *storage_for_profile(storage, saved.answers, preferred, saved.seconds)),
        (*found.family, *storage_for_family(storage, saved.answers), *absent_for_family(lacking)),
    )
