"""`watch`: chosen objects and PDOs; its picture, and the screen in a real terminal."""

from __future__ import annotations

from pathlib import Path

import pytest

from dvtcli.cli.monitor.signal_lines import GRAPH, Moment, View
from dvtcli.cli.monitor.watch import Board, shown_values, watch_picture
from dvtcli.domain.ports import Frame
from dvtcli.watch.decoder import Signal
from dvtcli.watch.seen import FrameStore
from dvtcli.watch.statistics import WatchedObject
from tests.cli.commands.bench import Bench
from tests.cli.monitor.test_model import BEGIN_S, decoder
from tests.cli.prompt.conftest import Open, open_terminal
from tests.cli.prompt.terminal import CTRL_C, DOWN, Terminal
from tests.simulator.serve.served import bus_words, served

__all__ = ["open_terminal"]
SCREENS = Path(__file__).parent / "screens"
MOMENT = Moment("sim", 72.0, 0, BEGIN_S + 1.0)


def watched(node: int, object_: str, name: str = "") -> WatchedObject:
    return WatchedObject(node, Signal(object_, name, object_))


def board() -> Board:
    """Two objects that move, one that is refused, one that was not read yet, and two PDOs, of which one came."""
    speed, status, refused = watched(1, "606C:00"), watched(3, "6041:00"), watched(1, "2000:00")
    for n in range(11):
        at_s = BEGIN_S + 0.1 * n
        speed.take(Signal("606C:00", "Velocity actual value", "606C:00"), 250 * n, at_s)
        status.take(Signal("6041:00", "Statusword", "6041:00"), 0x1237, at_s)
    refused.fail("refused: object does not exist in the object dictionary")
    made = Board(
        [speed, status, refused, watched(1, "6077:00")], [(1, "TPDO1"), (1, "TPDO2")], FrameStore(decoder()), 0.1
    )
    for n in range(11):
        made.store.take(Frame(0x201, bytes.fromhex(f"{n:02X}0A24FAFFFF3712"), timestamp_s=BEGIN_S + 0.1 * n))
    return made


@pytest.mark.parametrize(("columns", "rows"), [(80, 24), (120, 40)])
@pytest.mark.parametrize("mode", ["table", "graph"])
def test_screens_look_as_they_did(request: pytest.FixtureRequest, mode: str, columns: int, rows: int) -> None:
    drawn = watch_picture(board(), View(mode=mode, chosen=0), MOMENT, columns, rows)
    text = "\n".join(["".join(cell.text for cell in line).rstrip() for line in drawn] + [""])
    path = SCREENS / f"watch_{mode}_{columns}x{rows}.txt"
    if request.config.getoption("--update-transcripts"):
        path.write_text(text, encoding="utf-8")
    assert text == path.read_text("utf-8")


@pytest.mark.parametrize(("columns", "rows"), [(20, 3), (60, 20), (80, 24), (200, 60)])
def test_a_picture_has_its_size(columns: int, rows: int) -> None:
    for view in (View(), View(mode=GRAPH), View(chosen=99), View(plain=True)):
        lines = watch_picture(board(), view, MOMENT, columns, rows)
        assert len(lines) == rows
        assert all(sum(len(cell.text) for cell in line) <= columns for line in lines)


def test_what_changed_is_marked() -> None:
    """Also what stood still since, for half a second, as without colours nothing else tells it."""
    lines = ["".join(cell.text for cell in line) for line in watch_picture(board(), View(), MOMENT, 100, 24)]
    assert "2500* " in lines[2]
    assert " 4663  " in lines[3]


def test_what_was_read_before_it_failed_stays_in_its_course() -> None:
    one = watched(1, "6041:00")
    one.take(one.signal, 5, BEGIN_S)
    one.fail("no answer")
    assert (one.history.last, one.read_s, one.problem) == (5, BEGIN_S, "no answer")
    one.take(one.signal, 6, BEGIN_S + 1)
    assert one.problem == ""
    made = Board([one], [], FrameStore(decoder()), 1.0)
    made.forget()
    assert (one.history.last, list(one.history.points)) == (6, [])
    assert len(shown_values(made)) == 1


def test_without_a_terminal_objects_are_lines() -> None:
    with Bench(("gen4@1",)) as bench:
        documents = bench.run("watch 6041 606C --every 1ms --for 1ms --json").documents
        assert documents[-1]["schema"] == "dvtcli.watched-values/1"
        assert [one["object"] for one in documents[0]["values"]] == ["6041:00", "606C:00"]
        refused = bench.run("watch 6041 tpdo1")
        refused.failed(2, "needs a terminal")
        assert bench.run("watch nonsense").code == 2
        assert bench.run("watch 130:tpdo1").code == 2
        assert bench.run("watch").code == 2


def start(open_terminal: Open, *words: str, columns: int = 80, rows: int = 24) -> Terminal:
    """`watch` of two objects and a PDO, on a simulated node that is OPERATIONAL."""
    terminal = open_terminal("--sim", "gen4", *words, columns=columns, rows=rows)
    terminal.wait_prompt()
    terminal.run("nmt start")
    terminal.wait_prompt("sim/1 OP> ")
    terminal.run("watch 6041 1:1018:1 tpdo2 --every 50ms")
    terminal.wait("TPDO2 node 1  0x281")  # and not only its place: a frame came
    terminal.row("606C:00", "-1500 rpm")
    return terminal


def test_objects_and_pdos_in_a_terminal(open_terminal: Open) -> None:
    terminal = start(open_terminal)
    assert terminal.lines[0].startswith("WATCH sim  00:00:")
    assert "SDO every 50 ms" in terminal.lines[0]
    terminal.row("  1:1018:01   Identity ob…  ", " 30  ")
    terminal.type(DOWN)
    terminal.row("> 1:1018:01 ")
    terminal.type("g")
    terminal.until(lambda: "1018:01" in terminal.lines[2] and "-60 s" in terminal.text, "its graph")
    terminal.type("gp")
    terminal.until(
        lambda: "PAUSED" in terminal.lines[0] and "p go on" in terminal.lines[-1], "a screen that stands still"
    )
    terminal.resize(60, 20)
    terminal.until(lambda: terminal.lines[19].startswith(" p go on"), "the keys in the last row of the smaller screen")
    terminal.type("q")
    terminal.wait_prompt("sim/1 OP> ")


def test_only_ascii_and_ctrl_c(open_terminal: Open) -> None:
    terminal = start(open_terminal, "--ascii", columns=120)
    assert terminal.text.isascii()
    assert "?" not in terminal.text
    terminal.type(CTRL_C)
    terminal.wait_prompt("sim/1 OP> ")


def test_a_bus_that_goes_and_comes_back_is_waited_for(tmp_path: Path, open_terminal: Open, port: int) -> None:
    with served(tmp_path, "gen4@5", port=port) as server:
        terminal = open_terminal(*bus_words(server.port), "-n", "5", "watch", "1000", "tpdo1", columns=120)
        terminal.until(lambda: "131474" in terminal.text, "a value")
    terminal.wait("LOST for")
    with served(tmp_path, "gen4@5", port=port):
        terminal.until(lambda: "GONE" not in terminal.lines[0] and "131474" in terminal.text, "values of now")
        terminal.type("q")
        assert terminal.ended() == 0
