"""The one table of the DVT's words: what each takes and which function it is; read by click, Tcl, help and completion.

Knows no bus: a word's function is imported when the word is run.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from importlib import import_module
from typing import TYPE_CHECKING, Any

from dvtcli.cli.dvt import notation as numbers
from dvtcli.cli.effect import Effect

if TYPE_CHECKING:
    from dvtcli.cli.dvt.done import Done
    from dvtcli.operations.session import Session


@dataclass(frozen=True, slots=True)
class Argument:
    """One argument of a word: its name, and how its text is read (ValueError says what is wrong)."""

    name: str
    read: Callable[[str], Any]
    required: bool = True

    @property
    def shown(self) -> str:
        """The argument as a grammar shows it."""
        return self.name if self.required else f"[{self.name}]"


@dataclass(frozen=True, slots=True)
class Word:
    """One word; *modern* is the command line that does the same.

    *where* is `module:function` in this room, empty for `source`, which whoever runs words does itself.
    *effect* is what it does to nodes.
    """

    name: str
    arguments: tuple[Argument, ...]
    summary: str
    modern: str
    where: str
    effect: Effect

    @property
    def grammar(self) -> str:
        """The word with its arguments."""
        return " ".join([self.name, *(argument.shown for argument in self.arguments)])

    def bind(self, texts: Sequence[str]) -> list[Any]:
        """The arguments' values, None for those left out; ValueError says what is wrong."""
        least = sum(argument.required for argument in self.arguments)
        if not least <= len(texts) <= len(self.arguments):
            raise ValueError(f"it is: {self.grammar}")
        given: Sequence[str | None] = texts
        if texts and len(texts) < len(self.arguments) and not (self.arguments[0].required or texts[0][:1].isdigit()):
            given = (None, *texts)  # `fpo pre`: the node is left out
        pairs = zip(self.arguments, given, strict=False)
        values: list[Any] = [None if text is None else argument.read(text) for argument, text in pairs]
        values += [None] * (len(self.arguments) - len(values))
        names = [argument.name for argument in self.arguments]
        if "VALUE" in names:  # its bytes depend on the width behind it
            size = values.pop()
            values[-1] = numbers.value_bytes(values[-1], size)
        return values

    def run(self, session: Session, values: Sequence[Any]) -> Done:
        """Carry the word out; raises what its functions raise."""
        module, _, function = self.where.partition(":")
        done: Done = getattr(import_module(f"dvtcli.cli.dvt.{module}"), function)(session, *values)
        return done


def _state(text: str) -> str:
    if text not in ("pre", "op"):
        raise ValueError(f"{text}: the state is pre or op")
    return text


_NODE = Argument("NODE", numbers.node_id)
_MAYBE_NODE = Argument("NODE", numbers.node_id, required=False)
_OBJECT = (_NODE, Argument("INDEX", numbers.index), Argument("SUB", numbers.sub_index))
_VALUE = (*_OBJECT, Argument("VALUE", str), Argument("BYTES", numbers.width, required=False))

WORDS: dict[str, Word] = {
    word.name: word
    for word in (
        Word("sdo_rnx", _OBJECT, "read an object, in hex", "read 6041", "sdo:read_hex", Effect.READS),
        Word("sdo_rn", _OBJECT, "read an object, in decimal", "read 6041", "sdo:read_decimal", Effect.READS),
        Word("sdo_wnx", _VALUE, "write an object, in hex", "write 1800:2 1", "sdo:write", Effect.CHANGES),
        Word("sdo_wn", _VALUE, "write an object, in decimal", "write 1017 1000", "sdo:write", Effect.CHANGES),
        Word(
            "fpo", (_MAYBE_NODE, Argument("pre|op", _state, required=False)),
            "force pre-operational (pre) or operational (op)", "nmt preop", "state:force", Effect.COMMANDS,
        ),
        Word(
            "lg", (_MAYBE_NODE, Argument("LEVEL", numbers.level, required=False)),
            "log in at a level, 0 to log out", "login 4", "state:log_in_at", Effect.COMMANDS,
        ),
        Word(
            "store", (_MAYBE_NODE,),
            "keep what is set (in Tcl; elsewhere the command)", "store", "state:store", Effect.FINAL,
        ),
        Word(
            "map_in_tpdo", (*_OBJECT, Argument("COB-ID", numbers.can_id, required=False)),
            "put an object into the first TPDO with room", "map tpdo1 6041 --sync 1", "pdo_words:map_in_tpdo",
            Effect.CHANGES,
        ),
        Word("locate_tpdo", _OBJECT, "which TPDO holds an object", "pdo --all", "pdo_words:locate", Effect.READS),
        Word(
            "clear_all_pdos", (_NODE,),
            "no mapping, and disabled, for every PDO", "clear all", "pdo_words:clear_all", Effect.CHANGES,
        ),
        Word("source", (Argument("FILE", str),), "run a script", "run setup.tcl", "", Effect.RUNS),
    )
}  # fmt: skip
