"""What a process that its parent bounds (`bounded_process`) does: it limits its memory and time, and says why it ends.

Imports nothing of dvtcli. Knows neither what it reads nor who asks.
"""

from __future__ import annotations

import os
import sys

#: what it ends with if Python had no memory left
NO_MEMORY = 75


def limit(most_bytes: int, most_cpu_s: int | None = None) -> None:
    """Let this process take no more memory and CPU time, if the system has such limits; and leave no core file."""
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
    """Let this process take so much CPU time more from now on (s), if the system has such a limit."""
    if sys.platform == "win32":
        return
    import resource
    from time import process_time

    _, hard = resource.getrlimit(resource.RLIMIT_CPU)
    most = int(process_time()) + 1 + most_cpu_s
    resource.setrlimit(resource.RLIMIT_CPU, (most if hard == resource.RLIM_INFINITY else min(most, hard), hard))


def die_of(bug: BaseException) -> None:
    """End this process, and say why to whoever reads what it complains of."""
    os.write(2, f"{type(bug).__name__}: {bug}"[:1000].encode("utf-8", "replace"))
    os._exit(NO_MEMORY if isinstance(bug, MemoryError) else 1)
