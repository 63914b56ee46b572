"""What nodes hold, to a file of the format that its suffix says: those of `export_formats`.

Writes nothing to a node.
"""

from __future__ import annotations

from collections.abc import Mapping
from functools import cache
from typing import TYPE_CHECKING

from dvtcli.domain.hint import Action, Hint
from dvtcli.errors import UsageError
from dvtcli.operations.exchange.dbc_options import DbcOptions
from dvtcli.operations.exports.export_format import ExportRequest

if TYPE_CHECKING:
    from dvtcli.operations.exports.export_format import ExportFormat
    from dvtcli.operations.results import Facts
    from dvtcli.operations.session.session import Session


@cache
def export_formats() -> Mapping[str, ExportFormat]:
    """Every format by its suffixes."""
    from dvtcli.operations.exports.as_dbc import DbcExport
    from dvtcli.operations.exports.as_dcf import DcfExport
    from dvtcli.operations.exports.as_network_file import NetworkFileExport
    from dvtcli.operations.exports.as_nodelist import NodelistExport

    formats: tuple[ExportFormat, ...] = (DbcExport(), DcfExport(), NetworkFileExport(), NodelistExport())
    return {suffix: format_ for format_ in formats for suffix in format_.suffixes}


def is_of_all_nodes(file: str) -> bool:
    """Whether the format of *file* has all nodes in one file."""
    return _format_of(file).is_of_all


def export_file(
    session: Session, file: str, node_id: int | None = None, *, twice: bool = False, wishes: DbcOptions | None = None
) -> Facts:
    """Write the node with *node_id* (None: the selected one), as it is now, to *file*: a network file, a DCF or an XDC.

    A nodelist or a DBC file is of all nodes, as of `export_all`. With *twice* each object of a DCF is read two times.
    Raises as `export_node` and `export_dcf`; UsageError for another file with *twice*, or with *wishes* for another one
    than a DBC file.
    """
    kind = _format_of(file)
    if wishes and not kind.has_wishes:
        raise UsageError(
            f"{file} is no DBC file, which alone can have that",
            given=dict.fromkeys(wishes.named),
            hint=Hint(Action.EXPORT, {"file": "NAME.dbc", "services": "emcy,heartbeat"}),
        )
    if twice and not kind.reads_twice:
        raise UsageError(
            f"{file} is no DCF or XDC, which alone is read twice",
            given={"twice": True},
            hint=Hint(Action.EXPORT, {"file": "NAME.dcf", "twice": True}),
        )
    return kind.write(session, file, ExportRequest(node_id, twice, wishes or DbcOptions()))


def export_all(session: Session, file: str, *, twice: bool = False, wishes: DbcOptions | None = None) -> Facts:
    """Write all nodes that answer, or those of `-n`, to *file*: a nodelist with a DCF of each beside it, or a DBC file.

    *twice* and *wishes*, and what is raised for them, as of `export_file`. NoAnswer where no node answers.
    """
    if not is_of_all_nodes(file):
        others = " or ".join(
            sorted(suffix for suffix, export_format in export_formats().items() if export_format.is_of_all)
        )
        raise UsageError(f"{file}: what format is that?", hint=f"a name that ends in {others}")
    return export_file(session, file, twice=twice, wishes=wishes)


def _format_of(file: str) -> ExportFormat:
    """The format of *file*; UsageError, which names all formats, if no format has its suffix."""
    known, name = export_formats(), file.lower()
    found = next((export_format for suffix, export_format in known.items() if name.endswith(suffix)), None)
    if found is None:
        hint = Hint(
            Action.SAVE_SCRIPT, {"all": True}, f"a name that ends in {', '.join(sorted(known))}; {{}} writes a script"
        )
        raise UsageError(f"{file}: what format is that?", hint=hint)
    return found
