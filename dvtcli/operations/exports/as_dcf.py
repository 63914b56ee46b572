"""One node as a DCF or XDC."""

from __future__ import annotations

from typing import TYPE_CHECKING

from dvtcli.files.device_file import VALUE_SUFFIXES
from dvtcli.operations.exports.export_format import ExportFormat, ExportRequest

if TYPE_CHECKING:
    from dvtcli.operations.results import Facts
    from dvtcli.operations.session.session import Session


class DcfExport(ExportFormat):
    """All of a node's configuration, as a DCF or XDC."""

    suffixes = VALUE_SUFFIXES
    reads_twice = True

    def write(self, session: Session, file: str, wanted: ExportRequest) -> Facts:
        """Write it, as `export_dcf` does."""
        from dvtcli.operations.whole_device.export_dcf import export_dcf

        return export_dcf(session, file, wanted.node_id, twice=wanted.twice)
