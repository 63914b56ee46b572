"""Which lines of a script can be taken back: what `run --atomic` refuses before its first line runs.

Knows commands by their effect, names and parsed arguments. Runs nothing.
"""

from __future__ import annotations

import re
from dataclasses import dataclass
from typing import TYPE_CHECKING

from dvtcli.cli.command import effect_of
from dvtcli.cli.effect import Effect
from dvtcli.cli.global_options import PREFIX
from dvtcli.device.store_parameters import SIGNATURES
from dvtcli.errors import UsageError

if TYPE_CHECKING:
    import click

_INDEX = re.compile("[0-9a-f]{4}")
#: NMT commands after which what was changed is lost, or is at work.
_FINAL_NMT = frozenset({"start", "reset-node", "reset-comm"})


def is_rehearsal(ctx: click.Context) -> bool:
    """Whether the parsed line, which has not run yet, works on twins by an option of its own."""
    return bool(ctx.params.get(f"{PREFIX}dry_run"))


def final_word(ctx: click.Context) -> str | None:
    """What the parsed line does that no undo reverts, in its own words; None where it does no such thing."""
    name, params = ctx.info_name or "", ctx.params
    if is_rehearsal(ctx):
        return None
    if effect_of(ctx) is Effect.FINAL:
        return name
    if name == "nmt":
        return f"nmt {params.get('command_')}" if params.get("command_") in _FINAL_NMT else None
    if name == "fpo":
        return "fpo op" if "op" in params.get("values", ()) else None
    place = _place(ctx)
    return f"{name} to 0x{place:04X}" if place in SIGNATURES else None


def _place(ctx: click.Context) -> int | None:
    """The index that a `write`, or a word that writes, is about; None where that is a name, or something else."""
    if ctx.info_name == "write":
        head = ctx.params["object_"].text.partition(":")[0].lower().removeprefix("0x")
        return int(head, 16) if _INDEX.fullmatch(head) else None
    if ctx.info_name in ("sdo_wn", "sdo_wnx"):
        return int(ctx.params["values"][1])
    return None


def is_changing(ctx: click.Context) -> bool:
    """Whether the parsed line changes what a node holds, in a way that can be undone."""
    return not is_rehearsal(ctx) and effect_of(ctx) is Effect.CHANGES and final_word(ctx) is None


def does_other(ctx: click.Context) -> bool:
    """Whether the parsed line does something to a node that its history does not hold."""
    return not is_rehearsal(ctx) and (final_word(ctx) is not None or effect_of(ctx) is Effect.COMMANDS)


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
        word = final_word(ctx)
        if word is not None and self.final is None:
            self.final = (place, word)

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
