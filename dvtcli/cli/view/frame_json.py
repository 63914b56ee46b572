"""Frames as JSON on one line each, in half the time of their documents: a CAN-ID's constant parts are encoded once."""

from __future__ import annotations

from collections.abc import Callable
from functools import lru_cache
from typing import TYPE_CHECKING, Any

from dvtcli.domain.times import utc
from dvtcli.operations.results.documents import hex_bytes, json_value, physical_document
from dvtcli.operations.results.frames import FrameSeen, reading_document

if TYPE_CHECKING:
    from dvtcli.domain.datatypes import Value
    from dvtcli.domain.scaling import Scaling
    from dvtcli.watch.frame_reader import Reading

Encode = Callable[[Any], str]
#: stands for a changing value when the constant parts are encoded; none of the parts before them comes from a file
_CHANGING = "changing"
#: values of a signal whose text is kept: most signals keep a value for many frames
_REMEMBERED = 64


class FrameJson:
    """The text of each frame's document, `dvtcli.frame/1`; *encode* makes the JSON text of any value."""

    def __init__(self, encode: Encode) -> None:
        self._encode = encode
        #: by CAN-ID, and names of the signals: a short frame lacks the last ones
        self._templates: dict[tuple[int, bool, tuple[str, ...]], _Template] = {}

    def text(self, seen: FrameSeen) -> str:
        """The JSON text of `seen.document()`."""
        if not seen.signals:
            return self._encode(seen.document())
        key = seen.frame.can_id, seen.frame.extended, tuple(seen.signals)
        template = self._templates.get(key)
        if template is None or not template.is_of(seen):
            template = self._templates[key] = _Template(seen, self._encode)
        return template.text(seen)


class _Template:
    """The constant parts of the documents of one CAN-ID's frames, from its frame *first*."""

    def __init__(self, first: FrameSeen, encode: Encode) -> None:
        self._first, self._encode = first, encode
        changing = dict.fromkeys(("time", "data", "signals", "physical"), _CHANGING)
        words = reading_document(first.reading)
        constant = {key: value for key, value in (first.document() | changing).items() if key not in words}
        self._parts = encode(constant).removesuffix("}").split(f'"{_CHANGING}"', len(changing))
        scaled = {name: meaning for name, meaning in first.scalings.items() if name in first.signals}
        self._physical = [(name, _physical_text(name, meaning, encode)) for name, meaning in scaled.items()]
        self._reading, self._words = first.reading, self._words_of(first.reading)

    def is_of(self, seen: FrameSeen) -> bool:
        """Whether the constant parts are those of *seen*, too."""
        first = self._first
        return (
            seen.scalings is first.scalings
            and seen.objects is first.objects
            and seen.layout_from is first.layout_from
            and seen.layout_is_guess is first.layout_is_guess
            and (seen.kind, seen.node, seen.pdo) == (first.kind, first.node, first.pdo)
            and seen.frame.remote is first.frame.remote
        )

    def text(self, seen: FrameSeen) -> str:
        """The JSON text of *seen*, a frame with these constant parts."""
        if seen.reading is not self._reading:
            self._reading, self._words = seen.reading, self._words_of(seen.reading)
        before, after_time, after_data, after_signals, rest = self._parts
        signals = seen.signals
        values = self._encode({name: json_value(value) for name, value in signals.items()})
        physical = ",".join([text(signals[name]) for name, text in self._physical])
        return (
            f'{before}"{utc(seen.frame.timestamp_s)}"{after_time}"{hex_bytes(seen.frame.data)}"{after_data}{values}'
            f"{after_signals}{{{physical}}}{rest},{self._words}"
        )

    def _words_of(self, reading: Reading) -> str:
        return self._encode(reading_document(reading)).removeprefix("{")


def _physical_text(name: str, meaning: Scaling, encode: Encode) -> Callable[[Value], str]:
    """What returns the text of `physical_document` of a value, after the signal's *name*."""
    key = f"{encode(name)}:"
    if not meaning.has_number or meaning.values or meaning.states or meaning.bits:
        return lambda value: key + encode(physical_document(value, meaning))
    unit = encode(f" {meaning.unit}".rstrip())[1:-1]
    before, after = f'{key}{{"value":', f'{unit}","bits":[]}}'
    between = f',"unit":{encode(meaning.unit)},"text":"'

    @lru_cache(maxsize=_REMEMBERED)
    def text_of_integer(value: int) -> str:
        return f"{before}{meaning.number(value)!r}{between}{meaning.number_text(value)}{after}"

    def text(value: Value) -> str:
        if type(value) is int:
            return text_of_integer(value)
        # a REAL may be infinite, or -0.0, which equals 0.0; a BOOLEAN has another text
        return key + encode(physical_document(value, meaning))

    return text
