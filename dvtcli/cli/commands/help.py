"""Show all commands by task, one command with its examples, or a topic."""

from __future__ import annotations

from typing import TYPE_CHECKING

import click
from click.shell_completion import CompletionItem

from dvtcli.cli.catalogue import command_names, summary, unknown_command
from dvtcli.cli.command import DvtCommand, Effect
from dvtcli.cli.params import TextType
from dvtcli.cli.runner_interface import root

if TYPE_CHECKING:
    from dvtcli.operations.results import Facts


class HelpTopic(TextType):
    """The name of a command or a topic."""

    name = "subject"

    def shell_complete(self, _ctx: click.Context, _param: click.Parameter, incomplete: str) -> list[CompletionItem]:
        """Offer commands and topics with their one-line texts."""
        from dvtcli.cli.help.guide import TOPICS, topic

        rows = [(name, summary(name)) for name in command_names()]
        rows += [(name, topic(name).splitlines()[0]) for name in TOPICS]
        return [CompletionItem(name, help=text) for name, text in rows if name.startswith(incomplete.lower())]


@click.command("help", cls=DvtCommand, short_help=__doc__, effect=Effect.READS, needs_settings=False)
@click.argument("name", type=HelpTopic(), required=False, metavar="[COMMAND|TOPIC]")
@click.option("--all", "everything", is_flag=True, help="Show what each command does, and all global options.")
@click.option("--man", "manual_page", is_flag=True, help="The manual page in roff: help --man > dvtcli.1")
@click.pass_context
def command(ctx: click.Context, /, name: str | None, everything: bool, manual_page: bool) -> Facts:
    """Show all commands by task, or COMMAND with its options and examples, or a TOPIC.

    \b
    help
    help map
    help objects
    help --all
    help --man
    """
    from dvtcli.operations.results import Facts

    if manual_page:
        from dvtcli.cli.commands._manual import manual
        from dvtcli.version import __version__

        page = manual(root(ctx), __version__)
        return Facts("help", (("text", "\n".join(page)),), tuple(page))
    text = _subject(ctx, name.lower()) if name is not None else _general(ctx, everything=everything)
    return Facts("help", (("text", text),), tuple(text.splitlines()))


def _general(ctx: click.Context, *, everything: bool) -> str:
    from dvtcli.cli.help.guide import overview

    if everything:
        return root(ctx).long_help(click.Context(root(ctx), info_name="dvtcli"))
    return "\n".join(overview(_usable(ctx)))


def _usable(ctx: click.Context) -> dict[str, str]:
    from dvtcli.cli.aliases import usable_aliases

    return usable_aliases(ctx.obj.settings)


def _subject(ctx: click.Context, name: str) -> str:
    """Return the help of a command, else the text of a topic, or the expansion of an alias."""
    from dvtcli.cli.help.guide import TOPICS, topic

    found = root(ctx).get_command(ctx, name)
    if found is not None:
        return found.get_help(click.Context(found, info_name=name))
    if name in TOPICS:
        return topic(name)
    aliases = {word.lower(): text for word, text in _usable(ctx).items()}
    if name in aliases:
        return f"{name}  at the prompt, an alias of: {aliases[name]}"
    raise click.UsageError(unknown_command(name, TOPICS), ctx)
