"""Device profiles, and the learned write requirements of device types, as answers."""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterator
from pathlib import Path

from dvtcli.device.habits import OFTEN_ENOUGH, Habit, read_habits
from dvtcli.errors import SafetyRefusal, UsageError
from dvtcli.files.profiles import (
    folder,
    load_profile,
    own_names,
    profile_names,
    profile_path,
    profile_text,
    reasons,
)
from dvtcli.operations.results import HabitListing, ProfileListing, ProfileShown
from dvtcli.operations.results.learnt import HabitRow, Wanted, WantedState
from dvtcli.operations.results.library_files import ProfileRow
from dvtcli.operations.user.change_files import state_folder


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


def known_habits() -> tuple[str, ...]:
    """List the names of devices with remembered habits, sorted, without reading them."""
    return tuple(sorted(path.stem for path in habits_folder().glob("*.json")))


def list_habits() -> HabitListing:
    """List the habits of every device; unreadable files have an error in their row."""
    return HabitListing(tuple(map(_habit_row, known_habits())), str(habits_folder()))


def forget_habits(name: str) -> HabitListing:
    """Forget the habits of the device *name*, or with `all` of every device; returns the rest.

    Raises UsageError if nothing is remembered of *name*, SafetyRefusal if a file cannot be removed.
    """
    known = known_habits()
    if name != "all" and name.upper() not in known:
        remembered = f"remembered: {', '.join(known)}" if known else "no needs of devices are recorded"
        raise UsageError(f"nothing is remembered of {name}", hint=remembered)
    gone = known if name == "all" else (name.upper(),)
    for habit_name in gone:
        path = habits_folder() / f"{habit_name}.json"
        try:
            path.unlink(missing_ok=True)
        except OSError as failed:
            raise SafetyRefusal(f"{path} cannot be removed", why=failed.strerror, hint="remove it by hand") from failed
    left = list_habits()
    return HabitListing(left.rows, left.folder, gone)


def habits_folder() -> Path:
    """Return the folder of habits, which may not exist."""
    return state_folder(None) / "habits"


def _habit_row(name: str) -> HabitRow:
    try:
        known = read_habits(habits_folder() / f"{name}.json")
        return HabitRow(name, tuple(_wanted(known)), pre_operational=tuple(_pre_operational(known)))
    except (OSError, ValueError, RecursionError) as wrong:
        return HabitRow(name, (), f"it cannot be read ({wrong}), and does not count")


def _wanted(known: Counter[Habit]) -> Iterator[Wanted]:
    of_parameters = ((habit.parameter, habit.abort, times) for habit, times in known.items() if habit.parameter)
    for (direction, sub), abort, times in sorted(of_parameters):
        yield Wanted(str(direction), sub, abort, times, times >= OFTEN_ENOUGH)


def _pre_operational(known: Counter[Habit]) -> Iterator[WantedState]:
    for habit, times in known.items():
        if habit.parameter is None:
            yield WantedState(habit.abort, times, times >= OFTEN_ENOUGH)
