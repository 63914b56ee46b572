"""A named tuple is one value: a plain tuple alone stands for several."""

from __future__ import annotations

from dataclasses import dataclass
from typing import NamedTuple

import pytest

from dvtcli.cli.command import _names_node, _notation_notes
from dvtcli.cli.view.typed_hints import TypedCall, TypedHints
from dvtcli.domain.hint import Action, Hint, filled
from dvtcli.operations.results.documents import brief

ON_A_LINE = TypedCall(("-c", "can0"), alone=True)


class Word(NamedTuple):
    """A word of a line as a command could read it."""

    text: str
    node_id: int | None = None
    notation_note: str | None = None

    def __str__(self) -> str:
        return self.text


@dataclass(frozen=True)
class Row:
    """A part of a result."""

    word: Word
    words: tuple[Word, ...] = ()


def test_a_hint_fills_it_in_as_one_word() -> None:
    one, other = Word("6041", 5), Word("606C", 5)
    assert filled("map {objects}", {"objects": one}) == ["map", "6041"]
    assert filled("map {objects}", {"objects": (one, other)}) == ["map", "6041", "606C"]


def test_a_typed_hint_marks_it_as_no_option() -> None:
    hint = Hint(Action.READ, {"object": Word("-speed")})
    assert TypedHints(lambda: ON_A_LINE).text(hint) == "`dvtcli -c can0 read -- -speed`"


def test_a_typed_hint_selects_it_as_one_node() -> None:
    hints = TypedHints(lambda: ON_A_LINE)
    assert hints.text(Hint(Action.STORE, {"node": Word("5", 5)})) == "`dvtcli -c can0 -n 5 store`"
    assert hints.text(Hint(Action.STORE, {"node": (5, 7)})) == "`dvtcli -c can0 -n 5,7 store`"


@pytest.mark.parametrize("several", [False, True])
def test_a_command_asks_it_for_its_node_and_its_note(*, several: bool) -> None:
    word = Word("5:6041", 5, "read as hexadecimal")
    values = [(word,)] if several else [word]
    assert _names_node(values)
    assert list(_notation_notes(values)) == ["read as hexadecimal"]
    assert not _names_node([Word("6041")])


def test_a_result_prints_it_and_counts_the_items_of_a_tuple() -> None:
    assert brief(Row(Word("6041"))) == "Row(word=6041)"
    assert brief(Row(Word("6041"), (Word("606C"), Word("60FF")))) == "Row(word=6041, words=2 in all)"
