"""Restrict a network file to the chosen nodes, without what needs other nodes. Sends nothing."""

from __future__ import annotations

from dataclasses import replace
from typing import TYPE_CHECKING

from dvtcli.domain.hint import Action, Hint, verbatim
from dvtcli.domain.network.network_config import Endpoint
from dvtcli.domain.text import plural
from dvtcli.errors import UsageError
from dvtcli.operations.plans.stamping import linked_with

if TYPE_CHECKING:
    from dvtcli.domain.network.network_config import NetworkConfig
    from dvtcli.operations.session.session import Session
    from dvtcli.operations.session.session_nodes import SessionNodes
    from dvtcli.operations.user.session_user import SessionUser


def named_nodes(session: Session) -> tuple[int, ...]:
    """Return the nodes that the user chose; empty for all of the file.

    A single node counts only if `-n` is on the line itself: at a prompt and in scripts, settings and variables `-n`
    only selects the current node.
    """
    ids = session.base.nodes
    typed = session.settings.is_typed("node") and session.ends_with_line
    return ids if len(ids) > 1 or typed else ()


def of_nodes(session: SessionUser, file: str, config: NetworkConfig, ids: tuple[int, ...]) -> NetworkConfig:
    """Restrict *config* to the nodes *ids*, if any (`-n 1,3`); raises UsageError for a node not in the file."""
    if not ids:
        return config
    if unknown := [chosen_id for chosen_id in ids if chosen_id not in {node.node_id for node in config.nodes}]:
        raise UsageError(f"{file} has no node {', '.join(map(str, unknown))}", place=file)
    chosen, alone = _without_torn_links(config, _without_stamps(config, config.of(ids)))
    if left_out := len(config.links) - len(chosen.links):
        stay = ", ".join(f"{end.node_id}:{end.pdo}" for end in alone)
        kept = f"; left as they are: {stay}" if stay else ""
        session.reporter.note(
            f"{plural(left_out, 'link')} of {file} left out: not both ends are among the chosen nodes{kept}"
        )
    return chosen


def _without_stamps(config: NetworkConfig, chosen: NetworkConfig) -> NetworkConfig:
    """Drop from *chosen* the stamps that also cover links with nodes outside it."""
    ids = {node.node_id for node in chosen.nodes}
    nodes = (node if linked_with(config, node.node_id) <= ids else replace(node, stamp=None) for node in chosen.nodes)
    return replace(chosen, nodes=tuple(nodes))


def _without_torn_links(config: NetworkConfig, chosen: NetworkConfig) -> tuple[NetworkConfig, list[Endpoint]]:
    """Drop links of *chosen* that lack an end, and their PDOs; returns those PDOs, too.

    One end of such a link must not change while the other stays: the RPDO would receive another layout.
    """
    links, torn = chosen.links, {end for link in config.links if link not in chosen.links for end in link.ends}
    while shared := [link for link in links if not torn.isdisjoint(link.ends)]:
        links = tuple(link for link in links if link not in shared)
        torn |= {end for link in shared for end in link.ends}
    nodes = tuple(
        replace(node, pdos=tuple(pdo for pdo in node.pdos if Endpoint(node.node_id, pdo.pdo) not in torn))
        for node in chosen.nodes
    )
    ids = {node.node_id for node in chosen.nodes}
    alone = sorted((end for end in torn if end.node_id in ids), key=lambda end: (end.node_id, str(end.pdo)))
    return replace(chosen, nodes=nodes, links=links), alone


def tell_unknown_bit_rate(session: SessionNodes, nodes: int) -> None:
    """Report, once a session, that *nodes* nodes are read one by one as the bit rate is unknown, with a hint.

    Only for a bus that could read them in parallel: not for simulated nodes, twins, or an object gateway.
    """
    bus = session.bus
    if nodes < 2 or session.dry_run or bus.simulated or not bus.carries_frames or bus.bitrate is not None:
        return
    unknown = f"the bit rate of {bus.name} is not known"
    if not session.network.files.is_news(unknown):
        return
    session.reporter.note(
        Hint(
            Action.GIVE_BIT_RATE,
            {"rate": 250000},
            f"{verbatim(unknown)}: its {nodes} nodes are read slowly, and no bus load is kept free for a "
            "running machine; give it, as {} or as bitrate = 250000 in dvtcli.toml",
        )
    )
