"""Python's standard library as Windows has it.

Not doubled: drive letters and `\\` between folders, the console's own interface, and what other packages do there.
"""

from __future__ import annotations

import fcntl
import os
import select
import signal
import stat
import struct
import subprocess
import sys
from collections.abc import Iterable
from types import ModuleType
from typing import Any

from tests.elsewhere.double import be, facade
from tests.elsewhere.windows_files import CODE_PAGE, strict_files

_MODULES = "fcntl termios tty pty pwd grp resource readline curses syslog posix"
_OS = """
    fork forkpty geteuid getuid getgid getegid getgroups getpgid getpgrp getsid setsid setuid setgid seteuid setegid
    setpgid setpgrp setregid setreuid setresuid setgroups initgroups fchmod fchown chown lchown lchmod chroot mkfifo
    mknod makedev major minor nice getpriority setpriority killpg openpty ttyname tcgetpgrp tcsetpgrp pipe2 posix_spawn
    posix_spawnp posix_fadvise posix_fallocate pread preadv pwrite pwritev readv writev sched_getaffinity
    sched_setaffinity sched_yield statvfs fstatvfs sync fdatasync uname wait wait3 wait4 waitid WNOHANG WIFEXITED
    WEXITSTATUS getloadavg confstr sysconf pathconf fpathconf ctermid copy_file_range eventfd memfd_create pidfd_open
    fwalk get_blocking set_blocking lockf getrandom register_at_fork sendfile getxattr setxattr listxattr
    O_NOFOLLOW O_CLOEXEC O_NONBLOCK O_DIRECTORY O_SYNC O_DSYNC O_NOCTTY O_TMPFILE O_PATH O_NOATIME
"""
_SIGNALS = """
    SIGHUP SIGQUIT SIGTRAP SIGBUS SIGKILL SIGUSR1 SIGUSR2 SIGPIPE SIGALRM SIGCHLD SIGCONT SIGSTOP SIGTSTP SIGTTIN
    SIGTTOU SIGURG SIGXCPU SIGXFSZ SIGVTALRM SIGPROF SIGWINCH SIGIO SIGPOLL SIGPWR SIGSYS SIGRTMIN SIGRTMAX SIGCLD
    SIGSTKFLT alarm setitimer getitimer ITIMER_REAL ITIMER_VIRTUAL pthread_kill pthread_sigmask SIG_BLOCK SIG_UNBLOCK
    SIG_SETMASK sigpending sigwait sigwaitinfo sigtimedwait siginterrupt pause
"""
_SOCKET = """
    AF_CAN AF_NETLINK AF_UNIX AF_PACKET PF_CAN CAN_RAW CAN_RAW_FILTER CAN_BCM MSG_DONTWAIT MSG_NOSIGNAL SO_REUSEPORT
    TCP_QUICKACK TCP_USER_TIMEOUT CMSG_LEN CMSG_SPACE SCM_RIGHTS send_fds recv_fds
"""
#: Ctrl-Break's signal, which other systems know as SIGTTIN: whoever sends that sends a Ctrl-Break here
_SIGBREAK = 21
_HANDLED = frozenset(
    {signal.SIGABRT, signal.SIGFPE, signal.SIGILL, signal.SIGINT, signal.SIGSEGV, signal.SIGTERM, _SIGBREAK}
)
#: msvcrt's mode that lets go
_UNLOCK = 0


def become() -> None:
    """From now on this Python is one on Windows, for the project's code; whoever opens files finds Windows' rules."""
    strict_files()
    _streams()
    _folders()
    modules: dict[str, ModuleType] = {
        "os": facade("os", _OS, name="nt", linesep="\r\n", O_BINARY=0x8000, O_NOINHERIT=0, startfile=None, kill=_kill),
        "sys": facade("sys", "abiflags getdlopenflags", platform="win32"),
        "signal": facade("signal", _SIGNALS, SIGBREAK=_SIGBREAK, CTRL_C_EVENT=0, CTRL_BREAK_EVENT=1, signal=_signal),
        "select": facade("select", "poll epoll kqueue POLLIN POLLERR POLLHUP POLLNVAL", select=_select),
        "socket": facade("socket", _SOCKET),
        "subprocess": facade("subprocess", "", Popen=Popen, run=_run, CREATE_NEW_PROCESS_GROUP=0x200),
        "time": facade("time", "tzset clock_gettime clock_settime CLOCK_MONOTONIC CLOCK_BOOTTIME"),
        "msvcrt": _module("msvcrt", locking=_locking, LK_UNLCK=0, LK_LOCK=1, LK_NBLCK=2, kbhit=lambda: False),
        "winreg": _module("winreg", **_registry()),
    }  # fmt: skip
    be(frozenset(_MODULES.split()), modules)


def _module(name: str, **names: object) -> ModuleType:
    made = ModuleType(name)
    made.__dict__.update(names)
    return made


def _streams() -> None:
    """A console speaks UTF-8, pipes and files the system's code page, unless the environment says something else."""
    for stream, errors in ((sys.stdin, "strict"), (sys.stdout, "strict"), (sys.stderr, "backslashreplace")):
        if stream is None:
            continue
        if "PYTHONIOENCODING" not in os.environ and not stream.isatty():
            stream.reconfigure(encoding=CODE_PAGE, errors=errors)  # type: ignore[union-attr]
        if stream is not sys.stdin and not stream.isatty():
            stream.reconfigure(newline="\r\n")  # type: ignore[union-attr]


def _folders() -> None:
    """platformdirs' own code for Windows, which asks LOCALAPPDATA and APPDATA where it finds no other way."""
    real = sys.platform
    sys.platform = "win32"
    sys.modules["ctypes"] = None  # type: ignore[assignment]
    try:
        import platformdirs  # noqa: F401 - it looks at the platform once
    finally:
        sys.platform = real
        del sys.modules["ctypes"]


def _kill(process_id: int, number: int) -> None:
    """Whatever is sent to another process ends it at once, and none of its handlers learns of it.

    But for Ctrl-C and Ctrl-Break: whoever sends SIGINT, or Ctrl-Break's number, means these keys.
    """
    events = {0: signal.SIGINT, 1: _SIGBREAK}
    number = events.get(number, number)
    is_heard = process_id == os.getpid() or number in (signal.SIGINT, _SIGBREAK)
    os.kill(process_id, number if is_heard else signal.SIGKILL)


def _signal(number: int, handler: Any) -> Any:
    if number not in _HANDLED:
        raise ValueError("invalid signal value")
    return signal.signal(number, handler)


def _select(
    readers: Iterable[Any], writers: Iterable[Any], others: Iterable[Any], timeout_s: float | None = None
) -> tuple[list[Any], list[Any], list[Any]]:
    """Of sockets only, and of one at least."""
    waiting = [*readers, *writers, *others]
    if not waiting:
        raise OSError(10022, "An invalid argument was supplied")
    for one in waiting:
        if not stat.S_ISSOCK(os.fstat(one if isinstance(one, int) else one.fileno()).st_mode):
            raise OSError(10038, "An operation was attempted on something that is not a socket")
    return select.select(readers, writers, others, timeout_s)


class Popen(subprocess.Popen):  # type: ignore[type-arg]
    """Processes without what only other systems have; the flags of Windows are taken."""

    def __init__(self, *words: Any, creationflags: int = 0, **how: Any) -> None:
        for name in ("preexec_fn", "pass_fds", "user", "group", "umask", "process_group"):
            if how.get(name) not in (None, (), -1):
                raise ValueError(f"{name} is not supported on Windows platforms")
        super().__init__(*words, **how)


def _run(*words: Any, **how: Any) -> Any:
    how.pop("creationflags", None)
    return subprocess.run(*words, **how)  # noqa: PLW1510 - as the caller says


def _locking(descriptor: int, mode: int, count: int) -> None:
    """Lock *count* bytes from where the file stands, for this opening of it; OSError where another one has them."""
    start = os.lseek(descriptor, 0, os.SEEK_CUR)
    kind = fcntl.F_UNLCK if mode == _UNLOCK else fcntl.F_WRLCK
    # of an opening of the file, as Windows' locks are, not of the process (struct flock of 64-bit Linux)
    request = struct.pack("hhqqi4x", kind, os.SEEK_SET, start, count, 0)
    try:
        fcntl.fcntl(descriptor, fcntl.F_OFD_SETLK, request)
    except OSError as held:
        raise PermissionError(13, "Permission denied") from held


def _registry() -> dict[str, Any]:
    """winreg with the serial ports of TESTS_SERIAL_PORTS: `\\Device\\USBSER000=COM3`, with blanks between."""
    rows = [row.partition("=")[::2] for row in os.environ.get("TESTS_SERIAL_PORTS", "").split()]

    class Key:
        def __enter__(self) -> Key:
            return self

        def __exit__(self, *_: object) -> None: ...

    def open_key(_root: object, path: str) -> Key:
        if path != r"HARDWARE\DEVICEMAP\SERIALCOMM" or not rows:
            raise FileNotFoundError(2, "The system cannot find the file specified")
        return Key()

    def enum_value(_key: Key, number: int) -> tuple[str, str, int]:
        if number >= len(rows):
            raise OSError(259, "No more data is available")
        return (*rows[number], 1)

    return {"HKEY_LOCAL_MACHINE": 0x80000002, "OpenKey": open_key, "EnumValue": enum_value}
