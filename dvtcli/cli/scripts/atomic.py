"""Which lines of a script can be taken back: what `run --atomic` refuses before its first line runs.

Knows no command: each says what a line of it does. Runs nothing.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

from dvtcli.cli.command import of_line
from dvtcli.cli.effect import Effect, Final
from dvtcli.cli.global_options import PREFIX
from dvtcli.errors import UsageError

if TYPE_CHECKING:
    import click


def is_rehearsal(ctx: click.Context) -> bool:
    """Whether the parsed line, which has not run yet, works on twins by an option of its own."""
    return bool(ctx.params.get(f"{PREFIX}dry_run"))


def final(ctx: click.Context) -> Final | None:
    """What the parsed line does that no undo reverts; None where it does no such thing."""
    return None if is_rehearsal(ctx) else of_line(ctx).final(ctx.params)


def stores(ctx: click.Context) -> Final | None:
    """What the parsed line may store once its changes are made; None where it stores nothing, or nothing else."""
    return None if is_rehearsal(ctx) else of_line(ctx).stores(ctx.params)


def is_changing(ctx: click.Context) -> bool:
    """Whether the parsed line changes what a node holds, in a way that can be undone."""
    return not is_rehearsal(ctx) and of_line(ctx).effect is Effect.CHANGES and final(ctx) is None


def does_other(ctx: click.Context) -> bool:
    """Whether the parsed line does something to a node that its history does not hold."""
    return not is_rehearsal(ctx) and (final(ctx) is not None or of_line(ctx).effect is Effect.COMMANDS)


@dataclass(slots=True)
class Reach:
    """What a script does, from its first line on: whether it *changes*, and its first line that is *final*."""

    changes: bool = False
    final: tuple[str, str] | None = None
    #: the first final line that a changing one follows, with that one's place
    wrong: tuple[str, str, str] | None = None
    #: the first line that runs what cannot be parsed before it runs, and one that runs on after a failure
    opaque: str | None = None
    keeps_going: str | None = None

    def line(self, place: str, ctx: click.Context) -> None:
        """Take the line at *place* (`FILE:LINE`) in."""
        if is_changing(ctx):
            self._change(place)
        found = final(ctx) or stores(ctx)
        if found is not None and self.final is None:
            self.final = (place, found.words)

    def script(self, place: str, other: Reach) -> None:
        """Take in the script that the line at *place* runs."""
        if other.changes:
            self._change(place)
        self.wrong, self.opaque = self.wrong or other.wrong, self.opaque or other.opaque
        self.keeps_going = self.keeps_going or other.keeps_going
        self.final = self.final or other.final

    def not_parsed(self, place: str, *, tcl: bool) -> None:
        """Take in a script that does not exist yet, or a Tcl script, which may do anything at all."""
        self._change(place)
        if tcl:
            self.opaque = self.opaque or place

    def _change(self, place: str) -> None:
        self.changes = True
        if self.final is not None:
            self.wrong = self.wrong or (*self.final, place)

    def refuse(self) -> None:
        """Raise UsageError with FILE:LINE where an atomic script could not take all its lines back."""
        if self.opaque is not None:
            raise UsageError(
                f"{self.opaque}: a Tcl script is no part of an atomic one: what it does is not known before it runs",
                place=self.opaque,
            )
        if self.keeps_going is not None:
            raise UsageError(
                f"{self.keeps_going}: --keep-going and --atomic exclude each other: a failing line ends it",
                place=self.keeps_going,
            )
        if self.wrong is not None:
            place, word, later = self.wrong
            raise UsageError(
                f"{place}: `{word}` cannot be taken back, and {later} changes something after it",
                place=place,
                hint="in an atomic script it stands behind the last line that changes something",
            )
