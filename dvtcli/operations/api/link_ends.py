"""The ends of a link, and its heartbeat, from a program's words. Asks no device."""

from __future__ import annotations

from typing import Literal

from dvtcli.domain.network.wanted_state import Endpoint
from dvtcli.domain.pdo import Pdo
from dvtcli.errors import UsageError
from dvtcli.operations.api.checks import whole, word

_AN_END = "a PDO with its node: '1:tpdo1'"


def endpoints(*words: str) -> list[Endpoint]:
    """The PDOs with their nodes; UsageError where a word is none."""
    return [_endpoint(end_word) for end_word in words]


def _endpoint(text: str) -> Endpoint:
    head, _, tail = word("producer, consumers", text, _AN_END).partition(":")
    if not head.isdecimal() or not 1 <= int(head[:4]) <= 127:
        raise UsageError(f"{text!r}: {_AN_END}, node-IDs are 1…127")
    try:
        return Endpoint(int(head), Pdo.parse(tail))
    except ValueError as failed:
        raise UsageError(str(failed)) from failed


def heartbeat_of(heartbeat_ms: int | None, *, watched: bool) -> int | Literal[False] | None:
    """What a link does about heartbeats; UsageError where one is set that nobody is to watch."""
    if heartbeat_ms is None:
        return None if watched else False
    if not watched:
        raise UsageError("heartbeat=False leaves heartbeats alone, and heartbeat_ms sets one: give one of both")
    return whole("heartbeat_ms", heartbeat_ms, "a heartbeat in ms", 0xFFFF, low=1)
