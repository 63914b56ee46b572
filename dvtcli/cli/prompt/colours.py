"""Colours of the line being typed: a known command, an unknown one, options, hexadecimal numbers."""

from __future__ import annotations

import re
from collections.abc import Callable, Iterable

from prompt_toolkit.document import Document
from prompt_toolkit.formatted_text import StyleAndTextTuples
from prompt_toolkit.lexers import Lexer

from dvtcli.cli.catalogue import command_names

_WORDS = re.compile(r"\s+|\S+")
_HEXADECIMAL = re.compile(r"0x[0-9a-f]+(:[0-9a-fx]+)?|[0-9a-f]{4}(:[0-9a-f]{1,2})?", re.IGNORECASE)


class LineLexer(Lexer):
    """Styles the words of a line; *aliases* are known as commands are. While *is_plain*() nothing is styled."""

    def __init__(self, aliases: Iterable[str], is_plain: Callable[[], bool] = lambda: False) -> None:
        self._is_plain = is_plain
        self._commands = frozenset({*command_names(), *aliases})

    def lex_document(self, document: Document) -> Callable[[int], StyleAndTextTuples]:
        """The styled words of each line of *document*."""
        lines = document.lines

        def styled(number: int) -> StyleAndTextTuples:
            if self._is_plain():
                return [("", lines[number])]
            return self._styled(lines[number], first=not number or not lines[number - 1].endswith("\\"))

        return styled

    def _styled(self, line: str, *, first: bool) -> StyleAndTextTuples:
        styled: StyleAndTextTuples = []
        for word in _WORDS.findall(line):
            styled.append((self._style(word, first=first), word))
            first = first and word.isspace()
        return styled

    def _style(self, word: str, *, first: bool) -> str:
        if word.isspace():
            return ""
        if first:
            return "class:command" if word in self._commands else "class:unknown"
        if word.startswith("--") or word in ("|", ">", ">>"):
            return "class:option"
        return "class:number" if _HEXADECIMAL.fullmatch(word) else ""
