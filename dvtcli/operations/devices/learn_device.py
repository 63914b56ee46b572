"""Learn what a device accepts: tested with consent, rolled back, saved as a profile and a simulated family."""

from __future__ import annotations

import itertools
import time
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace
from datetime import UTC, datetime
from pathlib import Path
from typing import TYPE_CHECKING

from dvtcli.device.access_level import level_finding
from dvtcli.device.change.applied import refuse
from dvtcli.device.learn.probing import Terms, ask_safely
from dvtcli.device.learn.saving import not_asked, read_storage, storage_for_family, storage_for_profile
from dvtcli.device.learn.subjects import absences, mapped_subjects, read_device, subjects
from dvtcli.device.read_whole import values_of
from dvtcli.device.store.unstored import mark_stored, require_storable
from dvtcli.domain.datatypes import DOMAIN
from dvtcli.domain.hint import Action, Hint, verbatim
from dvtcli.domain.learning.conclusions import conclude, forecast, most_until_refused, most_writes
from dvtcli.domain.learning.probe import Conclusions, Value, merged
from dvtcli.domain.learning.read_dictionary import absent_for_family
from dvtcli.domain.nmt import NmtState
from dvtcli.domain.objects import RESTORE_PARAMETERS, STORE_PARAMETERS
from dvtcli.domain.text import join_some
from dvtcli.errors import DeviceRefused, SafetyRefusal, UsageError, stopped_node
from dvtcli.operations.devices.backup_device import read_every_object
from dvtcli.operations.results import LearnForecast, LearntDevice
from dvtcli.operations.results.learnt import Difference
from dvtcli.operations.session.simulated_nodes import family_named

if TYPE_CHECKING:
    from dvtcli.device.learn.probing import Asked
    from dvtcli.device.learn.saving import SignatureAnswers, Storage
    from dvtcli.device.node import Node
    from dvtcli.device.node_parts import NodeDescription, ReadableNode
    from dvtcli.device.observe import InitialState
    from dvtcli.domain.learning.probe import Probe, ProbeAnswer, ProbedPdo
    from dvtcli.domain.learning.probe_table import KnownAnswers
    from dvtcli.domain.learning.read_dictionary import Absence
    from dvtcli.domain.pdo import Pdo, PdoConfig
    from dvtcli.files.learnt_folder import Origin
    from dvtcli.files.sim_state import Values
    from dvtcli.operations.session.session import SessionNodes
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
        session.reporter.progress(f"node {node_id}: learning, write {next(count)} of {prepared.limit} at most", 0, 0)

    return wrote


def _looked(session: SessionUser, node: NodeDescription) -> Callable[[int, int], None]:
    """Return a callback that reports the search for missing objects."""
    text = f"node {node.node_id}: which objects of its EDS are there"
    return lambda done, total: session.reporter.progress(f"{text}, {done + 1} of {total}", done, total)


def _received(session: SessionNodes) -> frozenset[int]:
    """Return the CAN-IDs in use; if the bus carries no frames, they are unknown and no PDO is enabled."""
    if not session.bus.carries_frames:
        return frozenset(range(0x800))
    session.reporter.progress(f"listening for {LISTEN_S} s to which CAN-IDs are in use", 0, 0)
    return frozenset(frame.can_id for frame in session.bus.receive(LISTEN_S))


def _prepared(session: SessionNodes, node: Node, *, isolated: bool, with_store: bool) -> _Prepared:
    """Prepare the tests of *node*, which is locked; raises DeviceRefused if there are none."""
    found = _claimed(node)
    pdos = node.pdos()
    asked = subjects(node, pdos, frozenset() if session.dry_run else _received(session))
    if not asked:
        raise DeviceRefused(
            f"node {node.node_id} has no PDO that could be asked",
            node=node.node_id,
            why="no PDO has a writable mapping and COB-ID, and accepts its own configuration again",
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


def profile_to_compare(name: str) -> object:
    """The profile *name*; with a path, as in `./pump`, that in the folder."""
    from dvtcli.files.profiles import has_profile, load_folder_profile, load_profile

    path = Path(name)
    if path.name != name:
        if not has_profile(path):
            raise UsageError(
                f"{name} is not a folder with a profile.toml",
                place=name,
                hint=Hint(Action.GIVE, {"compare": None}, "takes a name, too"),
            )
        return load_folder_profile(path)
    try:
        return load_profile(name)
    except UsageError as unknown:
        if has_profile(path):
            unknown.hint = Hint(Action.GIVE, {"compare": f"./{name}"}, "takes the one in the folder")
        raise


def differences(profile: object, learnt: Conclusions) -> list[Difference]:
    """Compare a profile with *learnt* values; what it leaves to the EDS or the standard is no difference."""
    found = []
    for conclusion in learnt.profile:
        held = said(profile, conclusion.key)
        if held is not None and held != conclusion.value and not is_advice(held, conclusion.value):
            found.append(Difference(conclusion.key, held, conclusion))
    return found


def is_advice(held: Value | None, learnt: Value) -> bool:
    """Tell whether a profile advises against what the device accepts: no contradiction."""
    return (held, learnt) in (("warning", "fine"), ("advised", "no"))


def said(profile: object, key: str) -> Value | None:
    """Return *key* of the profile as in its file; None if absent."""
    field, _, way = key.partition(".")
    value = getattr(profile, field)
    if way:
        value = value[way] if isinstance(value, dict) else getattr(value, way)
    if value is None:
        return "fine" if field.endswith(("_tpdo", "_rpdo")) else None
    return _written(value)


def _written(value: object) -> Value:
    if isinstance(value, frozenset):
        return sorted(value)
    if isinstance(value, tuple):
        return [_written(item) for item in value]
    return value if isinstance(value, bool | int) else str(value)


#: Objects for which a family has no values: their values tell how a device stores.
_SIGNATURES = (STORE_PARAMETERS, RESTORE_PARAMETERS)


def refuse_name(name: str) -> None:
    """Raises UsageError for an invalid profile name, or a name whose folder is another's."""
    import re

    from dvtcli.files.learnt_folder import refuse_foreign

    if not re.fullmatch(r"[a-z][a-z0-9_-]*", name):
        raise UsageError(
            f"{name!r} is not a profile name",
            hint=Hint(Action.LEARN, {"save": "pump"}, "small letters, digits, - and _: {}"),
        )
    from dvtcli.files.profiles import builtin_names

    if name in builtin_names():
        raise UsageError(f"{name} is a profile that comes with dvtcli", hint=Hint(Action.GIVE, {"save": f"my-{name}"}))
    refuse_foreign(name)


def refuse_other(name: str, node: ReadableNode) -> None:
    """Raises SafetyRefusal if *name* was learnt from a device with another identity than *node*."""
    from dvtcli.files.learnt_folder import kept_profiles

    held = node.identity()
    own = (held.get("vendor") or 0, (held.get("product") or 0) if held.get("vendor") else 0)
    for path, kept in kept_profiles(name):
        theirs = (next(iter(kept.vendor_ids), 0), next(iter(kept.product_codes), 0))
        if theirs != own:
            raise SafetyRefusal(
                f"{path} was learnt from another device: {kept.title}, {_identity_text(*theirs)}; "
                f"node {node.node_id} is {node.title}, {_identity_text(*own)}",
                node=node.node_id,
                hint=Hint(Action.GIVE_NAME, why="with another name")
                + Hint(Action.FORCE, why=", or {} to write over it"),
            )


def _identity_text(vendor: int, product: int) -> str:
    return f"vendor 0x{vendor:X} product 0x{product:X}" if vendor else "without an identity"


def values_found(session: SessionNodes, node: Node) -> Values:
    """Return values of *node* that differ from its EDS: the initial values of a simulated device.

    Writes nothing. Empty without an EDS. Programs and other domains are left out.
    """
    if node.dictionary is None:
        return {}
    looked = read_every_object(
        session, node, only=lambda looked_entry, _known: looked_entry.entry.data_type not in (None, DOMAIN)
    )
    held = values_of(looked.objects)
    return {
        place: data
        for place, data in held.items()
        if place[0] not in _SIGNATURES and looked.objects[place].entry.at_power_on(node.node_id) != data
    }


def save_learnt(
    session: SessionNodes,
    node: ReadableNode,
    name: str,
    learnt: Conclusions,
    pdos: Mapping[Pdo, PdoConfig],
    known: Sequence[KnownAnswers],
    values: Values,
) -> tuple[str, ...]:
    """Save *learnt* as *name*; returns the files. Without an EDS, one is made of *pdos* and *known*.

    *values* are initial values of the simulated device. Raises InputFileError if a file cannot be read or written.
    """
    from dvtcli.files.learnt_folder import write_folder
    from dvtcli.files.sim_state import Kept

    origin = _origin(session, node, name)
    kept = [
        conclusion
        for conclusion in learnt.profile
        if not is_advice(said(node.profile, conclusion.key), conclusion.value)
    ]
    like = family_named(origin.like_family).pre_operational_writes
    family = [
        merged(conclusion, like) if conclusion.key == "pre_operational_writes" else conclusion
        for conclusion in learnt.family
    ]
    learnt = replace(learnt, profile=tuple(kept), family=tuple(family))
    path = session.network.files.eds_path(node.node_id)
    modules = None if path is None else session.network.files.modules(node.node_id, path)
    eds: Path | str = (
        _of_modules(path, modules) if path and modules else path or _described(node, name, origin, pdos, known)
    )
    if path is None:
        session.reporter.note(
            f"no EDS of node {node.node_id} is known: {name}.eds has only the objects that were read from it"
        )
        if node.bus.bitrate is None:
            session.reporter.note(
                Hint(
                    Action.GIVE_BIT_RATE,
                    why=f"nobody said the bus's bit rate: no BaudRate_ key of {verbatim(name)}.eds is 1; {{}} says it",
                )
            )
    _read_back(origin, learnt, eds)
    files = write_folder(Path(name), origin, learnt, eds, Kept(node.node_id, values))
    _take_up(session)
    return tuple(map(str, files))


def _of_modules(path: Path, modules: tuple[int, ...]) -> str:
    """Return the text of the EDS at *path* with its connected *modules*."""
    from dvtcli.files.device_file import connected_file
    from dvtcli.files.eds.ini import decode

    return decode(connected_file(path, modules))[0].replace("\r\n", "\n")


def _read_back(origin: Origin, learnt: Conclusions, eds: Path | str) -> None:
    """Check what is to be written by reading it; raises InputFileError if unreadable."""
    from dvtcli.files.device_file import must_describe, parse_device_file, read_device_file
    from dvtcli.files.learnt_folder import PROFILE, SIMULATED, profile_text, simulated_text
    from dvtcli.files.profiles import read_profile
    from dvtcli.simulator.network.family_file import read_family

    read_profile(profile_text(origin, learnt), f"{origin.name}/{PROFILE}")
    read_family(origin.name, simulated_text(origin, learnt), f"{origin.name}/{SIMULATED}")
    described = parse_device_file(eds.encode(), f"{origin.name}.eds") if isinstance(eds, str) else read_device_file(eds)
    must_describe(described.dictionary)


def _take_up(session: SessionNodes) -> None:
    """Give the met nodes their new profile."""
    from dvtcli.device.file_fits import as_file_says

    for node_id, node in session.network.nodes.items():
        node.profile = as_file_says(session.network.files.profile(node_id), node.dictionary)


def _described(
    node: ReadableNode, name: str, origin: Origin, pdos: Mapping[Pdo, PdoConfig], known: Sequence[KnownAnswers]
) -> str:
    """Make an EDS from reads of *node*, which has none."""
    from dvtcli.domain.learning.read_dictionary import described
    from dvtcli.files.eds.writer import eds_text

    dictionary = described(read_device(node, pdos, known))
    about = f"What was read by learn, and no more: {origin.said[0]}"
    return eds_text(dictionary, f"{name}.eds", about, datetime.now(UTC))


def _origin(session: SessionNodes, node: ReadableNode, name: str) -> Origin:
    from dvtcli.files.learnt_folder import Origin
    from dvtcli.files.profiles import builtin_names
    from dvtcli.simulator.network.family_file import family_names
    from dvtcli.version import __version__

    identity = node.identity()
    numbers = " ".join(f"{key} 0x{value:X}" for key, value in identity.items() if value is not None)
    day = datetime.now(UTC).date().isoformat()
    own = node.profile.name
    return Origin(
        name,
        node.title,
        own if own in builtin_names() else "generic",
        own if own in family_names() else "generic",
        identity.get("vendor"),
        identity.get("product"),
        (f"node {node.node_id} on {session.bus.name}, {day}, dvtcli {__version__}", numbers or "no identity"),
    )
