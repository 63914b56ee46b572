"""List the device profiles, or show one with its sources; show needs of single devices."""

from __future__ import annotations

from typing import TYPE_CHECKING

import click
from click.shell_completion import CompletionItem

from dvtcli.cli.command import DvtCommand, Effect
from dvtcli.cli.params import TextType

if TYPE_CHECKING:
    from dvtcli.operations.results import HabitListing, ProfileListing, ProfileShown


class ProfileName(TextType):
    """The name of a profile; after `forget`, of a device with recorded habits."""

    name = "profile"

    def shell_complete(self, ctx: click.Context, _param: click.Parameter, incomplete: str) -> list[CompletionItem]:
        """Offer the profiles, or the devices."""
        from dvtcli.operations.devices.show_profiles import known_habits, known_profiles

        names = (*known_habits(), "all") if ctx.params.get("action") == "forget" else known_profiles()
        return [CompletionItem(name) for name in names if name.startswith(incomplete)]


@click.command("profiles", cls=DvtCommand, short_help=__doc__, effect=Effect.NONE, needs_settings=False)
@click.argument(
    "action", type=click.Choice(["show", "habits", "forget"]), required=False, metavar="[show|habits|forget]"
)
@click.argument("name", type=ProfileName(), required=False, metavar="[NAME]")
def command(action: str | None, name: str | None) -> ProfileListing | ProfileShown | HabitListing:
    """Show the device families that dvtcli knows, and the source of each value.

    `habits` lists the values that devices accept only while a PDO is off, by vendor, product and revision; `forget`
    removes the values of one device, or of `all`.

    \b
    profiles
    profiles show gen4
    profiles habits
    """
    from dvtcli.operations.devices.show_profiles import (
        forget_habits,
        known_habits,
        known_profiles,
        list_habits,
        list_profiles,
        show_profile,
    )

    if name is None and action in ("show", "forget"):
        known = known_profiles() if action == "show" else (*known_habits(), "all")
        raise click.UsageError(f"give a name: {', '.join(known)}")
    if action == "habits":
        if name is not None:
            raise click.UsageError("profiles habits lists all of them")
        return list_habits()
    if name is None:
        return list_profiles()
    return show_profile(name) if action == "show" else forget_habits(name)
