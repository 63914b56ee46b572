"""Read a network file. Needs no bus and no session."""

from __future__ import annotations

import re
from dataclasses import replace
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING

from dvtcli.domain.hint import Action, Hint, verbatim
from dvtcli.domain.network.network_config import Endpoint
from dvtcli.domain.text import all_nodes, plural
from dvtcli.errors import InputFileError, UsageError
from dvtcli.files.network.read_network import WhyNot, read_network_file
from dvtcli.operations.plans.stamping import linked_with

if TYPE_CHECKING:
    from collections.abc import Collection

    from dvtcli.domain.network.network_config import NetworkConfig, NodeConfig
    from dvtcli.operations.session.session import Session
    from dvtcli.operations.session.session_nodes import SessionNodes
    from dvtcli.operations.user.session_user import SessionUser

#: dcfgen's name for the folder of the network file itself
BESIDE = "@BUS_CONFIG_PATH@/"


def read_network_config(file: str) -> NetworkConfig:
    """Read the network file *file*.

    Raises UsageError if it cannot be opened, InputFileError with all its errors; an unresolvable `dcf` or `profile` is
    an error, too, since rules need it.
    """
    try:
        why_not: dict[str, WhyNot] = {"dcf": partial(_why_no_dcf, Path(file).parent), "profile": _why_no_profile}
        return read_network_file(Path(file), why_not, partial(_why_no_modules, file))
    except OSError as failed:
        raise UsageError(f"{file}: {failed.strerror or failed}", place=file) from failed


def eds_of(file: str, node: NodeConfig) -> Path | None:
    """Find the `dcf` of *node* in *file*: a file beside it, of a simulated family, or of the library.

    Returns None if there is none.
    """
    return None if node.dcf is None else _dcf_path(Path(file).parent, node.dcf.text)


def _dcf_path(folder: Path, name: str) -> Path | None:
    path = folder / name.removeprefix(BESIDE)
    if path.is_file():
        return path
    from dvtcli.files.device_library import stored_path
    from dvtcli.simulator.network.family_file import family_eds, family_names

    return family_eds(name) if name in family_names() else stored_path(name)


def _why_no_dcf(folder: Path, name: str) -> str:
    """Explain why `dcf: NAME` in *folder* names no device description, with a suggestion; empty if it does."""
    found = _dcf_path(folder, name)
    if found is not None:
        return _why_no_description(found)
    from dvtcli.files.device_file import DEVICE_SUFFIXES
    from dvtcli.files.network.file_log import nearest
    from dvtcli.simulator.network.family_file import family_names

    path = folder / name.removeprefix(BESIDE)
    inside = path.parent
    beside = (
        [file.name for file in inside.iterdir() if file.suffix.lower() in DEVICE_SUFFIXES] if inside.is_dir() else []
    )
    if path.exists():
        kind = "a folder" if path.is_dir() else "a pipe or a device"
        return f"{path} is {kind}, and dcf names a file: an EDS, DCF, XDD or XDC"
    families = family_names()
    near = nearest(path.name, [*beside, *families])
    if near in beside:  # written as the file's author wrote the folder
        near = f"{name[: len(name) - len(path.name)]}{near}"
    meant = f"; did you mean {near!r}?" if near else f"; families are {', '.join(families)}"
    return f"there is no {path}, and no simulated family or library file is called {name[:40]!r}{meant}"


def _why_no_description(path: Path) -> str:
    """Explain why the file at *path* describes no device; empty if it does. Caches the parsed file."""
    from dvtcli.operations.session.simulated_nodes import read_dictionary

    try:
        read_dictionary(path)
    except (InputFileError, UsageError) as wrong:
        line = re.search(r":[0-9]+(?::[0-9]+)?$", wrong.place or "")
        at = f" ({path.name}{line[0]})" if line and line[0] not in wrong.text else ""
        return f"{wrong.text}{f': {wrong.why}' if wrong.why else ''}{at}"
    return ""


def _why_no_modules(file: str, node: NodeConfig) -> str:
    """Explain why the `dcf` of *node* does not have its modules; empty if it does, or another file describes it."""
    from dvtcli.operations.session.simulated_nodes import read_dictionary, why_no_modules

    path = eds_of(file, node)
    return "" if path is None else why_no_modules(read_dictionary(path), node.modules or ())


def _why_no_profile(name: str) -> str:
    """Explain why `profile: NAME` is unknown, with a suggestion; empty if known."""
    from dvtcli.files.profile.library import profile_path

    try:
        profile_path(name)
    except UsageError as wrong:
        hint = str(wrong.hint or "")
        return f"{wrong.text}; {hint if hint.startswith('did') else f'known are {hint}'}"
    return ""


def skipped_rules(ids: Collection[int]) -> str:
    """Say that rules which need an EDS were skipped for the nodes *ids* without a description."""
    return (
        f"{all_nodes(sorted(ids))}: no EDS, so rules that need an EDS were skipped; `dcf:` next to node_id names an EDS"
    )


def named_nodes(session: Session) -> tuple[int, ...]:
    """Return the nodes that the user chose; empty for all of the file.

    A single node counts only if `-n` is on the line itself: at a prompt and in scripts, settings and variables `-n`
    only selects the current node.
    """
    ids = session.base.nodes
    typed = session.settings.is_typed("node") and session.ends_with_line
    return ids if len(ids) > 1 or typed else ()


def of_nodes(session: SessionUser, file: str, config: NetworkConfig, ids: tuple[int, ...]) -> NetworkConfig:
    """Restrict *config* to the nodes *ids*, if any (`-n 1,3`); raises UsageError for a node not in the file."""
    if not ids:
        return config
    if unknown := [chosen_id for chosen_id in ids if chosen_id not in {node.node_id for node in config.nodes}]:
        raise UsageError(f"{file} has no {all_nodes(unknown)}", place=file)
    chosen, alone = _without_torn_links(config, _without_stamps(config, config.of(ids)))
    if left_out := len(config.links) - len(chosen.links):
        stay = ", ".join(f"{end.node_id}:{end.pdo}" for end in alone)
        kept = f"; not changed: {stay}" if stay else ""
        session.reporter.note(
            f"{plural(left_out, 'link')} of {file} left out, since their producer or consumer was not chosen{kept}"
        )
    return chosen


def _without_stamps(config: NetworkConfig, chosen: NetworkConfig) -> NetworkConfig:
    """Drop from *chosen* the stamps that also cover links with nodes outside it."""
    ids = {node.node_id for node in chosen.nodes}
    nodes = (node if linked_with(config, node.node_id) <= ids else replace(node, stamp=None) for node in chosen.nodes)
    return replace(chosen, nodes=tuple(nodes))


def _without_torn_links(config: NetworkConfig, chosen: NetworkConfig) -> tuple[NetworkConfig, list[Endpoint]]:
    """Drop links of *chosen* that lack an end, and their PDOs; returns those PDOs, too.

    One end of such a link must not change while the other stays: the RPDO would receive another layout.
    """
    links, unlinked = chosen.links, {end for link in config.links if link not in chosen.links for end in link.ends}
    while shared := [link for link in links if not unlinked.isdisjoint(link.ends)]:
        links = tuple(link for link in links if link not in shared)
        unlinked |= {end for link in shared for end in link.ends}
    nodes = tuple(
        replace(node, pdos=tuple(pdo for pdo in node.pdos if Endpoint(node.node_id, pdo.pdo) not in unlinked))
        for node in chosen.nodes
    )
    ids = {node.node_id for node in chosen.nodes}
    alone = sorted((end for end in unlinked if end.node_id in ids), key=lambda end: (end.node_id, str(end.pdo)))
    return replace(chosen, nodes=nodes, links=links), alone


def tell_unknown_bit_rate(session: SessionNodes, nodes: int) -> None:
    """Report, once a session, that *nodes* nodes are read one by one as the bit rate is unknown, with a hint.

    Only for a bus that could read them in parallel: not for simulated nodes, twins, or an object gateway.
    """
    bus = session.bus
    if nodes < 2 or session.dry_run or bus.simulated or not bus.carries_frames or bus.bitrate is not None:
        return
    unknown = f"the bit rate of {bus.name} is not known"
    if not session.network.files.is_news(unknown):
        return
    session.reporter.note(
        Hint(
            Action.GIVE_BIT_RATE,
            {"rate": 250000},
            f"{verbatim(unknown)}: its {nodes} nodes are read one after the other, which takes long, and without a "
            "limit of the bus load for a running machine; faster with {} or bitrate = 250000 in dvtcli.toml",
        )
    )
