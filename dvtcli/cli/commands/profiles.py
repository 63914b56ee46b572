"""List the device profiles, or show one with the reason for each value."""

from __future__ import annotations

from typing import TYPE_CHECKING

import click
from click.shell_completion import CompletionItem

from dvtcli.cli.command import DvtCommand
from dvtcli.cli.effect import Effect
from dvtcli.cli.params import TextType

if TYPE_CHECKING:
    from dvtcli.operations.results import ProfileListing, ProfileShown

TASK = ("Find nodes", 50)


class ProfileName(TextType):
    """The name of a profile."""

    name = "profile"

    def shell_complete(self, _ctx: click.Context, _param: click.Parameter, incomplete: str) -> list[CompletionItem]:
        """The profiles there are."""
        from dvtcli.operations.show_profiles import known_profiles

        return [CompletionItem(name) for name in known_profiles() if name.startswith(incomplete)]


@click.command("profiles", cls=DvtCommand, short_help=__doc__, effect=Effect.READS, needs_settings=False)
@click.argument("action", type=click.Choice(["show"]), required=False, metavar="[show]")
@click.argument("name", type=ProfileName(), required=False, metavar="[NAME]")
def command(action: str | None, name: str | None) -> ProfileListing | ProfileShown:
    """Show which device families dvtcli knows, and where each fact about one comes from.

    \b
    profiles
    profiles show gen4
    """
    from dvtcli.operations.show_profiles import known_profiles, list_profiles, show_profile

    if action is None:
        return list_profiles()
    if name is None:
        raise click.UsageError(f"which one? {', '.join(known_profiles())}")
    return show_profile(name)
