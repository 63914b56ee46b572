"""Edit the PDOs of a node or a file on the full screen, see the rules, then write like `map`."""

from __future__ import annotations

from typing import TYPE_CHECKING

import click

from dvtcli.cli.command import DvtCommand, Effect
from dvtcli.cli.pdo_params import NodePdo, PdoOrFile

if TYPE_CHECKING:
    from dvtcli.cli.conversation import Conversation


@click.command("edit", cls=DvtCommand, short_help=__doc__, effect=Effect.CHANGES)
@click.argument("what", type=PdoOrFile(), required=False, metavar="[PDO|FILE]")
@click.pass_obj
def command(session: Conversation, /, what: NodePdo | str | None) -> None:
    """Edit the PDOs of the node, beginning with PDO, or those of a network file, a DCF or an XDC, without a bus.

    PDOs, the frame of one, and the objects that it may map; Tab continues to the next. Nothing is written before F10
    (or Ctrl-S), which writes like map; F5 shows the plan, F2 saves a script, a network file or a DCF, F1 lists the
    keys, Esc leaves.

    \b
    edit
    edit tpdo1
    edit 5:rpdo2
    edit net.yaml       its nodes by their EDS or family; F10 writes the file
    edit node5.dcf      or an XDC
    """
    if isinstance(what, str):
        from dvtcli.cli.editor.edit_loop import edit_file

        edit_file(session, what)
        return
    from dvtcli.cli.editor.edit_loop import edit

    edit(session, what)
