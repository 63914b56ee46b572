"""Documents of a stream are the lines that `json.dumps` makes of each."""

from __future__ import annotations

import json
from io import StringIO

import pytest
from hypothesis import given
from hypothesis import strategies as st

from dvtcli.cli.view.output import Output
from dvtcli.domain.hint import Action, Hint

values = st.recursive(
    st.none() | st.booleans() | st.integers() | st.floats(allow_nan=False) | st.text(),
    lambda inner: st.lists(inner, max_size=3) | st.dictionaries(st.text(), inner, max_size=3),
    max_leaves=8,
)


def streamed(*documents: dict[str, object]) -> list[str]:
    out = StringIO()
    Output(out, StringIO()).documents(documents)
    return out.getvalue().splitlines()


@given(st.lists(st.dictionaries(st.text(), values, max_size=4), max_size=3))
def test_each_is_a_line(documents: list[dict[str, object]]) -> None:
    assert streamed(*documents) == [json.dumps(document, separators=(",", ":")) for document in documents]


def test_a_hint_is_a_text() -> None:
    (line,) = streamed({"hint": Hint(Action.SHOW_PDOS, why="shows them: {}")})
    assert "shows them: " in json.loads(line)["hint"]


def test_what_no_document_can_hold_is_an_error() -> None:
    with pytest.raises(TypeError):
        streamed({"data": b"1"})
