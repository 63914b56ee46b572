"""Lines of CiA 309-3: what is written is read back, and nothing that comes is too much."""

from __future__ import annotations

import pytest
from hypothesis import example, given
from hypothesis import strategies as st

from dvtcli.domain.gateway_requests import (
    Around,
    Nmt,
    Order,
    PdoEntry,
    Read,
    ReadPdo,
    Request,
    SetPdo,
    Write,
    WritePdo,
    format_request,
    parse_request,
    plan_lines,
)
from dvtcli.domain.gateway_words import (
    LONGEST_LINE,
    TYPES,
    GatewayError,
    GatewayRequestError,
    data_of,
    value_text,
    words_of,
)
from dvtcli.domain.network.network_plan import NetworkPlan, NodePlan
from dvtcli.domain.nmt import NmtCommand
from dvtcli.domain.plan import Plan, Step, ValueChange
from tests.domain.gateway_requests import REQUESTS, data_of_type


@given(REQUESTS)
def test_what_is_written_is_read_back(request_: Request) -> None:
    line = format_request(request_)
    assert parse_request(line) == request_
    assert parse_request(f"{line} # a comment") == request_


@example(("os", b""))
@example(("us", b""))
@example(("vs", b""))
@example(("t", bytes(6)))
@given(st.sampled_from(sorted(TYPES)).flatmap(lambda name: st.tuples(st.just(name), data_of_type(name))))
def test_a_value_is_read_back(typed: tuple[str, bytes]) -> None:
    name, data = typed
    again = data_of(name, words_of(value_text(name, data)))
    assert again == (data.rstrip(b"\0") if name == "vs" else data)


def test_no_bytes_are_no_number() -> None:
    with pytest.raises(ValueError, match="takes 2 bytes, not 0"):
        value_text("u16", b"")


@pytest.mark.parametrize(
    ("length", "type_name"), [(1, "u8"), (2, "u16"), (4, "u32"), (7, "u56"), (8, "u64"), (9, "os"), (20, "os")]
)
def test_a_planned_write_is_a_number_if_its_length_allows(length: int, type_name: str) -> None:
    data = bytes(range(1, length + 1))
    change = ValueChange(Step(0x2000, 1, None, data, "write"))
    node = NodePlan("drive", Plan(4, (change,)), {"vendor": 0x1E, "product": 7, "revision": None})
    lines = plan_lines(NetworkPlan("net.yaml", (node,)), {4: Around()})
    assert "#! require 4:identity vendor=0x0000001E product=0x00000007" in lines
    (asked,) = filter(None, map(parse_request, lines))
    assert asked == Request(1, None, 4, Write(0x2000, 1, type_name, data))


def test_a_plan_says_when_its_node_goes_to_pre_operational() -> None:
    node = NodePlan("drive", Plan(4, (ValueChange(Step(0x2000, 1, None, b"\1", "write")),)), {"vendor": 0x1E})
    lines = plan_lines(NetworkPlan("net.yaml", (node,)), {4: Around(preop=True)})
    at = next(number for number, line in enumerate(lines) if line.endswith(" 4 preop"))
    assert lines[at - 1] == "# node 4: its PDOs are set in PRE-OPERATIONAL"


def test_a_name_in_a_plan_is_printable_ascii() -> None:
    node = NodePlan("dr\x7five \u00e9~", Plan(4, ()), {"vendor": 0x1E})
    lines = plan_lines(NetworkPlan("net.yaml", (node,)), {4: Around()})
    assert any(line.startswith("# node 4 dr?ive ?~: ") for line in lines)


def parsed(line: str) -> Request | GatewayRequestError | None:
    try:
        return parse_request(line)
    except GatewayRequestError as refused:
        return refused


@given(st.text(max_size=60) | st.text('[]"# rwset0x19A\t', max_size=60))
@example('[1] 4 w 0x2000 0 vs "a')
@example("[99999999999] 4 start")
@example("[1] 4 r 0x1000 0 u32 #" + "x" * LONGEST_LINE)
@example("[1] 4 w 0x2000 0 os =AAA")
@example("[1] 4 w 0x2000 0 r32 1e999")
def test_whatever_comes_is_a_request_or_refused(line: str) -> None:
    outcome = parsed(line)
    if isinstance(outcome, GatewayRequestError):
        assert outcome.error in (GatewayError.SYNTAX, GatewayError.NOT_SUPPORTED)
        assert str(outcome)
    elif outcome is not None:
        assert parse_request(format_request(outcome)) == outcome


@pytest.mark.parametrize(
    ("line", "meant"),
    [
        ("[1] 4 preop", Request(1, None, 4, Nmt(NmtCommand.ENTER_PRE_OPERATIONAL))),
        ("[2] 1 4 W 0x1800 1 U32 0xC0000184", Request(2, 1, 4, Write(0x1800, 1, "u32", b"\x84\x01\0\xc0"))),
        ("4 write 4118 1 vs save", Request(None, None, 4, Write(0x1016, 1, "vs", b"save"))),
        ('[7] w 0x1010 1 vs "a ""b"""', Request(7, None, None, Write(0x1010, 1, "vs", b'a "b"'))),
        ("[8] 4 read 0x1018 1 # who", Request(8, None, 4, Read(0x1018, 1, None))),
        ("[8] 4 r 0x1018 1 x32", Request(8, None, 4, Read(0x1018, 1, "x32"))),
        ("[9] 0 reset communication", Request(9, None, 0, Nmt(NmtCommand.RESET_COMMUNICATION))),
        ("[3] 1 set node 5", Request(3, 1, None, Order("set node", (5,)))),
        ("set network 1", Request(None, None, None, Order("set network", (1,)))),
        ("[3] 1 r pdo 2", Request(3, 1, None, ReadPdo(2))),
        ("[3] w p 2 2 7 -1", Request(3, None, None, WritePdo(2, ("7", "-1")))),
        (
            "[3] set rpdo 1 0x181 sync1 2 u8 0x6041 0 u16",
            Request(3, None, None, SetPdo(False, 1, 0x181, "sync1", (PdoEntry("u8"), PdoEntry("u16", 0x6041, 0)))),
        ),
        ("[3] LSS_SWITCH_GLOB 1", Request(3, None, None, Order("lss_switch_glob", (1,)))),
        ("[3] boot_up_indication Enable", Request(3, None, None, Order("boot_up_indication enable"))),
    ],
)
def test_lines_of_the_field(line: str, meant: Request) -> None:
    assert parse_request(line) == meant


@pytest.mark.parametrize("line", ["", "  \t", "# only a comment", "[5]", "[5] # nothing"])
def test_nothing_is_asked(line: str) -> None:
    assert parse_request(line) is None


@pytest.mark.parametrize(
    ("line", "why"),
    [
        ("[x] 4 start", "sequence number"),
        ("[1] 4 w 0x1800 1 u8 256", "256 is not 0 to 255"),
        ("[1] 4 w 0x1800 1 u8 010", "without a leading zero"),
        ("[1] 4 w 0x1800 1 u8", "missing"),
        ("[1] 4 w 0x1800 1 u9 1", "not a data type"),
        ("[1] 4 w 0x1800 1 u8 1 2", "1 word, not 2"),
        ('[1] 4 w 0x1800 1 u8 "1"', "without quotes"),
        ("[1] 4 r 0x10000 0", "index 65536"),
        ("[1] 4 r 0x1000", "missing"),
        ("[1] 4 start now", "after the command"),
        ("[1] 1 4 set node 3", "takes no node"),
        ("[1] 1 set network 3", "takes no net"),
        ("[1] 4", "a command is missing"),
        ("[1] 1 2 3 start", "is not a command of the gateway"),
        ("[1] set tpdo 1 0x181 now 0", "event, rtr or sync"),
        ("[1] set tpdo 1 0x181 event 2 u8", "1 entries follow"),
        ("[1] w p 1 3 1 2", "2 values follow"),
        ("[1] r pdo", "number of a PDO is missing"),
        ("[1] r pdo 1 2", "or more follows"),
        ("[1] 4 r 0x1000 0 \x1b[2J", "not ASCII"),
        ("[1] fly", "not a command of the gateway"),
    ],
)
def test_what_is_wrong_is_said(line: str, why: str) -> None:
    with pytest.raises(GatewayRequestError, match=why):
        parse_request(line)
