"""Read a network file. Needs no bus and no session."""

from __future__ import annotations

import re
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING

from dvtcli.errors import InputFileError, UsageError
from dvtcli.files.network.read_network import WhyNot, read_network_file

if TYPE_CHECKING:
    from collections.abc import Collection

    from dvtcli.domain.network.network_config import NetworkConfig, NodeConfig

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
    from dvtcli.files.device_library.stored_files import stored_path
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
    beside = (
        [file.name for file in folder.iterdir() if file.suffix.lower() in DEVICE_SUFFIXES] if folder.is_dir() else []
    )
    if path.exists():
        kind = "a folder" if path.is_dir() else "a pipe or a device"
        return f"{path} is {kind}, and dcf names a file: an EDS, DCF, XDD or XDC"
    families = family_names()
    near = nearest(name, [*beside, *families])
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
    nodes = f"node{'' if len(ids) == 1 else 's'} {', '.join(map(str, sorted(ids)))}"
    return f"no EDS is known of {nodes}: rules that need an EDS were skipped; `dcf:` beside the node_id names one"
