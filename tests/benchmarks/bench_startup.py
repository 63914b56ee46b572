"""How long a command takes from start to end, beside a bare import of what such a program cannot do without.

    python -m tests.benchmarks startup

Processor time of whole processes, started in turn.
"""

from __future__ import annotations

from collections.abc import Iterator

from tests.benchmarks.figures import ROOT, Figure, cpu_s

#: what it is compared with; python-can imports asammdf, which takes half a second, wherever that is installed
IMPORT = "import sys; sys.modules['asammdf'] = None; import {module}"
ENTRY = "import sys; from dvtcli.__main__ import entry; sys.argv[1:] = {words!r}; entry()"
#: name, words of dvtcli, what is imported beside it, goal as a ratio
ROWS: list[tuple[str, list[str], str, float]] = [
    ("dvtcli --help", ["--help"], "click", 1.3),
    ("dvtcli --sim gen4 read 6041", ["--sim", "gen4", "read", "6041"], "can", 1.4),
    ("dvtcli --sim gen4 pdo", ["--sim", "gen4", "pdo"], "can", 1.5),
    ("dvtcli --sim gen4 map tpdo3 6041", ["--sim", "gen4", "-y", "map", "tpdo3", "6041"], "can", 1.5),
    (
        "dvtcli plan of two simulated nodes",
        ["--sim", "gen4@1", "--sim", "generic@5", "plan", str(ROOT / "examples" / "line.yaml")],
        "can",
        2.0,
    ),
]


def figures(rounds: int) -> Iterator[Figure]:
    """Each of ROWS."""
    for name, words, module, most in ROWS:
        command, other = ["-c", ENTRY.format(words=words)], ["-c", IMPORT.format(module=module)]
        for once in (command, other):
            cpu_s(once)  # compile, and fill the file cache
        pairs = [(1000 * cpu_s(command), 1000 * cpu_s(other)) for _ in range(rounds)]
        own, others = zip(*pairs, strict=True)
        yield Figure(name, "ms", own, f"import {module}", others, most=most)
