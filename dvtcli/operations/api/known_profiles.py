"""List and show device profiles for a program. Opens no bus."""

from __future__ import annotations

from typing import TYPE_CHECKING

from dvtcli.operations.api.called_hints import errors_in_calls
from dvtcli.operations.api.checks import word

if TYPE_CHECKING:
    from dvtcli.operations.results import ProfileListing, ProfileShown


def profiles() -> ProfileListing:
    """List the known device families, including the user's; a list of rows.

    Raises InputFileError for an unreadable profile of the user.
    """
    from dvtcli.operations.known_devices.show_profiles import list_profiles

    return list_profiles()


def profile(name: str) -> ProfileShown:
    """Return the profile *name* with the reason for each value.

    Raises UsageError if unknown, InputFileError if its file is invalid.
    """
    from dvtcli.operations.known_devices.show_profiles import show_profile

    word("name", name, "the name of a device family, as `dvtcli.profiles()` lists them")
    with errors_in_calls():
        return show_profile(name)
