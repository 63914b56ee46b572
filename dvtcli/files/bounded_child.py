"""A child process (see `bounded_process`) limits its own memory and CPU time, and reports why it ends.

Imports nothing of dvtcli, and no module that starts processes: what runs in the child has neither.
"""

from __future__ import annotations

import os
import sys

#: exit code if Python is out of memory
NO_MEMORY = 75


def limit(most_bytes: int, most_cpu_s: int | None = None) -> None:
    """Limit this process's memory (bytes) and CPU time (s), if the system can; disable core files."""
    if sys.platform == "win32":
        return
    import resource

    limits = [(resource.RLIMIT_AS, most_bytes, most_bytes), (resource.RLIMIT_CORE, 0, 0)]
    if most_cpu_s is not None:
        limits.append((resource.RLIMIT_CPU, most_cpu_s, most_cpu_s + 1))  # SIGXCPU comes at the lower one
    for what, most, most_ever in limits:
        _, hard = resource.getrlimit(what)
        hard = most_ever if hard == resource.RLIM_INFINITY else min(most_ever, hard)
        try:
            resource.setrlimit(what, (min(most, hard), hard))
        except (ValueError, OSError) as refused:  # macOS, below what is taken already
            os.write(2, f"no limit: {refused}\n".encode())


def go_on(most_cpu_s: int) -> None:
    """Allow this process *most_cpu_s* more seconds of CPU time from now on, if the system has a CPU limit."""
    if sys.platform == "win32":
        return
    import resource
    from time import process_time

    _, hard = resource.getrlimit(resource.RLIMIT_CPU)
    most = int(process_time()) + 1 + most_cpu_s
    resource.setrlimit(resource.RLIMIT_CPU, (most if hard == resource.RLIM_INFINITY else min(most, hard), hard))


def die_of(bug: BaseException) -> None:
    """End this process with the text of *bug* on stderr."""
    os.write(2, f"{type(bug).__name__}: {bug}"[:1000].encode("utf-8", "replace"))
    os._exit(NO_MEMORY if isinstance(bug, MemoryError) else 1)
