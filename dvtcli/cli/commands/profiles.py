"""List the device profiles, or show one with the reason for each value."""

from __future__ import annotations

from typing import TYPE_CHECKING

import click
from click.shell_completion import CompletionItem

from dvtcli.cli.command import DvtCommand
from dvtcli.cli.params import TextType

if TYPE_CHECKING:
    from dvtcli.operations.results import ProfileListing, ProfileShown
    from dvtcli.operations.results.device_profiles import ProfileRow


class ProfileName(TextType):
    """The name of a profile."""

    name = "profile"

    def shell_complete(self, _ctx: click.Context, _param: click.Parameter, incomplete: str) -> list[CompletionItem]:
        """The profiles there are."""
        from dvtcli.files.profile.library import profile_names

        return [CompletionItem(name) for name in profile_names() if name.startswith(incomplete)]


@click.command("profiles", cls=DvtCommand, short_help=__doc__)
@click.argument("action", type=click.Choice(["show"]), required=False, metavar="[show]")
@click.argument("name", type=ProfileName(), required=False, metavar="[NAME]")
def command(action: str | None, name: str | None) -> ProfileListing | ProfileShown:
    """Show which device families dvtcli knows, and where each fact about one comes from.

    \b
    profiles
    profiles show gen4
    """
    from dvtcli.files.profile.library import folder, profile_names
    from dvtcli.operations.results import ProfileListing

    if action is None:
        return ProfileListing(tuple(map(_row, profile_names())), str(folder()))
    if name is None:
        raise click.UsageError(f"which one? {', '.join(profile_names())}")
    return _shown(name)


def _row(name: str) -> ProfileRow:
    from dvtcli.files.profile.library import load_profile, own_names, profile_path
    from dvtcli.operations.results.device_profiles import ProfileRow

    profile = load_profile(name)
    return ProfileRow(name, profile.title, profile.vendor_ids, str(profile_path(name)), name in own_names())


def _shown(name: str) -> ProfileShown:
    from dvtcli.files.profile.library import profile_text
    from dvtcli.files.profile.reasons import reasons
    from dvtcli.operations.results import ProfileShown

    row = _row(name)
    found = list(reasons(profile_text(name)))
    like = next((one.value.strip("\"'") for one in found if one.key == "like"), None)
    return ProfileShown(row, tuple((one.key, one.value, one.reason) for one in found), like)
