"""What a node holds, to a file of the format that its suffix says. Writes nothing to a node."""

from __future__ import annotations

from typing import TYPE_CHECKING

from dvtcli.errors import UsageError
from dvtcli.files.dbc_text import SUFFIX as DBC_SUFFIX
from dvtcli.files.device_file import VALUE_SUFFIXES
from dvtcli.files.nodelist import SUFFIX as NODELIST_SUFFIX

if TYPE_CHECKING:
    from dvtcli.operations.results import Facts
    from dvtcli.operations.session.session import Session


def export_file(
    session: Session, file: str, node_id: int | None = None, *, twice: bool = False, services: str | None = None
) -> Facts:
    """Write the node with *node_id* (None: the selected one), as it is now, to *file*: a network file, a DCF or an XDC.

    A nodelist (.cpj) is of all nodes, each with its DCF beside it; a DBC file has the PDOs of all nodes. With *twice*
    each object of a DCF is read two times. Raises as `export_node` and `export_dcf`; UsageError for another file with
    *twice*. *services*, with commas between them, are for a DBC file only.
    """
    if services and not file.lower().endswith(DBC_SUFFIX):
        raise UsageError("--with is for a DBC file", hint="export NAME.dbc --with emcy,heartbeat")
    if file.lower().endswith(NODELIST_SUFFIX):
        from dvtcli.operations.exchange.export_nodelist import export_nodelist

        return export_nodelist(session, file, twice=twice)
    if file.lower().endswith(VALUE_SUFFIXES):
        from dvtcli.operations.whole_device.export_dcf import export_dcf

        return export_dcf(session, file, node_id, twice=twice)
    if twice:
        raise UsageError("--twice is for a DCF or XDC", hint="export NAME.dcf --twice")
    if file.lower().endswith(DBC_SUFFIX):
        from dvtcli.operations.exchange.export_dbc import export_dbc
        from dvtcli.operations.exchange.service_messages import services_of

        return export_dbc(session, file, services_of(services))
    from dvtcli.operations.exchange.export_network import export_node

    return export_node(session, file, node_id)
