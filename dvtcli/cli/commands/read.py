"""Read objects by SDO upload and decode them: one, several, or repeatedly."""

from __future__ import annotations

from typing import TYPE_CHECKING

import click

from dvtcli.cli.command import DvtCommand, Effect
from dvtcli.cli.object_params import OBJECT, DataTypeParam, Objects, ObjectWord
from dvtcli.cli.params import FILE, DurationType

if TYPE_CHECKING:
    from dvtcli.cli.conversation import Conversation
    from dvtcli.domain.datatypes import DataType
    from dvtcli.operations.results import Facts, RecordRead, ValueRead, ValuesRead, ValuesWatched
    from dvtcli.operations.session.session import SessionNodes


@click.command(
    "read",
    cls=DvtCommand,
    short_help=__doc__,
    effect=Effect.NONE,
    each=lambda params: params["output"] is None and params["every_s"] is None,
)
@click.argument("objects", cls=Objects, type=OBJECT, metavar="OBJECT…", nargs=-1, required=True)
@click.option("--as", "data_type", type=DataTypeParam(), metavar="TYPE", help="Decode as u8…u64, i8…i64, r32, vs, …")
@click.option("--every", "every_s", type=DurationType(), metavar="TIME", help="Repeat, at this interval (100ms, 5s).")
@click.option("--for", "for_s", type=DurationType(), metavar="TIME", help="End --every after TIME [until Ctrl-C].")
@click.option(
    "-o", "--output", type=FILE, metavar="FILE", help="Write one object's bytes to FILE; with --every a .csv."
)
@click.pass_obj
def command(
    session: Conversation,
    /,
    objects: tuple[ObjectWord, ...],
    data_type: DataType | None,
    every_s: float | None,
    for_s: float | None,
    output: str | None,
) -> ValueRead | RecordRead | ValuesRead | ValuesWatched | Facts:
    """Read each OBJECT; a record or an array without sub-index (`1018`) is read whole.

    With --every: a line each time, and at the end minimum, maximum and trend of each; with --json a document each
    time. An object that cannot be read ends it; of a record, sub-index 0 is read.

    \b
    read 6041
    read 6C01:1
    read statusword
    read 1018                the whole record; 1018:0 is its highest sub-index
    read 1018:1 --as u32
    read 3:6041              of node 3
    read 1008 -o name.txt    its bytes, as they are
    read 6041 606C
    read 6041 606C --every 100ms --for 300ms
    read 606C --every 50ms --for 200ms -o speed.csv
    """
    if every_s is not None:
        from dvtcli.cli.each_node import selected_objects
        from dvtcli.operations.objects.watch_objects import watch_objects

        selected, show = selected_objects(session, objects), session.output.stream
        return watch_objects(session, selected, every_s, for_s, show, data_type=data_type, file=output)
    if for_s is not None:
        raise click.UsageError("--for belongs to --every")
    if output is not None:
        return _to_file(session, objects, data_type, output)
    if len(objects) > 1:
        from dvtcli.cli.each_node import selected_objects
        from dvtcli.operations.objects.watch_objects import read_objects

        return read_objects(session, selected_objects(session, objects), data_type)
    from dvtcli.operations.objects.read_record import read_object

    return read_object(session, objects[0].text, data_type, objects[0].node_id)


def _to_file(session: SessionNodes, objects: tuple[ObjectWord, ...], data_type: DataType | None, output: str) -> Facts:
    """Write the bytes of the object into the file *output*; it holds those of a single node."""
    from dvtcli.cli.each_node import selected_nodes
    from dvtcli.operations.objects.write_object import read_to_file

    if len(objects) > 1:
        raise click.UsageError("-o takes the bytes of one object; with --every the values of several as .csv")
    (only,) = objects
    if only.node_id is None and len(selected_nodes(session)) > 1:
        raise click.UsageError("-o takes the bytes of one node's object: name it, as in read 1:1008 -o name.txt")
    if data_type is not None:
        raise click.UsageError("--as has no effect with -o: the bytes are written as they are")
    return read_to_file(session, only.text, output, only.node_id)
