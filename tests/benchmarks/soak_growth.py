"""Memory, descriptors and threads of processes over time, and what of them grew. Linux only (/proc)."""

from __future__ import annotations

from contextlib import suppress
from pathlib import Path
from statistics import median

#: of the looks: the first ones warm up, the next ones are compared with the last ones
_WARM, _PART = 0.25, 0.25
#: how much more memory is no growth (MiB, and share), since allocators keep what they once had
_MIB, _SHARE = 8.0, 0.15
#: how many more descriptors or threads are no growth: one connection more at this moment
_FEW = 3
#: fewer looks say nothing
_LOOKS = 60


class Growth:
    """Looks at *processes* by name."""

    def __init__(self, processes: dict[str, int]) -> None:
        self._processes = dict(processes)
        self._looks: dict[str, list[tuple[float, int, int]]] = {}

    def watch(self, name: str, process_id: int) -> None:
        """Look at this process from now on; another one of that name before begins anew."""
        if self._processes.get(name) != process_id:
            self._processes[name] = process_id
            self._looks.pop(name, None)

    def look(self) -> None:
        """Look at each once."""
        for name, process_id in tuple(self._processes.items()):
            with suppress(OSError, ValueError, KeyError):
                self._looks.setdefault(name, []).append(_look(process_id))

    def report(self) -> list[str]:
        """Print a row each; the names of what grew."""
        grown = []
        print(f"  {'process':<12} {'MiB then':>9} {'now':>7} {'descriptors':>12} {'now':>5} {'threads':>8} {'now':>5}")
        for name, looks in sorted(self._looks.items()):
            size = max(1, int(len(looks) * _PART))
            first = int(len(looks) * _WARM)
            then, now = looks[first : first + size] or looks, looks[-size:]
            row = [[median(look[column] for look in part) for part in (then, now)] for column in range(3)]
            (was, mib), (had, files), (ran, threads) = row
            print(f"  {name:<12} {was:>9.1f} {mib:>7.1f} {had:>12g} {files:>5g} {ran:>8g} {threads:>5g}")
            grew = mib > was * (1 + _SHARE) + _MIB or files > had + _FEW or threads > ran + _FEW
            if grew and len(looks) >= _LOOKS:
                grown.append(name)
        return grown


def _look(process_id: int) -> tuple[float, int, int]:
    """MiB that are the process's own, descriptors, threads."""
    process = Path(f"/proc/{process_id}")
    status = dict(line.split(":", 1) for line in (process / "status").read_text().splitlines() if ":" in line)
    return int(status["RssAnon"].split()[0]) / 1024, len(list((process / "fd").iterdir())), int(status["Threads"])
