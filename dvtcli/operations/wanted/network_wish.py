"""What a network file wants, read. Needs no bus and no session."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING

from dvtcli.errors import UsageError
from dvtcli.files.network.read_network import read_network_file

if TYPE_CHECKING:
    from dvtcli.domain.network.wanted_state import NetworkWish, NodeWish


def read_wish(file: str) -> NetworkWish:
    """What the network file *file* wants; UsageError where it cannot be read, InputFileError with all that is wrong."""
    try:
        return read_network_file(Path(file))
    except OSError as failed:
        raise UsageError(f"{file}: {failed.strerror or failed}", place=file) from failed


def eds_of(file: str, node: NodeWish) -> Path | None:
    """What `dcf` of *node* in the network *file* names: a file beside it, that of a simulated family, or the library's.

    None where it names none of these, or nothing.
    """
    if node.dcf is None:
        return None
    path = Path(file).parent / node.dcf.text
    if path.is_file():
        return path
    from dvtcli.files.device_library.stored_files import stored_path
    from dvtcli.simulator.network.family_file import family_eds, family_names

    return family_eds(node.dcf.text) if node.dcf.text in family_names() else stored_path(node.dcf.text)
