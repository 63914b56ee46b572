"""What was taken for granted where the streams of a network were found, and what is not counted, in words."""

from __future__ import annotations

from collections.abc import Iterable, Iterator

from dvtcli.domain.network.network_state import Identifier, NetworkState, NodeState, identifier_of
from dvtcli.domain.network.stream import EMCY_US, ON_RTR, SYNCHRONOUS, TIME_US, Stream, WhatIf, in_ms
from dvtcli.domain.pdo import Pdo, PdoConfig
from dvtcli.domain.several import join_some, plural


def without_producer(state: NetworkState) -> Iterator[tuple[NodeState, Pdo, PdoConfig]]:
    """The enabled RPDOs whose frames no node sends, one for each COB-ID."""
    seen: set[Identifier] = set()
    sent = {identifier_of(config) for _, _, config in state.enabled(is_tpdo=True)}
    for node, pdo, config in state.enabled(is_tpdo=False):
        if identifier_of(config) not in sent and identifier_of(config) not in seen:
            seen.add(identifier_of(config))
            yield node, pdo, config


def assumptions(state: NetworkState, streams: Iterable[Stream], what_if: WhatIf, sync_us: int | None) -> Iterator[str]:
    """What was taken for granted, and what is not counted."""
    streams = list(streams)
    if emcys := sum(stream.kind == "emcy" and stream.assumed for stream in streams):
        whose = "node sends" if emcys == 1 else "nodes send"
        every = in_ms(what_if.emcy_us or EMCY_US)
        yield f"{emcys} {whose} an EMCY each {every} at most (0x1015 is 0, which sets no limit)"
    if any(stream.kind == "time" for stream in streams):
        yield f"TIME is sent each {in_ms(TIME_US)}"
    timers = [stream for stream in streams if stream.kind == "tpdo" and stream.why.startswith("timer")]
    if timers:
        verb = "is" if len(timers) == 1 else "are"
        what = f"{plural(len(timers), 'TPDO')} without inhibit time {verb}"
        yield f"{what} sent by the event timer only: {_names(timers)}"
    by_master = [stream for stream in streams if stream.kind == "rpdo"]
    if by_master:
        yield f"a master sends on each SYNC what no node here does: {_names(by_master)}"
    others = [row for row in without_producer(state) if not _counted(row[2], sync_us)]
    if others:
        listed = join_some(f"{node.node_id}:{pdo}" for node, pdo, _ in others)
        yield f"no node here sends what {listed} {'hears' if len(others) == 1 else 'hear'}: not counted"
    asked = [f"{node.node_id}:{pdo}" for node, pdo, config in state.enabled(is_tpdo=True) if _is_asked(config)]
    if asked:
        yield f"sent on request (RTR) only, and not counted: {join_some(asked)}"
    if state.untold:
        ids = join_some(str(node_id) for node_id in state.untold)
        yield f"of node {ids} only what the file says is known, 8 bytes a PDO where it says no length"
    yield "SDO takes what is left: one of its frames may be under way when another one becomes ready"


def _counted(config: PdoConfig, sync_us: int | None) -> bool:
    kind = config.communication.transmission_type
    return sync_us is not None and kind is not None and kind in SYNCHRONOUS


def _is_asked(config: PdoConfig) -> bool:
    return config.communication.transmission_type in ON_RTR


def _names(streams: Iterable[Stream]) -> str:
    return join_some(f"{stream.node}:{stream.pdo}" for stream in streams)
