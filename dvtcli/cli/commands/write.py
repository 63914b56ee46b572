"""Write an object by SDO download, under the rules of the command for it."""

from __future__ import annotations

from collections.abc import Mapping
from typing import TYPE_CHECKING, Any

import click

from dvtcli.cli.command import DvtCommand, Effect, Final, final_write
from dvtcli.cli.object_params import OBJECT, DataTypeParam, ObjectWord
from dvtcli.cli.params import TEXT
from dvtcli.domain.object_syntax import parse_object
from dvtcli.operations.objects.write_object import refuse_unfit, write_text

if TYPE_CHECKING:
    from dvtcli.cli.conversation import Conversation
    from dvtcli.domain.datatypes import DataType
    from dvtcli.operations.results import Changed, Stored
    from dvtcli.operations.session.session import Session


def _final(params: Mapping[str, Any]) -> Final | None:
    """Detect 0x1010 and 0x1011 by number; names need a node."""
    place = parse_object(params["object_"].text)
    return final_write("write", None if place is None else place[0])


class _WriteCommand(DvtCommand):
    """`write`, whose number is checked while the line is parsed, if a file that is known without a bus has its type."""

    def parse_args(self, ctx: click.Context, args: list[str]) -> list[str]:
        """Parse *args*. Raises UsageError for a number that the object cannot hold."""
        rest = super().parse_args(ctx, args)
        session: Conversation | None = ctx.find_root().obj
        if session is not None and not ctx.resilient_parsing:
            params = ctx.params
            refuse_unfit(session.offline_dictionaries, params["object_"].text, params["value"], params["data_type"])
        return rest


@click.command("write", cls=_WriteCommand, short_help=__doc__, effect=Effect.CHANGES, final=_final)
@click.argument("object_", type=OBJECT, metavar="OBJECT")
@click.argument("value", type=TEXT)
@click.option("--as", "data_type", type=DataTypeParam(), metavar="TYPE", help="Encode as u8…u64, i8…i64, r32, vs, …")
@click.pass_obj
def command(session: Session, /, object_: ObjectWord, value: str, data_type: DataType | None) -> Changed | Stored:
    """Write VALUE to OBJECT and read it back; if it differs, the old value is restored.

    @FILE writes the bytes of a file; @@ is a text that begins with @.

    \b
    write 1017 1000
    write 60FF -1500
    write 1017 0x3E8 --as u16
    write 1010:1 save          the same as store
    write 3:1017 1000          of node 3
    write 2002 @curve.bin      the bytes of a file
    """
    node = session.node(object_.node_id)
    index, sub_index = object_.resolve(node)
    if value.startswith("@") and not value.startswith("@@"):
        from dvtcli.operations.objects.write_object import write_from_file

        if data_type is not None:
            raise click.UsageError("--as has no effect with @FILE: its bytes are written as they are")
        return write_from_file(session, node, index, sub_index, value[1:])
    value = value.removeprefix("@") if value.startswith("@@") else value
    return write_text(session, node, index, sub_index, value, data_type)
