"""Hours of work on a bad bus: changes, undos, stores and a monitor side by side, while the bus does what it can.

    python tests/benchmarks/soak.py [--minutes N] [--seed N]

The nodes are `dvtcli sim` in a process of its own. Between them and everybody stands a cable (`soak_cable`) that loses
frames, ends all connections and is full of other frames; another master resets the nodes. A Python program changes one
node through `import dvtcli`, commands of their own change another one and are killed, `monitor` and `log` listen. What
the nodes really hold is read past the cable, by SDO of our own, after each piece of work: it is what was said, or the
state is counted as wrong. Memory, descriptors and threads of what lives on are looked at all the time.

One table at the end; exit code 1 where a state was wrong or something grew.
"""

from __future__ import annotations

import argparse
import random
import sys
import tempfile
import threading
import time
from collections import Counter
from pathlib import Path

ROOT = Path(__file__).resolve().parents[2]
sys.path.insert(0, str(ROOT))

from tests.benchmarks.bench_serve import Sim, sim  # noqa: E402
from tests.benchmarks.soak_cable import Cable  # noqa: E402
from tests.benchmarks.soak_growth import Growth  # noqa: E402
from tests.benchmarks.soak_truth import Truth  # noqa: E402
from tests.benchmarks.soak_work import Killed, Listening, Program, Tally, Worker  # noqa: E402

#: the program's node, and the commands'
NODES = (1, 5)


def trouble(cable: Cable, server: Sim, lots: random.Random, tally: Tally, over: threading.Event) -> None:
    """One misfortune after the other until it is *over*."""
    while not over.wait(lots.uniform(0.3, 1.5)):
        what = lots.choice(["lose", "lose", "cut", "gone", "reset", "full"])
        tally.count(f"bus: {what}")
        if what == "lose":
            cable.losing = lots.choice([0.0, 0.0, 0.002, 0.01, 0.05])
        elif what == "cut":
            cable.cut()
        elif what == "gone":
            cable.away(lots.uniform(0.1, 1.0))
        elif what == "reset":
            Truth.reset(server, lots.choice(NODES))
        else:
            cable.flood(lots.randrange(500, 3000))


def soak(minutes: float, seed: int) -> int:
    """Run for *minutes*; the exit code."""
    lots, over, tally = random.Random(seed), threading.Event(), Tally(Counter(), [])
    with (
        tempfile.TemporaryDirectory() as home,
        sim(*(f"gen4@{node}" for node in NODES), "--state", str(Path(home, "kept"))) as server,
    ):
        cable, growth = Cable(server.port), Growth({"sim": server.process.pid})
        workers: list[Worker | Listening] = [
            Program(NODES[0], cable, server, random.Random(f"{seed} program"), tally, Path(home)),
            Killed(NODES[1], cable, server, random.Random(f"{seed} killed"), tally, Path(home)),
            Listening(["monitor"], cable, tally, Path(home), growth),
            Listening(["log", str(Path(home, "all.log"))], cable, tally, Path(home), growth),
        ]
        threads = [threading.Thread(target=worker.work, args=(over,), daemon=True) for worker in workers]
        threads.append(threading.Thread(target=trouble, args=(cable, server, lots, tally, over), daemon=True))
        growth.watch("program", Program.process_id(workers))
        for thread in threads:
            thread.start()
        until_s = time.monotonic() + minutes * 60
        while time.monotonic() < until_s and all(thread.is_alive() for thread in threads):
            growth.look()
            time.sleep(1)
        over.set()
        dead = [thread for thread in threads if not thread.is_alive()]
        cable.losing = 0.0
        for thread in threads:
            thread.join(120)
        cable.close()
    return report(tally, growth, minutes, dead=len(dead))


def report(tally: Tally, growth: Growth, minutes: float, *, dead: int) -> int:
    """Print the table; the exit code."""
    print(f"\n{minutes:g} minutes")
    for name, number in sorted(tally.counts.items()):
        print(f"  {name:<44} {number:>8}")
    grown = growth.report()
    for wrong in tally.wrong:
        print(f"WRONG: {wrong}")
    if dead:
        print("WRONG: a worker of the soak ended early")
    print(f"{len(tally.wrong)} wrong states, {len(grown)} grew")
    return 1 if tally.wrong or grown or dead else 0


if __name__ == "__main__":
    given = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    given.add_argument("--minutes", type=float, default=10.0)
    given.add_argument("--seed", type=int, default=int(time.time()))
    asked = given.parse_args()
    print(f"seed {asked.seed}", flush=True)
    sys.exit(soak(asked.minutes, asked.seed))
