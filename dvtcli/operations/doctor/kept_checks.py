"""What `doctor` says of what is kept on this machine: EDS files, journals, habits of devices, profiles."""

from __future__ import annotations

import tempfile
from collections.abc import Iterator
from typing import TYPE_CHECKING

from dvtcli.errors import DvtcliError, SafetyRefusal
from dvtcli.operations.doctor.failed_check import failed
from dvtcli.operations.results.diagnosis import Check

if TYPE_CHECKING:
    from pathlib import Path

    from dvtcli.operations.session.session import Session


def library_check() -> Check:
    """How many EDS files nodes are recognised by, and where they are."""
    from dvtcli.files.device_library.stored_files import folder, stored_files

    count = len(stored_files())
    return Check("EDS files", "ok", f"{count} in {folder()}{': eds list shows them' if count else ''}")


def state_checks(session: Session) -> Iterator[Check]:
    """Whether backups and journals can be written, and whether a journal waits."""
    from dvtcli.device.trust import private_folder, unusable
    from dvtcli.operations.user.keeping import state_folder

    folder, always = session.state_folder, state_folder(None)
    needed = [folder / name for name in ("journals", "backups")]
    needed += [always / name for name in ("locks", "changes", "habits", "programs")]
    try:
        private_folder(folder)
        for refused in filter(None, map(unusable, needed)):
            yield failed("state", refused)
            return
        with tempfile.NamedTemporaryFile(dir=folder):
            yield Check("state", "ok", f"{folder} can be written")
    except OSError as failure:
        hint = "without it nothing is changed on a real bus: --journal DIR names another folder"
        yield Check("state", "FAIL", f"{folder}: {failure.strerror}", hint)
        return
    except SafetyRefusal as refused:
        yield failed("state", refused)
        return
    yield _journals(folder)


def _journals(folder: Path) -> Check:
    from dvtcli.device.change.journal import Journals

    journals = Journals(folder / "journals", "")
    waiting = sorted(path.name for path in journals.folder.glob("*.json") if journals.counts(path))
    if waiting:
        return Check("journals", "warn", f"a change was interrupted: {', '.join(waiting)}", "recover finishes it")
    return Check("journals", "ok", "no change was interrupted")


def habits_check() -> Check:
    """Of how many devices something is remembered that changes how they are written to."""
    from dvtcli.operations.known_devices.device_habits import list_habits

    rows = list_habits().rows
    broken = [row.name for row in rows if row.problem]
    if broken:
        text = f"what is remembered of {', '.join(broken)} cannot be read"
        return Check("habits", "warn", text, "profiles forget removes it; it is found out anew")
    if not rows:
        return Check("habits", "ok", "nothing is remembered of any device")
    return Check("habits", "ok", f"{len(rows)} devices want a PDO off first, or may: profiles habits shows them")


def profiles_check() -> Check:
    """Whether every profile can be read."""
    from dvtcli.files.profile.library import load_profile, profile_names

    names = profile_names()
    for name in names:
        try:
            load_profile(name)
        except DvtcliError as wrong:
            return failed("profiles", wrong)
    return Check("profiles", "ok", f"{len(names)} are valid: {', '.join(names)}")
