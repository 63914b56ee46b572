"""Decode a recording: as lines, as JSON, or as a table with one column a signal."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING

import click

from dvtcli.cli.command import DvtCommand, Effect
from dvtcli.cli.commands._frame_options import decoding_options, only_option, parquet_options
from dvtcli.cli.params import FILE, TEXT
from dvtcli.operations.user.refused_options import refuse_options

if TYPE_CHECKING:
    from collections.abc import Iterable

    from dvtcli.cli.conversation import Conversation
    from dvtcli.operations.results import Facts, FrameSeen


@click.command("decode", cls=DvtCommand, short_help=__doc__, effect=Effect.NONE)
@click.argument("file", type=FILE)
@decoding_options
@click.option("--filter", "wanted", type=TEXT, metavar="TEXT", help="Only frames and signals with TEXT in their names.")
@only_option
@click.option(
    "--csv", "as_csv", is_flag=True, help="Print CSV: a row for each decoded frame, a column for each signal."
)
@click.option("-o", "--output", type=FILE, metavar="FILE", help="Write values to FILE: .csv .parquet .jsonl.")
@parquet_options
@click.pass_obj
def command(
    session: Conversation,
    /,
    file: str,
    dbc: str | None,
    nodes: tuple[int, ...] | None,
    wanted: str | None,
    only: frozenset[str] | None,
    as_csv: bool,
    output: str | None,
    **parquet: str | None,
) -> Facts | None:
    """Decode FILE (.asc .blf .log .trc .mf4 .pcapng .pcap, or a pasted log; - is standard input).

    PDOs are decoded by --dbc, by the mapping in --eds, else by the present mappings of the nodes, else by FILE's own
    SDO transfers; other PDOs are named by the pre-defined connection set (`TPDO1?`) and stay bytes. NMT, SDO, EMCY and
    other services are explained. --json prints a dvtcli.frame/1 document per frame.

    \b
    decode run.log
    decode run.asc --dbc drive.dbc --csv
    decode run.blf --nodes 1,5 --filter velocity
    decode run.log --filter velocity -o speed.csv
    decode run.log --only emcy,sdo-abort,nmt
    """
    from dvtcli.operations.frames.decode_recording import (
        ValuesOptions,
        decode_recording,
        values_into_file,
        write_values,
    )
    from dvtcli.operations.frames.recorded import standard_input

    if output is None:
        refuse_options(parquet, "only for a .parquet file", "give the file with -o")
    if as_csv:
        others = {"json": session.output.json, "output": output}
        refuse_options(others, "not with --csv, which prints a table", "-o writes a table: .csv .parquet .jsonl")
    text = (wanted or "").lower()
    options = ValuesOptions(parquet["layout"], parquet["source"], only=only or frozenset())
    with standard_input(file) as path:
        if output is not None:
            return values_into_file(session, path, Path(output), nodes, dbc, text, options)
        if as_csv:
            write_values(session, path, session.output.stdout, nodes, dbc, text, options)
        else:
            _show(session, decode_recording(session, path, nodes, dbc, text, options.only))
    return None


def _show(session: Conversation, frames: Iterable[FrameSeen]) -> None:
    if not session.output.json:
        session.output.stream(frames)
        return
    from dvtcli.cli.view.answers.frame_lines import FrameJson

    session.output.json_lines(map(FrameJson(session.output.encoder()).text, frames))
