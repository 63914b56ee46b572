"""How long a key takes in the mapping editor: the filter and the picture over a dictionary of 5,000 objects.

Prints p50, p99 and the longest time in ms; the goal is under 20 ms a key. Run it on a quiet machine.
"""

from __future__ import annotations

import tempfile
import time
from pathlib import Path
from statistics import median, quantiles

from dvtcli.cli.editor.draw import OBJECTS, EditorView, picture
from dvtcli.cli.editor.model import EditedPdos, ObjectList
from dvtcli.domain.cob_id import CobId
from dvtcli.domain.object_scalings import ObjectScalings
from dvtcli.domain.pdo import Pdo, PdoCommunicationParameter, PdoConfig
from dvtcli.operations.session.device_files import offline_dictionaries
from dvtcli.operations.user.options import Options
from tests.benchmarks.bench_keys import GOAL_MS, ROUNDS, large_eds

WORDS = ("velocity_actual_value_105", "motor temperature 307", "0x2001", "zzzz")


def key_times(objects: ObjectList) -> list[float]:
    """Milliseconds of every key of `WORDS`, each the median of `ROUNDS`: what other programs take away is not ours."""
    pdo = Pdo.parse("tpdo1")
    held = {pdo: PdoConfig(PdoCommunicationParameter(CobId(0x181), 255, 0, 0), ())}
    view = EditorView("node 1", EditedPdos(held), [pdo], pane=OBJECTS)
    rounds: list[list[float]] = []
    for _ in range(ROUNDS):
        times = []
        for text in [word[:end] for word in WORDS for end in range(1, len(word) + 1)]:
            began = time.perf_counter()
            view.offers = objects.offers(text, tpdo=True, bits_left=64)
            picture(view, 120, 40)
            times.append(1000 * (time.perf_counter() - began))
        rounds.append(times)
    return [median(times) for times in zip(*rounds, strict=True)]


def main() -> None:
    """Print the times."""
    with tempfile.TemporaryDirectory() as folder:
        eds = large_eds(Path(folder))
        ((dictionary, profile),) = offline_dictionaries(Options(eds=str(eds)))
        times = key_times(ObjectList(dictionary, profile, ObjectScalings()))
    percent = quantiles(times, n=100)[98]
    print(
        f"editor, a key: p50 {median(times):.1f} ms, p99 {percent:.1f} ms, most {max(times):.1f} ms (goal {GOAL_MS:g})"
    )


if __name__ == "__main__":
    main()
