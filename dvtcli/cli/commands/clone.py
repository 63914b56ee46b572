"""Copy a device's configuration from a file of another device of the same product."""

from __future__ import annotations

from functools import partial
from typing import TYPE_CHECKING

import click

from dvtcli.cli.command import DvtCommand, Effect
from dvtcli.cli.commands._file_plans import include as include_option
from dvtcli.cli.commands._file_plans import show_plan
from dvtcli.cli.params import FILE

if TYPE_CHECKING:
    from dvtcli.operations.results import NetworkApplied


@click.command("clone", cls=DvtCommand, short_help=__doc__, effect=Effect.CHANGES)
@click.argument("file", type=FILE)
@include_option
@click.pass_context
def command(ctx: click.Context, /, file: str, include: tuple[str, ...]) -> NetworkApplied:
    """Write the configuration of another device in FILE (a DCF, an XDC or a backup's .jsonl) to the selected node.

    Shows the plan and asks. The node must be named: -n, or `node ID` before it. Another product is refused (6),
    another revision asked about. As apply, and also writes manufacturer-specific objects that no PDO can map; --include
    adds mappable objects. Never written: a node-ID, passcodes, commands and outputs of the standards. A manufacturer's
    command, by its name, and an RPDO's object without a name of a setting need --include of that very object. Objects
    that are left out are listed with the reason. The exit code is 3 if a setting differs and is not written: the node
    is no clone then. If it fails, the node is as before.

    \b
    clone press.dcf --yes
    clone press.jsonl --yes
    clone press.dcf --dry-run
    """
    from dvtcli.operations.devices.plan_device import DeviceOptions, apply_device

    show = partial(show_plan, ctx.obj.output)
    return apply_device(ctx.obj, file, DeviceOptions(include, is_clone=True), on_plan=show)
