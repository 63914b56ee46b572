"""List a node's PDOs, or show one with its frame picture."""

from __future__ import annotations

from typing import TYPE_CHECKING

import click

from dvtcli.cli.command import DvtCommand
from dvtcli.cli.params import EDIT, EditOrPdo, NodePdo

if TYPE_CHECKING:
    from dvtcli.device.node import Node
    from dvtcli.domain.datatypes import DataType
    from dvtcli.domain.mapping import PdoMappingEntry
    from dvtcli.domain.pdo import Pdo, PdoConfig
    from dvtcli.operations.results import Changed, Facts, LastFrame, MappedName, PdoListing, PdoRow
    from dvtcli.operations.session import Session


@click.command("pdo", cls=DvtCommand, short_help=__doc__)
@click.argument("words", type=EditOrPdo(), nargs=-1, metavar="[edit] [PDO]")
@click.option("--all", "show_all", is_flag=True, help="Also PDOs that are off and empty.")
@click.pass_obj
def command(session: Session, /, words: tuple[NodePdo | str, ...], show_all: bool) -> PdoListing | Changed | Facts:
    """Show the PDOs as the node holds them now, or edit one as text.

    \b
    pdo                 the list
    pdo tpdo1           one, with the picture of its frame
    pdo edit tpdo1      in $EDITOR as YAML; what is saved is checked, shown and written
    """
    pdos = [word for word in words if isinstance(word, NodePdo)]
    editing = words[:1] == (EDIT,)
    if len(pdos) > 1 or len(words) - len(pdos) != editing or (editing and not pdos):
        raise click.UsageError("give one PDO: pdo tpdo1, or pdo edit tpdo1")
    pdo = pdos[0] if pdos else None
    if editing and pdo is not None:
        from dvtcli.cli.commands._pdo_edit import edit

        return edit(session, session.node(pdo.node_id), pdo.pdo)
    return _listing(session, pdo, show_all=show_all)


def _listing(session: Session, pdo: NodePdo | None, *, show_all: bool) -> PdoListing:
    from dataclasses import replace

    from dvtcli.device.read_pdos import read_optional
    from dvtcli.operations.results import PdoListing

    node = session.node(pdo.node_id if pdo else None)
    if pdo is None:
        rows = tuple(_row(node, one, config) for one, config in node.pdos().items())
        return PdoListing(node.node_id, node.title, rows, show_all)
    row = _row(node, pdo.pdo, node.pdo(pdo.pdo))
    row = replace(row, last=_last_frame(session, node, row.config))
    period = read_optional(node.sdo, 0x1006, 0, 4)
    return PdoListing(node.node_id, node.title, (row,), detail=True, sync_period_us=period)


def _row(node: Node, pdo: Pdo, config: PdoConfig) -> PdoRow:
    from dvtcli.operations.results import PdoRow

    named = tuple(_name(node, entry.index, entry.sub_index) for entry in config.mapping)
    return PdoRow(pdo, config, named, pdo.default_can_id(node.node_id), pdo.label in node.unstored)


def _name(node: Node, index: int, sub_index: int) -> MappedName:
    from dvtcli.operations.results import MappedName

    entry = node.dictionary.entry(index, sub_index) if node.dictionary else None
    if entry is None or node.dictionary is None:
        return MappedName()
    kind = entry.data_type.short if entry.data_type else ""
    return MappedName(node.dictionary.display_name(index, sub_index), kind, entry.unit)


def _last_frame(session: Session, node: Node, config: PdoConfig) -> LastFrame | None:
    """The last frame with the PDO's COB-ID, where the session listens and heard one."""
    from time import monotonic

    from dvtcli.domain.frame import decode
    from dvtcli.operations.results import LastFrame

    cob_id = config.communication.cob_id
    if session.frames is None or not config.enabled or config.mpdo is not None:
        return None
    heard = session.frames.last(cob_id.can_id, extended=cob_id.extended)
    if heard is None:
        return None

    def type_of(mapped: PdoMappingEntry) -> DataType | None:
        entry = node.dictionary.entry(mapped.index, mapped.sub_index) if node.dictionary else None
        return None if entry is None else entry.data_type

    found = iter(decode(config.mapping, heard.data, type_of))
    values = tuple(None if entry.is_dummy else next(found).value for entry in config.mapping)
    return LastFrame(heard.data, monotonic() - heard.at_s, heard.period, values)
