"""The monitor's keys that act, in real terminals: NMT, SYNC, the transmit list, a recording, the frame picture."""

from __future__ import annotations

import re
import threading
import time
from pathlib import Path

import can
import pytest

from dvtcli.cli.conversation import Conversation
from dvtcli.cli.monitor.actions import Actions
from dvtcli.cli.monitor.transmit_list import TransmitEntry, TransmitList
from dvtcli.cli.view.output import Output
from dvtcli.operations.frames.transmit_rows import transmit_row
from dvtcli.operations.frames.watch_bus import watching
from dvtcli.watch.decoder import Decoder
from tests.cli.monitor.test_monitor_screen import SIZES, leave, started
from tests.cli.prompt.conftest import Open, open_terminal
from tests.cli.prompt.terminal import ENTER, ESCAPE, Terminal
from tests.simulator.serve.served import bus_words, received, served

pytestmark = pytest.mark.drawn(6, "monitor keys that act")

__all__ = ["open_terminal"]
CLEAR_LINE, LEFT, RIGHT = "\x15", "\x1b[D", "\x1b[C"


def in_pre_operational(open_terminal: Open, *words: str, columns: int = 80) -> Terminal:
    terminal = open_terminal("--sim", "gen4", *words, "monitor", columns=columns)
    terminal.wait("heartbeat node 1")
    terminal.until(lambda: "1 Gen4" in terminal.lines[1] and "reading" not in terminal.lines[1], "the mapping, read")
    return terminal


def fill(terminal: Terminal, label: str, text: str) -> None:
    """Type *text* instead of what stands in the field *label*, and Enter."""
    terminal.until(lambda: f"{label}: " in terminal.lines[-1], f"the field {label!r}")
    terminal.type(CLEAR_LINE + text)
    terminal.until(lambda: f"{label}: {text}_" in terminal.lines[-1], f"{text!r} in the field {label!r}")
    terminal.type(ENTER)


@pytest.mark.parametrize(
    ("letter", "asked", "done"),
    [
        ("s", "goes to OPERATIONAL, and a machine may move; send it?", "nmt start: node 1 OPERATIONAL"),
        ("p", "goes to PRE-OPERATIONAL: PDOs end, and a machine may stop; send it?",
         "nmt preop: node 1 PRE-OPERATIONAL"),
        ("t", "goes to STOPPED, and a machine may stop; send it?", "nmt stop: node 1 STOPPED"),
        ("r", "goes through a restart: unstored values are lost, and a motor may be released; send it?",
         "nmt reset-node: node 1 PRE-OPERATIONAL"),
    ],
)  # fmt: skip
def test_nmt_is_asked_about_as_send_asks(open_terminal: Open, letter: str, asked: str, done: str) -> None:
    terminal = in_pre_operational(open_terminal, columns=120)
    for answer in ("n", "y"):
        terminal.type("n")
        terminal.wait("NMT to node 1 Gen4")
        terminal.type(letter)
        terminal.wait(asked)
        assert done not in terminal.text
        terminal.type(answer)
        terminal.wait("not done: the answer was no" if answer == "n" else done)


def test_nmt_starts_the_node(open_terminal: Open) -> None:
    terminal = in_pre_operational(open_terminal)
    terminal.type("n")
    terminal.wait("NMT to node 1 Gen4", "s  start", "c  reset-comm")
    terminal.type(ESCAPE)
    terminal.until(lambda: "NMT to" not in terminal.text, "the list gone")
    assert "NMT start ->" not in terminal.text
    terminal.type("n")
    terminal.wait("NMT to node 1 Gen4")
    terminal.type("s")
    terminal.wait("and a machine may move; send")
    terminal.type("y")
    terminal.wait("nmt start: node 1 OPERATIONAL", "0x281 TPDO2 node 1")


@pytest.mark.parametrize(("answer", "is_sent"), [("y", True), ("n", False), (ENTER, False), (ESCAPE, False)])
def test_sync_is_asked_about_as_send_asks(open_terminal: Open, answer: str, is_sent: bool) -> None:
    terminal = in_pre_operational(open_terminal, columns=120)
    terminal.type("y")
    fill(terminal, "SYNC period in ms", "0")
    terminal.wait("0: a period is 1…3600000 ms")
    fill(terminal, "SYNC period in ms", "100")
    terminal.wait("080#: SYNC: nodes apply the last received RPDOs", "every 100 ms until it is stopped?", "[y/N]")
    terminal.type(answer)
    if not is_sent:
        terminal.wait("not done: the answer was no")
        assert "0x080" not in terminal.text
        return
    terminal.wait("0x080 SYNC", "SYNC every 100 ms")
    terminal.type("y")
    terminal.wait("SYNC is off, ")
    assert "SYNC every" not in terminal.lines[0]


def test_a_dry_run_sends_nothing(open_terminal: Open) -> None:
    terminal = in_pre_operational(open_terminal, "--dry-run", columns=120)
    terminal.type("y")
    fill(terminal, "SYNC period in ms", "100")
    terminal.wait("dry run, not sent: 080#  SYNC")
    terminal.type("n")
    terminal.wait("NMT to node 1 Gen4")
    terminal.type("s")
    terminal.wait("dry run, nothing was sent: nmt start: node 1 OPERATIONAL")
    assert "0x080" not in terminal.text
    assert "0x000" not in terminal.text
    assert "1 Gen4 PRE-OPERATIONAL" in terminal.lines[1]


def test_a_transmit_list_is_typed_sent_edited_and_kept(tmp_path: Path, open_terminal: Open) -> None:
    """A PDO by name, in words and with a period, on a key; a frame once. Another monitor of the bus has them, too."""
    with served(tmp_path, "gen4@5") as server, server.attach() as other:
        assert server.dvtcli("-n", "5", "map", "rpdo1", "6040", "60FF", "--event").returncode == 0
        words = (*bus_words(server.port), "-n", "5", "monitor")
        terminal = open_terminal(*words, columns=120)
        terminal.until(lambda: "5 Gen4" in terminal.lines[1] and "reading" not in terminal.lines[1], "the mapping")
        terminal.type("x")
        terminal.wait("TRANSMIT (0 rows)")
        terminal.type("a")
        fill(terminal, "add", "rpdo1 6040")
        terminal.wait("rpdo1 6040: values are OBJECT=VALUE")
        fill(terminal, "add", "rpdo1 6040=6 60FF=-100 every 50ms key 1")
        terminal.type("a")
        fill(terminal, "add", "7A0#1027 key 2")
        terminal.wait("TRANSMIT (2 rows)")
        terminal.type("s")
        frames = wait_for_frame(other, 0x7A0)
        assert frames[-1].data == bytes.fromhex("1027")
        terminal.type(ESCAPE)
        terminal.until(lambda: "TRANSMIT" not in terminal.text, "the list gone")
        terminal.type("1")
        terminal.wait("205#06009CFFFFFF: received by RPDO1 of node 5", "every 50 ms until it is stopped? [y/N]")
        terminal.type("y")
        assert wait_for_frame(other, 0x205)[-1].data == bytes.fromhex("06009CFFFFFF")
        terminal.type("x")
        terminal.row("rpdo1 6040=6 60FF=-100", "50 ms", "being sent")
        terminal.type("1c")  # a digit is no key of the list; c stops the row
        terminal.until(lambda: "being sent" not in terminal.text, "the end of the sending")
        terminal.type(ENTER)
        terminal.until(lambda: "edit: rpdo1 6040=6 60FF=-100 every 50ms key 1_" in terminal.lines[-1], "the row")
        fill(terminal, "edit", "rpdo1 60FF=7")
        terminal.until(lambda: "rpdo1 60FF=7 " in terminal.text, "the edited row")
        terminal.type("s")
        terminal.wait("205#060007000000: received by RPDO1 of node 5")  # 6040 keeps the value it was sent with
        terminal.type("n")
        terminal.wait("not done: the answer was no")
        terminal.type(ESCAPE + "q")
        assert terminal.ended() == 0
        again = open_terminal(*words, columns=120)
        again.wait("heartbeat node 5")
        again.type("x")
        again.wait("TRANSMIT (2 rows)", "rpdo1 60FF=7", "7A0#1027")
        again.type("dd")
        again.wait("TRANSMIT (0 rows)")
        again.type(ESCAPE + "q")
        assert again.ended() == 0
    assert "[transmit]" not in (tmp_path / ".config" / "dvtcli" / "config.toml").read_text()


@pytest.mark.parametrize("meanwhile", ["deleted", "edited"])
def test_a_row_that_changes_while_its_frame_is_looked_up_is_not_sent(meanwhile: str) -> None:
    held, let_go = threading.Event(), threading.Event()

    def last(_address: object) -> None:
        held.set()
        assert let_go.wait(30)

    session = Conversation(Output())
    session.start({"sim": ("gen4",), "yes": True})
    with session, watching(session) as watched:
        actions = Actions(session, watched, last, Decoder().layout)
        actions.transmit_list()
        for letter in "atpdo1 6041=1 every 50ms":
            actions.press(letter, letter)
        actions.press("enter", "\r")
        actions.press("c", "c")
        assert held.wait(30)
        if meanwhile == "deleted":
            actions.press("d", "d")
        else:
            actions.press("enter", "\r")
            actions.press("backspace", "")
            actions.press("backspace", "")
            actions.press("s", "s")
            actions.press("enter", "\r")
        let_go.set()
        while actions.beside.doing:
            time.sleep(0.01)
        assert any("was not sent: the row was changed" in text for text, _bad in actions.beside.news())
        assert not any("cyclic" in mark for mark in actions.marks())
        actions.leave()


def test_a_sending_that_ends_by_itself_is_told_once(monkeypatch: pytest.MonkeyPatch) -> None:
    session = Conversation(Output())
    session.start({"sim": ("gen4",), "yes": True})
    with session, watching(session) as watched:
        actions = Actions(session, watched, lambda _address: None, Decoder().layout)
        actions.sync()
        for letter in "\b\b5":
            actions.press("backspace" if letter == "\b" else letter, letter)
        actions.press("enter", "\r")
        while not any("SYNC every" in mark for mark in actions.marks()):
            time.sleep(0.01)
        session.wire.close()
        while any("SYNC every" in mark for mark in actions.marks()):
            time.sleep(0.01)
        actions.check()
        actions.check()
        said = [(text, bad) for text, bad in actions.beside.news() if "SYNC ended after" in text]
        assert [bad for _text, bad in said] == [True]
        actions.leave()


def wait_for_frame(bus: can.BusABC, can_id: int) -> list[can.Message]:
    """The frames up to one with *can_id*."""
    found: list[can.Message] = []
    while not found or found[-1].arbitration_id != can_id:
        found += received(bus, 1)
    return found


def test_what_is_sent_by_period_ends_with_the_monitor(tmp_path: Path, open_terminal: Open) -> None:
    with served(tmp_path, "gen4@5") as server, server.attach() as other:
        terminal = open_terminal(*bus_words(server.port), "-n", "5", "--yes", "monitor")
        terminal.wait("heartbeat node 5")
        terminal.type("y")
        fill(terminal, "SYNC period in ms", "5")
        wait_for_frame(other, 0x080)
        terminal.type("q")
        assert terminal.ended() == 0
        while other.recv(0) is not None:
            pass
        assert not any(frame.arbitration_id == 0x080 for frame in received(other, 2))


def test_a_recording_has_the_frames_that_the_head_counts(tmp_path: Path, open_terminal: Open) -> None:
    terminal = started(open_terminal, 80, 24)
    terminal.type("l")
    fill(terminal, "record to", "run.xyz")
    terminal.until(lambda: "record to: run.xyz_" in terminal.lines[-1] and ".xyz" in terminal.lines[-2], "the refusal")
    fill(terminal, "record to", "run.log")
    terminal.until(lambda: (found := re.search(r"REC (\d+)", terminal.lines[0])) and int(found[1]) > 20, "a recording")
    terminal.type("l")
    said = terminal.row("run.log: ", " frames")
    count = int(said.split("run.log: ")[1].split()[0])
    assert len(list(can.LogReader(tmp_path / "run.log"))) == count > 20
    terminal.type("l")
    fill(terminal, "record to", "run.log")
    terminal.wait("run.log exists; overwrite it? [y/N]")
    terminal.type("n")
    terminal.wait("not done: the answer was no")
    leave(terminal)
    assert len(list(can.LogReader(tmp_path / "run.log"))) == count


@pytest.mark.parametrize(("columns", "rows"), SIZES)
def test_the_picture_of_a_frame_has_live_values(open_terminal: Open, columns: int, rows: int) -> None:
    terminal = started(open_terminal, columns, rows)
    terminal.type("i")
    terminal.wait("0x281 TPDO2 node 1", "every 50.0 ms", "Velocity actual value", "606C:00 i32")
    terminal.row("data ", "24 ", "FA ", "88 ", "FF")
    terminal.row("> 606C:00", "-1500 rpm", "-1500 .. -1500")
    terminal.type("i")
    terminal.wait("FRAME", "COUNT")
    leave(terminal)


def test_names_of_the_network_file_stand_instead_of_numbers(tmp_path: Path, open_terminal: Open) -> None:
    (tmp_path / "line.yaml").write_text("dvtcli: 1\nnodes:\n  press: {node_id: 1, profile: gen4}\n")
    terminal = open_terminal("--sim", "gen4", "monitor", "-d", "line.yaml")
    terminal.wait("heartbeat press")
    terminal.until(lambda: terminal.lines[1].startswith("1 press "), "the name above")
    terminal.type("f")
    terminal.wait("Enter keep")
    terminal.type("press" + ENTER)
    terminal.wait("heartbeat press", "filter: press")


def test_leaving_at_a_question_is_no(open_terminal: Open) -> None:
    terminal = in_pre_operational(open_terminal, columns=120)
    terminal.type("y")
    fill(terminal, "SYNC period in ms", "100")
    terminal.wait("[y/N]")
    terminal.child.kill(15)
    assert terminal.ended() == 143
    assert b"Traceback" not in terminal.written


def test_nmt_reaches_a_node_without_signals_and_all_nodes(open_terminal: Open) -> None:
    """Node 2 is known by its heartbeat only: ← and → go through the nodes that are seen."""
    terminal = open_terminal("--sim", "gen4@1", "--sim", "generic@2", "--sim", "gen4@3", "monitor", columns=120)
    terminal.wait("heartbeat node 2", "heartbeat node 3")
    terminal.until(lambda: "reading" not in terminal.lines[1] and "1 Gen4" in terminal.lines[1], "the mappings, read")
    terminal.type("n")
    terminal.wait("NMT to node 1 Gen4   ←→ another")
    terminal.type(RIGHT)
    terminal.wait("NMT to node 2 ")
    terminal.type("s")
    terminal.wait("node 2 goes to OPERATIONAL, and a machine may move; send it?")
    terminal.type("y")
    terminal.wait("nmt start: node 2 OPERATIONAL")
    terminal.type("n")
    terminal.wait("NMT to node 2 ")  # its signal is chosen now
    terminal.type(LEFT + LEFT)
    terminal.wait("NMT to all nodes")
    terminal.type(LEFT)
    terminal.wait("NMT to node 3 ")
    terminal.type(ESCAPE)
    terminal.until(lambda: "NMT to" not in terminal.text, "the list gone")


def test_a_row_is_judged_when_it_is_typed(open_terminal: Open) -> None:
    terminal = open_terminal("--sim", "generic", "monitor", columns=120)
    terminal.until(lambda: "1 Generic" in terminal.lines[1] and "reading" not in terminal.lines[1], "the mapping, read")
    for row, said in [
        ("rpdo1 6040=0x10000", "65536 does not fit UNSIGNED16"),
        ("rpdo1 60FF=1", "RPDO1 has no 60FF"),
        ("181#11", "0x181: the frame has 1 byte"),
        ("7A0#1027", "7A0#1027: no node that was read transmits CAN-ID 0x7A0"),
    ]:
        terminal.type("x")
        terminal.wait("TRANSMIT (")
        terminal.type("a")
        fill(terminal, "add", row)
        terminal.wait(said)
        terminal.type("d")
        terminal.wait("TRANSMIT (0 rows)")
        terminal.type(ESCAPE)
        terminal.until(lambda: "TRANSMIT" not in terminal.text, "the list gone")
    assert "0x7A0 " not in terminal.lines[3]


def test_the_reason_of_a_refused_row_is_read_whole_on_a_narrow_screen(open_terminal: Open) -> None:
    terminal = in_pre_operational(open_terminal)
    terminal.type("xa")
    fill(terminal, "add", "rpdo1 6040=0x10000")

    def below_the_list() -> str:
        lines = terminal.lines
        at = next((number for number, line in enumerate(lines) if line.endswith("refused")), len(lines))
        return " ".join(" ".join(lines[at + 1 : -1]).split())

    terminal.until(lambda: "RPDO1 of node 1 is off: it has no frame of values; `" in below_the_list(), "the reason")
    terminal.type("a")
    fill(terminal, "add", "7A0#1027")
    terminal.wait("TRANSMIT (2 rows)")
    terminal.until(lambda: "multiplexed" not in " ".join(terminal.lines[-4:]), "the other row, which is not refused")


@pytest.mark.parametrize("columns", [40, 80, 120])
def test_a_reason_is_shown_to_its_end(columns: int) -> None:
    reason = "the frame was not taken: " + "word " * 30 + "end"
    session = Conversation(Output())
    session.start({"sim": ("gen4",), "yes": True})
    with session, watching(session) as watched:
        actions = Actions(session, watched, lambda _address: None, Decoder().layout)
        rows = [TransmitEntry(transmit_row("7A0#1027"), refused=reason)]
        acts = actions._send, actions._cyclic, actions._keep, actions._check
        lines = TransmitList(rows, actions.dialogs.append, *acts).lines(columns, 20)
        actions.leave()
    shown = ["".join(cell.text for cell in line) for line in lines]
    assert reason in " ".join(" ".join(shown).split())
    assert all(len(line) <= columns for line in shown[2:-1])


def test_a_click_chooses_a_signal_and_a_row_of_a_dialog(open_terminal: Open) -> None:
    terminal = started(open_terminal, 80, 24)
    line = next(number for number, text in enumerate(terminal.lines) if "6077:00" in text)
    terminal.type(f"\x1b[<0;10;{line + 1}M\x1b[<0;10;{line + 1}m")
    terminal.until(lambda: "> 6077:00" in terminal.text, "the clicked signal")
    terminal.type("n")
    terminal.wait("NMT to node 1")
    line = next(number for number, text in enumerate(terminal.lines) if "p  preop" in text)
    terminal.type(f"\x1b[<0;10;{line + 1}M\x1b[<0;10;{line + 1}m")
    terminal.until(lambda: "> p  preop" in terminal.text, "the clicked command")
    terminal.type(ESCAPE)
    leave(terminal)
