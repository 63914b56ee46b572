"""Restore the node's defaults (0x1011 "load")."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import click

from dvtcli.cli.command import DvtCommand, Effect
from dvtcli.cli.commands._store_group import StoreGroup
from dvtcli.operations.changes.store_restore import look_before_restores, restore_defaults

if TYPE_CHECKING:
    from collections.abc import Mapping, Sequence

    from dvtcli.errors import LeftChanged
    from dvtcli.operations.results import Stored
    from dvtcli.operations.session.session import Session, SessionNodes


def _look_ahead(session: SessionNodes, node_ids: Sequence[int], params: Mapping[str, Any]) -> None:
    """Check all of *node_ids* before the first restore."""
    look_before_restores(session, node_ids, params["group"], prove=params["prove"])


def _who_restored(node_ids: Sequence[int], outcomes: Mapping[int, Any]) -> LeftChanged | None:
    from dvtcli.operations.changes.store_network import only_some_restored

    return only_some_restored(node_ids, outcomes)


@click.command(
    "restore",
    cls=DvtCommand,
    short_help=__doc__,
    effect=Effect.BRINGS_BACK,
    each=lambda _params: True,
    ahead=_look_ahead,
    ending=_who_restored,
)
@click.argument("group", type=StoreGroup(), required=False, metavar="[all|communication|application|N]")
@click.option("--prove", is_flag=True, help="Reset the node at once, and check that it has its defaults.")
@click.pass_obj
def command(session: Session, /, group: int | None, prove: bool) -> Stored:
    """Restore the node's defaults (0x1011 "load"); they take effect with the next reset.

    \b
    restore
    restore communication
    restore --prove
    """
    return restore_defaults(session, session.node(), group, prove=prove)
