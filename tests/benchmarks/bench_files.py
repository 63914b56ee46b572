"""What commands take that read a network file and no bus, beside ruamel.yaml's reading of the same file.

    python -m tests.benchmarks files

Networks of 16 and 127 nodes of the generic family, four TPDOs and four RPDOs each. Processor time of whole processes.
`growth` is the exponent from 16 to 127 nodes of the time without what a command takes for one node, by the least times
of all rounds; each round takes the least of three, since a start varies as much as few nodes take.
"""

from __future__ import annotations

import tempfile
from collections.abc import Iterator
from math import log
from pathlib import Path

from examples.many_nodes import network
from tests.benchmarks.figures import Figure, cpu_s

COUNTS = (1, 16, 127)
#: a command of a network file, and how often ruamel.yaml's time of reading it the one of 127 nodes may take
COMMANDS: list[tuple[str, list[str], float]] = [
    ("load", ["load", "{}"], 3.3),
    ("check", ["check", "{}"], 3.3),
    ("explain -d", ["explain", "181#0102", "-d", "{}"], 0.8),
]
_RUAMEL = "import sys; from ruamel.yaml import YAML; YAML(typ='safe', pure=True).compose(open(sys.argv[1]).read())"
_MOST_GROWTH = 1.1


def figures(rounds: int) -> Iterator[Figure]:
    """Each command on 127 nodes, and how it grows from 16 on."""
    with tempfile.TemporaryDirectory() as folder:
        files = {}
        for count in COUNTS:
            files[count] = Path(folder) / f"{count}.yaml"
            files[count].write_text(network(count).replace("{store: true}", "{dcf: generic}"), "utf-8")
        for name, words, most in COMMANDS:
            took = [
                {
                    count: min(cpu_s(["-m", "dvtcli", *(word.format(file) for word in words)]) for _ in range(3))
                    for count, file in files.items()
                }
                for _ in range(rounds)
            ]
            reading = [cpu_s(["-c", _RUAMEL, str(files[127])]) - cpu_s(["-c", "import ruamel.yaml"]) for _ in took]
            yield Figure(f"{name}: 127 nodes", "s", [each[127] for each in took], "ruamel.yaml", reading, most=most)
            start_s, few_s, all_s = (min(each[count] for each in took) for count in COUNTS)
            if all_s > few_s > start_s:  # otherwise the machine's noise is longer than 15 nodes
                growth = log((all_s - start_s) / (few_s - start_s)) / log(126 / 15)
                yield Figure(f"{name}: growth, n^", "", [growth], "n^1", [1.0], most=_MOST_GROWTH)
