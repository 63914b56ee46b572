"""The mapping editor when something goes wrong: another size, a killed process, a lost bus; and live values."""

from __future__ import annotations

from dataclasses import dataclass, field
from pathlib import Path

import can
import pytest

from dvtcli.cli.editor.draw import FRAME, PDOS, EditorView, Named, picture
from dvtcli.cli.editor.model import EditedPdos
from dvtcli.domain.cob_id import CobId
from dvtcli.domain.pdo import Pdo, PdoCommunicationParameter, PdoConfig, PdoMappingEntry
from dvtcli.domain.profile import Severity
from dvtcli.domain.rules.finding import Finding
from tests.cli.editor.test_editor_screen import F2, F10, edited, pdos
from tests.cli.prompt.conftest import Open, open_terminal
from tests.cli.prompt.terminal import CTRL_C, ENTER, ESCAPE, Terminal
from tests.posix import SIGKILL
from tests.simulator.serve.killing import CutOff, Victim, killable
from tests.simulator.serve.served import bus_words, own_environment, served

pytestmark = pytest.mark.drawn(2, "mapping editor")

__all__ = ["open_terminal"]


@dataclass
class AtTerminal(Victim):
    """A dvtcli at a terminal that is killed at a frame."""

    terminal: Terminal = field(kw_only=True)

    def kill(self) -> None:
        """Kill it."""
        self.terminal.child.kill(SIGKILL)


def is_download(message: can.Message) -> bool:
    return message.arbitration_id == 0x601 and message.data[0] & 0xE0 == 0x20


def state_of(folder: Path) -> dict[str, str]:
    return {name: own_environment(folder)[name] for name in ("XDG_STATE_HOME", "LOCALAPPDATA")}


def with_a_change(open_terminal: Open, port: int, folder: Path) -> Terminal:
    """The editor with a change of TPDO2 that is not applied."""
    terminal = open_terminal(*bus_words(port), "-n", "1", "edit", "tpdo2", environment=state_of(folder))
    terminal.wait("FRAME OF TPDO2", "606C:00/32")
    terminal.type("d")
    terminal.wait("TPDO2 changed, not applied", "4 bytes free")
    terminal.until(lambda: "asking the rules" not in terminal.text, "the rules asked")
    return terminal


@pytest.mark.parametrize("is_killed", [True, False])
def test_a_change_cut_short_is_recovered(tmp_path: Path, open_terminal: Open, is_killed: bool) -> None:
    with killable(tmp_path, "gen4@1") as server:
        before = pdos(server)
        terminal = with_a_change(open_terminal, server.port, tmp_path)
        victim = AtTerminal(3, is_download, terminal=terminal) if is_killed else CutOff(3, is_download)
        server.door.victim = victim
        terminal.type(F10)
        code = terminal.ended()
        server.door.victim = None
        assert code in ((None, 137) if is_killed else (5, 7)), terminal.text
        assert pdos(server) != before
        assert server.dvtcli("-n", "1", "--yes", "recover").returncode == 0
        assert pdos(server) == before


@dataclass
class Stopped(Victim):
    """A dvtcli at a terminal that gets a Ctrl-C at a frame."""

    terminal: Terminal = field(kw_only=True)

    def falls_at(self, request: bytes) -> bool:
        """Press Ctrl-C there; the request is passed on all the same."""
        if super().falls_at(request):
            self.left = -1  # once
            self.terminal.type(CTRL_C)
        return False


def test_ctrl_c_while_a_change_is_written_rolls_it_back_and_says_the_edits(tmp_path: Path, open_terminal: Open) -> None:
    with killable(tmp_path, "gen4@1") as server:
        before = pdos(server)
        terminal = with_a_change(open_terminal, server.port, tmp_path)
        server.door.victim = Stopped(3, is_download, terminal=terminal)
        terminal.type(F10)
        assert terminal.ended() == 130, terminal.text
        server.door.victim = None
        assert "your edit as a command: map tpdo2 6077" in " ".join(terminal.text.split())
        assert pdos(server) == before


def test_a_bus_lost_while_one_edits_is_told_and_the_editor_still_works(tmp_path: Path, open_terminal: Open) -> None:
    with served(tmp_path, "gen4@1") as server:
        words = (*bus_words(server.port), "-n", "1", "--eds", "gen4", "edit", "tpdo2")
        terminal = open_terminal(*words, environment=state_of(tmp_path))
        terminal.wait("FRAME OF TPDO2", "606C:00/32")
        server.end()
        terminal.wait("failed", "edits stay, but F10 cannot write")
        terminal.type("d")
        terminal.wait("TPDO2 changed, not applied", "4 bytes free")
        terminal.type(F2)
        terminal.wait("save as: ")
        terminal.type(ENTER)
        terminal.wait("edits stay, but F10 cannot write", "is the server still running?")
        terminal.type(F10)
        assert terminal.ended() == 5, terminal.text
        assert "your edit as a command: map tpdo2 6077" in " ".join(terminal.text.split())


def test_another_size_of_the_terminal_shows_one_pane_or_all(open_terminal: Open) -> None:
    terminal = edited(open_terminal, "tpdo2")
    terminal.resize(120, 40)
    terminal.wait("PDOS", "FRAME OF TPDO2", "OBJECTS")
    terminal.resize(80, 24)
    terminal.until(lambda: "FRAME OF TPDO2" in terminal.text and "OBJECTS" not in terminal.text, "one pane")
    assert all(len(line) <= 80 for line in terminal.lines)


def test_values_of_received_frames_stand_beside_their_objects(open_terminal: Open) -> None:
    terminal = open_terminal("--sim", "gen4")
    terminal.wait_prompt()
    terminal.run("nmt start")
    terminal.wait("OPERATIONAL")
    terminal.run("edit tpdo2")
    terminal.wait("FRAME OF TPDO2")
    terminal.row("606C:00/32", "Velocity actual value", "rpm")
    terminal.type("d")
    terminal.wait("TPDO2 changed, not applied")
    terminal.until(lambda: " A" not in terminal.row("5100:02/16"), "no values of another layout")
    terminal.type(ESCAPE)


@pytest.mark.parametrize(("mpdo", "way"), [(0xFE, "SAM"), (0xFF, "DAM")])
def test_a_multiplexed_pdo_is_shown_as_such(mpdo: int, way: str) -> None:
    tpdo1 = Pdo.parse("tpdo1")
    config = PdoConfig(PdoCommunicationParameter(CobId(0x181), 255, 0, 0), (), mpdo=mpdo)
    view = EditorView("node 1", EditedPdos({tpdo1: config}), [tpdo1], pane=FRAME)
    text = "\n".join(drawn(view))
    assert f"multiplexed PDO ({way}," in text
    assert "free" not in text


def drawn(view: EditorView, columns: int = 80) -> list[str]:
    return ["".join(cell.text for cell in line).rstrip() for line in picture(view, columns, 24)]


def view_of_two(pane: int, *findings: Finding) -> EditorView:
    tpdo1, rpdo1 = Pdo.parse("tpdo1"), Pdo.parse("rpdo1")
    mapping = PdoMappingEntry(0x6041, 0, 16), PdoMappingEntry(0x5100, 1, 16)
    sends = PdoConfig(PdoCommunicationParameter(CobId(0x181), 255, 25, 100), mapping)
    receives = PdoConfig(PdoCommunicationParameter(CobId(0x201, valid=False), 1, None, 0), ())
    pdos = EditedPdos({tpdo1: sends, rpdo1: receives})
    return EditorView("node 1", pdos, [tpdo1, rpdo1], pane=pane, findings={tpdo1: findings})


def test_a_finding_is_marked_in_its_line_and_said_for_the_chosen_line() -> None:
    findings = (
        Finding("pdo-length", Severity.ERROR, "0x1A00:00", "too many"),
        Finding("entry-length", Severity.WARNING, "0x1A00:02", "another length"),
        Finding("can-id-clash", Severity.ERROR, "1800:01", "used twice"),
    )
    view = view_of_two(FRAME, *findings)
    lines = drawn(view)
    marked = [(line[:13].split("!")[1].split()[0], line.rpartition("  ")[2]) for line in lines if line[1:2] == "!"]
    assert marked == [("b", "[entry-length]"), ("enabled,", "[pdo-length]"), ("COB-ID", "[can-id-clash]")]
    for chosen, finding in ((0, findings[0]), (1, findings[1]), (2, findings[2])):
        view.frame_cursor.chosen = chosen
        assert f"{finding.place}: {finding.text} [{finding.rule}] (+2)" in drawn(view)


@pytest.mark.parametrize("columns", [80, 120])
def test_the_pdos_stand_with_state_timers_and_length(columns: int) -> None:
    lines = drawn(view_of_two(PDOS), columns)
    (sends,) = [line for line in lines if "TPDO1 " in line[:12]]
    (receives,) = [line for line in lines if "RPDO1 " in line[:12]]
    words = "TPDO1 0x181 enabled 255 2.5 ms 100 ms 4 B" if columns == 80 else "TPDO1 0x181 on 255 4 B 2.5/100"
    assert " ".join(sends.split()[1:]).startswith(words)
    assert receives.split()[:4] == ["RPDO1", "0x201", "off", "1"]


def test_a_record_s_name_gives_way_to_that_of_its_object() -> None:
    view = view_of_two(FRAME)
    entry = PdoMappingEntry(0x5100, 1, 16)
    view.names = {entry: Named("Device measurements of the left drive.Battery voltage")}
    assert any("5100:01/16 …Battery voltage" in line for line in drawn(view, 120))
    assert any("5100:01/16 Device measurements of the left drive.Battery voltage" in line for line in drawn(view))
