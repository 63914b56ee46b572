"""What a network file wants, read. Needs no bus and no session."""

from __future__ import annotations

from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING

from dvtcli.errors import UsageError
from dvtcli.files.network.read_network import read_network_file

if TYPE_CHECKING:
    from collections.abc import Collection

    from dvtcli.domain.network.wanted_state import NetworkWish, NodeWish

#: dcfgen's name for the folder of the network file itself
BESIDE = "@BUS_CONFIG_PATH@/"


def read_wish(file: str) -> NetworkWish:
    """Read the network file *file*; UsageError if it cannot be opened, InputFileError with all that is wrong in it.

    A `dcf` that names nothing is wrong, too: without the file no rule could be asked that needs it.
    """
    try:
        return read_network_file(Path(file), partial(_why_no_dcf, Path(file).parent))
    except OSError as failed:
        raise UsageError(f"{file}: {failed.strerror or failed}", place=file) from failed


def eds_of(file: str, node: NodeWish) -> Path | None:
    """Find what `dcf` of *node* in the network *file* names: a file beside it, a simulated family's, or the library's.

    None if it names none of these, or nothing.
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
    """Tell why `dcf: NAME` of a network file in *folder* names nothing, and what may be meant; empty if it does."""
    if _dcf_path(folder, name) is not None:
        return ""
    from dvtcli.files.device_file import DEVICE_SUFFIXES
    from dvtcli.files.network.file_log import nearest
    from dvtcli.simulator.network.family_file import family_names

    path = folder / name.removeprefix(BESIDE)
    beside = [one.name for one in folder.iterdir() if one.suffix.lower() in DEVICE_SUFFIXES] if folder.is_dir() else []
    near = nearest(name, [*beside, *family_names()])
    meant = f"; did you mean {near!r}?" if near else "; `profiles` lists the families, `eds list` the library"
    return f"there is no {path}, and no simulated family or library file is called {name[:40]!r}{meant}"


def skipped_rules(ids: Collection[int]) -> str:
    """Say that the rules that need an EDS were not asked about the nodes *ids*, which nothing describes."""
    nodes = f"node{'' if len(ids) == 1 else 's'} {', '.join(map(str, sorted(ids)))}"
    return f"no EDS is known of {nodes}: rules that need an EDS were skipped; `dcf:` beside the node_id names one"
