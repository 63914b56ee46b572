"""The mapping editor in real terminals: PDOs built by keys alone, refusals, the mouse, and what leaving means."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

import pytest

from dvtcli.operations.plans.read_network_config import read_network_config
from dvtcli.operations.session.simulated_nodes import read_dictionary
from tests.cli.prompt.conftest import Open, open_terminal
from tests.cli.prompt.terminal import CTRL_C, DOWN, ENTER, ESCAPE, F1, TAB, Terminal
from tests.simulator.serve.served import Served, bus_words, served
from tests.small_eds import U32, Eds, var

pytestmark = pytest.mark.drawn(4, "mapping editor")

__all__ = ["open_terminal"]
CLEAR_LINE, UNDO, REDO, SAVE = "\x15", "\x1a", "\x19", "\x13"
F2, F5, F10, SHIFT_TAB = "\x1bOQ", "\x1b[15~", "\x1b[21~", "\x1b[Z"
SCRIPT = Path(__file__).parents[3] / "scripts" / "pdo_config.dvt"
SCREENS = Path(__file__).parent / "screens"
#: what the script maps
WANTED = {
    1: ("606c", "6077", "6041"),
    2: ("5100:1", "5100:2", "5100:3", "5100:4"),
    3: ("2620", "6c01:1", "6c01:2", "6800:1", "6800:2"),
    4: ("6c01:3", "6c01:4", "6c01:5"),
}


def edited(open_terminal: Open, *words: str, columns: int = 80, rows: int = 24) -> Terminal:
    terminal = open_terminal("--sim", "gen4", "edit", *words, columns=columns, rows=rows)
    terminal.wait("EDIT node 1", "value in the node")
    return terminal


def chosen(terminal: Terminal, text: str) -> None:
    terminal.until(lambda: any(line.lstrip().startswith(">") and text in line for line in terminal.lines), f"> {text}")


def fill(terminal: Terminal, label: str, text: str) -> None:
    terminal.until(lambda: f"{label}: " in terminal.lines[-1], f"the field {label!r}")
    terminal.type(CLEAR_LINE + text)
    terminal.until(lambda: f"{label}: {text}_" in terminal.lines[-1], f"{text!r} in {label!r}")
    terminal.type(ENTER)


def map_object(terminal: Terminal, text: str) -> None:
    """In the pane of objects: filter by *text*, and map the first object."""
    terminal.type(text)
    whole = text if len(text) != 6 else f"{text[:5]}0{text[5]}"
    chosen(terminal, whole.upper())
    terminal.type(ENTER)
    terminal.wait("is mapped; Enter maps another, Tab leaves the list")
    terminal.until(lambda: any(line.startswith(" map: _") for line in terminal.lines), "an empty filter")


def build(terminal: Terminal, number: int, objects: tuple[str, ...], held: int, *, off: bool) -> None:
    """From the pane of PDOs with TPDO *number* chosen: map *objects* instead of the *held* entries, on every SYNC."""
    terminal.type(ENTER)
    terminal.wait(f"FRAME OF TPDO{number}")
    for left in reversed(range(held)):
        terminal.type("d")
        terminal.until(lambda left=left: sum("/" in line[:22] for line in terminal.lines[3:-4]) == left, f"{left} left")
    terminal.type("a")
    terminal.wait(" map: _")
    for text in objects:
        map_object(terminal, text)
    terminal.type(SHIFT_TAB)
    terminal.wait(f"FRAME OF TPDO{number}")
    terminal.type(DOWN)
    chosen(terminal, "COB-ID")
    terminal.type(ENTER)
    fill(terminal, "COB-ID", "auto")
    terminal.row("COB-ID", f"0x{0x101 + 0x100 * (number - 1) + 0x80:X}")
    terminal.type(DOWN)
    chosen(terminal, "type")
    terminal.type(ENTER)
    fill(terminal, "type", "1")
    terminal.row("type", "1 ", "SYNC")
    for name in ("inhibit time", "event timer"):
        terminal.type(DOWN)
        chosen(terminal, name)
        terminal.type(ENTER)
        fill(terminal, name, "0")
        terminal.row(name, "0 ms")
    if off:
        terminal.type("e")
    terminal.wait("enabled, ")
    terminal.type(SHIFT_TAB)
    terminal.wait("PDOS")


def pdos(server: Served) -> list[dict[str, Any]]:
    ran = server.dvtcli("-n", "1", "pdo", "--all", "--json")
    assert ran.returncode == 0
    return [
        {name: value for name, value in row.items() if name != "last_frame"} for row in json.loads(ran.stdout)["pdos"]
    ]


def test_keys_alone_make_the_pdos_of_the_script(tmp_path: Path, open_terminal: Open) -> None:
    for name in ("by_script", "by_keys"):
        (tmp_path / name).mkdir()
    with served(tmp_path / "by_script", "gen4@1") as server:
        assert server.dvtcli("-n", "1", "run", str(SCRIPT)).returncode == 0
        by_script = pdos(server)
    with served(tmp_path / "by_keys", "gen4@1") as server:
        before = pdos(server)
        terminal = open_terminal(*bus_words(server.port), "-n", "1", "edit")
        terminal.wait("EDIT node 1")
        for number, objects in WANTED.items():
            row = next(row for row in before if row["pdo"] == f"tpdo{number}")
            build(terminal, number, objects, len(row["mapping"]), off=not row["enabled"])
            chosen(terminal, f"TPDO{number}")
            assert pdos(server) == before, "nothing is written before it is applied"
            terminal.type(DOWN)
        terminal.type(F10)
        terminal.wait("TPDO1, TPDO2, TPDO3, TPDO4 set: ", "value in the node")
        terminal.type(ESCAPE)
        assert terminal.ended() == 0
        assert pdos(server) == by_script != before


def test_a_pdo_that_stays_off_is_said_with_the_key_that_enables_it(open_terminal: Open) -> None:
    terminal = open_terminal("--sim", "gen4", "edit", "tpdo3")
    terminal.wait("FRAME OF TPDO3")
    terminal.type("a")
    terminal.wait(" map: _")
    map_object(terminal, "606C")
    terminal.wait("TPDO3 is off:")
    terminal.type(F5)
    terminal.wait("TPDO3 stays off: e enables a PDO")


@pytest.mark.parametrize("key", ["n", "L"])
def test_a_key_for_several_nodes_says_what_it_needs(open_terminal: Open, key: str) -> None:
    terminal = open_terminal("--sim", "gen4", "edit")
    terminal.wait("PDOS")
    terminal.type(key)
    terminal.wait(f"{key} needs a network file with several nodes: dvtcli edit FILE")


def test_rules_are_said_while_one_edits_and_refuse_as_map_does(open_terminal: Open) -> None:
    terminal = edited(open_terminal, "tpdo1")
    terminal.type("a")
    terminal.wait(" map: _")
    terminal.type("1018:1")
    terminal.row("> 1018:01", "not mappable")
    terminal.type(ENTER)
    terminal.wait("1018:01: not mappable")
    terminal.type(CLEAR_LINE + "zzz")
    terminal.wait("no object matches by number, name or unit")
    terminal.type(ENTER)
    terminal.wait("no object is named 'zzz'")
    terminal.type(CLEAR_LINE)
    for text in ("606c", "60ff"):
        map_object(terminal, text)
    terminal.type(SHIFT_TAB)
    terminal.wait("FRAME OF TPDO1", "16 bits too many", "0x1A00")
    terminal.type(F10)
    terminal.wait("not applied: ", "TPDO1 changed, not applied")
    terminal.type("d")
    terminal.wait("2 bytes free")
    terminal.type(UNDO)
    terminal.wait("16 bits too many")
    terminal.type(REDO)
    terminal.wait("2 bytes free")
    terminal.type(F5)
    terminal.wait("PLAN", "0x1A00:02", "dry run: TPDO1 would be set")
    terminal.type(ESCAPE)
    terminal.until(lambda: "PLAN" not in terminal.text, "the plan gone")
    terminal.type(SAVE)  # Ctrl-S applies
    terminal.wait("TPDO1 set: ", "value in the node")
    terminal.type(ESCAPE)
    assert terminal.ended() == 0


def test_a_dry_run_says_that_nothing_was_written(open_terminal: Open) -> None:
    terminal = edited(open_terminal, "--dry-run", "tpdo1", columns=120)
    terminal.type("e")
    terminal.wait("TPDO1 changed, not applied")
    terminal.type(F10)
    terminal.wait("dry run: TPDO1 would be set with 1 write; nothing was written")
    terminal.type(ESCAPE)
    assert terminal.ended() == 0


def test_leaving_with_changes_asks_and_writes_nothing(open_terminal: Open) -> None:
    terminal = edited(open_terminal, "tpdo1", columns=120, rows=40)
    terminal.type("e")
    terminal.wait("TPDO1 changed, not applied", "off, 6 bytes free")
    for key in (ESCAPE, CTRL_C):
        terminal.type(key)
        terminal.wait("TPDO1 changed and not applied: leave without? [y/N]")
        terminal.type("n")
        terminal.until(lambda: "leave without?" not in terminal.text, "the question answered")
    terminal.type(F2)
    fill(terminal, "save as", "pdos.dvt")
    terminal.wait("pdos.dvt: a script of 1 line")
    terminal.type(ESCAPE)
    terminal.wait("leave without?")
    terminal.type("y")
    assert terminal.ended() == 0
    assert "TPDO1 left as it was" in terminal.text


def test_edits_after_an_applied_change_are_called_discarded(open_terminal: Open) -> None:
    """The screen is left with TPDO1 as it was applied, not as it was before."""
    terminal = edited(open_terminal, "tpdo1", columns=120, rows=40)
    terminal.type("e")
    terminal.wait("TPDO1 changed, not applied")
    terminal.type(F10)
    terminal.wait("TPDO1 set: ", "value in the node")
    terminal.type("e" + TAB + TAB + DOWN + "e")
    terminal.wait("TPDO1, TPDO2 changed, not applied")
    terminal.type(ESCAPE)
    terminal.wait("leave without?")
    terminal.type("y")
    assert terminal.ended() == 0
    assert "TPDO1: later edits discarded; what was applied stays" in terminal.text
    assert "TPDO2 left as it was" in terminal.text


@pytest.mark.parametrize("name", ["x.txt", "y.eds", "pdos", "z.xdd", "net.json", "a.tcl"])
def test_another_suffix_is_refused_before_anything_is_written(tmp_path: Path, open_terminal: Open, name: str) -> None:
    terminal = edited(open_terminal, "tpdo1", columns=120, rows=40)
    before = sorted(tmp_path.rglob(name))
    terminal.type("e" + F2)
    fill(terminal, "save as", name)
    terminal.wait(f"{name} is not written: its suffix is to be one of .dvt .yaml .yml .dcf .xdc")
    assert sorted(tmp_path.rglob(name)) == before == []
    fill(terminal, "save as", "n.DVT")
    terminal.wait("n.DVT: a script of 1 line")


def test_every_finding_of_the_rules_is_listed(open_terminal: Open) -> None:
    terminal = edited(open_terminal, "tpdo1", columns=120, rows=40)
    terminal.type("c")
    terminal.wait("the rules have no findings")
    terminal.type(DOWN)
    terminal.row("> ", "COB-ID")
    terminal.type(ENTER)
    fill(terminal, "COB-ID", "0x281")
    terminal.wait("[can-id-clash]")
    terminal.type("c")
    terminal.wait("FINDINGS", "CAN-ID 0x281 is already")
    terminal.type(ESCAPE)
    terminal.until(lambda: "FINDINGS" not in terminal.text, "the list gone")


def test_a_click_chooses_and_the_wheel_scrolls(open_terminal: Open) -> None:
    terminal = edited(open_terminal, columns=120, rows=40)
    terminal.type("\x1b[<0;5;5M\x1b[<0;5;5m")  # column 5, row 5 from 1: the second PDO
    terminal.wait("FRAME OF TPDO2")
    terminal.type("\x1b[<65;5;4M")
    terminal.wait("FRAME OF TPDO5")
    terminal.type("\x1b[<0;90;6M\x1b[<0;90;6m")
    terminal.until(lambda: any("> 2020:0" in line for line in terminal.lines), "the third object chosen")


def click(terminal: Terminal, text: str, *, at: int = 0) -> None:
    """Click on the first row that holds *text*, in its column *at*."""
    terminal.wait(text)
    row = next(number for number, line in enumerate(terminal.lines) if text in line)
    column = terminal.lines[row].index(text) + at
    terminal.type(f"\x1b[<0;{column + 1};{row + 1}M\x1b[<0;{column + 1};{row + 1}m")


def test_the_mouse_alone_maps_moves_edits_and_applies(open_terminal: Open) -> None:
    terminal = edited(open_terminal)
    click(terminal, "TPDO3")
    chosen(terminal, "TPDO3")
    click(terminal, " a add", at=1)
    terminal.wait("OBJECTS FOR TPDO3: maps nothing, 8 bytes free")
    for text in ("2020:01", "2020:03"):
        click(terminal, text)
        chosen(terminal, text)
        click(terminal, text)
        terminal.wait(f"{text}/", " is mapped", " map: _")
    click(terminal, " Tab PDOs", at=1)
    terminal.wait("STATE")
    click(terminal, "*TPDO3")
    terminal.wait("FRAME OF TPDO3")
    chosen(terminal, "2020:03")
    click(terminal, " < > move", at=1)
    chosen(terminal, "a 0-3  2020:03")
    click(terminal, " < > move", at=3)
    chosen(terminal, "b 2-5  2020:03")
    click(terminal, "COB-ID")
    chosen(terminal, "COB-ID")
    click(terminal, "COB-ID")
    fill(terminal, "COB-ID", "auto")
    click(terminal, " e on/off", at=1)
    terminal.wait("enabled, 2 bytes free")
    click(terminal, "2020:01")
    chosen(terminal, "2020:01")
    click(terminal, " d remove", at=1)
    terminal.wait("4 bytes free")
    click(terminal, " ^Z undo", at=1)
    terminal.wait("2 bytes free")
    click(terminal, " F10/^S", at=1)
    terminal.wait("TPDO3 set: ", "value in the node")
    click(terminal, " Esc leave", at=1)
    assert terminal.ended() == 0


def test_the_cursor_of_the_terminal_stands_where_something_is_said(open_terminal: Open) -> None:
    terminal = edited(open_terminal, "tpdo2")
    chosen(terminal, "606C:00")
    assert terminal.cursor_line.startswith("> a 0-3  606C:00")
    terminal.type(REDO)
    terminal.wait("nothing to redo")
    assert terminal.cursor_line == "nothing to redo"
    terminal.type(DOWN)
    terminal.until(lambda: terminal.cursor_line.startswith("> b"), "the second object chosen")
    terminal.type(ENTER)
    terminal.wait("length in bits: 16_")
    assert terminal.screen.cursor.x == len("length in bits: 16")
    terminal.type(ESCAPE + "d" + ESCAPE)
    terminal.wait("leave without?")
    assert "leave without?" in terminal.cursor_line
    terminal.type("y")
    assert terminal.ended() == 0


def test_a_value_that_cannot_be_is_said_whole_and_each_field_says_what_it_takes(open_terminal: Open) -> None:
    terminal = edited(open_terminal, "tpdo2")
    for _ in range(3):
        terminal.type(DOWN)
    chosen(terminal, "COB-ID")
    terminal.type(ENTER)
    terminal.wait("a CAN-ID as 0x181; auto: that of the pre-defined connection set")
    fill(terminal, "COB-ID", "0x80000281")
    terminal.wait("bits 29..31", "have options of their own")
    terminal.type(CLEAR_LINE + "keep" + ENTER)
    terminal.until(lambda: "COB-ID: " not in terminal.lines[-1], "the field gone")
    terminal.type(DOWN + ENTER)
    terminal.wait("1…240: every N-th SYNC")
    fill(terminal, "type", "0xFE")
    terminal.row("type", "254")


def test_a_node_that_restarts_is_read_again_and_what_is_edited_stays(tmp_path: Path, open_terminal: Open) -> None:
    with served(tmp_path, "gen4@1") as server:
        terminal = open_terminal(*bus_words(server.port), "-n", "1", "edit", "tpdo2")
        terminal.wait("FRAME OF TPDO2", "606C:00/32")
        terminal.type("d")
        terminal.wait("TPDO2 changed, not applied")
        assert server.dvtcli("-n", "1", "--yes", "nmt", "reset-node").returncode == 0
        terminal.wait("the node restarted, another client wrote to it", "TPDO2 changed, not applied")
        terminal.type(F10)
        terminal.wait("TPDO2 set: ", "value in the node")
        terminal.type(ESCAPE)
        assert terminal.ended() == 0
        tpdo2 = next(row for row in pdos(server) if row["pdo"] == "tpdo2")
        assert [entry["object"] for entry in tpdo2["mapping"]] == ["6077:00", "5100:02"]


def test_without_a_terminal_it_is_refused(tmp_path: Path) -> None:
    with served(tmp_path, "gen4@1") as server:
        ran = server.dvtcli("-n", "1", "edit")
    assert (ran.returncode, "there is no terminal" in ran.stderr) == (6, True)


def test_a_node_without_a_pdo_is_refused(tmp_path: Path, open_terminal: Open) -> None:
    device = Eds()
    device.variable(0x1000, var("Device type", U32, 0, "ro"))
    device.variable(0x2000, var("Speed", U32, 0, mapping=1))
    (tmp_path / "bare.eds").write_text(device.text(), encoding="utf-8")
    (tmp_path / "bare.yaml").write_text("nodes: {a: {node_id: 1, dcf: bare.eds}}\n", encoding="utf-8")
    for words in (("--sim", "bare.eds", "edit"), ("edit", "bare.yaml")):
        terminal = open_terminal(*words, columns=120)
        assert terminal.ended() == 2
        assert "has no PDO to edit" in terminal.text


def test_only_ascii_where_it_is_asked_for(open_terminal: Open) -> None:
    terminal = edited(open_terminal, "--ascii", "tpdo1", columns=120, rows=40)
    assert terminal.text.isascii()
    terminal.type(TAB)
    terminal.wait("filter")
    assert terminal.text.isascii()


def test_what_is_edited_is_saved_by_the_suffix(tmp_path: Path, open_terminal: Open) -> None:
    terminal = edited(open_terminal, "tpdo1")
    terminal.type(F2)
    fill(terminal, "save as", "empty.dvt")
    terminal.wait("no device is changed; a script has the changes")
    terminal.type("d")
    terminal.wait("8 bytes free")
    terminal.type("a")
    terminal.wait(" map: _")
    map_object(terminal, "606c")
    for file, said in (("n.yaml", "a network file with 10 PDOs"), ("n.dcf", "the node with"), ("n.dvt", "a script of")):
        terminal.type(F2)
        fill(terminal, "save as", file)
        terminal.wait(f"{file}: {said}")
    terminal.type(F2)
    fill(terminal, "save as", "n.dvt")
    terminal.wait("n.dvt exists; overwrite it? [y/N]")
    terminal.type("n")
    terminal.wait("the answer was no")
    terminal.type(ESCAPE)
    terminal.wait("leave without?")
    terminal.type("y")
    assert terminal.ended() == 0
    dictionary = read_dictionary(tmp_path / "n.dcf")
    mapped = [dictionary.entry(0x1A00, sub_index) for sub_index in (0, 1)]
    assert [entry is not None and entry.value for entry in mapped] == [b"\x01", bytes.fromhex("20006c60")]
    (node,) = read_network_config(str(tmp_path / "n.yaml")).nodes
    assert [word.text for word in next(pdo for pdo in node.pdos if str(pdo.pdo) == "tpdo1").mapping or ()] == [
        "velocity_actual_value"
    ]
    for words in (("--yes", "apply", "n.yaml"), ("-n", "1", "run", "n.dvt")):
        (folder := tmp_path / words[-1][2:]).mkdir()
        with served(folder, "gen4@1") as server:
            ran = server.dvtcli(*words[:-1], str(tmp_path / words[-1]))
            assert ran.returncode == 0, ran.stderr
            tpdo1 = next(row for row in pdos(server) if row["pdo"] == "tpdo1")
            assert [entry["object"] for entry in tpdo1["mapping"]] == ["606C:00"]


def test_all_keys_are_listed(open_terminal: Open) -> None:
    terminal = edited(open_terminal)
    for key in ("?", F1):
        terminal.type(key)
        terminal.wait("KEYS", "F10, Ctrl-S", "Esc, Ctrl-C")
        assert all(len(line) < 80 for line in terminal.lines)
        terminal.type(ESCAPE)
        terminal.until(lambda: "KEYS" not in terminal.text, "the keys gone")
    terminal.type(TAB + TAB)
    terminal.wait(" map: _")
    terminal.type("?")
    terminal.wait(" map: ?_")
    terminal.type(F10)
    terminal.wait("nothing to apply: the node already has these values")


def test_what_is_applied_is_undone_at_the_prompt(open_terminal: Open) -> None:
    terminal = open_terminal("--sim", "gen4")
    terminal.wait_prompt()
    terminal.run("edit tpdo1")
    terminal.wait("EDIT node 1")
    terminal.type("e")
    terminal.wait("TPDO1 changed, not applied")
    terminal.type(F10)
    terminal.wait("TPDO1 set: 1 write, read back equal. In RAM only: `store` keeps it")
    terminal.type(ESCAPE)
    terminal.wait_prompt("sim/1 PRE-OP*> ")
    terminal.run("undo")
    terminal.wait("TPDO1 rolled back: 1 write")


def test_undo_after_a_dry_run_hits_no_earlier_change(tmp_path: Path, open_terminal: Open) -> None:
    with served(tmp_path, "gen4@1") as server:
        assert server.dvtcli("-n", "1", "set", "tpdo2", "--timer", "70").returncode == 0
        before = pdos(server)
        terminal = open_terminal(*bus_words(server.port), "-n", "1", "--dry-run")
        terminal.wait("DRY-RUN>")
        terminal.run("edit tpdo1")
        terminal.wait("EDIT node 1")
        terminal.type("e")
        terminal.wait("TPDO1 changed, not applied")
        terminal.type(F10)
        terminal.wait("nothing was written")
        terminal.type(ESCAPE)
        terminal.wait("DRY-RUN*>")
        terminal.run("undo")
        terminal.wait("dry run: TPDO1 would be")
        assert pdos(server) == before


def compare(request: pytest.FixtureRequest, name: str, shown: list[str]) -> None:
    """Compare the screens *shown* with the kept ones, or keep them if asked to."""
    kept, now = SCREENS / name, "\n".join(shown) + "\n"
    if request.config.getoption("--update-transcripts"):
        kept.write_text(now, encoding="utf-8")
    assert now == kept.read_text(encoding="utf-8")


@pytest.mark.parametrize(("columns", "rows"), [(80, 24), (120, 40)])
def test_screens_look_as_they_did(request: pytest.FixtureRequest, open_terminal: Open, columns: int, rows: int) -> None:
    terminal = edited(open_terminal, "tpdo2", columns=columns, rows=rows)
    shown: list[str] = []

    def keep(view: str, keys: str, *texts: str) -> None:
        terminal.type(keys)
        terminal.wait(*texts)
        shown.append("\n".join([f"==== {view}", *terminal.lines]))

    keep("frame", "", "FRAME OF TPDO2")
    keep("changed", "d", "TPDO2 changed, not applied", "4 bytes free")
    keep("objects", TAB + "606", " map: 606_", "> 606", "Tab PDOs")
    keep("too long", "c\r" + "606c\r" + SHIFT_TAB, "too many", "[", "Tab objects")
    keep("PDOs", SHIFT_TAB, "PDOS", "> ", "Tab frame")
    keep("keys", F1, "KEYS")
    keep("save", ESCAPE + F2, "save as: pdos.dvt_", "Esc no")
    terminal.type(ESCAPE + UNDO)
    keep("plan", F5, "PLAN", "0x1A01:00")
    keep("leaving", ESCAPE + ESCAPE, "leave without?")
    compare(request, f"{columns}x{rows}.txt", shown)
