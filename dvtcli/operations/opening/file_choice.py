"""Which file describes a node that nobody chose one for, and why: one of the library.

Asks the node who it is. Does not know files that somebody chose.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

from dvtcli.device.read_pdos import read_identity
from dvtcli.operations.opening.simulated_nodes import FileChoice

if TYPE_CHECKING:
    from dvtcli.domain.ports import SdoReader
    from dvtcli.files.device_library.match import Match


def found_file(node: SdoReader) -> FileChoice | None:
    """The file for the *node* by what it says of itself; None where none is known."""
    from dvtcli.files.device_library.stored_files import stored_files

    files = stored_files()
    if not files:
        return None
    vendor, product = (read_identity(node, sub) for sub in (1, 2))
    if vendor is None or product is None:
        return None
    if any((one.vendor_id, one.product_code) == (vendor, product) for one in files):
        from dvtcli.files.device_library.match import match

        found = match(files, vendor, product, read_identity(node, 3))
        if found is not None:
            return as_choice(found)
    return None


def as_choice(found: Match) -> FileChoice:
    """*found* with its reason in words."""
    return FileChoice(found.file.path, f"library: {found.why}", found.note, found.doubtful)
