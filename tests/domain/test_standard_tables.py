"""Tables of the standards: each number, as it stands there, has its meaning here."""

from __future__ import annotations

import pytest

from dvtcli.domain.datatypes import DATA_TYPES
from dvtcli.domain.emergency_codes import emergency_text
from dvtcli.domain.gateway_words import GatewayError
from dvtcli.domain.lss_services import BIT_TIMINGS
from dvtcli.domain.standard_objects import is_pdo_mapping


@pytest.mark.parametrize(
    ("code", "word"),
    [
        (0x0000, "reset"), (0x1000, "generic"), (0x2110, "input"), (0x3100, "mains"), (0x4200, "device temperature"),
        (0x8110, "overrun"), (0x8120, "passive"), (0x8130, "heartbeat"), (0x8140, "bus-off"), (0x8150, "collision"),
        (0x8210, "too short"), (0x8220, "length exceeded"), (0x8230, "MPDO"), (0x8240, "SYNC"),
        (0x8250, "RPDO time-out"), (0x9000, "external"), (0xF001, "additional"), (0xFF01, "device specific"),
    ],
)  # fmt: skip
def test_an_emergency_error_code_has_its_meaning(code: int, word: str) -> None:
    """CiA 301, table 26."""
    assert word in emergency_text(code)


def test_each_data_type_has_its_index() -> None:
    """CiA 301, table 44."""
    types = {
        0x01: "BOOLEAN", 0x02: "INTEGER8", 0x03: "INTEGER16", 0x04: "INTEGER32", 0x05: "UNSIGNED8",
        0x06: "UNSIGNED16", 0x07: "UNSIGNED32", 0x08: "REAL32", 0x09: "VISIBLE_STRING", 0x0A: "OCTET_STRING",
        0x0B: "UNICODE_STRING", 0x0C: "TIME_OF_DAY", 0x0D: "TIME_DIFFERENCE", 0x0F: "DOMAIN", 0x10: "INTEGER24",
        0x11: "REAL64", 0x12: "INTEGER40", 0x13: "INTEGER48", 0x14: "INTEGER56", 0x15: "INTEGER64",
        0x16: "UNSIGNED24", 0x18: "UNSIGNED40", 0x19: "UNSIGNED48", 0x1A: "UNSIGNED56", 0x1B: "UNSIGNED64",
    }  # fmt: skip
    assert {code: data_type.name for code, data_type in DATA_TYPES.items()} == types
    assert {data_type.bits for data_type in DATA_TYPES.values() if data_type.name[-2:] == "56"} == {56}


def test_each_bit_rate_of_lss_has_its_index() -> None:
    """CiA 305, table of standard bit timing parameters; index 5 is reserved."""
    rates_kbit = {0: 1000, 1: 800, 2: 500, 3: 250, 4: 125, 6: 50, 7: 20, 8: 10}
    assert {index: rate // 1000 for rate, index in BIT_TIMINGS.items()} == rates_kbit


def test_each_error_of_a_gateway_has_its_number() -> None:
    """CiA 309-3, internal error codes."""
    words = {
        100: "not supported", 101: "syntax", 102: "state", 103: "time-out", 104: "net", 105: "node", 106: "net",
        107: "node", 202: "heartbeat", 203: "heartbeat", 204: "NMT", 400: "PDO", 401: "PDO", 501: "LSS",
        502: "node-ID", 503: "bit rate", 504: "LSS", 600: "memory",
    }  # fmt: skip
    assert [int(error) for error in GatewayError] == [*words]
    assert [error for error, word in words.items() if word.lower() not in GatewayError(error).text.lower()] == []


@pytest.mark.parametrize(("first", "last"), [(0x1400, 0x15FF), (0x1600, 0x17FF), (0x1800, 0x19FF), (0x1A00, 0x1BFF)])
def test_the_mapping_parameters_have_their_areas(first: int, last: int) -> None:
    """CiA 301, table 43."""
    is_mapping = bool(first & 0x200)
    assert [is_pdo_mapping(index) for index in (first, last)] == [is_mapping] * 2
    assert not is_pdo_mapping(0x13FF)
    assert not is_pdo_mapping(0x1C00)
    assert not is_pdo_mapping(0x3600)
