"""Save a learnt profile: name, replacement, source."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import replace
from datetime import UTC, datetime
from pathlib import Path
from typing import TYPE_CHECKING

from dvtcli.device.read_whole import values_of
from dvtcli.domain.datatypes import DOMAIN
from dvtcli.domain.hint import Action, Hint, verbatim
from dvtcli.domain.learning.operational import merged
from dvtcli.domain.learning.probe import Conclusions, Value
from dvtcli.domain.learning.storage import RESTORE, STORE
from dvtcli.errors import SafetyRefusal, UsageError
from dvtcli.operations.opening.simulated_nodes import family_named
from dvtcli.operations.results.learnt import Difference
from dvtcli.operations.whole_device.read_whole_device import read_every_object

if TYPE_CHECKING:
    from dvtcli.device.node import Node
    from dvtcli.device.node_parts import ReadableNode
    from dvtcli.domain.learning.probe_table import KnownAnswers
    from dvtcli.domain.pdo import Pdo, PdoConfig
    from dvtcli.files.learnt_folder import Origin
    from dvtcli.files.sim_state import Values
    from dvtcli.operations.session.session_nodes import SessionNodes


def profile_to_compare(name: str) -> object:
    """The profile *name*; with a path, as in `./pump`, that in the folder."""
    from dvtcli.files.profile.library import has_profile, load_folder_profile, load_profile

    path = Path(name)
    if path.name != name:
        if not has_profile(path):
            raise UsageError(
                f"{name} is no folder with a profile.toml",
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
_SIGNATURES = (STORE, RESTORE)


def refuse_name(name: str) -> None:
    """Raises UsageError for an invalid profile name, or a name whose folder is another's."""
    import re

    from dvtcli.files.learnt_folder import refuse_foreign

    if not re.fullmatch(r"[a-z][a-z0-9_-]*", name):
        raise UsageError(
            f"{name!r} is not a profile name",
            hint=Hint(Action.LEARN, {"save": "pump"}, "small letters, digits, - and _: {}"),
        )
    from dvtcli.files.profile.toml import builtin_names

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
                f"{path} was learnt of another device: {kept.title}, {_identity_text(*theirs)}; "
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
        session.tell.note(f"no EDS of node {node.node_id} is known: {name}.eds has what was read of it, and no more")
        if node.bus.bitrate is None:
            session.tell.note(
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
    from dvtcli.files.connected_file import connected_file
    from dvtcli.files.eds.ini import decode

    return decode(connected_file(path, modules))[0].replace("\r\n", "\n")


def _read_back(origin: Origin, learnt: Conclusions, eds: Path | str) -> None:
    """Check what is to be written by reading it; raises InputFileError if unreadable."""
    from dvtcli.files.device_file import must_describe, parse_device_file, read_device_file
    from dvtcli.files.learnt_folder import PROFILE, SIMULATED, profile_text, simulated_text
    from dvtcli.files.profile.toml import read_profile
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
    from dvtcli.device.learn.read_device import read_device
    from dvtcli.domain.learning.read_dictionary import described
    from dvtcli.files.eds.writer import eds_text

    dictionary = described(read_device(node, pdos, known))
    about = f"What was read by learn, and no more: {origin.said[0]}"
    return eds_text(dictionary, f"{name}.eds", about, datetime.now(UTC))


def _origin(session: SessionNodes, node: ReadableNode, name: str) -> Origin:
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
