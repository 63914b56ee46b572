"""A file of a modular device with its connected modules, which describes all that they add in sections of its own."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

from dvtcli.files.carried_over import kept
from dvtcli.files.device_file import device_file_bytes, read_device_file
from dvtcli.files.eds.reader import EdsFile
from dvtcli.files.file_info import file_info


def connected_file(path: Path, modules: Sequence[int]) -> bytes:
    """Return the EDS or DCF at *path* with *modules* connected, and the sections of their objects."""
    read = read_device_file(path, modules)
    keeps = kept(read, of_a_node=True) if isinstance(read, EdsFile) else None
    return device_file_bytes(read.dictionary, path.name, f"made from {path.name}", None, file_info(read), keeps)
