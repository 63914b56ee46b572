"""One node's PDOs as a network file."""

from __future__ import annotations

from typing import TYPE_CHECKING

from dvtcli.operations.exports.export_format import ExportFormat, ExportRequest

if TYPE_CHECKING:
    from dvtcli.operations.results import Facts
    from dvtcli.operations.session.session import Session


class NetworkFileExport(ExportFormat):
    """A node's PDOs, as a network file."""

    suffixes = (".yaml", ".yml")

    def write(self, session: Session, file: str, wanted: ExportRequest) -> Facts:
        """Write it, as `export_node` does; UsageError for another suffix."""
        from dvtcli.operations.exchange.export_network import export_node

        return export_node(session, file, wanted.node_id)
