"""Parse the XML of XDD and XDC files: bytes -> elements by local names, each with its line.

Refuses a document type, and with it all entity definitions, and files larger than any device needs. Keeps the root's
namespace only: CiA 311 has global elements in a namespace and local elements in none, and files differ.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, field
from typing import NamedTuple, NoReturn
from xml.parsers import expat

from dvtcli.errors import InputFileError

#: A file is some 200 kB, with some thousand elements, ten deep.
MOST_BYTES = 16 << 20
_MOST_ELEMENTS = 300_000
_MOST_DEPTH = 64
_MOST_ATTRIBUTES = 100
_SEPARATOR = " "


@dataclass(slots=True)
class XmlElement:
    """An element: local *name*, *line* (from 1), attributes and child elements; *text* is its own characters.

    *start* is the number of bytes before it in the file.
    """

    name: str
    line: int
    attributes: dict[str, str]
    children: list[XmlElement] = field(default_factory=list)
    text: str = ""
    start: int = 0

    def all(self, name: str) -> list[XmlElement]:
        """The children called *name*."""
        return [child for child in self.children if child.name == name]

    def first(self, *path: str) -> XmlElement | None:
        """Return the element at *path*, the first child of each name; None if absent."""
        found: XmlElement | None = self
        for name in path:
            found = next((child for child in found.children if child.name == name), None) if found else None
        return found

    def anywhere(self, name: str) -> Iterator[XmlElement]:
        """Iterate over this element and all below it named *name*, in order."""
        left = [self]
        while left:
            one = left.pop()
            if one.name == name:
                yield one
            left += reversed(one.children)

    def said(self, name: str) -> str:
        """Return the stripped text of the first child *name*; empty if absent."""
        found = self.first(name)
        return "" if found is None else found.text.strip()


class XmlTree(NamedTuple):
    """A whole file: *root*, the root's namespace, and the types named by its elements (`xsi:type`)."""

    root: XmlElement
    namespace: str
    types: frozenset[str]


def read_xml(data: bytes, source: str) -> XmlTree:
    """Parse the elements of *data*; *source* is its name for messages.

    Raises InputFileError for malformed XML, a document type, or more size or depth than any device needs.
    """
    if len(data) > MOST_BYTES:
        why = "an XDD or XDC is some 200 kB"
        raise InputFileError(f"{source} is larger than {MOST_BYTES >> 20} MiB", place=f"{source}:1", why=why)
    return _XmlReading(source).read(data)


class _XmlReading:
    """A file being parsed."""

    def __init__(self, source: str) -> None:
        self._source = source
        self._open: list[XmlElement] = []
        self._texts: list[list[str]] = []
        self._count = 0
        self._root: XmlElement | None = None
        self._namespace = ""
        self._types: set[str] = set()
        parser = self._parser = expat.ParserCreate(namespace_separator=_SEPARATOR)
        parser.buffer_text = True
        parser.StartDoctypeDeclHandler = self._document_type
        parser.StartElementHandler = self._start
        parser.EndElementHandler = self._end
        parser.CharacterDataHandler = self._characters

    def read(self, data: bytes) -> XmlTree:
        try:
            self._parser.Parse(data, True)
        except expat.ExpatError as wrong:
            column = f":{wrong.offset + 1}"
            raise InputFileError(
                f"{self._source} is not well-formed XML",
                place=f"{self._source}:{wrong.lineno}{column}",
                why=expat.ErrorString(wrong.code) or str(wrong),
            ) from None
        except (LookupError, ValueError) as wrong:  # an encoding that nobody knows, or of several bytes a letter
            raise InputFileError(
                f"{self._source}: its encoding is not known", place=f"{self._source}:1", why=str(wrong)
            ) from None
        if self._root is None:
            raise AssertionError("without a first element the parser has refused the file")
        return XmlTree(self._root, self._namespace, frozenset(self._types))

    def _fail(self, text: str, why: str) -> NoReturn:
        place = f"{self._source}:{self._parser.CurrentLineNumber}"
        raise InputFileError(f"{self._source} {text}", place=place, why=why)

    def _document_type(self, name: str, *_: object) -> None:
        self._fail(
            f"has a document type (<!DOCTYPE {name[:40]}>)",
            "an XDD or XDC has none; entities that a file defines are not read",
        )

    def _start(self, name: str, attributes: dict[str, str]) -> None:
        space, _, local = name.rpartition(_SEPARATOR)
        self._count += 1
        if self._count > _MOST_ELEMENTS:
            self._fail(f"has more than {_MOST_ELEMENTS} elements", "an XDD or XDC has some thousand")
        if len(self._open) >= _MOST_DEPTH or len(attributes) > _MOST_ATTRIBUTES:
            self._fail(
                f"is nested deeper than {_MOST_DEPTH} elements, or an element has very many attributes", "no XDD is"
            )
        named = {key.rpartition(_SEPARATOR)[2]: value for key, value in attributes.items()}
        element = XmlElement(local, self._parser.CurrentLineNumber, named, start=self._parser.CurrentByteIndex)
        if self._open:
            self._open[-1].children.append(element)
        else:
            self._root, self._namespace = element, space
        if "type" in named and len(self._types) < _MOST_ATTRIBUTES:
            self._types.add(named["type"])
        self._open.append(element)
        self._texts.append([])

    def _end(self, _name: str) -> None:
        self._open.pop().text = "".join(self._texts.pop())

    def _characters(self, text: str) -> None:
        self._texts[-1].append(text)
