"""Decide if all lines of a script can be rolled back, for `run --atomic`, before the first line runs."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

from dvtcli.cli.command import Effect, Final, of_line
from dvtcli.cli.global_options import PREFIX
from dvtcli.errors import UsageError

if TYPE_CHECKING:
    import click


def is_rehearsal(ctx: click.Context) -> bool:
    """Whether the parsed line, not yet run, works on twins by its own option."""
    return bool(ctx.params.get(f"{PREFIX}dry_run"))


def final(ctx: click.Context) -> Final | None:
    """Return the part of the parsed line that no undo reverts; None if none."""
    return None if is_rehearsal(ctx) else of_line(ctx).final(ctx.params)


def stores(ctx: click.Context) -> Final | None:
    """Return the store that may follow the parsed line's changes; None for lines without changes or stores."""
    return None if is_rehearsal(ctx) else of_line(ctx).stores(ctx.params)


def is_changing(ctx: click.Context) -> bool:
    """Whether the parsed line changes a node in a way that undo can revert."""
    return not is_rehearsal(ctx) and of_line(ctx).effect is Effect.CHANGES and final(ctx) is None


def does_other(ctx: click.Context) -> bool:
    """Whether the parsed line affects a node in a way not recorded in its history."""
    return not is_rehearsal(ctx) and (final(ctx) is not None or of_line(ctx).effect is Effect.COMMANDS)


@dataclass(slots=True)
class Reach:
    """The effects of a script from its first line: whether it *changes* nodes, and its first *final* line."""

    changes: bool = False
    final: tuple[str, str] | None = None
    #: the first final line followed by a changing line, with the latter's place
    wrong: tuple[str, str, str] | None = None
    #: the first line with a script that cannot be parsed in advance, and with --keep-going
    opaque: str | None = None
    keeps_going: str | None = None

    def line(self, place: str, ctx: click.Context) -> None:
        """Add the line at *place* (`FILE:LINE`)."""
        if is_changing(ctx):
            self._change(place)
        found = final(ctx) or stores(ctx)
        if found is not None and self.final is None:
            self.final = (place, found.words)

    def script(self, place: str, other: Reach) -> None:
        """Add the script run by the line at *place*."""
        if other.changes:
            self._change(place)
        self.wrong, self.opaque = self.wrong or other.wrong, self.opaque or other.opaque
        self.keeps_going = self.keeps_going or other.keeps_going
        self.final = self.final or other.final

    def not_parsed(self, place: str, *, tcl: bool) -> None:
        """Add a script that does not exist yet, or a Tcl script, with unknown effects."""
        self._change(place)
        if tcl:
            self.opaque = self.opaque or place

    def _change(self, place: str) -> None:
        self.changes = True
        if self.final is not None:
            self.wrong = self.wrong or (*self.final, place)

    def refuse(self) -> None:
        """Raise UsageError with FILE:LINE if an atomic script could not roll back all lines."""
        if self.opaque is not None:
            raise UsageError(
                f"{self.opaque}: an atomic script cannot run a Tcl script, since its changes are unknown before it "
                f"runs",
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
                f"{place}: `{word}` cannot be rolled back, but {later} changes something after it",
                place=place,
                hint="in an atomic script, put it after the last line that changes something",
            )
