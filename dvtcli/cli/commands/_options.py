"""Options that several commands share, and what they give."""

from __future__ import annotations

from collections.abc import Callable, Iterable
from functools import wraps
from typing import TYPE_CHECKING, Any, TypeVar

import click

from dvtcli.cli.object_params import COB_ID, TransmissionType
from dvtcli.cli.params import FILE, NODE_ID, TEXT, CanopenType, KindsType, MillisecondsType, NodesType, NumberType
from dvtcli.domain.request import PdoRequest
from dvtcli.errors import UsageError

if TYPE_CHECKING:
    from dvtcli.cli.object_params import NodePdo
    from dvtcli.cli.view.output import Output
    from dvtcli.domain.network.network_config import Endpoint
    from dvtcli.domain.network.network_plan import NetworkPlan
    from dvtcli.domain.pdo import Pdo
    from dvtcli.operations.session.session_nodes import SessionNodes


def dbc_options(command: Callable[..., Any]) -> Callable[..., Any]:
    """Add `--with`, `--split-bits` and `--all`, as one *options*. Raises UsageError for an unknown service."""

    @wraps(command)
    def with_options(*values: Any, services: str | None, split_bits: bool, everything: bool, **others: Any) -> Any:
        from dvtcli.operations.exchange.dbc_options import DbcOptions
        from dvtcli.operations.exchange.export_dbc import services_of

        return command(*values, options=DbcOptions(services_of(services), split_bits, everything), **others)

    for option in (
        click.option("--all", "everything", is_flag=True, help="DBC: also PDOs that are off."),
        click.option("--split-bits", is_flag=True, help="DBC: a signal for each bit that has a name."),
        click.option("--with", "services", type=TEXT, metavar="LIST", help="DBC: also nmt,sync,emcy,heartbeat,sdo."),
    ):
        with_options = option(with_options)
    return with_options


F = TypeVar("F", bound=Callable[..., object])


def decoding_options(command: F) -> F:
    """Add the options that select how a recording is decoded."""
    nodes = click.option(
        "--nodes", type=NodesType(), metavar="ID,…", help="Nodes whose mappings decode it [the selected node]."
    )
    return nodes(
        click.option("-d", "--dbc", type=FILE, metavar="FILE", help="Decode by a DBC or network file.")(command)
    )


def only_option(command: F) -> F:
    """Add the option that selects kinds of frames."""
    return click.option(
        "--only",
        type=KindsType(),
        metavar="KIND,…",
        help="Only these kinds of frames: pdo, emcy, nmt, sdo, sdo-abort, heartbeat, …",
    )(command)


def parquet_options(command: F) -> F:
    """Add the options of .parquet files."""
    layout = click.option(
        "--layout", type=click.Choice(["long", "wide"]), metavar="long|wide",
        help="For .parquet: a row for each value, or a column for each signal [long].",
    )  # fmt: skip
    return layout(
        click.option(
            "--source",
            type=TEXT,
            metavar="TEXT",
            help="For .parquet: name of the recorder [log: this computer; decode: FILE].",
        )(command)
    )


_OPTIONS = [
    click.option("--cob-id", type=COB_ID, metavar="ID", help="CAN-ID with 0x, `auto` or `keep`."),
    click.option("--type", "type_", type=TransmissionType(), metavar="N",
                 help="Transmission type 0…255."),
    click.option("--sync", type=NumberType(1, 240, "a number of SYNCs"), metavar="N", help="On every N-th SYNC."),
    click.option("--event", is_flag=True, help="Event-driven (type 255)."),
    click.option("--inhibit", type=MillisecondsType(100), metavar="MS", help="Inhibit time in ms (steps of 0.1)."),
    click.option("--timer", type=MillisecondsType(1000), metavar="MS", help="Event timer in ms; 0 is off."),
    click.option("--sync-start", type=NumberType(0, 240, "a SYNC start value"), metavar="N", help="SYNC start value."),
    click.option("--rtr/--no-rtr", "rtr", default=None, help="Bit 30 of the COB-ID: RTR allowed or not."),
    click.option("--extended", is_flag=True, help="A 29-bit CAN-ID."),
    click.option("--off", is_flag=True, help="Leave the PDO disabled."),
]  # fmt: skip


def pdo_options(function: F) -> F:
    """Add the options that describe a PDO."""
    for option in reversed(_OPTIONS):
        function = option(function)
    return function


def request(options: dict[str, Any], *, enabled: bool | None) -> PdoRequest:
    """Return the request in *options*; *enabled* is the PDO's new state unless --off is given."""
    kinds = [name for name in ("type_", "sync") if options[name] is not None] + (["event"] if options["event"] else [])
    if len(kinds) > 1:
        raise click.UsageError("--type, --sync and --event exclude each other: give only one of them")
    kind = 255 if options["event"] else options["sync"] if options["type_"] is None else options["type_"]
    return PdoRequest(
        cob_id=options["cob_id"],
        transmission_type=kind,
        inhibit_time=options["inhibit"],
        event_timer=options["timer"],
        sync_start_value=options["sync_start"],
        rtr_allowed=options["rtr"],
        extended=options["extended"],
        enabled=False if options["off"] else enabled,
    )


def one_node(pdos: Iterable[NodePdo]) -> tuple[int | None, list[Pdo]]:
    """Return the common node-ID of *pdos* (None if unnamed), and the PDOs.

    Raises UsageError if they name several nodes.
    """
    chosen = list(pdos)
    node_ids = {pdo.node_id for pdo in chosen}
    if len(node_ids) > 1:
        raise click.UsageError("PDOs of several nodes: use one line for each node")
    return node_ids.pop(), [pdo.pdo for pdo in chosen]


def endpoints(session: SessionNodes, words: Iterable[NodePdo]) -> list[Endpoint]:
    """Return the PDOs of *words*, each with its node."""
    from dvtcli.domain.network.network_config import Endpoint

    return [Endpoint(session.node_id() if word.node_id is None else word.node_id, word.pdo) for word in words]


_GROUPS = {"all": 1, "communication": 2, "application": 3}


class StoreGroup(CanopenType):
    """`all`, `communication`, `application`, or a sub-index 1…127."""

    name = "group"

    def parse(self, text: str, ctx: click.Context | None) -> int:
        """Return the sub-index of 0x1010 or 0x1011."""
        if text.lower() in _GROUPS:
            return _GROUPS[text.lower()]
        return int(NumberType(1, 127, "all, communication, application, or a sub-index").parse(text, ctx))


class ProofWay(CanopenType):
    """`reset` or `power`; a group's word after a bare `--prove` belongs to the command."""

    name = "way"

    def parse(self, text: str, ctx: click.Context | None) -> str | int:
        """Return the word, or the sub-index of a group."""
        if text.lower() in ("reset", "power"):
            return text.lower()
        try:
            return StoreGroup().parse(text, ctx)
        except ValueError as wrong:
            raise ValueError(f"write power, or no value for a reset; {wrong}") from wrong


def way_and_group(prove: str | int | None, group: int | None) -> tuple[str | None, int | None]:
    """Return the way of proof, None for none, and the group. Raises UsageError for two groups."""
    if not isinstance(prove, int):
        return prove, group
    if group is not None:
        raise UsageError("two groups are given; store one group at a time")
    return "reset", prove


def show_plan(output: Output, plan: NetworkPlan) -> None:
    """Show the planned writes and the findings as a part of the answer; not with JSON, which has them anyway."""
    if output.json:
        return
    from dvtcli.cli.view.answers.network_lines import plan_lines
    from dvtcli.cli.view.error_lines import finding_line
    from dvtcli.domain.profile import Severity
    from dvtcli.operations.results.networks import network_findings

    findings = network_findings(plan)
    shown = (finding for finding in findings if not output.quiet or finding.severity is not Severity.NOTE)
    output.lines(map(finding_line, shown))
    if plan.to_do:
        output.said(plan_lines(plan, output.width), error=False)


trust_stamp = click.option(
    "--trust-stamp",
    is_flag=True,
    help="Skip nodes whose 0x1020 has the stamp of this file (stamp: true), and name them.",
)
to_manager = click.option(
    "--to-manager",
    "manager",
    type=NODE_ID,
    metavar="NODE",
    help="Write NODE, a CANopen manager, which downloads it to each node that boots (0x1F22).",
)
include = click.option(
    "--include",
    type=TEXT,
    multiple=True,
    metavar="OBJECT",
    help="With a DCF, an XDC or a backup: treat the manufacturer-specific OBJECT (3001, or 3001:1 alone) as "
    "configuration, too; 2000-2FFF for a range, in which objects that an RPDO can map count only if their names show "
    "that they are settings.",
)
