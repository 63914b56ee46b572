"""How long a key takes at the prompt: menu and syntax colours over a dictionary of 5,000 objects, key by key.

Prints p50, p99 and the longest time in ms; the goal is under 20 ms a key. Run it on a quiet machine.
"""

from __future__ import annotations

import sys
import tempfile
import time
from pathlib import Path
from statistics import median, quantiles

from prompt_toolkit.completion import CompleteEvent
from prompt_toolkit.document import Document

from dvtcli.cli.conversation import Conversation
from dvtcli.cli.prompt.full_line import LineCompleter, LineLexer
from dvtcli.cli.prompt.status import syntax
from dvtcli.cli.view.output import Output

OBJECTS, ROUNDS, GOAL_MS = 5000, 5, 20.0
NAMES = ("Velocity actual value", "Torque demand", "Motor temperature", "Battery voltage", "Position target")
LINES = (
    "map tpdo1 0x2001 velocity_actual_value_105 2003:0 --cob-id auto --sync 1",
    'read "Motor temperature 307',
    "objects torque --mappable tpdo",
    "map rpdo1 dummy/16 vlctyctl zzzz",
)


def large_eds(folder: Path) -> Path:
    """An EDS of `OBJECTS` mappable objects."""
    path = folder / "large.eds"
    sections = (
        f"[{0x2000 + n:04X}]\nParameterName={NAMES[n % len(NAMES)]} {n}\nObjectType=7\nDataType=6\nAccessType=rw\n"
        "PDOMapping=1\n"
        for n in range(OBJECTS)
    )
    path.write_text("[DeviceInfo]\nProductName=Large\n" + "".join(sections), encoding="utf-8")
    return path


def key_times(session: Conversation) -> list[float]:
    """Milliseconds of every key of `LINES`, each the median of `ROUNDS`: what other programs take away is not ours."""
    completer, lexer = LineCompleter(session), LineLexer(())
    keys = [line[:end] for line in LINES for end in range(1, len(line) + 1)]
    rounds: list[list[float]] = []
    for _ in range(ROUNDS):
        times = []
        for text in keys:
            document = Document(text)
            began = time.perf_counter()
            list(completer.get_completions(document, CompleteEvent()))
            lexer.lex_document(document)(0)
            syntax(text, 80, {})
            times.append(1000 * (time.perf_counter() - began))
        rounds.append(times)
    return [median(times) for times in zip(*rounds, strict=True)]


def main() -> int:
    """Measure and print; 1 where the goal is missed."""
    with tempfile.TemporaryDirectory() as folder:
        session = Conversation(Output())
        session.start({"sim": (str(large_eds(Path(folder))),)})
        session.started = True
        try:
            times = key_times(session)
        finally:
            session.close()
    p99 = quantiles(times, n=100)[98]
    print(
        f"{len(times)} keys over {OBJECTS} objects: p50 {median(times):.1f} ms, p99 {p99:.1f} ms, max {max(times):.1f}"
    )
    print(f"goal: p99 under {GOAL_MS:.0f} ms: {'reached' if p99 < GOAL_MS else 'missed'}")
    return 0 if p99 < GOAL_MS else 1


if __name__ == "__main__":
    sys.exit(main())
