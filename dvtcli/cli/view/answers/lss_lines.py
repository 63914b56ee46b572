"""The text of `lss`."""

from __future__ import annotations

from collections.abc import Iterator
from typing import TYPE_CHECKING

from dvtcli.cli.view.lines import Cell, Line, Table
from dvtcli.domain.nmt import UNCONFIGURED
from dvtcli.domain.text import plural

if TYPE_CHECKING:
    from dvtcli.operations.results.lss_nodes import BitRateFound, LssBitRate, LssChanged, LssFound, LssGiven

_DRY_RUN = Cell("dry run: ", "cyan")
_WOULD = {
    "node-id": "give node-ID {}", "store": "store node-ID {}",
        "assign": "search for the nodes of the file and give node-IDs",
}  # fmt: skip


def found_lines(result: LssFound, width: int) -> Iterator[Line]:
    """Show the nodes found, with LSS addresses."""
    if result.dry_run:
        yield [_DRY_RUN, Cell(f"lss {result.action} would send LSS requests. Nothing was sent.")]
        return
    if result.nodes:
        yield from _nodes(result, width)
    took = f"{plural(result.requests, 'request')}, {result.seconds:.1f} s"
    if result.action == "select":
        yield f"selected, and waits for `lss node-id N` ({took})"
        return
    yield f"{_summary(result)} ({took})"
    if result.action == "scan" and result.nodes:
        if result.free is None:
            yield [Cell("  no node-ID is free: nodes answer with each of 1 to 127", "dim")]
            return
        yield [Cell(f"  no node answers as node {result.free}; this assigns that node-ID:", "dim")]
        yield [Cell(f"  lss node-id {result.free} {result.nodes[0].address}", "dim")]  # one row of 80 columns, to copy


def _nodes(result: LssFound, width: int) -> Iterator[Line]:
    table = Table(("VENDOR", "PRODUCT", "REVISION", "SERIAL", "NODE", "PROFILE"), shrink=5)
    for node in result.nodes:
        told = {None: "?", UNCONFIGURED: "none"}.get(node.node_id, str(node.node_id))
        table.add(*(f"0x{part:08X}" for part in node.address.parts), told, node.profile or "-")
    yield from table.lines(width)
    for node in result.nodes:
        if not node.confirmed:
            yield [Cell(f"  {node.address} is answered by no node or by several", "red")]


def _summary(result: LssFound) -> str:
    if result.within is not None:
        return "at least one node is within these ranges" if result.within else "no node is within these ranges"
    if result.action == "identify" and result.answered is None:
        return plural(len(result.nodes), "node") + " with that LSS address" if result.nodes else "no node has it"
    if result.nodes:
        return plural(len(result.nodes), "node") + " without a node-ID"
    if not result.answered:
        return "no node without a node-ID answers"
    if result.action == "identify":
        return "there are nodes without a node-ID; lss scan finds their addresses"
    return "nodes without a node-ID do not support Fastscan: use lss select with the address on the name plate"


def changed_lines(result: LssChanged, _width: int) -> Iterator[Line]:
    """Show the nodes' new node-IDs."""
    if result.dry_run:
        what = _WOULD[result.action].format(result.wanted)
        yield [_DRY_RUN, Cell(f"lss {result.action} would {what} by LSS. Nothing was sent.")]
        return
    for node in result.nodes:
        yield _given(node)
    for name in result.missing:
        yield [Cell(f"{name}: not found", "red")]
    if result.action == "assign" and not (result.nodes or result.missing):
        yield "every node has its node-ID, confirmed by SDO"
    if result.nodes and not all(node.stored for node in result.nodes):
        stored = "; ".join(f"lss store {node.node_id}" for node in result.nodes)
        yield [Cell(f"  lost at power-off until it is stored: {stored}", "dim")]


def _given(node: LssGiven) -> list[Cell]:
    name = f" {node.name}" if node.name else ""
    before = "none" if node.before == UNCONFIGURED else str(node.before)
    line = [Cell(f"node {node.node_id}", "bold"), Cell(f"{name}  {node.address}")]
    if node.before != node.node_id:
        line.append(Cell(f"  (before: {before})", "dim"))
    if node.proved:
        line.append(Cell("  stored, proved by a reset", "green"))
    elif node.stored:
        line.append(Cell("  stored, acknowledged by the node", "green"))
    return line


def bit_rate_lines(result: LssBitRate, _width: int) -> Iterator[Line]:
    """Show the new bit rate of the bus and its nodes."""
    if result.dry_run:
        yield [_DRY_RUN, Cell(f"lss bitrate would set {result.bit_rate} bit/s by LSS. Nothing was sent.")]
        return
    if not result.nodes:
        yield f"the bus already runs at {result.bit_rate} bit/s; nothing was sent and nothing is stored"
        return
    for node in result.nodes:
        name = "no node-ID" if node.node_id == UNCONFIGURED else f"node {node.node_id}"
        said = "  stored, proved by a reset" if node.proved else "  stored, acknowledged by the node"
        stored = [Cell(said, "green")] if node.stored else []
        yield [Cell(name, "bold"), Cell(f"  {node.address}"), *stored]
    yield f"{plural(len(result.nodes), 'node')} at {result.bit_rate} bit/s (before: {result.before})"
    if not all(node.stored for node in result.nodes):
        yield [Cell("  lost at power-off until it is stored: lss store NODE, for each", "dim")]


def measured_rate_lines(result: BitRateFound, width: int) -> Iterator[Line]:
    """Show the detected bit rate, and the frames received at each bit rate."""
    table = Table(("BIT/S", "FRAMES", "ERROR FRAMES"))
    for trial in result.heard:
        table.add(str(trial.bit_rate), str(trial.frames), str(trial.error_frames))
    yield from table.lines(width)
    if result.bit_rate is not None:
        yield [Cell(f"{result.bus} runs at {result.bit_rate} bit/s", "green"), Cell(f": -b {result.bit_rate}")]
        return
    yield [Cell(_nothing(result), "red")]
    yield [Cell(f"  {hint}", "dim") for hint in _hints(result)]


def _nothing(result: BitRateFound) -> str:
    at = "at none of the standard's bit rates" if result.complete else f"at {result.heard[0].bit_rate} bit/s"
    if result.silent:
        return f"{result.bus} is silent: no frame and no error frame {at}, {result.seconds:g} s each"
    if not any(trial.frames for trial in result.heard):
        return f"{result.bus}: something is sent, and {at} it can be read"
    return f"{result.bus}: frames come, and {at} without error frames"


def _hints(result: BitRateFound) -> Iterator[str]:
    if result.silent:
        yield (
            "the bit rate of a silent bus cannot be found: check the cable, and switch a node on meanwhile, for its "
            "boot-up message; --for 5s"
        )
    elif not any(trial.frames for trial in result.heard):
        yield "one node alone is never acknowledged, and cannot be read while we are silent: connect a second one"
    else:
        yield "there are two bit rates on the bus, or a bad line: disconnect the nodes one by one"
