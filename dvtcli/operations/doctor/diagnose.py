"""The checks behind `doctor`: this machine, the settings, the bus, what is kept. Each one answers, whatever is broken.

Does not know how checks look on a screen.
"""

from __future__ import annotations

import platform
import re
from collections.abc import Iterator
from typing import TYPE_CHECKING

from dvtcli.errors import DvtcliError
from dvtcli.operations.doctor.bus_checks import bus_checks
from dvtcli.operations.doctor.failed_check import failed
from dvtcli.operations.doctor.kept_checks import habits_check, library_check, profiles_check, state_checks
from dvtcli.operations.results.diagnosis import Check
from dvtcli.operations.user.options import Options

if TYPE_CHECKING:
    from dvtcli.operations.session.session import Session


def checks(session: Session) -> Iterator[Check]:
    """Every check, what the others need first."""
    yield _python()
    yield _packages()
    yield _settings(session)
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
    """The packages that dvtcli names as its own, with their versions."""
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


def _settings(session: Session) -> Check:
    """Which settings count, and where each was said."""
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
    return " ".join(map(str, value)) if isinstance(value, tuple) else str(value)


def _library_settings(options: dict[str, object]) -> Iterator[tuple[str, object, str]]:
    """What python-can's own files and environment add to *options*, as far as it counts."""
    from dvtcli.bus.python_can_settings import library_settings

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
    for interface in found:
        verdict = "warn" if interface.problem else "ok"
        yield Check(
            "interface",
            verdict,  # type: ignore[arg-type]
            f"{interface.interface} {interface.channel}  {interface.about}".rstrip(),
            interface.problem,
        )
    if not found:
        on_a_line = session.options.interface in _OVER_A_LINE
        needless = bool(session.options.sim or others or on_a_line)
        hint = None if needless else "is the adapter plugged in, and its driver (or python-can's extra) installed?"
        yield Check("interface", "ok" if needless else "warn", "none was found on this machine", hint)
    yield from others


def _transports() -> Iterator[Check]:
    """Ways to a bus that other packages bring, for `-i`."""
    from dvtcli.bus.transports import brought

    for transport in brought():
        yield Check(
            "transport",
            "warn" if transport.problem else "ok",
            f"{transport.name}  {transport.about}",
            transport.problem,
        )
