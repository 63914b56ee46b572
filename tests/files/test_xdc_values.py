"""Values that are changed in an XDC: what changes, what stays byte for byte, and what cannot be said."""

from __future__ import annotations

import re

import pytest
from hypothesis import given
from hypothesis import strategies as st

from dvtcli.errors import InputFileError
from dvtcli.files.device_file import change_values
from dvtcli.files.xdd.xdd_reader import parse_xdd
from tests.small_xdd import COMMISSIONING, OBJECTS, record, variable, xdd

#: an object whose values stand in its parameter, and two objects that share a parameter
PARAMETERS = (
    '<parameter uniqueID="own"><defaultValue value="3"/><actualValue value="4"/></parameter>'
    '<parameter uniqueID="shared"><actualValue value="5"/></parameter>'
)
REFERRING = (
    variable(0x2000, "By parameter", "0006", "rw", uniqueIDRef="own")
    + variable(0x2001, "First", "0006", "rw", uniqueIDRef="shared")
    + variable(0x2002, "Second", "0006", "rw", uniqueIDRef="shared")
    + variable(0x2003, "Both", "0006", "rw", actualValue="7")
)
XDC = xdd(OBJECTS + REFERRING, PARAMETERS, commissioning=COMMISSIONING)
#: objects with a value that can be changed, each with its bytes
CHANGED = {
    (0x1018, 1): 4,
    (0x1400, 1): 4,
    (0x1400, 2): 1,
    (0x1A00, 1): 4,
    (0x2000, 0): 2,
    (0x2003, 0): 2,
    (0x6200, 0): 1,
}
VALUE = re.compile(rb'(?: actualValue=| value=)"[^"]*"')


def value_of(data: bytes, index: int, sub_index: int) -> bytes | None:
    entry = parse_xdd(data, "n.xdc").dictionary.entry(index, sub_index)
    return None if entry is None else entry.initial(7)


@given(
    st.fixed_dictionaries({}, optional={place: st.binary(min_size=n, max_size=n) for place, n in CHANGED.items()}),
    st.sampled_from(["utf-8", "utf-8-sig", "iso-8859-1"]),
    st.sampled_from(["\n", "\r\n"]),
)
def test_a_changed_xdc_says_the_values_and_everything_else_stays(
    values: dict[tuple[int, int], bytes], encoding: str, line_end: str
) -> None:
    text = XDC.replace("Pump 7", "Pümpe 7").replace('encoding="utf-8"', f'encoding="{encoding.removesuffix("-sig")}"')
    data = text.replace("\n", line_end).encode(encoding)
    made = change_values(data, "n.xdc", values, 7)
    assert not made.left_out
    assert {place: value_of(made.data, *place) for place in values} == values
    others = CHANGED.keys() - values.keys() | {(0x1800, 1), (0x2001, 0), (0x2002, 0)}
    assert all(value_of(made.data, *place) == value_of(data, *place) for place in others)
    assert VALUE.sub(b"", made.data) == VALUE.sub(b"", data)
    assert change_values(made.data, "n.xdc", values, 7).data == made.data


def test_a_value_of_a_parameter_is_changed_there() -> None:
    made = change_values(XDC.encode(), "n.xdc", {(0x2000, 0): b"\x09\0"}, 7).data.decode()
    assert made == XDC.replace('<actualValue value="4"/>', '<actualValue value="9"/>')


def test_a_value_beside_that_of_a_parameter_is_changed_in_both() -> None:
    text = XDC.replace('uniqueIDRef="own"', 'uniqueIDRef="own" actualValue="0x0004"')
    made = change_values(text.encode(), "n.xdc", {(0x2000, 0): b"\x09\0"}, 7).data
    assert made == text.replace('value="4"', 'value="0x0009"').replace('"0x0004"', '"0x0009"').encode()


def test_a_value_of_a_shared_parameter_is_left_out_and_named() -> None:
    made = change_values(XDC.encode(), "n.xdc", {(0x2001, 0): b"\x09\0"}, 7)
    assert made.data == XDC.encode()
    assert dict(made.left_out) == {
        (0x2001, 0): "its value is that of the parameter shared, which other objects have, too"
    }


def test_a_value_of_a_template_is_left_out_and_named() -> None:
    """The parameter itself has none, and no other object refers to it."""
    parameters = (
        '<parameterTemplate uniqueID="template"><actualValue value="5"/></parameterTemplate>'
        '<parameter uniqueID="own" templateIDRef="template"/>'
    )
    text = xdd(OBJECTS + variable(0x2000, "Own", "0006", "rw", uniqueIDRef="own"), parameters).encode()
    made = change_values(text, "n.xdc", {(0x2000, 0): b"\x09\0"}, 7)
    assert made.data == text
    assert dict(made.left_out) == {
        (0x2000, 0): "its value is that of the parameter own, which has it from its template"
    }


def test_what_the_file_does_not_describe_is_left_out_and_named() -> None:
    made = change_values(XDC.encode(), "n.xdc", {(0x3000, 0): b"\x09\0"}, 7)
    assert dict(made.left_out) == {(0x3000, 0): "the file does not describe it"}


def test_a_value_that_is_the_default_already_is_not_added() -> None:
    assert change_values(XDC.encode(), "n.xdc", {(0x1800, 1): (0x187).to_bytes(4, "little")}, 7).data == XDC.encode()


def test_the_first_of_two_sub_indices_counts_as_it_is_read() -> None:
    twice = record(0x2100, "Twice", (0, "0005", "ro", 1), (1, "0005", "rw", 4), (1, "0005", "rw", 6))
    text = xdd(OBJECTS + twice, commissioning=COMMISSIONING)
    made = change_values(text.encode(), "n.xdc", {(0x2100, 1): b"\x09"}, 7).data.decode()
    assert made == text.replace('defaultValue="4"', 'defaultValue="4" actualValue="9"')


@pytest.mark.parametrize("encoding", ["utf-16", "utf-16-le", "utf-16-be"])
def test_an_xdc_in_utf_16_is_refused(encoding: str) -> None:
    data = XDC.replace('encoding="utf-8"', 'encoding="utf-16"').encode(encoding)
    with pytest.raises(InputFileError, match=r"n\.xdc is in UTF-16, in which values cannot be changed"):
        change_values(data, "n.xdc", {}, 7)
