"""How long a key takes in the mapping editor over a dictionary of 5,000 objects: until the terminal shows its effect.

The editor runs in a terminal of 120x40; a key without a visible effect does not count. Prints p50, p99 and the longest
time in ms; the goal is p99 under 20 ms. Beside it the models alone: filter and picture. Run it on a quiet machine.
"""

from __future__ import annotations

import fcntl
import os
import pty
import select
import signal
import struct
import sys
import tempfile
import termios
import time
from pathlib import Path
from statistics import median, quantiles

import pyte

from dvtcli.cli.editor.draw import OBJECTS, EditorView, picture
from dvtcli.cli.editor.model import EditedPdos, ObjectList
from dvtcli.domain.cob_id import CobId
from dvtcli.domain.object_scalings import ObjectScalings
from dvtcli.domain.pdo import Pdo, PdoCommunicationParameter, PdoConfig
from dvtcli.operations.session.device_files import offline_dictionaries
from dvtcli.operations.user.options import Options
from tests.benchmarks.bench_keys import GOAL_MS, ROUNDS, large_eds

WORDS = ("velocity_actual_value_105", "motor temperature 307", "0x2001", "zzzz")
COLUMNS, ROWS = 120, 40
#: maximum wait for the screen, and for the effect of a key (s)
_START_S, _QUIET_S = 20.0, 0.15
_DOWN, _UP, _LEFT, _RIGHT, _BACK, _TAB = b"\x1b[B", b"\x1b[A", b"\x1b[D", b"\x1b[C", b"\x7f", b"\t"
_ASKS_CURSOR, _CURSOR = b"\x1b[6n", b"\x1b[1;1R"
#: how often the keys are typed, from the objects' pane on: the median is without what other programs take away
TIMES = 5
KEYS = (
    *(bytes([letter]) for letter in b"velocity 105"), *[_BACK] * 12, *[_DOWN] * 45, *[_UP] * 45,
    *(bytes([letter]) for letter in b"motor temperature 307"), *[_BACK] * 21, *[_TAB] * 6,
)  # fmt: skip


def _variable(place: str, data_type: int, value: str) -> str:
    return (
        f"[{place}]\nParameterName=Value\nObjectType=7\nDataType={data_type}\nAccessType=rw\n"
        f"DefaultValue={value}\nPDOMapping=0\n"
    )


def device_eds(folder: Path) -> Path:
    """The EDS of a device with 5,000 mappable objects and four TPDOs."""
    path = large_eds(folder)
    parts = [path.read_text(encoding="utf-8"), _variable("1000", 7, "0")]
    for number in range(4):
        parts.append(f"[180{number}]\nParameterName=TPDO\nObjectType=9\nSubNumber=6\n")
        values = ((0, 5, "5"), (1, 7, f"$NODEID+0x{0x180 + 0x100 * number:X}"), (2, 5, "255"), (3, 6, "0"), (5, 6, "0"))
        parts += [_variable(f"180{number}sub{sub}", data_type, value) for sub, data_type, value in values]
        parts.append(f"[1A0{number}]\nParameterName=Mapping\nObjectType=9\nSubNumber=9\n")
        parts += [_variable(f"1A0{number}sub{sub}", 7 if sub else 5, "0") for sub in range(9)]
    path.write_text("".join(parts), encoding="utf-8")
    return path


class Terminal:
    """The editor of *eds* in a terminal; the answer to each request for the cursor's position is made up."""

    def __init__(self, eds: Path) -> None:
        self.process_id, self._file = pty.fork()
        if not self.process_id:
            os.environ.update(TERM="xterm-256color", HOME=str(eds.parent))
            os.execv(sys.executable, [sys.executable, "-m", "dvtcli", "--sim", str(eds), "edit", "tpdo1"])  # noqa: S606
        fcntl.ioctl(self._file, termios.TIOCSWINSZ, struct.pack("HHHH", ROWS, COLUMNS, 0, 0))
        self._screen = pyte.Screen(COLUMNS, ROWS)
        self._stream = pyte.ByteStream(self._screen)
        self._show(self._read(_START_S, until=b"OBJECTS"))
        self._show(self._read(1.0))

    def _read(self, duration_s: float, until: bytes | None = None) -> list[tuple[float, bytes]]:
        """What the terminal gets within *duration_s*, or until *until* was in it; each part with its time."""
        found: list[tuple[float, bytes]] = []
        ends_s = time.perf_counter() + duration_s
        while (left_s := ends_s - time.perf_counter()) > 0:
            if not select.select([self._file], [], [], left_s)[0]:
                break
            data = os.read(self._file, 1 << 16)
            found.append((time.perf_counter(), data))
            if _ASKS_CURSOR in data:
                os.write(self._file, _CURSOR)
            if until is not None and until in data:
                break
        return found

    def _show(self, received: list[tuple[float, bytes]]) -> float | None:
        """Show *received*; the time of the last that changed the screen, None if none did."""
        changed_s = None
        for at_s, data in received:
            before = self._picture()
            self._stream.feed(data)
            if self._picture() != before:
                changed_s = at_s
        return changed_s

    def _picture(self) -> tuple[object, ...]:
        """All cells, with their styles: a cell that is only reversed is a change, too."""
        return tuple(tuple(sorted(self._screen.buffer[row].items())) for row in range(ROWS))

    def milliseconds(self, key: bytes) -> float | None:
        """Type *key*; the time until the screen shows its effect, None if it has none."""
        began_s = time.perf_counter()
        os.write(self._file, key)
        shown_s = self._show(self._read(_QUIET_S))
        return None if shown_s is None else 1000 * (shown_s - began_s)

    def close(self) -> None:
        """End the editor."""
        os.kill(self.process_id, signal.SIGKILL)
        os.waitpid(self.process_id, 0)
        os.close(self._file)


def terminal_times(eds: Path) -> list[list[float]]:
    """Milliseconds of every key of `KEYS` that has an effect, each in all rounds."""
    terminal = Terminal(eds)
    try:
        for _ in range(2):
            terminal.milliseconds(_TAB)
        rounds = [[terminal.milliseconds(key) for key in KEYS] for _ in range(TIMES)]
    finally:
        terminal.close()
    return [[taken for taken in times if taken is not None] for times in zip(*rounds, strict=True) if any(times)]


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
            picture(view, COLUMNS, ROWS)
            times.append(1000 * (time.perf_counter() - began))
        rounds.append(times)
    return [median(times) for times in zip(*rounds, strict=True)]


def _print(what: str, times: list[float]) -> None:
    percent = quantiles(times, n=100)[98]
    print(
        f"{what}, {len(times)} keys: p50 {median(times):.1f} ms, p99 {percent:.1f} ms, most {max(times):.1f} ms "
        f"(goal: p99 < {GOAL_MS:g} ms)"
    )


def main() -> None:
    """Print the times."""
    with tempfile.TemporaryDirectory() as folder:
        eds = large_eds(Path(folder))
        ((dictionary, profile),) = offline_dictionaries(Options(eds=str(eds)))
        _print("filter and picture", key_times(ObjectList(dictionary, profile, ObjectScalings())))
        keys = terminal_times(device_eds(Path(folder)))
    where = f"editor in a terminal {COLUMNS}x{ROWS}"
    _print(where, [taken for times in keys for taken in times])
    _print(f"{where}, median of {TIMES} rounds", [median(times) for times in keys])


if __name__ == "__main__":
    main()
