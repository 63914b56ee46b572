"""Bring a network to the state in a file: all nodes, or none."""

from __future__ import annotations

from functools import partial
from typing import TYPE_CHECKING, Any

import click

from dvtcli.cli.command import DvtCommand, Effect, Final
from dvtcli.cli.commands._file_plans import include as include_option
from dvtcli.cli.commands._file_plans import show_plan, to_manager
from dvtcli.cli.commands._file_plans import trust_stamp as trust_stamp_option
from dvtcli.cli.params import FILE

if TYPE_CHECKING:
    from collections.abc import Mapping

    from dvtcli.domain.store import ProveBy
    from dvtcli.operations.results import NetworkApplied


def _stores(params: Mapping[str, Any]) -> Final | None:
    from dvtcli.operations.network.network_files import may_store

    return Final(f"store of apply {params['file']}") if may_store(params["file"]) else None


@click.command("apply", cls=DvtCommand, short_help=__doc__, effect=Effect.CHANGES, stores=_stores)
@click.argument("file", type=FILE)
@click.option("--prove", is_flag=True, help="Reset each node that stored, and compare its values.")
@trust_stamp_option
@include_option
@to_manager
@click.pass_context
def command(
    ctx: click.Context,
    /,
    file: str,
    prove: bool,
    trust_stamp: bool,
    include: tuple[str, ...],
    manager: int | None,
) -> NetworkApplied:
    """Carry out the plan of the network FILE, or a saved plan, on all nodes; if one node fails, on none.

    Asks first. PDOs are disabled, everything is written and read back, then consumers are enabled, then producers.
    Nodes store last, if the file says so. A saved plan is refused (6) if a node has changed since.

    FILE may also be a DCF, an XDC or a backup (.jsonl) of the selected node; if no node is selected, of the node whose
    node-ID it has. Only configuration that differs is written: no commands, no outputs, and of manufacturer-specific
    objects only those of --include. A range includes no command, and an RPDO-mappable object only if its name says a
    setting. The last line names settings that differ and are not written. Another product is refused (6),
    another revision asked about; a power stage (0x6041) must be off.

    With --to-manager one node is written instead: the manager that downloads to the others (0x1F22, 0x1F26, 0x1F27).

    \b
    apply press.yaml --yes
    apply plan.json --yes
    apply press.yaml --dry-run
    apply press.dcf --yes
    apply press.yaml --trust-stamp   read only nodes whose 0x1020 is not that of this file
    apply press.yaml --to-manager 3 --yes   node 3 downloads it to each node that boots
    """
    from dvtcli.operations.network.network_files import apply_file

    show = partial(show_plan, ctx.obj.output)
    prove_by: ProveBy | None = "reset" if prove else None
    return apply_file(
        ctx.obj, file, prove=prove_by, trust_stamp=trust_stamp, include=include, manager=manager, on_plan=show
    )
