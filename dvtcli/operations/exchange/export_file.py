"""What a node holds, to a file of the format that its suffix says. Writes nothing to a node."""

from __future__ import annotations

from typing import TYPE_CHECKING

from dvtcli.errors import UsageError
from dvtcli.files.dbc_text import SUFFIX as DBC_SUFFIX
from dvtcli.files.device_file import VALUE_SUFFIXES
from dvtcli.files.nodelist import SUFFIX as NODELIST_SUFFIX

if TYPE_CHECKING:
    from dvtcli.operations.exchange.dbc_wishes import DbcWishes
    from dvtcli.operations.results import Facts
    from dvtcli.operations.session.session import Session


_NOT_DBC = "--with, --split-bits and --all are for a DBC file"
#: formats that have all nodes in one file
NETWORK_SUFFIXES = (NODELIST_SUFFIX, DBC_SUFFIX)


def export_file(
    session: Session, file: str, node_id: int | None = None, *, twice: bool = False, wishes: DbcWishes | None = None
) -> Facts:
    """Write the node with *node_id* (None: the selected one), as it is now, to *file*: a network file, a DCF or an XDC.

    A nodelist or a DBC file is of all nodes, as of `export_all`. With *twice* each object of a DCF is read two times.
    Raises as `export_node` and `export_dcf`; UsageError for another file with *twice*, or with *wishes* for another one
    than a DBC file.
    """
    if file.lower().endswith(NETWORK_SUFFIXES):
        return export_all(session, file, twice=twice, wishes=wishes)
    if wishes:
        raise UsageError(_NOT_DBC, hint="export NAME.dbc --with emcy,heartbeat")
    if file.lower().endswith(VALUE_SUFFIXES):
        from dvtcli.operations.whole_device.export_dcf import export_dcf

        return export_dcf(session, file, node_id, twice=twice)
    if twice:
        raise UsageError("--twice is for a DCF or XDC", hint="export NAME.dcf --twice")
    from dvtcli.operations.exchange.export_network import export_node

    return export_node(session, file, node_id)


def export_all(session: Session, file: str, *, twice: bool = False, wishes: DbcWishes | None = None) -> Facts:
    """Write all nodes that answer, or those of `-n`, to *file*: a nodelist with a DCF of each beside it, or a DBC file.

    *twice* and *wishes*, and what is raised for them, as of `export_file`. NoAnswer where no node answers.
    """
    if file.lower().endswith(NODELIST_SUFFIX):
        from dvtcli.operations.exchange.export_nodelist import export_nodelist

        if wishes:
            raise UsageError(_NOT_DBC, hint="export NAME.dbc --with emcy,heartbeat")
        return export_nodelist(session, file, twice=twice)
    if not file.lower().endswith(DBC_SUFFIX):
        raise UsageError(f"{file}: what format is that?", hint=f"a name that ends in {' or '.join(NETWORK_SUFFIXES)}")
    if twice:
        raise UsageError("--twice is for a DCF or XDC", hint="export NAME.dcf --twice")
    from dvtcli.operations.exchange.dbc_wishes import DbcWishes
    from dvtcli.operations.exchange.export_dbc import export_dbc

    return export_dbc(session, file, wishes or DbcWishes())
