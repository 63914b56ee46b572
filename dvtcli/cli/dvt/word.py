"""A word of the DVT: name, arguments and function; declared in the file of its function."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

from dvtcli.cli.dvt import notation as numbers

if TYPE_CHECKING:
    from dvtcli.cli.command import Effect, Final
    from dvtcli.domain.rules.finding import Finding


@dataclass(frozen=True, slots=True)
class Argument:
    """An argument of a word: its name, and the reader of its text (raises ValueError with the reason)."""

    name: str
    read: Callable[[str], Any]
    required: bool = True

    @property
    def shown(self) -> str:
        """The argument in a grammar."""
        return self.name if self.required else f"[{self.name}]"


@dataclass(frozen=True, slots=True)
class DvtWord:
    """A word; *modern* is the equivalent command line.

    *effect* is the effect on nodes. *run* executes the word with the session and the values of `bind`, and raises its
    functions' errors; None if the caller executes it. *final* returns the part that no undo reverts, if dependent on
    values.
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
        """Return the arguments' values, None if omitted. Raises ValueError with the reason."""
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


@dataclass(frozen=True, slots=True)
class WordResult:
    """The result of a word: its text, and findings of rules."""

    text: str = "OK"
    findings: tuple[Finding, ...] = ()
    #: the lines of a text with several
    rows: tuple[str, ...] = ()
