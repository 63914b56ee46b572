"""Change values of an XDC; every other byte of the file stays."""

from __future__ import annotations

import codecs
import re
from collections import Counter
from collections.abc import Iterator, Mapping
from dataclasses import replace
from xml.sax.saxutils import escape

from dvtcli.domain.object_dictionary import OdEntry
from dvtcli.domain.text import safe
from dvtcli.errors import InputFileError
from dvtcli.files.dcf.write_dcf import DcfText, Place, refuse_unlike_values, value_text
from dvtcli.files.eds.findings import Findings
from dvtcli.files.eds.written_values import same_value
from dvtcli.files.xdd.xdd_parameters import Parameter
from dvtcli.files.xdd.xdd_reader import XddFile, number_of, parse_xdd
from dvtcli.files.xdd.xml_tree import XmlElement

_ACTUAL, _DEFAULT, _REFERENCE = "actualValue", "defaultValue", "uniqueIDRef"
#: encodings in which a letter of a tag has more than one byte
_WIDE = (codecs.BOM_UTF16_LE, codecs.BOM_UTF16_BE, b"<\0", b"\0<")
_ATTRIBUTE = re.compile(rb"""\s+([^\s=<>/"']+)\s*=\s*("[^"<]*"|'[^'<]*')""")
_TAG = re.compile(rb"<[^\s<>/]+")
_QUOTES = {'"': "&quot;"}


def change_values(data: bytes, source: str, values: Mapping[Place, bytes], node_id: int) -> DcfText:
    """Return the XDC *data* (named *source*) with those of *values* that it does not mean already.

    *values* of *node_id* go by index and sub-index. Raises InputFileError if *data* is no XDC, is in UTF-16, or a value
    does not read back.
    """
    if data.startswith(_WIDE):
        raise InputFileError(f"{source} is in UTF-16, in which values cannot be changed", place=f"{source}:1")
    xdc = parse_xdd(data, source)
    writer = _Writer(xdc, data)
    described = dict(_elements(xdc))
    left_out = dict.fromkeys(values.keys() - described.keys(), "the file does not describe it")
    told: dict[Place, bytes] = {}
    changes: dict[Place, bytes] = {}
    for (index, sub_index), element in described.items():
        entry = xdc.dictionary[index].entries[sub_index]
        if (value := replace(entry, default=None).initial(node_id)) is not None:
            told[index, sub_index] = value
        wanted = values.get((index, sub_index))
        if wanted is None or same_value(entry.data_type, entry.initial(node_id), wanted):
            continue
        try:
            writer.write(element, entry, wanted)
        except ValueError as why:
            left_out[index, sub_index] = str(why)
        else:
            changes[index, sub_index] = wanted
    made = writer.to_bytes()
    refuse_unlike_values(parse_xdd(made, source).dictionary, told | changes, node_id)
    return DcfText(made, tuple(changes), left_out)


def _elements(xdc: XddFile) -> Iterator[tuple[Place, XmlElement]]:
    """Iterate over the entries of the dictionary, each with the element that describes it."""
    unread = Findings()
    for index, element in xdc.objects.items():
        entries = xdc.dictionary[index].entries
        subs: dict[int | None, XmlElement] = {}
        for sub in element.all("CANopenSubObject"):
            subs.setdefault(number_of(sub, "subIndex", 0xFF, unread), sub)
        for sub_index in entries:
            yield (index, sub_index), subs.get(sub_index, element)


class _Writer:
    """The XDC *xdc* with changed attributes in its *data*."""

    def __init__(self, xdc: XddFile, data: bytes) -> None:
        self._parameters, self._data = xdc.parameters, data
        self._references = Counter(
            item.attributes.get(_REFERENCE, "")
            for element in xdc.objects.values()
            for item in (element, *element.all("CANopenSubObject"))
        )
        #: new bytes by where those begin and end that they replace
        self._edits: dict[tuple[int, int], bytes] = {}

    def write(self, element: XmlElement, entry: OdEntry, wanted: bytes) -> None:
        """Let *element* and its parameter, if that has a value, say *wanted*; raises ValueError with the reason."""
        name = element.attributes.get(_REFERENCE, "")
        parameter = self._parameters.get(name) if name else None
        own, of_parameter = element.attributes.get(_ACTUAL), _actual_of(parameter)
        like = own or ("" if parameter is None else parameter.value(_ACTUAL)) or element.attributes.get(_DEFAULT, "")
        text = value_text(entry.data_type, wanted, like)
        if safe(text) != text or not text.isascii():
            raise ValueError("it has characters that an attribute of the file cannot have")
        if of_parameter is not None and self._references[name] == 1:
            self._set(of_parameter, "value", text)
            if own is None:
                return
        elif own is None and parameter is not None and parameter.value(_ACTUAL) is not None:
            others = "which other objects have, too" if of_parameter is not None else "which has it from its template"
            raise ValueError(f"its value is that of the parameter {name}, {others}")
        self._set(element, _ACTUAL, text)

    def _set(self, element: XmlElement, name: str, text: str) -> None:
        """Let the attribute *name* of *element* be *text*; a new one stands behind the default value, else last."""
        tag = _TAG.match(self._data, element.start)
        if tag is None:
            raise AssertionError(f"no tag begins at {element.start}")
        at = last = tag.end()
        while (found := _ATTRIBUTE.match(self._data, at)) is not None:
            at = found.end()
            local = found[1].rpartition(b":")[2].decode("latin-1")
            if local == name:
                self._edits[found.start(2), found.end(2)] = _quoted(text)
                return
            if local == _DEFAULT:
                last = at
        place = last if last != tag.end() else at
        self._edits[place, place] = b" " + name.encode() + b"=" + _quoted(text)

    def to_bytes(self) -> bytes:
        """Return the file with its edits."""
        pieces, at = [], 0
        for (begin, end), new in sorted(self._edits.items()):
            pieces += [self._data[at:begin], new]
            at = end
        return b"".join([*pieces, self._data[at:]])


def _actual_of(parameter: Parameter | None) -> XmlElement | None:
    """Return the element with the actual value of *parameter* itself, not of its template."""
    return None if parameter is None else parameter.element.first(_ACTUAL)


def _quoted(text: str) -> bytes:
    return f'"{escape(text, _QUOTES)}"'.encode("ascii")
