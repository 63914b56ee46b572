"""`python -m dvtcli.bus.driver_parts`: what of the usual interfaces is missing on this system, as JSON.

A separate process, because loading a maker's library runs its code. Opens no bus.
"""

from __future__ import annotations

import json
import socket
import sys
from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from importlib.util import find_spec

from dvtcli.interpreter import how_to_install


@dataclass(frozen=True, slots=True)
class Driver:
    """What python-can needs for an interface.

    *libraries* has names to load for each `sys.platform` that the interface works on; no names: none is needed.
    *maker* describes the library, *package* is what pip installs.
    """

    libraries: Mapping[str, tuple[str, ...]]
    maker: str = ""
    package: str = ""
    needs_kernel: bool = False


_EVERYWHERE: Mapping[str, tuple[str, ...]] = {"linux": (), "win32": (), "darwin": ()}
DRIVERS = {
    "socketcan": Driver({"linux": ()}, needs_kernel=True),
    "pcan": Driver(
        {
            "linux": ("libpcanbasic.so",),
            "win32": ("PCANBasic.dll",),
            "darwin": ("libPCBUSB.dylib", "/usr/local/lib/libPCBUSB.dylib"),
        },
        "PEAK's PCAN-Basic",
    ),
    "kvaser": Driver({"linux": ("libcanlib.so",), "win32": ("canlib32.dll",)}, "Kvaser's CANlib"),
    "ixxat": Driver({"win32": ("vcinpl2.dll", "vcinpl.dll")}, "HMS's VCI driver"),
    "gs_usb": Driver(
        {
            "linux": ("libusb-1.0.so.0", "libusb-1.0.so"),
            "win32": ("libusb-1.0.dll",),
            "darwin": ("libusb-1.0.dylib", "/opt/homebrew/lib/libusb-1.0.dylib", "/usr/local/lib/libusb-1.0.dylib"),
        },
        "libusb",
        "python-can[gs-usb]",
    ),
    "slcan": Driver(_EVERYWHERE, package="python-can[serial]"),
}


def missing_parts(name: str, platform: str = sys.platform) -> list[str] | None:
    """List what the driver of interface *name* lacks on *platform*; None if it does not exist there."""
    driver = DRIVERS[name]
    if platform not in driver.libraries:
        return None
    return list(_lacks(driver, driver.libraries[platform]))


def _lacks(driver: Driver, libraries: tuple[str, ...]) -> Iterator[str]:
    if driver.needs_kernel and (why := _kernel_lacks()):
        yield why
    if driver.package and not _is_installed(driver.package):
        yield how_to_install(driver.package)
    if libraries and (why := _not_loaded(libraries)):
        yield f"{driver.maker} {why}"


def _is_installed(package: str) -> bool:
    """Whether the modules that *package* brings can be imported; asked by name, since imports would load libraries."""
    if package == "python-can[serial]":
        return find_spec("serial") is not None
    return find_spec("gs_usb") is not None and find_spec("usb") is not None


def _kernel_lacks() -> str | None:
    """Tell why this kernel has no CAN sockets; None if it has."""
    if sys.platform != "linux" or not hasattr(socket, "AF_CAN"):
        return "this Python has no CAN sockets"
    try:
        socket.socket(socket.AF_CAN, socket.SOCK_RAW, socket.CAN_RAW).close()
    except OSError as failed:
        return f"sudo modprobe can_raw ({failed.strerror})"
    return None


def _not_loaded(libraries: tuple[str, ...]) -> str | None:
    """Tell why none of *libraries* can be loaded; None if one can."""
    try:
        from ctypes import CDLL
    except ImportError:
        return "cannot be loaded: this Python has no ctypes"
    failures = []
    for library in libraries:
        try:
            CDLL(library)
        except OSError as failed:
            failures.append(str(failed.__cause__ or failed))  # a frozen program's loader wraps the system's words
        else:
            return None
    found = [text for text in failures if not says_absent(text)]
    return f"cannot be loaded: {found[0]}" if found else f"is not installed ({libraries[0]})"


def says_absent(text: str) -> bool:
    """Whether *text*, with which Linux, Windows or macOS refused to load a library, says that there is no such file."""
    return any(words in text for words in ("cannot open shared object", "not find", "image not found")) or (
        "(no such file" in text and "(mach-o" not in text and "(not a mach-o" not in text
    )


if __name__ == "__main__":
    sys.stdout.write("\n" + json.dumps({name: missing_parts(name) for name in DRIVERS}) + "\n")
