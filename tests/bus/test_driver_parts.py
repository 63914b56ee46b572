"""Which parts of a driver are missing: libraries that load or do not, Python's modules, a kernel's sockets."""

from __future__ import annotations

import json
import shutil
import subprocess
import sys
from pathlib import Path

import can
import pytest

from dvtcli.bus.driver_parts import DRIVERS, missing_parts, says_absent
from tests.process import environment

on_linux = pytest.mark.skipif(sys.platform != "linux", reason="LD_LIBRARY_PATH names the folder of libraries")


def missing(folder: Path, *, without_packages: bool = False) -> dict[str, list[str] | None]:
    """What a new process finds missing if libraries are also looked for in *folder*."""
    isolated = ["-S"] if without_packages else []
    done = subprocess.run(
        [sys.executable, *isolated, "-m", "dvtcli.bus.driver_parts"],
        env=environment() | {"LD_LIBRARY_PATH": str(folder)}, capture_output=True, text=True, check=True,
    )  # fmt: skip
    found: dict[str, list[str] | None] = json.loads(done.stdout)
    return found


def a_library() -> Path:
    """A shared library of this machine."""
    maps = Path("/proc/self/maps").read_text("utf-8").split()
    return Path(next(word for word in maps if word.startswith("/") and "libc.so" in word))


@on_linux
def test_a_library_that_loads_is_ready_and_one_that_does_not_says_why(tmp_path: Path) -> None:
    before = missing(tmp_path)
    if not before["kvaser"]:
        pytest.skip("Kvaser's CANlib is installed here")
    assert before["kvaser"] == ["Kvaser's CANlib is not installed (libcanlib.so)"]
    shutil.copyfile(a_library(), tmp_path / "libcanlib.so")
    (tmp_path / "libpcanbasic.so").write_bytes(b"no library" * 100)
    found = missing(tmp_path)
    assert found["kvaser"] == []
    (why,) = found["pcan"] or ()
    assert why.startswith("PEAK's PCAN-Basic cannot be loaded: ")
    assert "invalid ELF header" in why
    assert {name: lacks for name, lacks in found.items() if name not in ("kvaser", "pcan")} == {
        name: lacks for name, lacks in before.items() if name not in ("kvaser", "pcan")
    }


def test_a_missing_module_is_named_with_what_installs_it(tmp_path: Path) -> None:
    found = missing(tmp_path, without_packages=True)
    assert found["slcan"] == ["pip install 'python-can[serial]'"]
    assert "pip install 'python-can[gs-usb]'" in (found["gs_usb"] or [])


@pytest.mark.parametrize(
    ("text", "absent"),
    [
        ("libcanlib.so: cannot open shared object file: No such file or directory", True),
        ("/usr/lib/libcanlib.so: invalid ELF header", False),
        ("libcanlib.so: wrong ELF class: ELFCLASS32", False),
        ("Could not find module 'PCANBasic.dll' (or one of its dependencies). Try using the full path", True),
        ("[WinError 193] %1 is not a valid Win32 application", False),
        ("dlopen(libPCBUSB.dylib, 6): image not found", True),
        ("dlopen(libPCBUSB.dylib, 0x0006): tried: 'libPCBUSB.dylib' (no such file), '/usr/lib/libPCBUSB.dylib' (no such"
         " file, not in dyld cache)", True),
        ("dlopen(libPCBUSB.dylib, 0x0006): tried: 'libPCBUSB.dylib' (no such file), '/usr/local/lib/libPCBUSB.dylib'"
         " (mach-o file, but is an incompatible architecture (have 'x86_64', need 'arm64'))", False),
        ("dlopen(libPCBUSB.dylib, 0x0006): tried: 'libPCBUSB.dylib' (not a mach-o file), '/usr/lib/libPCBUSB.dylib' (no"
         " such file)", False),
    ],
)  # fmt: skip
def test_a_library_that_is_absent_is_told_from_one_that_is_broken(text: str, absent: bool) -> None:
    """In the words of Linux, Windows and macOS."""
    assert says_absent(text) is absent


@pytest.mark.parametrize(
    ("platform", "absent"),
    [("linux", {"ixxat"}), ("win32", {"socketcan"}), ("darwin", {"socketcan", "kvaser", "ixxat"})],
)
def test_each_system_has_its_interfaces(platform: str, absent: set[str]) -> None:
    assert {name for name in DRIVERS if missing_parts(name, platform) is None} == absent


def test_they_are_python_cans() -> None:
    assert set(DRIVERS) <= set(can.VALID_INTERFACES)
