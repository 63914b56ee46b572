"""What a network file wants, read. Needs no bus and no session."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING

from dvtcli.errors import UsageError
from dvtcli.files.network.read_network import read_network_file

if TYPE_CHECKING:
    from dvtcli.domain.network.wanted_state import NetworkWish


def read_wish(file: str) -> NetworkWish:
    """What the network file *file* wants; UsageError where it cannot be read, InputFileError with all that is wrong."""
    try:
        return read_network_file(Path(file))
    except OSError as failed:
        raise UsageError(f"{file}: {failed.strerror or failed}", place=file) from failed
