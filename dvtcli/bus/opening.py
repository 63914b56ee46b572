"""Open a python-can bus, or a bus of another package; wait for a missing bus: retry, and at once after kernel news."""

from __future__ import annotations

import errno
import socket
import subprocess
import sys
from collections.abc import Callable, Iterator, Mapping
from contextlib import contextmanager, suppress
from dataclasses import dataclass, replace
from difflib import get_close_matches
from importlib.metadata import EntryPoint, entry_points
from select import select
from time import monotonic, sleep
from typing import Any, TypeVar

import can

from dvtcli.bus.carrier import Carrier
from dvtcli.bus.drivers import PcanCarrier, check_bit_rate, is_missing, what_to_install, why_missing
from dvtcli.bus.kernel_links import KernelCarrier, check_link, kernel_link
from dvtcli.bus.python_can import BitRateSetter, CanBus
from dvtcli.bus.python_can_settings import bit_rate_of, bus_name, given_settings, with_library_settings
from dvtcli.bus.sdo.sdo_link import DEFAULT_RETRIES, DEFAULT_TIMEOUT_S
from dvtcli.bus.socketcand import ServerCarrier, SocketcandBus
from dvtcli.domain.hint import Action, Hint
from dvtcli.domain.ports import CanopenBus
from dvtcli.domain.text import plural
from dvtcli.errors import BusUnavailable
from dvtcli.interpreter import how_to_install, python_words

#: errors of python-can's drivers if a driver, a setting or a device is missing
OPEN_FAILURES = (
    can.CanError,
    OSError,
    ValueError,
    TypeError,
    KeyError,
    AttributeError,
    NameError,
    ImportError,
    NotImplementedError,
    RuntimeError,
)
_DRIVER_PACKAGES = {
    "slcan": "python-can[serial]",
    "serial": "python-can[serial]",
    "robotell": "python-can[serial]",
    "seeedstudio": "python-can[seeedstudio]",
    "gs_usb": "python-can[gs-usb]",
    "canalystii": "python-can[canalystii]",
    "cantact": "python-can[cantact]",
    "neovi": "python-can[neovi]",
    "udp_multicast": "python-can[multicast]",
    "pcan": "python-can[pcan]",
}
_NO_CHANNEL = Hint(
    Action.CHECK_SETUP, why="is the adapter plugged in, and the channel's name right? {} lists the interfaces found"
)
_NO_PERMISSION = {
    "linux": "no permission: sudo usermod -aG dialout $USER, then log in again (`ls -l` shows the port's group)",
    "win32": "another program has it open, or this user may not use it",
}.get(sys.platform, "no permission: `ls -l` shows the owner")
_ERRNO_HINTS: dict[int, Hint | str] = {
    errno.ENODEV: _NO_CHANNEL,
    errno.ENXIO: _NO_CHANNEL,
    errno.ENOENT: _NO_CHANNEL,
    errno.EACCES: _NO_PERMISSION,
    errno.EPERM: _NO_PERMISSION,
    errno.EBUSY: "another program has opened it",
    errno.EAFNOSUPPORT: "this system's kernel has no SocketCAN (sudo modprobe can_raw)",
    errno.ECONNREFUSED: Hint(Action.SERVE, why="no server there: start it first ({})"),
    errno.ETIMEDOUT: "no answer from there: check the host name and the port",
}
#: errors of an unplugged adapter, a busy port and a missing server
_PASSING = frozenset(
    {errno.ENODEV, errno.ENXIO, errno.ENOENT, errno.EBUSY, errno.EIO, errno.ECONNREFUSED, errno.ECONNRESET}
    | {errno.ETIMEDOUT, errno.EHOSTUNREACH, errno.ENETUNREACH, errno.ENETDOWN}
)


def unavailable(config: Mapping[str, object], error: Exception) -> BusUnavailable:
    """The error for *config* after python-can or a driver raised *error*."""
    if config.get("interface") is None:
        return BusUnavailable(
            "no CAN interface is configured",
            hint=Hint(Action.GIVE_INTERFACE, why="give {}")
            + Hint(Action.GIVE_CHANNEL, why=" and {}")
            + Hint(Action.GIVE_SIMULATED, {"what": "generic"}, ", or {} for a simulated node"),
        )
    why = str(error) or type(error).__name__
    if isinstance(error, NameError) and config["interface"] in can.VALID_INTERFACES:
        why = why_missing(str(config["interface"]))
    unavailable = BusUnavailable(f"cannot open {bus_name(config)}", why=why, hint=_hint(config, error))
    number = errno.ETIMEDOUT if isinstance(error, TimeoutError) else _errno_of(error)
    unavailable.may_come = number in _PASSING or (isinstance(error, can.CanError) and not is_missing(error))
    return unavailable


def _hint(config: Mapping[str, object], error: Exception) -> Hint | str:
    interface, channel = str(config["interface"]), config.get("channel")
    others = transports()
    if interface not in can.VALID_INTERFACES and interface not in others:
        known = [*can.VALID_INTERFACES, *others]
        near = get_close_matches(interface, known, n=3)
        meant = f"did you mean {near[0]}? " if near else ""
        return f"{meant}known interfaces: {', '.join(sorted(known))}"
    if interface == "socketcan" and {"host", "port"} & config.keys():
        return Hint(
            Action.GIVE_INTERFACE, {"interface": "socketcand"},
            "socketcan is a link of this computer; a server at a host and port is {}",
        )  # fmt: skip
    number = errno.ETIMEDOUT if isinstance(error, TimeoutError) else _errno_of(error)
    if number in _ERRNO_HINTS:
        return _ERRNO_HINTS[number]
    if interface in others and interface not in can.VALID_INTERFACES:
        return f"{interface} has its own package; its documentation describes the channel"
    if isinstance(error, ImportError | can.CanInterfaceNotImplementedError):
        package = _DRIVER_PACKAGES.get(interface)
        if package:
            return f"its driver is missing: {how_to_install(package)}"
    if is_missing(error) and (install := what_to_install(interface)) is not None:
        return install
    return _setting_hint(interface, channel, error)


def _setting_hint(interface: str, channel: object, error: Exception) -> Hint | str:
    if interface == "socketcand":
        return (
            Hint(Action.GIVE_INTERFACE, {"interface": "socketcand"}, "for example {}")
            + Hint(Action.GIVE_CHANNEL, {"channel": "127.0.0.1:29536"}, " {}, for can0 of that server")
            + Hint(Action.GIVE_CHANNEL, {"channel": "can1"}, "for another interface {}")
            + Hint(Action.GIVE_SETTING, {"setting": "host=127.0.0.1"}, " {}")
            + Hint(Action.GIVE_SETTING, {"setting": "port=29536"}, " {}")
        )
    if channel is None:
        return Hint(Action.GIVE_CHANNEL, why="no channel: give {}")
    if isinstance(error, TypeError):
        return Hint(
            Action.GIVE_SETTING, why="a setting is missing or unknown: {}, see python-can's page about this interface"
        )
    return "is the maker's driver installed?" + replace(_NO_CHANNEL, why=f" {_NO_CHANNEL.why}")


def _errno_of(error: BaseException | None) -> int | None:
    """The operating system's error number for *error* or its cause."""
    while error is not None:
        if isinstance(error, OSError) and error.errno is not None:
            return error.errno
        error = error.__cause__ or error.__context__
    return None


class SlcanCarrier(Carrier):
    """The adapter at *port*; *asked* is the requested bit rate (bit/s), None for none."""

    def __init__(self, port: str, asked: int | None) -> None:
        self._damaged = self._told_damaged = 0
        self._news: list[str] = []
        if asked is None:
            self._news.append(
                f"no bit rate is given: {port} keeps its present bit rate; without a bit rate it does not open"
            )

    def is_damaged(self, error: Exception) -> bool:
        """Whether *error* of receiving is a damaged line: characters were lost, and the next line is whole."""
        damaged = isinstance(error, ValueError | IndexError) and not isinstance(error, can.CanError)
        self._damaged += damaged
        return damaged

    def news(self) -> list[str]:
        """A missing bit rate, and damaged lines."""
        news, self._news = self._news, []
        if self._damaged > self._told_damaged:
            lines = plural(self._damaged - self._told_damaged, "damaged line")
            news.append(
                f"the adapter sent {lines}, whose frames are missing: characters were lost on the serial line; use "
                f"another cable or port, or the setting rtscts=true of the interface"
            )
            self._told_damaged = self._damaged
        return news

    def lost_frames(self) -> int:
        """How many lines were damaged."""
        return self._damaged


#: interfaces that echo sent frames only with receive_own_messages
_NO_ECHO_UNASKED = frozenset({"socketcan", "virtual"})


def open_bus(
    interface: str | None = None,
    channel: str | None = None,
    bitrate: int | None = None,
    extra: Mapping[str, object] | None = None,
    *,
    timeout_s: float = DEFAULT_TIMEOUT_S,
    retries: int = DEFAULT_RETRIES,
) -> CanBus:
    """Open a CAN interface. Raises BusUnavailable with the reason and a hint.

    *interface*, *channel*, *bitrate* (bit/s) and *extra* have python-can's names and meaning; a None value
    comes from python-can's own configuration. *timeout_s* is the SDO time-out, *retries* (0..) the repetitions of a
    read's first request after it.
    """
    config = given = given_settings(interface, channel, bitrate, extra or {})
    try:
        config = with_library_settings(given)
        _look_first(config)
        bus = _open(config)
    except OPEN_FAILURES as error:
        raise unavailable(config, error) from error
    carrier = _carrier(config, bus)
    opened = CanBus(
        bus,
        bus_name(config),
        timeout_s=timeout_s,
        retries=retries,
        bitrate=carrier.bit_rate or bit_rate_of(config),
        carrier=carrier,
        setter=BitRateSetter(config, _open),
    )
    if config["interface"] in _NO_ECHO_UNASKED and not config.get("receive_own_messages"):
        opened.echoes.rule_out()
    return opened


def open_listening(
    interface: str | None, channel: str | None, bit_rate: int, extra: Mapping[str, object], *, listen_only: bool
) -> CanBus:
    """Open a CAN interface to listen at *bit_rate* (bit/s), and later at others (`set_bit_rate`).

    *listen_only* sends nothing. Raises SafetyRefusal if listen-only mode is not certain, or if the bit rate cannot be
    set from here; BusUnavailable. A system link already in listen-only mode is used with its own bit rate.
    """
    config = given = given_settings(interface, channel, bit_rate, extra)
    try:
        config = with_library_settings(given)
        setter = BitRateSetter(config, _open)
        link = kernel_link(str(config.get("channel"))) if config["interface"] == "socketcan" else None
        if link is not None and link.up and link.listen_only:
            return CanBus(_open(config), bus_name(config), bitrate=link.bit_rate, setter=setter)
        setter.require(bit_rate, listen_only=listen_only)
        bus = setter.reopened(bit_rate, listen_only=listen_only)
    except OPEN_FAILURES as error:
        raise unavailable(config, error) from error
    return CanBus(bus, bus_name(config), bitrate=bit_rate, carrier=_carrier(config, bus), setter=setter)


def _look_first(config: Mapping[str, object]) -> None:
    """Check for obstacles before opening; raises one of OPEN_FAILURES with a better reason."""
    if config["interface"] == "socketcan":
        check_link(config.get("channel"))
    if config["interface"] == "pcan":
        check_bit_rate(config, bit_rate_of(config))


def _open(config: Mapping[str, object]) -> can.BusABC:
    options: dict[str, Any] = dict(config)
    if options["interface"] == "socketcand":
        del options["interface"]
        return SocketcandBus(**options)
    return can.Bus(**options, ignore_config=True)


def open_transport(
    interface: str | None = None,
    channel: str | None = None,
    bitrate: int | None = None,
    extra: Mapping[str, object] | None = None,
    *,
    timeout_s: float = DEFAULT_TIMEOUT_S,
    retries: int = DEFAULT_RETRIES,
) -> CanopenBus:
    """As `open_bus`, also for another package's bus that is no python-can interface.

    Found by an entry point *interface* in the group `dvtcli.bus`: a function with all parameters of this function but
    the first.
    """
    found = None if interface is None or interface in can.VALID_INTERFACES else transports().get(interface)
    if found is None:
        return open_bus(interface, channel, bitrate, extra, timeout_s=timeout_s, retries=retries)
    try:
        opened: CanopenBus = found.load()(channel, bitrate, extra or {}, timeout_s=timeout_s, retries=retries)
    except OPEN_FAILURES as error:
        raise unavailable({"interface": interface, "channel": channel}, error) from error
    return opened


def _carrier(config: Mapping[str, object], bus: can.BusABC) -> Carrier:
    """The carrier for *bus*."""
    if config["interface"] == "socketcan":
        return KernelCarrier(bus, str(config["channel"]), bit_rate_of(config))
    if config["interface"] == "pcan":
        return PcanCarrier(bit_rate_of(config))
    if config["interface"] == "slcan":
        return SlcanCarrier(str(config["channel"]), bit_rate_of(config))
    return ServerCarrier(bus) if isinstance(bus, SocketcandBus) else Carrier()


#: group of the entry points
GROUP = "dvtcli.bus"
#: Time to load a package, in seconds: long enough for a busy computer.
PATIENCE_S = 30.0
_LOAD = """
import sys
from importlib.metadata import EntryPoint
if not callable(EntryPoint("", sys.argv[1], "").load()):
    raise TypeError("it is not a function")
"""


@dataclass(frozen=True, slots=True)
class Brought:
    """Another package's bus by *name*; *about* names its package and fault, *problem* the remedy."""

    name: str
    about: str
    problem: Hint | str | None = None


def transports() -> Mapping[str, EntryPoint]:
    """The entry point for each name; the last found if a name is used twice."""
    return {point.name: point for point in entry_points(group=GROUP)}


def brought() -> Iterator[Brought]:
    """Each bus of other packages; loading longer than `PATIENCE_S` is a problem."""
    from can import VALID_INTERFACES

    for name, one in sorted(transports().items()):
        about = f"of {_package(one)}: {one.value}"
        if name in VALID_INTERFACES:
            yield Brought(name, about, "never opened: python-can has an interface of this name")
            continue
        hint: Hint | str | None = None
        if (why := _problem(one)) is not None:
            about, hint = f"{about}; {why}", "`pip check` says what its package lacks"
        others = [f"that of {_package(other)}: {other.value}" for other in entry_points(group=GROUP, name=name)]
        others.remove(f"that of {_package(one)}: {one.value}")
        if others:
            about = f"{about}; never opened: {', '.join(others)}"
            which = f"{{}} opens that of {_package(one)}: uninstall the wrong package"
            hint = Hint(Action.GIVE_INTERFACE, {"interface": name}, which)
        yield Brought(name, about, hint)


def _package(one: EntryPoint) -> str:
    return "a package" if one.dist is None else f"{one.dist.name} {one.dist.version}"


def _problem(one: EntryPoint) -> str | None:
    """Why *one* cannot be loaded; None if it can."""
    command = [*python_words(), "-P", "-c", _LOAD, one.value]
    try:
        done = subprocess.run(  # noqa: S603 - our own words
            command, stdout=subprocess.DEVNULL, stderr=subprocess.PIPE, stdin=subprocess.DEVNULL,
            timeout=PATIENCE_S, encoding="utf-8", errors="replace", check=False,
        )  # fmt: skip
    except subprocess.TimeoutExpired:
        return f"it cannot be loaded within {PATIENCE_S:g} s"
    if done.returncode == 0:
        return None
    said = done.stderr.strip().splitlines()
    return f"it cannot be loaded: {said[-1] if said else f'its process ended with {done.returncode}'}"


B = TypeVar("B")
#: pause between two tries (s): first, and maximum
FIRST_S, MOST_S = 0.1, 2.0
#: maximum delay until *stopping* is noticed (s)
_SLICE_S = 0.05
#: rtnetlink's group for link events (linux/rtnetlink.h)
_LINK_NEWS = 1


def wait_for_bus(open_once: Callable[[], B], stopping: Callable[[], bool]) -> B | None:
    """Try *open_once* until the bus opens; None as soon as *stopping*().

    The pause doubles between tries up to MOST_S; kernel news about a link end it.
    """
    pause_s = FIRST_S
    with _link_news() as news:
        while not stopping():
            with suppress(BusUnavailable):
                return open_once()
            pause_s = FIRST_S if _rested(news, pause_s, stopping) else min(2 * pause_s, MOST_S)
    return None


def _rested(news: socket.socket | None, pause_s: float, stopping: Callable[[], bool]) -> bool:
    """Wait *pause_s*, or until *stopping*() or a link event; True for a link event."""
    end_s = monotonic() + pause_s
    while not stopping() and (left_s := end_s - monotonic()) > 0:
        if news is None:
            sleep(min(left_s, _SLICE_S))
        elif select([news], [], [], min(left_s, _SLICE_S))[0]:
            sleep(_SLICE_S)  # events come in groups, as a link is set up in several steps
            _read_all(news)
            return True
    return False


def _read_all(news: socket.socket) -> None:
    with suppress(OSError):  # no more events; or so many that some were lost, which is an event, too
        while news.recv(1 << 16):
            pass


@contextmanager
def _link_news() -> Iterator[socket.socket | None]:
    """A socket that is readable after a link event; None if the kernel has no such events."""
    family = getattr(socket, "AF_NETLINK", None)
    news = None
    if family is not None:
        with suppress(OSError):  # a sandbox, or a kernel without it
            news = socket.socket(family, socket.SOCK_RAW, 0)
            news.setblocking(False)
            news.bind((0, _LINK_NEWS))
    try:
        yield news
    finally:
        if news is not None:
            news.close()
