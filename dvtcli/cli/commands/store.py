"""Store the node's values, so that they survive a power cycle (0x1010 "save")."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import click

from dvtcli.cli.command import DvtCommand, Effect
from dvtcli.cli.commands._store_group import ProofWay, StoreGroup, way_and_group
from dvtcli.cli.params import NumberType
from dvtcli.errors import UsageError
from dvtcli.operations.changes.store_restore import POWER_CYCLE_S, look_before_stores, store_settings

if TYPE_CHECKING:
    from collections.abc import Mapping, Sequence

    from dvtcli.domain.store import ProveBy
    from dvtcli.errors import LeftChanged
    from dvtcli.operations.results import Stored
    from dvtcli.operations.session.session import Session, SessionNodes


def _look_ahead(session: SessionNodes, node_ids: Sequence[int], params: Mapping[str, Any]) -> None:
    """Check all of *node_ids* before the first store."""
    way, group = way_and_group(params["prove"], params["group"])
    look_before_stores(session, node_ids, group, prove=way)


def _who_stored(node_ids: Sequence[int], outcomes: Mapping[int, Any]) -> LeftChanged | None:
    from dvtcli.operations.changes.store_network import only_some_stored

    return only_some_stored(node_ids, outcomes)


@click.command(
    "store",
    cls=DvtCommand,
    short_help=__doc__,
    effect=Effect.KEEPS,
    each=lambda params: params["prove"] != "power",
    ahead=_look_ahead,
    ending=_who_stored,
)
@click.argument("group", type=StoreGroup(), required=False, metavar="[all|communication|application|N]")
@click.option(
    "--prove",
    type=ProofWay(),
    is_flag=False,
    flag_value="reset",
    metavar="[power]",
    help="Reset the node and compare its values; `power`: wait for a power cycle.",
)
@click.option(
    "--within",
    "limit_s",
    type=NumberType(1, 3600, "a time in s"),
    metavar="S",
    help="How long `--prove power` waits for the power cycle [60].",
)
@click.option("--if-changed", is_flag=True, help="Store only if something was written since the node booted.")
@click.pass_obj
def command(
    session: Session, /, group: int | None, prove: ProveBy | int | None, limit_s: int | None, if_changed: bool
) -> Stored:
    """Store the node's parameters (0x1010 "save").

    \b
    store
    store communication
    store --prove            reset the node, and compare its values
    store --prove power      the same with a power cycle that you make
    store --if-changed       in scripts: spares the EEPROM
    """
    way, group = way_and_group(prove, group)
    if limit_s is not None and way != "power":
        raise UsageError("--within belongs to --prove power")
    if if_changed and way is not None:
        raise UsageError(
            "with --if-changed nothing may be stored, and --prove would then prove nothing: give only one of them"
        )
    return store_settings(
        session, session.node(), group, prove=way, if_changed=if_changed, wait_s=limit_s or POWER_CYCLE_S
    )
