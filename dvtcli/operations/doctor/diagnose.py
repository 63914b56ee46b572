"""The checks behind `doctor`: this machine, the settings, the bus, what is kept. Each one answers, whatever is broken.

Does not know how checks look on a screen.
"""

from __future__ import annotations

import platform
import re
import tempfile
from collections.abc import Iterator
from typing import TYPE_CHECKING

from dvtcli.errors import DvtcliError, SafetyRefusal, UsageError
from dvtcli.operations.results.diagnosis import Check
from dvtcli.operations.user.options import Options

if TYPE_CHECKING:
    from pathlib import Path

    from dvtcli.domain.ports import Frame
    from dvtcli.operations.session.session import Session

#: How long the bus is listened to, in seconds.
LISTEN_S = 1.0
_WORST = "is the bit rate right, the other end powered, and is there a terminator (120 ohm) at each end of the line?"


def checks(session: Session) -> Iterator[Check]:
    """Every check, what the others need first."""
    yield _python()
    yield _packages()
    yield _settings(session)
    yield from _interfaces(session)
    yield from _bus(session)
    yield _library()
    yield from _kept(session)
    yield _habits()
    yield _profiles()


def failed(name: str, error: DvtcliError) -> Check:
    """The check *name* that ended in *error*."""
    why = f": {error.why}" if error.why else ""
    return Check(name, "FAIL", f"{error.text}{why}", error.hint, error.exit_code)


def _python() -> Check:
    from dvtcli.version import __version__

    return Check(
        "dvtcli", "ok", f"{__version__} on Python {platform.python_version()}, {platform.platform(terse=True)}"
    )


def _packages() -> Check:
    """The packages that dvtcli names as its own, with their versions."""
    from importlib.metadata import PackageNotFoundError, requires, version

    try:
        wanted = [line for line in requires("dvtcli") or [] if "extra ==" not in line]
        names = [re.split(r"[^\w.-]", line)[0] for line in wanted]
        shown = ", ".join(f"{name} {version(name)}" for name in names)
    except PackageNotFoundError as missing:
        return Check("packages", "FAIL", f"{missing.name} is not installed", f"pip install {missing.name}")
    return Check("packages", "ok", shown)


def _settings(session: Session) -> Check:
    """Which settings count, and where each was said."""
    try:
        session.require_settings()
    except DvtcliError as wrong:
        return failed("settings", wrong)
    default, options = Options()._asdict(), session.options._asdict()
    files = [file.path for file in session.settings.files]
    said = [
        f"{name} = {_shown(value)} ({session.settings.sources.get(name, 'this line')})"
        for name, value in options.items()
        if value != default[name]
    ]
    said += [f"{name} = {value} ({where})" for name, value, where in _library_settings(options)]
    found = f"; files: {', '.join(files)}" if files else ""
    text = ("; ".join(said) or "all as they come") + found
    in_vain = session.settings.never_taken()
    if in_vain is None:
        return Check("settings", "ok", text)
    refused, _, cure = in_vain.partition("; ")
    return Check("settings", "warn", f"{text}; {refused}", cure)


def _shown(value: object) -> str:
    return " ".join(map(str, value)) if isinstance(value, tuple) else str(value)


def _library_settings(options: dict[str, object]) -> Iterator[tuple[str, object, str]]:
    """What python-can's own files and environment add to *options*, as far as it counts."""
    from dvtcli.bus.opening import library_settings

    if options["sim"] or options["interface"]:
        return
    for name, (value, where) in library_settings().items():
        if name in ("interface", "channel", "bitrate") and options.get(name) is None:
            yield name, value, where


#: interfaces of python-can that need no adapter of this machine: servers, and what lives in this computer
_OVER_A_LINE = frozenset({"socketcand", "udp_multicast", "virtual"})


def _interfaces(session: Session) -> Iterator[Check]:
    from dvtcli.bus.discover import find_interfaces

    others = list(_transports())
    found = find_interfaces()
    for one in found:
        verdict = "warn" if one.problem else "ok"
        yield Check("interface", verdict, f"{one.interface} {one.channel}  {one.about}".rstrip(), one.problem)  # type: ignore[arg-type]
    if not found:
        on_a_line = session.options.interface in _OVER_A_LINE
        needless = bool(session.options.sim or others or on_a_line)
        hint = None if needless else "is the adapter plugged in, and its driver (or python-can's extra) installed?"
        yield Check("interface", "ok" if needless else "warn", "none was found on this machine", hint)
    yield from others


def _transports() -> Iterator[Check]:
    """Ways to a bus that other packages bring, for `-i`."""
    from dvtcli.bus.transports import brought

    for one in brought():
        yield Check("transport", "warn" if one.problem else "ok", f"{one.name}  {one.about}", one.problem)


def _bus(session: Session) -> Iterator[Check]:
    """Whether the bus opens, what is heard on it, and whether the selected node answers."""
    from dvtcli.bus.opening import is_configured

    try:
        session.require_settings()
    except DvtcliError:
        yield Check("bus", "warn", "not opened: who chooses it is not certain", "see `settings` above")
        return
    options = session.options
    if not (options.sim or options.interface or options.channel or is_configured()):
        others = "dvtcli at a terminal offers what is there; or -i and -c, or --sim"
        described = session.settings.described_buses()
        yield Check("bus", "warn", "none is chosen", f"{described}; {others}" if described else others)
        return
    try:
        network = session.network
        yield Check("bus", "ok", f"{network.bus.name} opened, chosen by {session.chosen_by()}")
        yield from _heard(session)
        yield from _node(session)
    except DvtcliError as error:
        yield failed("bus", error)


def _heard(session: Session) -> Iterator[Check]:
    """The traffic of a second."""
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
    errors, nodes = bus.error_frame_count() - before, sorted(bus.heard_nodes())
    if errors:
        told = "; ".join(bus.disturbances()) or _WORST
        yield Check("traffic", "FAIL", f"{errors} error frames and {frames} frames in {LISTEN_S:g} s", told, 5)
    elif frames or bus.simulated:
        yield Check("traffic", "ok", f"{frames / LISTEN_S:.0f} frames/s, no error frames")
    else:
        yield Check(
            "traffic", "warn", f"nothing was heard in {LISTEN_S:g} s", f"nodes may be quiet: scan asks them. {_WORST}"
        )
    yield Check("heartbeats", "ok", f"heard of node {', '.join(map(str, nodes))}" if nodes else "none was heard")


def _node(session: Session) -> Iterator[Check]:
    """Whether the selected node answers, and by which files it is known."""
    try:
        node_id = session.node_id()
    except UsageError:
        yield Check("node", "ok", "none is selected (-n ID)")
        return
    try:
        node = session.node(node_id)
        node.sdo.upload(0x1000, 0)
    except DvtcliError as silent:
        yield failed("node", silent)
        return
    if node.dictionary is None:
        hint = "objects have no names: --eds FILE, or eds add FILE once and for all"
        yield Check("node", "warn", f'node {node_id} "{node.title}" answers; no EDS is known for it', hint)
        return
    if node.unlike_file:
        hint = "changes need --force: give the --eds FILE of this device, or none"
        yield Check("node", "warn", f"node {node_id} answers; {node.unlike_file}", hint)
        return
    yield Check("node", "ok", f'node {node_id} "{node.title}" answers; {node.dictionary.source}')


def _library() -> Check:
    from dvtcli.files.device_library.stored_files import folder, stored_files

    count = len(stored_files())
    return Check("EDS files", "ok", f"{count} in {folder()}{': eds list shows them' if count else ''}")


def _kept(session: Session) -> Iterator[Check]:
    """Whether backups and journals can be written, and whether a journal waits."""
    from dvtcli.device.trust import private_folder

    folder = session.state_folder
    try:
        private_folder(folder)
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


def _habits() -> Check:
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


def _profiles() -> Check:
    from dvtcli.files.profile.library import load_profile, profile_names

    names = profile_names()
    for name in names:
        try:
            load_profile(name)
        except DvtcliError as wrong:
            return failed("profiles", wrong)
    return Check("profiles", "ok", f"{len(names)} are valid: {', '.join(names)}")
