"""The device profiles for a program: which there are, and why each says what it says. Opens no bus."""

from __future__ import annotations

from typing import TYPE_CHECKING

from dvtcli.operations.api.called_hints import errors_in_calls
from dvtcli.operations.api.checks import word

if TYPE_CHECKING:
    from dvtcli.operations.results import ProfileListing, ProfileShown


def profiles() -> ProfileListing:
    """The device families that dvtcli knows, the user's own ones too; a list of rows.

    InputFileError for one of the user's own that cannot be read.
    """
    from dvtcli.operations.known_devices.show_profiles import list_profiles

    return list_profiles()


def profile(name: str) -> ProfileShown:
    """The profile *name*, with the reason for each of its values.

    UsageError where there is none of that name, InputFileError where its file is wrong.
    """
    from dvtcli.operations.known_devices.show_profiles import show_profile

    word("name", name, "the name of a device family, as `dvtcli.profiles()` lists them")
    with errors_in_calls():
        return show_profile(name)
