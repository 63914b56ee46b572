"""Golden screens: what a person sees, in two sizes of terminal, kept as text in `screens/`.

`pytest tests/cli/prompt/test_screens.py --update-transcripts` rewrites them; look at the difference before keeping it.
README and the documentation show some of them.
"""

from __future__ import annotations

import re
import threading
from collections.abc import Callable, Iterator
from dataclasses import dataclass
from pathlib import Path

import pytest

from tests.cli.prompt.conftest import Open
from tests.cli.prompt.terminal import CTRL_C, CTRL_D, CTRL_R, PATIENCE_S, Terminal
from tests.cli.prompt.wire import Wire
from tests.harness.sample import part
from tests.simulator.serve.served import bus_words

SCREENS = Path(__file__).parent / "screens"
SIZES = [(80, 24), (120, 40)]
MAP = "map tpdo1 6C01:1 606C 6041 --cob-id 0x201 --sync 1"
_SDO_IDLE = "  2 idle SDO rows left out: f sdo shows them"
_VOLATILE = [
    (re.compile(r"HB \d\.\d s"), "HB 0.0 s"),
    (re.compile(r"equal, \d+\.\d\d s"), "equal, 0.00 s"),
    (re.compile(r"dvtcli \d+\.\d+\.\d+"), "dvtcli 0.0.0"),
    (re.compile(r"127\.0\.0\.1:\d{4,5}"), "127.0.0.1:00000"),
    (re.compile(r"\d\d:\d\d:\d\d\.\d{3}[+-]\d\d:\d\d"), "00:00:00.000+00:00"),
    (re.compile(r"\d+ frames  \d+/s"), "0 frames  0/s"),
    # the mapping was read at once, or more than 5 s ago
    (re.compile(r"(0x\d{3} SDO \w+ node 5 .*\n){1,2}(  1 idle SDO row .*\n)?"), f"{_SDO_IDLE}\n\n"),
    (re.compile(r"( +\d+(\.\d)? Hz)?( +\d+\.\d ms)?( +±\d+\.\d ms)?( +\d+) +\d+\.\d s  "), r"\5  0.0 s  "),
    (re.compile(r"(MONITOR \S{12})\S*  \d\d:\d\d:\d\d"), r"\1  00:00:00"),
]


def steady(terminal: Terminal) -> str:
    text = terminal.text
    for pattern, replacement in _VOLATILE:
        text = pattern.sub(replacement, text)
    return text + "\n"


@dataclass
class Stage:
    """What a scene plays on: terminals of one size."""

    open_terminal: Open
    columns: int
    rows: int
    wire: Wire

    def terminal(self, *words: str) -> Terminal:
        return self.open_terminal(*words, columns=self.columns, rows=self.rows)

    def prompt(self) -> Terminal:
        """The prompt of a simulated node whose heartbeat is heard."""
        terminal = self.terminal("--sim", "gen4")
        terminal.wait_prompt()
        terminal.until(lambda: re.search(r"HB \d\.\d s", terminal.toolbar) is not None, "a heartbeat")
        return terminal

    def mapped(self) -> Terminal:
        """The same after a change that is not stored."""
        terminal = self.prompt()
        terminal.run(MAP)
        terminal.wait_prompt("sim/1 PRE-OP*> ")
        return terminal

    def on_wire(self, *words: str) -> Terminal:
        """dvtcli on a bus of its own; an SDO server that is held up there is not given up."""
        bus = [*bus_words(self.wire.port), "--timeout", str(PATIENCE_S), "-n", "5", "--eds", str(self.wire.eds)]
        return self.terminal(*bus, *words)


def typed(keys: str) -> Callable[[Stage], Terminal]:
    def play(stage: Stage) -> Terminal:
        terminal = stage.prompt()
        terminal.type(keys)
        return terminal

    return play


def leaving(stage: Stage) -> Terminal:
    terminal = stage.mapped()
    terminal.type(CTRL_D)
    return terminal


def interrupted(stage: Stage) -> Terminal:
    """Ctrl-C while the fourth write of a mapping is on its way."""
    go_on = threading.Event()
    stage.wire.at_download = lambda number: go_on.wait(PATIENCE_S) if number == 4 else None
    terminal = stage.on_wire("-q")  # without notes: a backup has its time in its name
    terminal.wait_prompt(f"127.0.0.1:{stage.wire.port}/5 PRE-OP> ")
    terminal.run(MAP)
    terminal.until(lambda: stage.wire.downloads == 4, "the fourth write")
    terminal.type(CTRL_C)
    terminal.wait("stopping at the next safe point")
    go_on.set()
    terminal.wait_prompt(f"127.0.0.1:{stage.wire.port}/5 PRE-OP> ")
    return terminal


def monitored(stage: Stage) -> Terminal:
    """One frame of each kind, and the screen held."""
    terminal = stage.on_wire("monitor")
    terminal.until(lambda: terminal.lines[1].strip() == "5 Gen4", "the mapping, read")
    terminal.wait("2 idle SDO rows left out")
    for can_id, data in ((0x705, "05"), (0x185, "37 12"), (0x285, "24 FA FF FF 78 00 88 FF"), (0x085, "30 81 11")):
        stage.wire.say(can_id, bytes.fromhex(data))
    terminal.wait("24 FA FF FF 78 00 88 FF")
    terminal.until(lambda: "EMCY node 5" in terminal.text and "0x705" in terminal.text, "each of them")
    terminal.type("p")
    return terminal


def resized(stage: Stage) -> Terminal:
    """A command half typed, and the other size of terminal."""
    terminal = stage.prompt()
    terminal.type("map tpdo1 6C01:1 velocity_a")
    terminal.wait("4 of 6 free bytes")
    columns, rows = next(size for size in SIZES if size[0] != stage.columns)
    terminal.resize(columns, rows)
    terminal.until(lambda: terminal.toolbar.startswith(" SIMULATED"), "the toolbar in the last row")
    return terminal


def rows_of_text(screen: str) -> str:
    """A screen without its blank rows."""
    return "\n".join(row for row in screen.splitlines() if row)


#: name -> what happens, and what the finished screen shows
SCENES: dict[str, tuple[Callable[[Stage], Terminal], str]] = {
    "menu": (typed("map tpdo1 6C01:1 velocity_a"), "4 of 6 free bytes"),
    "wrong": (typed("mpa tpdo1 6041\r"), "corrected, Enter runs"),
    "question": (typed("set tpdo1 ?"), "Leave the PDO disabled."),
    "search": (typed(CTRL_R + "xyz"), "i-search"),
    "toolbar": (Stage.mapped, "TPDO1 not stored"),
    "leaving": (leaving, "leave? [y/N]"),
    "interrupted": (interrupted, "rolled back"),
    "monitor": (monitored, "PAUSED"),
    "resize": (resized, "4 of 6 free bytes"),
    "tour": (lambda stage: stage.terminal("tour"), "tour>"),
}


@pytest.fixture
def wire() -> Iterator[Wire]:
    wire = Wire()
    yield wire
    wire.close()


def pytest_generate_tests(metafunc: pytest.Metafunc) -> None:
    """Each scene in one size, in another one in another run; with --every-size, and to be kept, in each."""
    if "columns" in metafunc.fixturenames:
        config = metafunc.config
        every = config.getoption("--every-size") or config.getoption("--update-transcripts")
        count = len(SIZES) if every else 1
        cases = [(name, *size) for name in SCENES for size in part(SIZES, count, config, name)]
        metafunc.parametrize(("name", "columns", "rows"), cases)


@pytest.mark.counted
def test_screen(
    name: str, columns: int, rows: int, open_terminal: Open, wire: Wire, request: pytest.FixtureRequest
) -> None:
    file = SCREENS / f"{name}_{columns}.txt"
    play, shows = SCENES[name]
    terminal = play(Stage(open_terminal, columns, rows, wire))
    terminal.wait(shows)
    if request.config.getoption("--update-transcripts"):
        file.write_text(steady(terminal), encoding="utf-8")
        return
    expected = file.read_text("utf-8")
    compared = rows_of_text if name == "resize" else str  # what it leaves blank above it is prompt_toolkit's
    terminal.until(lambda: compared(steady(terminal)) == compared(expected), f"the screen\n{expected}\n")


def test_every_screen_is_of_a_scene() -> None:
    kept = {path.stem.rpartition("_")[0] for path in SCREENS.iterdir()}
    assert kept == set(SCENES)
