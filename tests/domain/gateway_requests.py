"""Any request that a gateway's client may make, for Hypothesis."""

from __future__ import annotations

from typing import Any

from hypothesis import strategies as st

from dvtcli.domain.datatypes import Kind
from dvtcli.domain.gateway_requests import (
    ORDERS,
    Command,
    Level,
    Nmt,
    Order,
    PdoEntry,
    Read,
    ReadPdo,
    Request,
    SetPdo,
    Write,
    WritePdo,
    level_of,
)
from dvtcli.domain.gateway_words import TYPES
from dvtcli.domain.nmt import NmtCommand
from tests.domain.test_datatypes import values

INDEXES, SUB_INDEXES, NAMES = st.integers(0, 0xFFFF), st.integers(0, 0xFF), st.sampled_from(sorted(TYPES))
_TEXTS = st.text(st.characters(min_codepoint=0x20, max_codepoint=0x7E), max_size=30)


def data_of_type(name: str) -> st.SearchStrategy[bytes]:
    """Bytes that are a value of the type *name*."""
    kind = TYPES[name]
    if kind.kind is Kind.VISIBLE_STRING:
        return _TEXTS.map(lambda text: text.encode("ascii"))
    if kind.kind is Kind.REAL:
        return st.floats(width=32 if kind.bits == 32 else 64, allow_nan=False, allow_infinity=False).map(kind.encode)
    return values(kind).map(kind.encode)


def _orders(name: str) -> st.SearchStrategy[Order]:
    shape = ORDERS[name]
    numbers = st.tuples(*(st.integers(*one) for one in shape.ranges))
    few = numbers if shape.least is None else st.one_of(numbers, st.just(()))
    return st.builds(Order, st.just(name), few)


_ENTRIES = st.one_of(st.builds(PdoEntry, NAMES), st.builds(PdoEntry, NAMES, INDEXES, SUB_INDEXES))
_TRANSMISSIONS = st.one_of(st.sampled_from(["event", "rtr"]), st.integers(0, 240).map(lambda n: f"sync{n}"))
_COMMANDS: st.SearchStrategy[Command] = st.one_of(
    st.builds(Read, INDEXES, SUB_INDEXES, st.none() | NAMES),
    NAMES.flatmap(lambda name: st.builds(Write, INDEXES, SUB_INDEXES, st.just(name), data_of_type(name))),
    st.builds(Nmt, st.sampled_from(NmtCommand)),
    st.sampled_from(sorted(ORDERS)).flatmap(_orders),
    st.builds(
        SetPdo,
        st.booleans(),
        st.integers(1, 512),
        st.integers(0, 0xFFFF_FFFF),
        _TRANSMISSIONS,
        st.lists(_ENTRIES, max_size=8).map(tuple),
    ),
    st.builds(ReadPdo, st.integers(1, 512)),
    st.builds(
        WritePdo,
        st.integers(1, 512),
        st.lists(st.integers(-9, 99).map(str) | _TEXTS.map('"{}'.format), max_size=8).map(tuple),
    ),
)


def _request(command: Command) -> st.SearchStrategy[Request]:
    nothing: st.SearchStrategy[Any] = st.none()
    level = level_of(command)
    nets = nothing if level is Level.GATEWAY else nothing | st.integers(0, 0xFFFF)
    nodes = st.integers(0, 0xFF) if level is Level.NODE else nothing
    placed = st.builds(Request, nothing | st.integers(0, 0xFFFF_FFFF), nets, nodes, st.just(command))
    if level is not Level.NODE:
        return placed
    return placed | st.builds(Request, nothing | st.integers(0, 9), nothing, nothing, st.just(command))


#: any request, as it could be made
REQUESTS = _COMMANDS.flatmap(_request)
