"""Read an object by SDO upload and decode it."""

from __future__ import annotations

from typing import TYPE_CHECKING

import click

from dvtcli.cli.command import DvtCommand
from dvtcli.cli.effect import Effect
from dvtcli.cli.object_params import OBJECT, DataTypeParam, ObjectWord
from dvtcli.cli.params import FILE

if TYPE_CHECKING:
    from dvtcli.domain.datatypes import DataType
    from dvtcli.operations.results import Facts, ValueRead
    from dvtcli.operations.session import Session

TASK = ("See", 30)


@click.command(
    "read",
    cls=DvtCommand,
    short_help=__doc__,
    effect=Effect.READS,
    each=lambda params: params["output"] is None,
)
@click.argument("object_", type=OBJECT, metavar="OBJECT")
@click.option("--as", "data_type", type=DataTypeParam(), metavar="TYPE", help="Decode as u8…u64, i8…i64, r32, vs, …")
@click.option("-o", "--output", type=FILE, metavar="FILE", help="Its bytes into FILE, for what is long.")
@click.pass_obj
def command(
    session: Session, /, object_: ObjectWord, data_type: DataType | None, output: str | None
) -> ValueRead | Facts:
    """Read OBJECT.

    \b
    read 6041
    read 6C01:1
    read statusword
    read 1018:1 --as u32
    read 3:6041              of node 3
    read 1008 -o name.txt    its bytes, as they are
    """
    if output is not None:
        from dvtcli.operations.object_files import read_to_file

        if data_type is not None:
            raise click.UsageError("--as is of no use with -o: the bytes are written as they are")
        return read_to_file(session, object_.text, output, object_.node_id)
    from dvtcli.operations.read_object import read_object

    return read_object(session, object_.text, data_type, object_.node_id)
