"""Show the device profiles with their reasons. Needs no bus and no session."""

from __future__ import annotations

from dvtcli.files.profile.library import (
    folder,
    load_profile,
    own_names,
    profile_names,
    profile_path,
    profile_text,
    reasons,
)
from dvtcli.operations.results import ProfileListing, ProfileShown
from dvtcli.operations.results.library_files import ProfileRow


def known_profiles() -> tuple[str, ...]:
    """The profiles' names, sorted; reads no profile."""
    return profile_names()


def list_profiles() -> ProfileListing:
    """List every profile, including the user's; raises InputFileError for an unreadable profile."""
    return ProfileListing(tuple(map(_row, profile_names())), str(folder()))


def show_profile(name: str) -> ProfileShown:
    """Show the profile *name* with the reason for each value; raises UsageError if unknown."""
    row = _row(name)
    found = list(reasons(profile_text(name)))
    like = next((reason.value.strip("\"'") for reason in found if reason.key == "like"), None)
    return ProfileShown(row, tuple((reason.key, reason.value, reason.reason) for reason in found), like)


def _row(name: str) -> ProfileRow:
    profile = load_profile(name)
    return ProfileRow(name, profile.title, profile.vendor_ids, str(profile_path(name)), name in own_names())
