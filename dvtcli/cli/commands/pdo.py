"""List a node's PDOs, or show a PDO with its frame picture."""

from __future__ import annotations

from typing import TYPE_CHECKING

import click

from dvtcli.cli.command import DvtCommand, Effect
from dvtcli.cli.pdo_params import EDIT, EditOrPdo, NodePdo
from dvtcli.operations.user.refused_options import refuse_options

if TYPE_CHECKING:
    from dvtcli.cli.conversation import Conversation
    from dvtcli.operations.results import Changed, Facts, PdoListing


@click.command(
    "pdo",
    cls=DvtCommand,
    short_help=__doc__,
    effect=Effect.NONE,
    each=lambda params: not any(word == EDIT for word in params["words"]),
)
@click.argument("words", type=EditOrPdo(), nargs=-1, metavar="[edit] [PDO]")
@click.option("--all", "show_all", is_flag=True, help="Also PDOs that are off and empty.")
@click.pass_obj
def command(session: Conversation, /, words: tuple[NodePdo | str, ...], show_all: bool) -> PdoListing | Changed | Facts:
    """Show the PDOs as the node holds them now, or edit one as text.

    \b
    pdo                 the list
    pdo tpdo1           one, with the picture of its frame
    pdo edit tpdo1      in $EDITOR as YAML; saved changes are checked, shown and written
    """
    pdos = [word for word in words if isinstance(word, NodePdo)]
    editing = words[:1] == (EDIT,)
    if len(pdos) > 1 or len(words) - len(pdos) != editing or (editing and not pdos):
        raise click.UsageError("give one PDO: pdo tpdo1, or pdo edit tpdo1")
    pdo = pdos[0] if pdos else None
    if pdo is not None:
        refuse_options({"all": show_all}, "for the list of all PDOs only", "leave it out for one PDO")
    if editing and pdo is not None:
        from dvtcli.cli.commands._pdo_edit import edit

        return edit(session, pdo.pdo, pdo.node_id)
    from dvtcli.operations.pdos.list_pdos import list_pdos, show_pdo

    return list_pdos(session, show_all=show_all) if pdo is None else show_pdo(session, pdo.pdo, pdo.node_id)
