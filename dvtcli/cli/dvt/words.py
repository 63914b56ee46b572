"""The DVT's words, from the files that declare them; read by click, Tcl, help and completion."""

from __future__ import annotations

from dvtcli.cli.dvt import pdo_words, single_sdos, state
from dvtcli.cli.dvt.word import Argument, DvtWord
from dvtcli.cli.effect import Effect

#: executed by the caller
_SOURCE = DvtWord("source", (Argument("FILE", str),), "run a script", "run setup.tcl", Effect.RUNS, None)

WORDS: dict[str, DvtWord] = {word.name: word for word in (*single_sdos.WORDS, *state.WORDS, *pdo_words.WORDS, _SOURCE)}
