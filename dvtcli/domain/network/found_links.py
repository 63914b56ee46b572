"""Which RPDOs of a network hear which TPDOs, as their nodes are set. Reads no node."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping
from dataclasses import dataclass

from dvtcli.domain.network.links import agrees
from dvtcli.domain.network.wanted_state import Endpoint, LinkWish
from dvtcli.domain.pdo import Pdo, PdoConfig

Configs = Mapping[int, Mapping[Pdo, PdoConfig]]


@dataclass(frozen=True, slots=True)
class FoundLinks:
    """The *links* that there are, and what hears a frame that it is *unlike*: consumer and producer."""

    links: tuple[LinkWish, ...]
    unlike: tuple[tuple[Endpoint, Endpoint], ...] = ()


def found_links(held: Configs, watches: Callable[[int, int], bool]) -> FoundLinks:
    """The links of nodes that hold *held*, by node-ID: one CAN-ID, both sides enabled, layouts that agree.

    *watches* says whether a consumer (its node-ID first) waits for the heartbeat of a producer; a link where one does
    not is one without. A CAN-ID that several nodes send makes none.
    """
    consumers: dict[Endpoint, list[Endpoint]] = {}
    unlike: list[tuple[Endpoint, Endpoint]] = []
    for consumer, heard in _enabled(held, is_tpdo=False):
        senders = [(one, sent) for one, sent in _enabled(held, is_tpdo=True) if _same_id(sent, heard)]
        if len(senders) != 1 or senders[0][0].node_id == consumer.node_id:
            continue
        producer, sent = senders[0]
        if agrees(sent.mapping, heard.mapping):
            consumers.setdefault(producer, []).append(consumer)
        else:
            unlike.append((consumer, producer))
    links = []
    for producer, ends in sorted(consumers.items(), key=lambda item: (item[0].node_id, item[0].pdo)):
        all_watch = all(watches(end.node_id, producer.node_id) for end in ends)
        links.append(LinkWish(producer, tuple(ends), None if all_watch else False))
    return FoundLinks(tuple(links), tuple(unlike))


def _enabled(held: Configs, *, is_tpdo: bool) -> Iterator[tuple[Endpoint, PdoConfig]]:
    for node_id, pdos in held.items():
        for pdo, config in pdos.items():
            if pdo.is_tpdo is is_tpdo and config.enabled and config.mpdo is None and not config.inconsistency:
                yield Endpoint(node_id, pdo), config


def _same_id(one: PdoConfig, other: PdoConfig) -> bool:
    a, b = one.communication.cob_id, other.communication.cob_id
    return (a.can_id, a.extended) == (b.can_id, b.extended)
