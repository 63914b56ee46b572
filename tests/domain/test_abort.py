from __future__ import annotations

import pytest

from dvtcli.domain.abort import Abort, abort_text


@pytest.mark.parametrize(
    ("code", "text"),
    [
        (0x0602_0000, "object does not exist in the object dictionary"),
        (0x0604_0041, "object cannot be mapped to the PDO"),
        (0x0604_0042, "number and length of the mapped objects would exceed the PDO's length"),
        (0x0609_0011, "sub-index does not exist"),
        (0x0609_0030, "invalid value for the parameter"),
        (0x0800_0022, "data cannot be transferred or stored because of the present device state"),
    ],
)
def test_texts(code: int, text: str) -> None:
    assert abort_text(code) == text


def test_every_code_we_reason_about_has_words() -> None:
    assert not [code for code in Abort if abort_text(code) == "unknown abort code"]


def test_unknown_codes_are_said_to_be_unknown() -> None:
    assert abort_text(0x0123_4567) == "unknown abort code"
