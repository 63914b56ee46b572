"""What `doctor` says of what is kept on this machine: EDS files, journals, habits of devices, profiles."""

from __future__ import annotations

import tempfile
from collections.abc import Iterable, Iterator
from pathlib import Path
from typing import TYPE_CHECKING

from dvtcli.device.change.private_file import to_disk, unfinished
from dvtcli.domain.hint import Action, Hint, as_hint
from dvtcli.domain.several import join_some
from dvtcli.errors import DvtcliError, SafetyRefusal
from dvtcli.operations.doctor.failed_check import failed
from dvtcli.operations.results.diagnosis import Check

if TYPE_CHECKING:
    from dvtcli.operations.session.session import Session


#: what the journal of a device with many PDOs takes
_TRIED_BYTES = 60_000


def library_check() -> Check:
    """How many EDS files nodes are recognised by, and where they are."""
    from dvtcli.files.device_library.stored_files import folder, stored_files

    count = len(stored_files())
    return Check("EDS files", "ok", f"{count} in {folder()}{': eds list shows them' if count else ''}")


def state_checks(session: Session) -> Iterator[Check]:
    """Whether backups and journals can be written, and whether a journal waits."""
    from dvtcli.device.trust import OTHER_STATE, private_folder, unusable
    from dvtcli.operations.user.keeping import state_folder

    folder, always = session.state_folder, state_folder(None)
    needed = [folder / name for name in ("journals", "backups")]
    needed += [always / name for name in ("locks", "changes", "habits", "programs")]
    try:
        private_folder(folder)
        for refused in filter(None, map(unusable, needed)):
            yield failed("state", refused)
            return
        for path in needed:
            _try(path)
        yield Check("state", "ok", f"{folder} can be written{_left_over(needed)}")
    except OSError as failure:
        place = Path(str(failure.filename or folder))
        moves = {folder / "journals", folder / "backups"} & {place, *place.parents} or place == folder != always
        other = Hint(Action.GIVE_JOURNAL, why="names another folder") if moves else OTHER_STATE
        hint = as_hint("without it nothing is changed on a real bus: make room or mend it")
        hint = hint + other if other else hint
        text = f"a change cannot keep its files: {failure.strerror or failure}: {failure.filename or folder}"
        yield Check("state", "FAIL", text, hint)
        return
    except SafetyRefusal as refused:
        yield failed("state", refused)
        return
    yield _journals(folder)


def _try(folder: Path) -> None:
    """Do in *folder*, or if it is missing in the one above, what keeps a journal; nothing if neither is there yet.

    OSError, which names a file, if the disk does not take that.
    """
    folder = folder if folder.is_dir() else folder.parent
    if folder.is_dir():
        try:
            with tempfile.NamedTemporaryFile(suffix=".tmp", dir=folder) as file:
                file.write(bytes(_TRIED_BYTES))
                file.flush()
                to_disk(file.fileno())
        except OSError as failed:
            raise OSError(failed.errno, failed.strerror, failed.filename or str(folder)) from failed


def _left_over(folders: Iterable[Path]) -> str:
    """What processes that were killed left in *folders*: it harms nobody."""
    from dvtcli.device.change.journal import unneeded_markers

    found = [path for folder in folders for path in (*unfinished(folder), *unneeded_markers(folder))]
    if not found:
        return ""
    return f"; files that killed processes left, which harm nobody: {join_some(map(str, found))}"


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
