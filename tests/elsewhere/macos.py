"""Python's standard library as macOS has it: POSIX without what only Linux has."""

from __future__ import annotations

import fcntl
import os
from typing import Any

from tests.elsewhere.double import be, facade

_OS = """
    sched_getaffinity sched_setaffinity posix_fadvise posix_fallocate copy_file_range eventfd memfd_create pidfd_open
    getrandom getxattr setxattr listxattr setns O_TMPFILE O_PATH O_NOATIME O_RSYNC getresuid setresuid
"""
_SOCKET = "AF_CAN AF_NETLINK AF_PACKET PF_CAN CAN_RAW CAN_RAW_FILTER CAN_BCM TCP_QUICKACK TCP_USER_TIMEOUT MSG_NOSIGNAL"


#: fcntl's command that waits for the drive itself
_FULL_SYNC = 51


def _fcntl(file: Any, command: int, *rest: Any) -> Any:
    if command == _FULL_SYNC:
        os.fsync(file)
        return 0
    return fcntl.fcntl(file, command, *rest)


def become() -> None:
    """From now on this Python is one on macOS, for the project's code."""
    be(
        frozenset({"spwd", "msvcrt", "winreg"}),
        {
            "os": facade("os", _OS),
            "fcntl": facade("fcntl", "F_OFD_SETLK F_SETLEASE F_SETPIPE_SZ", F_FULLFSYNC=_FULL_SYNC, fcntl=_fcntl),
            "sys": facade("sys", "", platform="darwin"),
            "signal": facade("signal", "SIGPWR SIGSTKFLT SIGRTMIN SIGRTMAX sigtimedwait sigwaitinfo SIGCLD SIGPOLL"),
            "select": facade("select", "epoll"),
            "socket": facade("socket", _SOCKET),
            "time": facade("time", "clock_settime CLOCK_BOOTTIME"),
        },
    )
