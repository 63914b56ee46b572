"""Rules about keys: keys unknown to the standard, and keys without effect at their place."""

from __future__ import annotations

import re
from collections.abc import Collection, Iterator
from difflib import get_close_matches

from dvtcli.domain.lint import NOTE, WARNING, check
from dvtcli.files.eds.ini import IniValue
from dvtcli.files.eds.keys import KEYS, OBJECT
from dvtcli.files.eds.linted_text import Found, LintedText, is_head

SECTIONS = {
    name.lower(): name
    for name in ("FileInfo", "DeviceInfo", "DummyUsage", "Comments", "DeviceComissioning", "MandatoryObjects",
                 "OptionalObjects", "ManufacturerObjects", "SupportedModules", "ConnectedModules", "StandardDataTypes",
                 "DynamicChannels", "Tools")
}  # fmt: skip
_NEARLY_OBJECT = re.compile(r"(0x)?[0-9a-f]{3,5}h?((sub|s)[0-9a-z]*|_[0-9a-z]+|:[0-9a-z]+)?")
#: Keys of entries: in an object with sub-indices they belong to these.
_OF_ENTRIES = ("datatype", "accesstype", "defaultvalue", "lowlimit", "highlimit", "pdomapping", "parametervalue")
#: Maximum number of keys to check for misspelling; further keys are reported as unknown.
_MOST_LOOKED_UP = 200
_LONGEST = 40
#: BaudRate_100 is another key than BaudRate_10, and no slip of the pen.
_NUMBER = re.compile(r"\d+")


@check("misspelt-key", WARNING, "a key that is nearly one of the standard's: it is not read", "CiA 306, 4.4 to 4.6")
def misspelt_key(text: LintedText) -> Found:
    """The intended value is missing."""
    for value, near in unknown_keys(text):
        if near:
            yield value.line, f"{value.key} is unknown; did you mean {near}?"


@check("unknown-key", NOTE, "a key that the standard does not have", "CiA 306, 4.4 to 4.6")
def unknown_key(text: LintedText) -> Found:
    """Most likely a tool's private key; kept unchanged."""
    for value, near in unknown_keys(text):
        if not near:
            yield value.line, f"{value.key} is not known"


@check(
    "misspelt-section", WARNING, "a section that is nearly one of the standard's: it is not read", "CiA 306, 4.4 to 4.8"
)
def misspelt_section(text: LintedText) -> Found:
    """The intended section is missing."""
    for section in text.file.layout.stray[:_MOST_LOOKED_UP]:
        name = section.name.replace(" ", "").lower()
        near = get_close_matches(name, SECTIONS, 1, 0.8) if len(name) <= _LONGEST else []
        if near:
            yield section.line, f"[{section.name}] is unknown; did you mean [{SECTIONS[near[0]]}]?"
        elif _NEARLY_OBJECT.fullmatch(name):
            yield section.line, f"[{section.name}] is not an object; write [XXXX] or [XXXXsubYY] in hexadecimal"


@check("no-sub-number", NOTE, "an object with sub-indices has no SubNumber", "CiA 306, 4.6.3: SubNumber")
def no_sub_number(text: LintedText) -> Found:
    """Readers that rely on SubNumber find no sub-index."""
    for entry in text.objects:
        if (
            entry.sub_index is None
            and entry.index in text.of_many
            and not entry.values.keys() & {"subnumber", "compactsubobj"}
        ):
            yield entry.section.line, "no SubNumber, but sub-indices"


@check(
    "key-without-effect", NOTE, "an object with sub-indices has keys that only sub-indices may have", "CiA 306, 4.6.3"
)
def key_without_effect(text: LintedText) -> Found:
    """The key applies to none of the sub-indices."""
    for entry in text.objects:
        if is_head(text, entry):
            for key in _OF_ENTRIES:
                if key in entry.values:
                    value = entry.values[key]
                    yield value.line, f"{value.key} says nothing here: the sub-indices have their own"


def unknown_keys(text: LintedText) -> Iterator[tuple[IniValue, str]]:
    """Iterate over values of unknown keys, each with the most similar known key, or an empty text."""
    seen: dict[tuple[str, str], str] = {}
    sections = [(name, text.values(name).items()) for name in KEYS if name != OBJECT]
    for name, values in [*sections, *((OBJECT, entry.values.items()) for entry in text.objects)]:
        known = _LOWER[name]
        for key, value in values:
            if key not in known:
                if (name, key) not in seen:
                    looked_up = len(seen) < _MOST_LOOKED_UP and len(key) <= _LONGEST
                    seen[name, key] = _nearest(key, known) if looked_up else ""
                yield value, seen[name, key]


def _nearest(key: str, known: Collection[str]) -> str:
    near = get_close_matches(key.replace(" ", ""), known, 1, 0.8)
    is_same_number = bool(near) and _NUMBER.findall(key) == _NUMBER.findall(near[0])
    return _SPELLED[near[0]] if is_same_number else ""


_LOWER = {name: frozenset(key.lower() for key in keys) for name, keys in KEYS.items()}
_SPELLED = {key.lower(): key for keys in KEYS.values() for key in keys}
