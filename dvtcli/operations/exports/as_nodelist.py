"""All nodes as a nodelist with a DCF of each."""

from __future__ import annotations

from typing import TYPE_CHECKING

from dvtcli.files.nodelist import SUFFIX
from dvtcli.operations.exports.export_format import ExportFormat, ExportRequest

if TYPE_CHECKING:
    from dvtcli.operations.results import Facts
    from dvtcli.operations.session.session import Session


class NodelistExport(ExportFormat):
    """Which nodes there are, as a nodelist, with a DCF of each beside it."""

    suffixes = (SUFFIX,)
    is_of_all = True
    reads_twice = True

    def write(self, session: Session, file: str, wanted: ExportRequest) -> Facts:
        """Write it, as `export_nodelist` does."""
        from dvtcli.operations.exchange.export_nodelist import export_nodelist

        return export_nodelist(session, file, twice=wanted.twice)
