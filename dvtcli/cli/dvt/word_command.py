"""The DVT's words as click commands, made from their table."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import click

from dvtcli.cli.command import DvtCommand
from dvtcli.cli.dvt.words import WORDS, DvtWord, answer
from dvtcli.cli.params import FILE, TEXT, CanopenType, TextType
from dvtcli.cli.runner_interface import runners

if TYPE_CHECKING:
    from click.shell_completion import CompletionItem

    from dvtcli.cli.conversation import Conversation


class NodeText(TextType):
    """A typed node-ID, with completion of known nodes."""

    def shell_complete(self, ctx: click.Context, param: click.Parameter, incomplete: str) -> list[CompletionItem]:
        """Offer the session's node-IDs without using a bus."""
        from click.shell_completion import CompletionItem as Item

        del param
        session: Conversation | None = ctx.find_root().obj
        known = session.known_ids() if session is not None else []
        return [Item(str(node_id)) for node_id in known if str(node_id).startswith(incomplete)]


class WordCommand(DvtCommand):
    """A word; its arguments are read together, since a value's width may follow it."""

    def __init__(self, word: DvtWord) -> None:
        self.word = word
        kinds: dict[str, CanopenType] = {"NODE": NodeText(), "FILE": FILE}
        params: list[click.Parameter] = [
            click.Argument(
                [f"dvt_{number}"], type=kinds.get(one.name, TEXT), required=one.required, metavar=one.shown
            )
            for number, one in enumerate(word.arguments)
        ]  # fmt: skip
        text = f"{word.summary[0].upper()}{word.summary[1:]}. The modern form: {word.modern}. More: help dvt."
        final = word.final
        super().__init__(
            word.name, params=params, callback=click.pass_context(self._run), help=text, effect=word.effect,
            final=None if final is None else lambda params: final(params["values"]),
        )  # fmt: skip

    def parse_args(self, ctx: click.Context, args: list[str]) -> list[str]:
        """Parse *args* and read them by the word's own rules."""
        rest = super().parse_args(ctx, args)
        texts = [ctx.params.pop(key) for key in sorted(key for key in ctx.params if key.startswith("dvt_"))]
        if ctx.resilient_parsing:
            return rest
        try:
            ctx.params["values"] = self.word.bind([text for text in texts if text is not None])
        except ValueError as wrong:
            raise click.UsageError(f"{self.word.name}: {wrong}", ctx) from wrong
        return rest

    def _run(self, ctx: click.Context, /, values: list[Any]) -> Any:
        if self.word.run is None:
            return runners(ctx).file(ctx.obj, values[0])
        return answer(self.word, ctx.obj, values)


def word_command(name: str) -> WordCommand | None:
    """The word *name* as a click command, or None."""
    word = WORDS.get(name)
    return None if word is None else WordCommand(word)
