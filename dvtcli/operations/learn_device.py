"""Learning what a device takes: asked under consent, put back, and kept as a profile and a simulated family."""

from __future__ import annotations

import itertools
import time
from collections.abc import Callable
from dataclasses import dataclass, replace
from datetime import UTC, datetime
from pathlib import Path
from typing import TYPE_CHECKING

from dvtcli.device.access_level import level_finding
from dvtcli.device.applied import refuse
from dvtcli.device.learn.safely import Terms, ask_safely
from dvtcli.device.learn.subjects import subjects
from dvtcli.device.read_pdos import read_optional
from dvtcli.domain.learning.conclusions import Conclusions, Value, conclude
from dvtcli.domain.learning.forecast import forecast, most_writes
from dvtcli.domain.nmt import NmtState
from dvtcli.domain.several import several
from dvtcli.errors import DeviceRefused, SafetyRefusal, UsageError
from dvtcli.operations.results import LearnForecast, LearntDevice
from dvtcli.operations.results.learnt import Difference

if TYPE_CHECKING:
    from dvtcli.device.learn.safely import Asked
    from dvtcli.device.node import Node
    from dvtcli.domain.learning.probe import Probe, Subject
    from dvtcli.files.learnt_folder import Origin
    from dvtcli.operations.session import Session

#: How long the bus is listened to for CAN-IDs in use, in seconds.
LISTEN_S = 1.5
#: Bit of 0x1010:s by which a device says that it saves by itself (CiA 301, 7.5.2.13).
_BY_ITSELF = 2


@dataclass(frozen=True, slots=True)
class _Prepared:
    """What is to be asked of a node, and what has to be said before."""

    node: Node
    subjects: list[Subject]
    probes: list[Probe]
    limit: int
    stores: str

    @property
    def pdos(self) -> tuple[str, ...]:
        return tuple(str(subject.pdo) for subject in self.subjects)


def learn(
    session: Session, *, save: str | None = None, compare: str | None = None, isolated: bool = False
) -> LearntDevice | LearnForecast:
    """Find out what the selected node takes, and put everything back.

    *save* is the name of the profile and of the folder that are written, *compare* that of a profile, or the path of
    such a folder, to compare with; *isolated* asserts that nothing else is on the bus. Errors: SafetyRefusal without
    consent, and without force where *save* was learnt of another device; DeviceRefused where no PDO can be asked,
    UsageError where *save* names somebody else's folder.
    """
    started = time.monotonic()
    node = session.node()
    if save is not None:
        _refuse_name(save)
        _eds_of(session, node)
    known = None if compare is None else _profile_values(compare)
    if save is not None and not session.options.force:
        _refuse_other(save, node)
    found = node.claim()
    if found.state is NmtState.STOPPED:
        raise SafetyRefusal(
            f"node {node.node_id} is STOPPED: it answers no SDO", node=node.node_id, hint=f"nmt preop {node.node_id}"
        )
    refuse(level_finding(node.access), "nothing was asked", node.node_id, force=False)
    pdos = node.pdos()
    heard = frozenset[int]() if session.dry_run else _heard(session)
    prepared = _prepared(node, subjects(node, pdos, heard), isolated=isolated)
    if session.dry_run:
        return LearnForecast(node.node_id, prepared.pdos, prepared.probes, prepared.limit, prepared.stores)
    _consent(session, prepared, found.state, isolated=isolated)
    terms = Terms(prepared.limit, isolated)
    asked = ask_safely(node, prepared.subjects, pdos, found, terms, _told(session, prepared))
    learnt = _concluded(node, asked)
    answers = [answer for one in asked.known for answer in one.answers.values()]
    return LearntDevice(
        node.node_id, node.title, prepared.pdos, answers, learnt, asked.writes, time.monotonic() - started,
        () if save is None else _saved(session, node, save, learnt),
        None if known is None else (compare or "", _differences(known, learnt)),
    )  # fmt: skip


def _told(session: Session, prepared: _Prepared) -> Callable[[], None]:
    """What tells the user of each write; how many there will be depends on the answers."""
    count, node_id = itertools.count(1), prepared.node.node_id

    def wrote() -> None:
        session.tell.progress(f"node {node_id}: learning, write {next(count)} of {prepared.limit} at most", 0, 0)

    return wrote


def _heard(session: Session) -> frozenset[int]:
    """CAN-IDs that pass; none may be known where the bus carries no frames, so then no PDO is enabled."""
    if not session.bus.carries_frames:
        return frozenset(range(0x800))
    session.tell.progress(f"listening for {LISTEN_S} s to which CAN-IDs are in use", 0, 0)
    return frozenset(frame.can_id for frame in session.bus.receive(LISTEN_S))


def _prepared(node: Node, found: list[Subject], *, isolated: bool) -> _Prepared:
    if not found:
        raise DeviceRefused(
            f"node {node.node_id} has no PDO that could be asked",
            node=node.node_id,
            why="none has a mapping and a COB-ID that can be written, and a configuration that it takes back",
            hint="pdo --all shows them; clear one",
        )
    probes, limit = [], 0
    for subject in found:
        own = forecast(subject, isolated=isolated)
        probes += own
        limit += most_writes(subject, own)
    return _Prepared(node, found, probes, limit, _stores(node))


def _stores(node: Node) -> str:
    """What every write may do to the device's memory, in words; empty where it stores on command only."""
    capability = read_optional(node.sdo, 0x1010, 1, 4)
    if capability is None:
        return "it has no 0x1010, so it may save each write by itself"
    if capability & _BY_ITSELF:
        return f"0x1010:01 is {capability}: it saves by itself, so each write wears its memory"
    return ""


def _consent(session: Session, prepared: _Prepared, state: NmtState | None, *, isolated: bool) -> None:
    node = prepared.node
    labels = several(subject.pdo.label for subject in prepared.subjects)
    enabled = [subject.pdo.label for subject in prepared.subjects if subject.held.enabled]
    verb = "is" if len(enabled) == 1 else "are"
    parts = [
        f"{labels} of node {node.node_id} will be written up to {prepared.limit} times and put back",
        f"{several(enabled)} {verb} enabled, and off meanwhile" if enabled else "",
        prepared.stores,
        "the node is OPERATIONAL, will be PRE-OPERATIONAL meanwhile, and OPERATIONAL again after that"
        if state is NmtState.OPERATIONAL
        else "",
        "nothing else is on the bus (--isolated)" if isolated else "",
    ]
    session.consent(f"{'; '.join(part for part in parts if part)}; learn?")


def _concluded(node: Node, asked: Asked) -> Conclusions:
    known = {one.subject.pdo.direction: one for one in asked.known}
    most = 0
    if node.dictionary is not None:
        mappings = [
            node.dictionary[pdo.mapping_index] for pdo in node.present() if pdo.mapping_index in node.dictionary
        ]
        most = max((max(one.entries, default=0) for one in mappings), default=0)
    return conclude(known, most)


def _refuse_name(name: str) -> None:
    """Raise UsageError for a name that no profile can have, or whose folder is somebody else's."""
    import re

    from dvtcli.files.learnt_folder import refuse_foreign

    if not re.fullmatch(r"[a-z][a-z0-9_-]*", name):
        raise UsageError(f"{name!r} is not a profile name", hint="small letters, digits, - and _: learn --save pump")
    from dvtcli.files.profile.toml import builtin_names

    if name in builtin_names():
        raise UsageError(f"{name} is a profile that comes with dvtcli", hint=f"--save my-{name}")
    refuse_foreign(name)


def _refuse_other(name: str, node: Node) -> None:
    """Raise SafetyRefusal where what is kept as *name* was learnt of a device with another identity than *node*."""
    from dvtcli.files.learnt_folder import kept_profiles

    held = node.identity()
    own = (held.get("vendor") or 0, (held.get("product") or 0) if held.get("vendor") else 0)
    for path, kept in kept_profiles(name):
        theirs = (next(iter(kept.vendor_ids), 0), next(iter(kept.product_codes), 0))
        if theirs != own:
            raise SafetyRefusal(
                f"{path} was learnt of another device: {kept.title}, {_identity_text(*theirs)}; "
                f"node {node.node_id} is {node.title}, {_identity_text(*own)}",
                node=node.node_id,
                hint="--save with another name, or --force to write over it",
            )


def _identity_text(vendor: int, product: int) -> str:
    return f"vendor 0x{vendor:X} product 0x{product:X}" if vendor else "without an identity"


def _saved(session: Session, node: Node, name: str, learnt: Conclusions) -> tuple[str, ...]:
    from dvtcli.files.learnt_folder import write_folder

    origin = _origin(session, node, name)
    advised = {"rw_in_tpdo", "rww_in_tpdo", "rw_in_rpdo"}
    kept = [one for one in learnt.profile if one.key not in advised or _said(node.profile, one.key) != "warning"]
    learnt = replace(learnt, profile=tuple(kept))
    files = write_folder(Path(name), origin, learnt, _eds_of(session, node))
    return tuple(map(str, files))


def _eds_of(session: Session, node: Node) -> Path:
    """The file that the simulated family gets a copy of; UsageError where none is known."""
    path = session.network.files.eds_path(node.node_id)
    if path is None:
        raise UsageError(
            f"no EDS of node {node.node_id} is known, which a simulated family needs",
            node=node.node_id,
            hint="--eds FILE, or eds add FILE",
        )
    return path


def _origin(session: Session, node: Node, name: str) -> Origin:
    from dvtcli.files.learnt_folder import Origin
    from dvtcli.files.profile.toml import builtin_names
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


def _profile_values(name: str) -> object:
    """The profile *name*; with a path, as in `./pump`, that in the folder."""
    from dvtcli.files.profile.library import has_profile, load_folder_profile, load_profile

    path = Path(name)
    if path.name != name:
        if not has_profile(path):
            raise UsageError(f"{name} is no folder with a profile.toml", place=name, hint="--compare takes a name, too")
        return load_folder_profile(path)
    return load_profile(name)


def _differences(profile: object, learnt: Conclusions) -> list[Difference]:
    """What the profile says otherwise; what it leaves to the EDS or the standard is no difference."""
    found = []
    for one in learnt.profile:
        said = _said(profile, one.key)
        advised = said == "warning" and one.value == "fine"  # the device takes it: that is no reason to
        if said is not None and said != one.value and not advised:
            found.append(Difference(one.key, said, one))
    return found


def _said(profile: object, key: str) -> Value | None:
    """What the profile says of *key*, as it is written in its file; None where it does not say."""
    field, _, way = key.partition(".")
    value = getattr(profile, field)
    if way:
        value = value[way]
    if value is None:
        return "fine" if field.endswith(("_tpdo", "_rpdo")) else None
    return _written(value)


def _written(value: object) -> Value:
    if isinstance(value, frozenset):
        return sorted(value)
    if isinstance(value, tuple):
        return [_written(one) for one in value]
    return value if isinstance(value, bool | int) else str(value)
