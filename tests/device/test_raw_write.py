"""What a raw write makes of a PDO, as it will read back, and what of the node is looked at for that."""

from __future__ import annotations

from dataclasses import replace

import pytest

from dvtcli.device.node import Node
from dvtcli.device.raw_write import held_value, raw_change, raw_write_findings
from dvtcli.domain.cob_id import CobId
from dvtcli.domain.pdo import Pdo, PdoConfig
from dvtcli.domain.plan import PdoChange, Step, ValueChange
from dvtcli.errors import SdoAborted, SdoProtocolError
from tests.device.test_reading_and_storing import Table, Values
from tests.laws.bench import NODE, DirectBus, booted

TPDO1 = Pdo.parse("tpdo1")
OFF = {(0x1800, 1): b"\x81\1\0\x80", (0x1800, 5): b"\0\0", (0x1A00, 0): b"\0"}


def entries(count: int) -> Values:
    return {(0x1A00, number): (0x2000_0008 + (number << 8)).to_bytes(4, "little") for number in range(1, count + 1)}


def node_of(values: Values) -> tuple[Node, Table]:
    table = Table({**OFF, **values})
    return Node(DirectBus(booted(), table), NODE), table


def becomes(node: Node, index: int, sub_index: int, data: bytes) -> PdoConfig | None:
    """What TPDO1 is after the write; None where it is no change of the PDO."""
    change = raw_change(node, Step(index, sub_index, None, data, "write"))
    if isinstance(change, ValueChange):
        return None
    assert isinstance(change, PdoChange)
    assert change.before == node.known_pdo(TPDO1)
    return change.after


@pytest.mark.parametrize(
    ("there", "count", "mapped", "held_count", "unread"),
    [
        (3, 2, 2, None, ()),
        (3, 3, 3, None, ()),
        (3, 5, 3, 5, ((0x1A00, 4),)),
        (0, 1, 0, 1, ((0x1A00, 1),)),
        (64, 64, 64, None, ()),
        (64, 65, 64, 65, ()),
    ],
)
def test_a_count_makes_as_many_entries_active_as_there_are(
    there: int, count: int, mapped: int, held_count: int | None, unread: tuple[tuple[int, int], ...]
) -> None:
    node, table = node_of(entries(there))
    after = becomes(node, 0x1A00, 0, bytes([count]))
    assert after is not None
    assert (len(after.mapping), after.held_count, after.unread) == (mapped, held_count, unread)
    table.values[0x1A00, 0] = bytes([count])
    assert after == node.pdo(TPDO1), "as it reads back"


def test_a_parameter_becomes_what_is_written() -> None:
    node, _ = node_of({})
    now = node.pdo(TPDO1).communication
    assert becomes(node, 0x1800, 5, b"\x64\0") == replace(node.pdo(TPDO1), communication=replace(now, event_timer=100))
    after = becomes(node, 0x1800, 1, b"\x90\1\0\x80")
    assert after is not None
    assert after.communication.cob_id == CobId(0x190, valid=False)


@pytest.mark.parametrize(
    ("index", "sub_index", "data"),
    [
        (0x1800, 5, b"\0\0"),
        (0x1800, 5, b"\1\0\0\0\0"),
        (0x1800, 1, b"\x90\1\0\x80\0"),
        (0x1800, 7, b"\1"),
        (0x1800, 7, b"\1\2\3\4\5"),
        (0x1A00, 1, b"\x10\0\x41\x60"),
        (0x1017, 0, b"\1\0"),
    ],
)
def test_what_is_so_already_of_another_length_or_nothing_active_is_no_change_of_a_pdo(
    index: int, sub_index: int, data: bytes
) -> None:
    assert becomes(node_of({})[0], index, sub_index, data) is None


def test_an_entry_that_is_too_long_is_not_cut() -> None:
    node, _ = node_of({(0x1A00, 1): b"\x10\0\x41\x60\1"})
    with pytest.raises(SdoProtocolError, match="0x1A00:01 answered 5 bytes"):
        becomes(node, 0x1A00, 0, b"\1")


def test_entries_are_read_for_a_count_only() -> None:
    for write, read in (
        ((0x1800, 5, b"\2\0"), False),
        ((0x1A00, 1, b"\x08\1\0\x20"), False),
        ((0x1A00, 0, b"\2"), True),
    ):
        node, table = node_of(entries(2))
        raw_write_findings(node, *write)
        assert ((0x1A00, 2) in table.reads) == read, write


def test_a_count_without_entries_is_an_error() -> None:
    node, _ = node_of(entries(2))
    assert [finding.text for finding in raw_write_findings(node, 0x1A00, 0, b"\3")] == [
        "the count would be 3, but 0x1A00:03 cannot be read"
    ]


@pytest.mark.parametrize(("code", "passes"), [(0x0601_0001, True), (0x0800_0022, False), (0x0602_0000, False)])
def test_what_cannot_be_put_back_is_write_only_and_nothing_else(code: int, passes: bool) -> None:
    class Refusing(Table):
        def upload(
            self, index: int, sub_index: int, *, timeout_s: float | None = None, retries: int | None = None
        ) -> bytes:
            raise SdoAborted(index, sub_index, code)

    node = Node(DirectBus(booted(), Refusing({})), NODE)
    if passes:
        assert held_value(node, 0x2000, 1) is None
        return
    with pytest.raises(SdoAborted):
        held_value(node, 0x2000, 1)
