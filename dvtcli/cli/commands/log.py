"""Record the bus as .asc .blf .log .trc .mf4 .pcapng, or decoded as .csv .parquet .jsonl."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Any

import click

from dvtcli.cli.command import DvtCommand, Effect
from dvtcli.cli.commands._frame_options import only_option, parquet_options
from dvtcli.cli.params import FILE, DurationType, LogFilterType, NodesType, NumberType, RotationType
from dvtcli.errors import UsageError
from dvtcli.operations.user.refused_options import refuse_options

if TYPE_CHECKING:
    from dvtcli.operations.results import Facts
    from dvtcli.operations.session.session import Session


@click.command("log", cls=DvtCommand, short_help=__doc__, effect=Effect.NONE)
@click.argument("file", type=FILE)
@click.option("-a", "--append", is_flag=True, help="Append to FILE (.blf .log); with --decode, start a new file.")
@click.option(
    "-s", "--file_size", "--file-size", "size", type=NumberType(1000, 1 << 40, "a size in bytes"), metavar="BYTES",
    help="Start a new file after this many bytes (.asc .blf .log).",
)  # fmt: skip
@click.option(
    "--filter", "filters", type=LogFilterType(), multiple=True, metavar="ID:MASK",
    help="CAN-ID:MASK in hex, repeatable; with --decode also TEXT: signals with TEXT in their names.",
)  # fmt: skip
@only_option
@click.option("--duration", "--for", "duration", type=DurationType(), metavar="TIME",
              help="End after TIME (300ms, 5s, 2min).")  # fmt: skip
@click.option("--decode", is_flag=True, help="Record values: .csv, .jsonl, or .parquet for many machines.")
@parquet_options
@click.option(
    "--rotate", type=RotationType(), metavar="10min|100MB",
    help="For --decode: start a new file after this time or size.",
)  # fmt: skip
@click.option("--nodes", type=NodesType(), metavar="ID,…", help="For --decode: nodes whose mapping is read.")
@click.option("-d", "--dbc", type=FILE, metavar="FILE", help="For --decode: a DBC or network file.")
@click.pass_obj
def command(
    session: Session,
    /,
    file: str,
    append: bool,
    size: int | None,
    filters: tuple[tuple[int, int] | str, ...],
    duration: float | None,
    decode: bool,
    **values: Any,
) -> Facts:
    """Record every frame into FILE until Ctrl-C; its suffix chooses the format: .asc .blf .log .trc .mf4 .pcapng.

    Sends nothing; with --decode it reads the mappings once, by SDO upload, at the start. A .parquet file has a row for
    each value, in the same columns for all devices: recordings of a fleet are one table. If log was killed, the next
    log into the same file completes the file that was left, all but the last second.

    \b
    log run.asc
    log run.log --duration 10 --filter 180:780
    log run.blf --file_size 5000000
    log speed.csv --decode --nodes 5
    log speed.csv --decode --filter velocity
    log run.parquet --decode -a --rotate 10min
    """
    rotate, layout, source, only = (values.pop(name) for name in ("rotate", "layout", "source", "only"))
    if decode:
        refuse_options({"file_size": size}, "for recorded frames only", "with --decode: --rotate 100MB")
    else:
        of_values = {"layout": layout, "source": source, "rotate": rotate, "only": only}
        of_values |= {"node_ids": values["nodes"], "dbc": values["dbc"]}
        refuse_options(of_values, "only with --decode", "frames: -s BYTES, --filter ID:MASK")
    path, (masks, text) = Path(file), _masks_and_text(filters, decode=decode)
    if decode:
        from dvtcli.operations.frames.decode_recording import ValuesOptions
        from dvtcli.operations.frames.record_values import record_values

        options = ValuesOptions(layout, source, rotate or (0.0, 0), append, only or frozenset())
        return record_values(session, path, masks, duration, **values, text=text, options=options)
    from dvtcli.operations.frames.record_values import record_frames

    return record_frames(session, path, masks, duration, append=append, most_bytes=size or 0)


def _masks_and_text(
    filters: tuple[tuple[int, int] | str, ...], *, decode: bool
) -> tuple[tuple[tuple[int, int], ...], str]:
    """Return CAN-IDs with masks, and the text to search in names of signals. Raises UsageError if unusable."""
    words = [word for word in filters if isinstance(word, str)]
    if len(words) > 1 or (words and not decode):
        raise UsageError(
            f"--filter {words[-1]}: not ID:MASK in hexadecimal, such as 180:780",
            hint="with --decode, give one --filter: a text that the signal names contain",
        )
    return tuple(mask for mask in filters if not isinstance(mask, str)), "".join(words).lower()
