"""Make a device what a file says of another one of the same product."""

from __future__ import annotations

from functools import partial
from typing import TYPE_CHECKING

import click

from dvtcli.cli.command import DvtCommand
from dvtcli.cli.commands._include import include as include_option
from dvtcli.cli.commands._shown_plan import show_plan
from dvtcli.cli.effect import Effect
from dvtcli.cli.params import FILE

if TYPE_CHECKING:
    from dvtcli.operations.results import NetworkApplied


@click.command("clone", cls=DvtCommand, short_help=__doc__, effect=Effect.CHANGES)
@click.argument("file", type=FILE)
@include_option
@click.pass_context
def command(ctx: click.Context, /, file: str, include: tuple[str, ...]) -> NetworkApplied:
    """Write to the selected node what FILE (a DCF, an XDC or a backup's .jsonl) says that another one held.

    Shows what is to be written and asks. The node is never the file's own: -n names it, or `node ID` before it.
    Another product is refused (6), another revision asked about. As apply, and with the maker's own objects that the
    file has a value for and that no PDO can map; --include names those that one could. A node-ID, passcodes, and
    commands and outputs of the standards are never written; a command of the maker by its name, and what an RPDO
    could take and no word calls a setting, only where --include names that very object, not by a range. What is left
    out is listed with why. A setting that differs and is not written ends it with 3: the node is no clone then. With
    a fault the node is as it was.

    \b
    clone press.dcf --yes
    clone press.jsonl --yes
    clone press.dcf --dry-run
    """
    from dvtcli.operations.whole_device.plan_device import DeviceOptions, apply_device

    show = partial(show_plan, ctx.obj.output)
    return apply_device(ctx.obj, file, DeviceOptions(include, is_clone=True), on_plan=show)
