"""What is said of the nodes of a network once what was changed was taken back, or not of all of them.

Knows node-IDs only: what happened it is told.
"""

from __future__ import annotations

from collections.abc import Iterable, Sequence

from dvtcli.domain.several import join_some


def all_back(
    back: Sequence[int],
    unwritten: Sequence[int],
    restarted: Sequence[int],
    unknown: Sequence[int],
    look_at: int | None,
) -> str:
    """The state where nothing is left changed: the nodes that were put *back* and read, and those *unwritten*.

    Of those *restarted* meanwhile what else they held is lost; of the *unknown* ones nobody could ask whether they
    did. *look_at* is one whose NMT state is not known.
    """
    who = f"node {_names(back)}" if unwritten else "every node"
    what = f"what was changed is as it was on {who}" if restarted or unwritten else "every node is as it was"
    said = [f"rolled back: {what}, read back equal"]
    if unwritten:
        said.append(f"nothing was written to node {_names(unwritten)}")
    said.append("nothing was stored")
    if look_at is not None:
        said.append(f"look at the NMT state of node {look_at}")
    if restarted:
        said.append(f"node {join_some(map(str, restarted))} restarted: what else it held in RAM only is lost")
    if unknown:
        said.append(f"whether node {_names(unknown)} restarted is not known: the bus is gone")
    return "; ".join(said)


def other_nodes(back: Sequence[int], unwritten: Sequence[int]) -> list[tuple[str, str]]:
    """The labelled lines for the nodes beside those that are left changed: put *back* and read, and *unwritten*."""
    rows = ((back, "as before, read back equal"), (unwritten, "nothing was written to it"))
    return [("others", f"node {_names(numbers)}: {text}") for numbers, text in rows if numbers]


def _names(node_ids: Iterable[int]) -> str:
    return ", ".join(map(str, node_ids))
