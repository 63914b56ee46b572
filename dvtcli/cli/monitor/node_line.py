"""The monitor's line of nodes: who is there, in which NMT state, in whatever room there is.

Pure. Does not know the terminal, the keys or the bus.
"""

from __future__ import annotations

from collections.abc import Iterable, Mapping

from dvtcli.cli.monitor.room import wide
from dvtcli.cli.view.columns import clipped
from dvtcli.cli.view.lines import Cell
from dvtcli.domain.nmt import NmtState
from dvtcli.domain.several import plural
from dvtcli.watch.seen import FrameStore

#: columns of each node's name, as many as there is room for; in the end none
_NAMES = (60, 30, 20, 14, 10, 0)
_STATE_STYLES: dict[NmtState | None, str] = {NmtState.OPERATIONAL: "green", None: "dim"}


def node_line(store: FrameStore, reading: int | None, width: int, *, plain: bool) -> list[Cell]:
    """The nodes that are heard or known, with their names and states, and which one is being *read*, if any.

    Where they are too many the states get shorter, then their names, which go in the end. Then they stand by their
    states, those in another state than most first: by number, at last only counted.
    """
    names, heard = store.decoder.names, {row.service.node for row in store.rows.values()}
    shown = sorted({node for node in heard if node is not None} | set(names))
    states = {node: store.states.get(node) for node in shown}
    before = [Cell(f"reading the mapping of node {reading}...  ", "cyan")] if reading is not None else []
    if not shown:
        return [*before, Cell("no node is heard", "dim")]
    room = width - wide([before], plain=plain) if before else width
    return [*before, *_fitting(names, states, room, plain=plain)]


def _fitting(names: Mapping[int, str], states: Mapping[int, NmtState | None], width: int, *, plain: bool) -> list[Cell]:
    """All nodes of *states* in *width* columns, with as much of their *names* as there is room for."""
    for most, short in ((_NAMES[0], False), *((most, True) for most in _NAMES)):
        nodes = [_node_cells(one, names.get(one, ""), state, most, short=short) for one, state in states.items()]
        if wide(nodes, plain=plain) <= width:
            return [cell for group in nodes for cell in group]
    return _by_state(states, width, plain=plain)


def _node_cells(node_id: int, name: str, state: NmtState | None, most: int, *, short: bool) -> list[Cell]:
    """A node with its name, of at most *most* columns, and its state; in few words where *short*."""
    label = f"{node_id} {clipped(name, most)}" if name and most else f"{node_id}" if not most else f"node {node_id}"
    said = f" {state.short if short else state.label}   " if state is not None else "   "
    return [Cell(label, "bold"), Cell(said, _STATE_STYLES.get(state, "yellow"))]


def _by_state(states: Mapping[int, NmtState | None], width: int, *, plain: bool) -> list[Cell]:
    """The nodes of each state, the rarest first; the most common ones are counted where their numbers do not fit."""
    members: dict[NmtState | None, list[int]] = {}
    for node, state in states.items():
        members.setdefault(state, []).append(node)
    groups = sorted(members, key=lambda state: (len(members[state]), members[state]))
    for listed in range(len(groups), -1, -1):
        cells = [
            _group(ranges(members[state]) if at < listed else plural(len(members[state]), "node"), state)
            for at, state in enumerate(groups)
        ]
        if wide(cells, plain=plain) <= width:
            return [cell for group in cells for cell in group]
    return [Cell(plural(len(states), "node"), "yellow")]


def _group(who: str, state: NmtState | None) -> list[Cell]:
    said = "no heartbeat" if state is None else state.short
    return [Cell(who, "bold"), Cell(f" {said}   ", _STATE_STYLES.get(state, "yellow"))]


def ranges(nodes: Iterable[int]) -> str:
    """Node-IDs in order, with those that follow one another as one: `1-5,9`."""
    runs: list[list[int]] = []
    for node in nodes:
        if runs and node == runs[-1][-1] + 1:
            runs[-1].append(node)
        else:
            runs.append([node])
    return ",".join(f"{run[0]}" if len(run) == 1 else f"{run[0]}-{run[-1]}" for run in runs)
