"""All nodes as a DBC file."""

from __future__ import annotations

from typing import TYPE_CHECKING

from dvtcli.files.dbc_text import SUFFIX
from dvtcli.operations.exports.export_format import ExportFormat, ExportRequest

if TYPE_CHECKING:
    from dvtcli.operations.results import Facts
    from dvtcli.operations.session.session import Session


class DbcExport(ExportFormat):
    """The enabled PDOs of all nodes, as a DBC file."""

    suffixes = (SUFFIX,)
    is_of_all = True
    has_wishes = True

    def write(self, session: Session, file: str, wanted: ExportRequest) -> Facts:
        """Write it, as `export_dbc` does."""
        from dvtcli.operations.exchange.export_dbc import export_dbc

        return export_dbc(session, file, wanted.dbc)
