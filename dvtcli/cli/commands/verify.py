"""Read PDOs back and compare with this session's values, or with a FILE; --frame checks a real frame."""

from __future__ import annotations

from functools import partial
from typing import TYPE_CHECKING

import click

from dvtcli.cli.command import DvtCommand, Effect
from dvtcli.cli.params import TEXT
from dvtcli.cli.pdo_params import PDO, NodePdo
from dvtcli.cli.runner_interface import runners
from dvtcli.errors import UsageError
from dvtcli.operations.user.options import CASE_FORMATS, is_file

if TYPE_CHECKING:
    from dvtcli.operations.results import Compared, ComparedNodes


@click.command("verify", cls=DvtCommand, short_help=__doc__, effect=Effect.NONE, formats=CASE_FORMATS)
@click.argument("words", type=TEXT, nargs=-1, metavar="[PDO...] [FILE]")
@click.option("--frame", is_flag=True, help="Start the node and check a frame of each enabled TPDO.")
@click.pass_context
def command(ctx: click.Context, /, words: tuple[str, ...], frame: bool) -> Compared | ComparedNodes:
    """Compare the present values of the nodes; exit code 3 if they differ, 1 if no frame came.

    FILE is a script (the result of its lines), a network file (YAML), a DCF, XDC or backup (its settings, also settings
    that apply does not write), or an EDS (its PDOs). Without FILE the lines before are compared. If no node is
    selected, a DCF, XDC or backup is compared with the node whose node-ID it has.

    \b
    verify                   everything this session changed, on every node
    verify tpdo1 --frame
    verify tpdo1 press.dcf
    verify press.dvt         the values that a script would set
    verify press.yaml        a network file, on each of its nodes
    verify tpdo1 press.dcf --frame
    """
    from dvtcli.operations.devices.verify_nodes import verify

    pdos, file = _sorted_words(words)
    rehearse = partial(runners(ctx).rehearsed, ctx.obj)
    return verify(ctx.obj, rehearse, [(word.node_id, word.pdo) for word in pdos], file, frame=frame)


def _sorted_words(words: tuple[str, ...]) -> tuple[list[NodePdo], str | None]:
    """Split *words* into PDOs and the file. Raises UsageError for a second file or an unknown word."""
    pdos: list[NodePdo] = []
    files: list[str] = []
    for word in words:
        if is_file(word):
            files.append(word)
            continue
        try:
            pdos.append(PDO.parse(word, None))
        except ValueError as wrong:
            raise UsageError(f"{word!r} is neither a PDO nor a file") from wrong
    if len(files) > 1:
        raise UsageError("verify compares with one file at a time")
    return pdos, files[0] if files else None
