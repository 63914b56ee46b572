"""One PDO as text: what is written is read back, and what is wrong is said with its line."""

from __future__ import annotations

from contextlib import suppress

import pytest
from hypothesis import given
from hypothesis import strategies as st

from dvtcli.domain.cob_id import CobId
from dvtcli.domain.pdo import Direction, Pdo, PdoCommunicationParameter, PdoConfig, PdoMappingEntry
from dvtcli.errors import InputFileError
from dvtcli.files.pdo_yaml import MappingWord, PdoText, read_pdo_yaml, write_pdo_yaml

TPDO1 = Pdo(Direction.TPDO, 1)


NUMBERS = st.tuples(
    st.none() | st.integers(0, 255), st.none() | st.integers(0, 0xFFFF), st.none() | st.integers(0, 0xFFFF),
    st.none() | st.integers(0, 240),
)  # fmt: skip
OBJECTS = st.lists(st.tuples(st.integers(8, 0xFFFF), st.integers(0, 255), st.integers(0, 255)), max_size=8)


@given(st.integers(1, 0x1FFFFFFF), st.booleans(), st.booleans(), NUMBERS, OBJECTS, st.text(max_size=20))
def test_what_is_written_is_read_back(
    can_id: int,
    valid: bool,
    rtr: bool,
    numbers: tuple[int | None, int | None, int | None, int | None],
    objects: list[tuple[int, int, int]],
    name: str,
) -> None:
    cob_id = CobId(can_id, valid=valid, rtr_allowed=rtr, extended=can_id > 0x7FF)
    mapping = tuple(PdoMappingEntry(*entry) for entry in objects)
    config = PdoConfig(PdoCommunicationParameter(cob_id, *numbers), mapping)
    text = write_pdo_yaml(TPDO1, config, [name] * len(mapping), name)
    words = tuple(map(str, mapping))
    read = read_pdo_yaml(text, TPDO1)
    assert tuple(word.text for word in read.mapping or ()) == words
    assert (read.cob_id, read.enabled, read.rtr_allowed, read.extended) == (can_id, valid, rtr, can_id > 0x7FF)
    assert (read.transmission_type, read.inhibit_time, read.event_timer, read.sync_start_value) == numbers


def test_values_are_read_as_they_stand() -> None:
    text = "mapping:\n  - 6041\n  - 606C:00/32\n  - 'velocity'\ncob_id: AUTO\ntype: 0x1\nenabled: off\n"
    read = read_pdo_yaml(text, TPDO1)
    assert read.mapping == (MappingWord("6041", 2), MappingWord("606C:00/32", 3), MappingWord("velocity", 4))
    assert (read.cob_id, read.transmission_type, read.enabled) == ("auto", 1, False)
    assert read_pdo_yaml("type: 1\n", TPDO1) == PdoText(transmission_type=1)
    assert read_pdo_yaml("mapping:\n", TPDO1).mapping == ()


@pytest.mark.parametrize(
    ("text", "line", "says"),
    [
        ("type: 1\ntype: 2\n", 2, "is in line 1 already"),
        ("type: 1\ninhibt_ms: 2\n", 2, "did you mean 'inhibit_ms'?"),
        ("\n\ntype: 256\n", 3, "0…255"),
        ("inhibit_ms: 0.05\n", 1, "steps of 0.1"),
        ("type: nan\n", 1, "nan"),
        ("inhibit_ms: nan\n", 1, "nan"),
        ("pdo: tpdo2\n", 1, "about tpdo1"),
        ("cob_id: 201\n", 1, "0x"),
        ("enabled: maybe\n", 1, "true or false"),
        ("mapping: 6041\n", 1, "list"),
        ("mapping:\n  - [6041]\n", 2, "one value"),
        ("type: 1\n mapping: [\n", 2, ""),
        ("- 6041\n", 1, "key: value"),
        ("", 1, "key: value"),
        ("a: 1\n---\nb: 2\n", 1, ""),
        ("type: \x00\n", 1, ""),
    ],
)
def test_what_is_wrong_is_said_with_its_line(text: str, line: int, says: str) -> None:
    with pytest.raises(InputFileError) as caught:
        read_pdo_yaml(text, TPDO1)
    assert caught.value.place is not None
    assert caught.value.place.startswith("line ")
    if says:
        assert caught.value.place == f"line {line}"
        assert says in caught.value.text


@given(st.text(max_size=200))
def test_any_text_is_read_or_refused(text: str) -> None:
    with suppress(InputFileError):  # any other error fails the test
        assert isinstance(read_pdo_yaml(text, TPDO1), PdoText)
