"""The checks of `doctor`: this machine, settings, bus, stored data. Each returns a result, whatever is broken."""

from __future__ import annotations

import platform
import re
import tempfile
from collections.abc import Iterable, Iterator
from pathlib import Path
from typing import TYPE_CHECKING

from dvtcli.device.change.private_file import OTHER_STATE, private_folder, to_disk, unfinished, unusable
from dvtcli.device.unnamed_nodes import add_eds
from dvtcli.domain.hint import Action, Hint, as_hint
from dvtcli.domain.objects import DEVICE_TYPE
from dvtcli.domain.text import all_nodes, join_some
from dvtcli.errors import DvtcliError, SafetyRefusal, UsageError
from dvtcli.operations.results.facts import Check
from dvtcli.operations.user.options import Options

if TYPE_CHECKING:
    from dvtcli.domain.ports import Frame
    from dvtcli.operations.session.session import SessionNodes
    from dvtcli.operations.user.session_user import SessionUser


def failed(name: str, error: DvtcliError) -> Check:
    """Make the failed check *name* from *error*."""
    why = f": {error.why}" if error.why else ""
    return Check(name, "FAIL", f"{error.text}{why}", error.hint, error.exit_code)


#: size of the journal of a device with many PDOs
_TRIED_BYTES = 60_000


def library_check() -> Check:
    """Check the EDS library: number of files, folder."""
    from dvtcli.files.device_library import folder, stored_files

    count = len(stored_files())
    return Check("EDS files", "ok", f"{count} in {folder()}{': eds list shows them' if count else ''}")


def state_checks(session: SessionUser) -> Iterator[Check]:
    """Check that backups and journals can be written, and that no journal waits."""
    from dvtcli.operations.user.change_files import state_folder

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
        hint = as_hint("without it nothing is changed on a real bus: free space or repair it")
        hint = hint + other if other else hint
        text = f"a change cannot keep its files: {failure.strerror or failure}: {failure.filename or folder}"
        yield Check("state", "FAIL", text, hint)
        return
    except SafetyRefusal as refused:
        yield failed("state", refused)
        return
    yield _journals(folder)


def _try(folder: Path) -> None:
    """Test the file operations of a journal in *folder* or its parent; skipped if neither exists.

    Raises OSError, with a file name, if the disk refuses.
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
    """Report harmless remains of killed processes in *folders*."""
    from dvtcli.device.change.journal import unneeded_markers

    found = [path for folder in folders for path in (*unfinished(folder), *unneeded_markers(folder))]
    if not found:
        return ""
    return f"; harmless files of killed processes: {join_some(map(str, found))}"


def _journals(folder: Path) -> Check:
    from dvtcli.device.change.journal import JournalFolder

    journals = JournalFolder(folder / "journals", "")
    waiting = sorted(path.name for path in journals.folder.glob("*.json") if journals.counts(path))
    if waiting:
        return Check("journals", "warn", f"a change was interrupted: {', '.join(waiting)}", "recover finishes it")
    return Check("journals", "ok", "no change was interrupted")


def habits_check() -> Check:
    """Count devices with remembered habits for writing."""
    from dvtcli.operations.devices.show_profiles import list_habits

    rows = list_habits().rows
    broken = [row.name for row in rows if row.problem]
    if broken:
        text = f"the saved needs of {', '.join(broken)} cannot be read"
        return Check("habits", "warn", text, "profiles forget removes it; it is found out again")
    if not rows:
        return Check("habits", "ok", "no needs of devices are recorded")
    return Check("habits", "ok", f"{len(rows)} devices want a PDO off first, or may: profiles habits shows them")


def profiles_check() -> Check:
    """Check that every profile can be read."""
    from dvtcli.files.profiles import load_profile, profile_names

    names = profile_names()
    for name in names:
        try:
            load_profile(name)
        except DvtcliError as wrong:
            return failed("profiles", wrong)
    return Check("profiles", "ok", f"{len(names)} are valid: {', '.join(names)}")


#: How long the bus is listened to, in seconds.
LISTEN_S = 1.0
_WORST = "check the bit rate, the power of the other end, and the terminators (120 ohm) at both ends of the line"


def bus_checks(session: SessionNodes) -> Iterator[Check]:
    """Check that the bus opens, its traffic, and the selected node."""
    from dvtcli.bus.python_can_settings import is_configured

    try:
        session.require_settings()
    except DvtcliError:
        yield Check("bus", "warn", "not opened: who chooses it is not certain", "see `settings` above")
        return
    options = session.options
    if not (options.sim or options.interface or options.channel or is_configured()):
        others = "dvtcli at a terminal offers what is there, or " + Hint(Action.GIVE_INTERFACE, why=" choose {}")
        others += Hint(Action.GIVE_CHANNEL, why=" and {}") + Hint(Action.GIVE_SIMULATED, why=", or {}")
        described = session.settings.described_buses()
        yield Check("bus", "warn", "none is chosen", described + others if described else others)
        return
    try:
        network = session.network
        yield Check("bus", "ok", f"{network.bus.name} opened, chosen by {session.chosen_by()}")
        yield from _received(session)
        yield from _node(session)
    except DvtcliError as error:
        yield failed("bus", error)


def _received(session: SessionNodes) -> Iterator[Check]:
    """Report the traffic of a second."""
    bus, frames = session.wire, 0

    def count(_frame: Frame, sent: bool) -> None:
        nonlocal frames
        frames += not sent

    stop, before = bus.tap(count), bus.error_frame_count()
    try:
        bus.sleep(LISTEN_S)
    finally:
        stop()
    if not bus.carries_frames:
        yield Check("traffic", "ok", "no CAN frames are carried: objects are read and written")
        return
    errors, nodes = bus.error_frame_count() - before, sorted(bus.nodes_seen())
    if errors:
        told = "; ".join(bus.disturbances()) or _WORST
        yield Check("traffic", "FAIL", f"{errors} error frames and {frames} frames in {LISTEN_S:g} s", told, 5)
    elif frames or bus.simulated:
        yield Check("traffic", "ok", f"{frames / LISTEN_S:.0f} frames/s, no error frames")
    else:
        yield Check(
            "traffic", "warn", f"nothing was received in {LISTEN_S:g} s", f"nodes may be silent: scan asks. {_WORST}"
        )
    yield Check("heartbeats", "ok", f"received from {all_nodes(nodes)}" if nodes else "none was received")


def _node(session: SessionNodes) -> Iterator[Check]:
    """Report whether the selected node answers, and its files."""
    try:
        node_id = session.node_id()
    except UsageError:
        yield Check("node", "ok", "none is selected")
        return
    try:
        node = session.node(node_id)
        node.sdo.upload(DEVICE_TYPE, 0)
    except DvtcliError as silent:
        yield failed("node", silent)
        return
    if node.dictionary is None:
        hint = Hint(Action.GIVE_EDS, why="objects have no names: {}")
        hint += add_eds([node], ", or ", " once and for all")
        yield Check("node", "warn", f'node {node_id} "{node.title}" answers; it has no EDS', hint)
        return
    if node.unlike_file:
        hint = Hint(Action.FORCE, why="changes need {}")
        hint += Hint(Action.GIVE_EDS, why=": give the {} of this device, or none")
        yield Check("node", "warn", f"node {node_id} answers; {node.unlike_file}", hint)
        return
    yield Check("node", "ok", f'node {node_id} "{node.title}" answers; {node.dictionary.source}')


def checks(session: SessionNodes) -> Iterator[Check]:
    """Run every check, prerequisites first."""
    yield _python()
    yield _packages()
    yield _settings(session)
    yield drivers_check(session)
    yield from _interfaces(session)
    yield from bus_checks(session)
    yield library_check()
    yield from state_checks(session)
    yield habits_check()
    yield profiles_check()


def _python() -> Check:
    from dvtcli.version import __version__

    return Check(
        "dvtcli", "ok", f"{__version__} on Python {platform.python_version()}, {platform.platform(terse=True)}"
    )


def _packages() -> Check:
    """Report dvtcli's packages and their versions."""
    from importlib.metadata import PackageNotFoundError, requires, version

    from dvtcli.version import DISTRIBUTION

    try:
        wanted = [line for line in requires(DISTRIBUTION) or [] if "extra ==" not in line]
    except PackageNotFoundError:
        return Check("packages", "ok", "not known: dvtcli runs from a folder or a file that pip did not install")
    try:
        names = [re.split(r"[^\w.-]", line)[0] for line in wanted]
        shown = ", ".join(f"{name} {version(name)}" for name in names)
    except PackageNotFoundError as missing:
        return Check("packages", "FAIL", f"{missing.name} is not installed", f"pip install {missing.name}")
    return Check("packages", "ok", shown)


def _settings(session: SessionUser) -> Check:
    """Report the settings in force and their sources."""
    try:
        session.require_settings()
    except DvtcliError as wrong:
        return failed("settings", wrong)
    default, options = Options()._asdict(), session.options._asdict()
    files = [file.path for file in session.settings.files]
    said = [
        f"{name} = {_shown(value)} ({session.settings.place_of(name)})"
        for name, value in options.items()
        if value != default[name]
    ]
    said += [f"{name} = {value} ({where})" for name, value, where in _library_settings(options)]
    found = f"; files: {', '.join(files)}" if files else ""
    text = ("; ".join(said) or "all as they come") + found
    project, in_vain = session.settings.project, session.settings.never_taken()
    if project is not None and not project.trusted:
        text += " (not trusted)"
    if in_vain is None and (withheld := session.settings.withheld()) is not None:
        return Check("settings", "warn", text, withheld)
    if in_vain is None:
        return Check("settings", "ok", text)
    refused, _, cure = in_vain.partition("; ")
    return Check("settings", "warn", f"{text}; {refused}", cure)


def _shown(value: object) -> str:
    return " ".join(map(str, value)) if type(value) is tuple else str(value)


def _library_settings(options: dict[str, object]) -> Iterator[tuple[str, object, str]]:
    """Yield the settings that python-can's files and environment add to *options*."""
    from dvtcli.bus.python_can_settings import library_settings

    if options["sim"] or options["interface"]:
        return
    for name, (value, where) in library_settings().items():
        if name in ("interface", "channel", "bitrate") and options.get(name) is None:
            yield name, value, where


#: interfaces of python-can without an adapter of this machine: servers, and buses within this computer
_OVER_A_LINE = frozenset({"socketcand", "udp_multicast", "virtual"})


def drivers_check(session: SessionUser) -> Check:
    """Tell which of the usual drivers are ready, and what the others lack; a warning if it is the chosen one's."""
    from dvtcli.bus.discover import drivers_missing

    found = drivers_missing()
    if not found:
        return Check("drivers", "warn", "unknown: the process that searches for them gave no answer")
    ready = [name for name, lacks in found.items() if lacks == []]
    lacking = [f"{name} ({'; '.join(lacks)})" for name, lacks in found.items() if lacks]
    absent = [name for name, lacks in found.items() if lacks is None]
    parts = {"ready": ready, "missing": lacking, "not on this system": absent}
    text = "; ".join(f"{title}: {', '.join(names)}" for title, names in parts.items() if names)
    chosen = session.options.interface or ""
    if chosen in absent:
        return Check("drivers", "warn", text, f"{chosen} does not exist on this system")
    if chosen in found and chosen not in ready:
        return Check("drivers", "warn", text, f"for {chosen}: {'; '.join(found[chosen] or ())}")
    return Check("drivers", "ok", text)


def _interfaces(session: SessionUser) -> Iterator[Check]:
    from dvtcli.bus.discover import find_interfaces

    others = list(_transports())
    found, unanswered = find_interfaces()
    for interface in found:
        verdict = "warn" if interface.problem else "ok"
        yield Check(
            "interface",
            verdict,  # type: ignore[arg-type]
            f"{interface.interface} {interface.channel}  {interface.about}".rstrip(),
            interface.problem,
        )
    if unanswered:
        cure = "disconnect the adapter and connect it again, or reinstall the driver; then repeat this"
        yield Check("interface", "warn", f"unknown adapters: no answer from {join_some(unanswered)}", cure)
    elif not found:
        on_a_line = session.options.interface in _OVER_A_LINE
        needless = bool(session.options.sim or others or on_a_line)
        hint = (
            None if needless else "check that the adapter is connected and its driver (or python-can's extra) installed"
        )
        yield Check("interface", "ok" if needless else "warn", "none was found on this machine", hint)
    yield from others


def _transports() -> Iterator[Check]:
    """Report bus interfaces from other packages, for `-i`."""
    from dvtcli.bus.opening import brought

    for transport in brought():
        yield Check(
            "transport",
            "warn" if transport.problem else "ok",
            f"{transport.name}  {transport.about}",
            transport.problem,
        )
