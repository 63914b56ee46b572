"""A word of the DVT: its name, its arguments, what it does; declared in the file that has its function.

Knows no word.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

from dvtcli.cli.dvt import notation as numbers

if TYPE_CHECKING:
    from dvtcli.cli.dvt.done import WordResult
    from dvtcli.cli.effect import Effect, Final


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
class DvtWord:
    """One word; *modern* is the command line that does the same.

    *effect* is what it does to nodes. *run* carries it out with the session and the values that `bind` brought, and
    raises what its functions raise; None where whoever runs lines does it itself. *final* says of these values what no
    undo reverts, where that depends on them.
    """

    name: str
    arguments: tuple[Argument, ...]
    summary: str
    modern: str
    effect: Effect
    run: Callable[..., WordResult] | None
    final: Callable[[Sequence[Any]], Final | None] | None = None

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


NODE = Argument("NODE", numbers.node_id)
MAYBE_NODE = Argument("NODE", numbers.node_id, required=False)
OBJECT = (NODE, Argument("INDEX", numbers.index), Argument("SUB", numbers.sub_index))
VALUE = (*OBJECT, Argument("VALUE", str), Argument("BYTES", numbers.width, required=False))
