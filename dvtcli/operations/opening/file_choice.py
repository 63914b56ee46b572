"""Which file describes a node that nobody chose one for, and why: one of the library, or its simulated family's.

The library goes first, but a family whose four numbers are the node's before a file of another revision.

Asks the node who it is. Does not know files that somebody chose.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

from dvtcli.device.read_pdos import IDENTITY, read_identity
from dvtcli.errors import SdoAborted
from dvtcli.operations.opening.simulated_nodes import FileChoice

if TYPE_CHECKING:
    from dvtcli.domain.ports import SdoReader
    from dvtcli.files.device_library.match import Match

#: revision and serial number, as sub-indices of 0x1018
_TOLD = (3, 4)


def found_file(node: SdoReader) -> FileChoice | None:
    """The file for the *node* by what it says of itself; None where none is known."""
    from dvtcli.files.device_library.stored_files import stored_files

    files = stored_files()
    vendor, product = (read_identity(node, sub) for sub in (1, 2))
    if vendor is None or product is None:
        return None
    if any((file.vendor_id, file.product_code) == (vendor, product) for file in files):
        from dvtcli.files.device_library.match import match

        found = match(files, vendor, product, read_identity(node, 3))
        if found is not None:
            family = _of_family(node, vendor, product) if found.of_other_revision else None
            return family or as_choice(found)
    return _of_family(node, vendor, product)


def as_choice(found: Match) -> FileChoice:
    """*found* with its reason in words."""
    return FileChoice(found.file.path, f"library: {found.why}", found.note, found.doubtful)


def _of_family(node: SdoReader, vendor: int, product: int) -> FileChoice | None:
    """The EDS of a simulated family, where the *node* is one: all four numbers of its identity are.

    A device of that make has another serial number, and its own EDS. A profile that was learnt of it changes nothing.
    """
    from dvtcli.files.profile.library import builtin_for_identity
    from dvtcli.simulator.network.family_file import family_eds, family_names

    name = builtin_for_identity(vendor, product).name
    if name not in family_names() or not product:
        return None
    from dvtcli.operations.opening.simulated_nodes import read_dictionary

    path = family_eds(name)
    family = read_dictionary(path)
    if (family.info.vendor_id, family.info.product_code) != (vendor, product):
        return None
    for sub in _TOLD:
        entry = family.entry(IDENTITY, sub)
        if entry is None or _held(node, sub) != entry.initial(0):
            return None
    return FileChoice(path, f"family {name}: its identity and serial number are the simulated one's")


def _held(node: SdoReader, sub_index: int) -> bytes | None:
    try:
        return node.upload(IDENTITY, sub_index)
    except SdoAborted:
        return None
