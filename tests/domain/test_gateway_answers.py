"""Answers in both dialects look as in the field, and stay one line of ASCII whatever a node says."""

from __future__ import annotations

import re

from hypothesis import given
from hypothesis import strategies as st

from dvtcli.domain.gateway_words import Dialect, Done, Failed, GatewayError, format_answer


@given(st.none() | st.integers(0, 0xFFFF_FFFF), st.sampled_from(Dialect), st.text(max_size=400),
       st.sampled_from(GatewayError).map(int) | st.integers(0x0500_0000, 0x0FFF_FFFF))  # fmt: skip
def test_a_failure_is_one_line_with_its_code(sequence: int | None, dialect: Dialect, text: str, code: int) -> None:
    line = format_answer(sequence, Failed(code, text), dialect)
    assert line.isascii()
    assert line.isprintable()
    head = "" if sequence is None else rf"\[{sequence}\] "
    digits = str(code) if code < 1000 else f"{code:08X}"
    form = rf"{head}ERROR: {digits} \(.*\)" if dialect is Dialect.PAREN else rf"{head}ERROR:(0x)?{digits} #.*"
    assert re.fullmatch(form, line)


def test_answers_look_as_in_the_field() -> None:
    refused, syntax = Failed(0x0602_0000), Failed(101)
    assert format_answer(1, Done()) == "[1] OK"
    assert format_answer(1, Done("500")) == "[1] 500"
    assert format_answer(1, refused) == "[1] ERROR:0x06020000 #object does not exist in the object dictionary"
    said = "[1] ERROR: 06020000 (object does not exist in the object dictionary)"
    assert format_answer(1, refused, Dialect.PAREN) == said
    assert format_answer(1, syntax) == "[1] ERROR:101 #Syntax error"
    assert format_answer(None, syntax, Dialect.PAREN) == "ERROR: 101 (Syntax error)"
    assert format_answer(1, Failed(102, "a\nb\x1b[2J")) == "[1] ERROR:102 #a?b?[2J"
