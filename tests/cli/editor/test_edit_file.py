"""`edit FILE` in real terminals: a network file's nodes and a DCF, without a bus; what is written, kept and said."""

from __future__ import annotations

from collections import Counter
from dataclasses import replace
from pathlib import Path

import pytest

from dvtcli.domain.network.network_config import FileWord, NetworkConfig, PartialPdoConfig
from dvtcli.domain.pdo import Pdo
from dvtcli.operations.plans.read_network_config import read_network_config
from tests.cli.editor.test_editor_screen import CLEAR_LINE, F2, F5, F10, click, compare, fill
from tests.cli.prompt.conftest import Open, open_terminal
from tests.cli.prompt.terminal import DOWN, ENTER, ESCAPE, TAB, Terminal
from tests.process import run

pytestmark = pytest.mark.drawn(2, "mapping editor")

__all__ = ["open_terminal"]
PLAIN = """# a drive and what commands it
options: {heartbeat_multiplier: 2.5}
master: {sync_period: 10000}
nodes:
  drive:
    node_id: 5
    dcf: gen4   # the family
    tpdo:
      1: {mapping: [6041:00, 606C:00], event_timer: 100, inhibit_ms: 2.5}
    sdo:
      - {object: "1014:00", value: 0x85}
    store: true
  other:
    node_id: 6
    dcf: gen4
    heartbeat_producer: 500
  stranger:
    node_id: 7
    tpdo:
      1: {cob_id: 0x1B7}
"""


def opened(tmp_path: Path, open_terminal: Open, *words: str, columns: int = 80, rows: int = 24) -> Terminal:
    (tmp_path / "net.yaml").write_text(PLAIN, encoding="utf-8")
    terminal = open_terminal(*words, "edit", "net.yaml", columns=columns, rows=rows)
    terminal.wait('EDIT net.yaml  node 5 "Gen4"  as the file has it', "check: 0 errors")
    return terminal


def other_node(terminal: Terminal, number: str, node_id: int) -> None:
    terminal.type("n")
    terminal.wait("which node?")
    terminal.type(number)
    terminal.wait(f"net.yaml  node {node_id} ", "bus load")


def pdo_of(config: NetworkConfig, node_id: int, pdo: str) -> PartialPdoConfig:
    node = next(node for node in config.nodes if node.node_id == node_id)
    return next(one for one in node.pdos if one.pdo == Pdo.parse(pdo))


def test_nodes_of_a_network_file_are_edited_and_everything_else_is_kept(tmp_path: Path, open_terminal: Open) -> None:
    terminal = opened(tmp_path, open_terminal)
    before = read_network_config(str(tmp_path / "net.yaml"))
    terminal.wait("no EDS of node 7: this part of the file is kept unchanged")
    terminal.type(F10)
    terminal.wait("nothing to write: the file already has these values")
    terminal.type(ENTER)
    terminal.wait("FRAME OF TPDO1", "606C:00/32 Velocity actual value")
    terminal.type("d")
    terminal.wait("TPDO1 changed, not written")
    terminal.type(F5)
    terminal.wait("PLAN", "0x1A00:00")
    terminal.type(ESCAPE)
    terminal.until(lambda: "PLAN" not in terminal.text, "the plan gone")
    other_node(terminal, "2", 6)
    terminal.type(DOWN + "e")
    terminal.wait("TPDO2, 5:tpdo1 changed, not written")
    terminal.type(ESCAPE)
    terminal.wait("5:tpdo1, 6:tpdo2 changed and not written: leave without?")
    terminal.type("n" + F10)
    terminal.wait("net.yaml exists; overwrite it, which loses 2 comments? [y/N]")
    terminal.type("n" + ENTER)
    terminal.wait("not written: not done: the answer was no", "TPDO2, 5:tpdo1 changed, not written")
    assert (tmp_path / "net.yaml").read_text(encoding="utf-8") == PLAIN
    terminal.type(F10)
    terminal.wait("overwrite it")
    terminal.type("y" + ENTER)
    terminal.wait("net.yaml: 5:tpdo1, 6:tpdo2 written", 'node 6 "Gen4"  as the file has it')
    terminal.type(ESCAPE)
    assert terminal.ended() == 0
    after = read_network_config(str(tmp_path / "net.yaml"))
    assert pdo_of(after, 5, "tpdo1") == replace(
        pdo_of(before, 5, "tpdo1"), mapping=(FileWord("velocity_actual_value"),)
    )
    assert pdo_of(after, 6, "tpdo2") == PartialPdoConfig(Pdo.parse("tpdo2"), enabled=False)
    drive, other, stranger = before.nodes
    assert after == replace(
        before,
        nodes=(
            replace(drive, pdos=(pdo_of(after, 5, "tpdo1"),)),
            replace(other, pdos=(pdo_of(after, 6, "tpdo2"),)),
            stranger,
        ),
    )


def test_f10_keeps_what_another_program_wrote_and_names_the_way_out(tmp_path: Path, open_terminal: Open) -> None:
    terminal = opened(tmp_path, open_terminal)
    terminal.type("e")
    terminal.wait("TPDO1 changed, not written")
    theirs = PLAIN.replace("heartbeat_producer: 500", "heartbeat_producer: 900")
    (tmp_path / "net.yaml").write_text(theirs, encoding="utf-8")
    terminal.type(F10)
    terminal.wait(
        "not written: net.yaml was changed by another program and is not overwritten; F2", "saves under another name"
    )
    terminal.type(F2)
    fill(terminal, "save as", "node.dcf")
    terminal.wait("node.dcf is not written")
    terminal.type(F2)
    fill(terminal, "save as", "mine.yaml")
    terminal.wait("mine.yaml: 5:tpdo1 written")
    terminal.type(ESCAPE)
    terminal.wait("leave without?")
    terminal.type("y")
    assert terminal.ended() == 0
    assert (tmp_path / "net.yaml").read_text(encoding="utf-8") == theirs
    assert not (tmp_path / "node.dcf").exists()


def test_findings_of_check_and_the_bus_load_are_shown_while_one_edits(tmp_path: Path, open_terminal: Open) -> None:
    terminal = opened(tmp_path, open_terminal)
    other_node(terminal, "2", 6)
    terminal.type(ENTER)
    terminal.wait("FRAME OF TPDO1")
    terminal.type(DOWN)
    terminal.row("> ", "COB-ID")
    terminal.type(ENTER)
    fill(terminal, "COB-ID", "0x185")
    terminal.wait("0x185", "CAN-ID 0x185 is already sent by TPDO1 of node 5")
    load = next(line for line in terminal.lines if "bus load" in line)
    terminal.type(DOWN * 3 + ENTER)
    fill(terminal, "event timer", "5")
    terminal.until(lambda: all(load != line for line in terminal.lines) and "bus load" in terminal.text, "a new load")


def test_a_network_file_is_saved_under_another_name_and_a_dry_run_writes_none(
    tmp_path: Path, open_terminal: Open
) -> None:
    terminal = opened(tmp_path, open_terminal, "--dry-run")
    terminal.type("e")
    terminal.wait("TPDO1 changed, not written")
    terminal.type(F10)
    terminal.wait("dry run: 5:tpdo1 would be written; nothing was written")
    terminal.type(F2)
    fill(terminal, "save as", "new.yaml")
    terminal.wait("new.yaml: 5:tpdo1 written; dry run: only this file was written")
    terminal.type(ESCAPE)
    terminal.wait("leave without?")
    terminal.type("y")
    assert terminal.ended() == 0
    assert (tmp_path / "net.yaml").read_text(encoding="utf-8") == PLAIN
    before, after = (read_network_config(str(tmp_path / name)) for name in ("net.yaml", "new.yaml"))
    assert pdo_of(after, 5, "tpdo1") == replace(pdo_of(before, 5, "tpdo1"), enabled=False)


def test_a_dcf_is_edited_and_only_its_pdos_change(tmp_path: Path, open_terminal: Open) -> None:
    assert run(("--sim", "gen4@9", "export", "n.dcf"), cwd=tmp_path).returncode == 0
    before = (tmp_path / "n.dcf").read_text(encoding="latin-1").splitlines()
    terminal = open_terminal("edit", "n.dcf")
    terminal.wait('EDIT n.dcf  node 9 "Gen4"  as the file has it')
    terminal.type(ENTER)
    terminal.wait("FRAME OF TPDO1", "Statusword")
    terminal.type("a")
    terminal.wait(" map: _")
    terminal.type(CLEAR_LINE + "606c")
    terminal.row("> 606C:00")
    terminal.type(ENTER)
    terminal.wait("is mapped")
    terminal.type(F10)
    terminal.wait("n.dcf exists; overwrite it? [y/N]")
    terminal.type("y" + ENTER)
    terminal.wait("n.dcf: 9:tpdo1 written", "as the file has it")
    terminal.type(TAB)
    terminal.wait("606C:00/32")
    terminal.type(ESCAPE)
    assert terminal.ended() == 0
    after = (tmp_path / "n.dcf").read_text(encoding="latin-1").splitlines()
    added = Counter(after) - Counter(before)
    assert added["ParameterValue=0x606C0020"] == 1
    values = [line for line in added.elements() if not line.startswith("Modif")]
    assert len(values) == 2, values
    assert all(line.startswith("ParameterValue=") for line in values), values


@pytest.mark.parametrize(
    ("name", "text", "said"),
    [
        ("a.txt", "", "edit takes a PDO, a network file (.yaml), a DCF (.dcf) or an XDC (.xdc)"),
        ("a.eds", "", "eds convert a.eds a.dcf` makes a DCF, which can be edited"),
        ("a.XDD", "", "eds convert a.XDD a.dcf` makes a DCF, which can be edited"),
        ("a.XDC", "", "a.XDC is not well-formed XML"),
        ("a.yaml", "nodes: {a: {node_id: 5, tpdo: {1: {cob_id: 0x1B7}}}}", "its nodes have no EDS"),
        ("a.yaml", "nodes: {a: {node_id: 5, dcf: gen4, tpdo: {1: {mapping: [1018:01]}}}}", "not mappable"),
        ("gone.yaml", None, "No such file"),
        ("gone.dcf", None, "gone.dcf"),
    ],
)
def test_a_file_that_cannot_be_edited_is_refused(
    tmp_path: Path, open_terminal: Open, name: str, text: str | None, said: str
) -> None:
    if text is not None:
        (tmp_path / name).write_text(text, encoding="utf-8")
    terminal = open_terminal("edit", name, columns=120)
    assert terminal.ended()
    assert said in " ".join(terminal.text.split())


def test_a_tpdo_is_linked_to_an_rpdo_which_skips_what_it_does_not_receive(tmp_path: Path, open_terminal: Open) -> None:
    terminal = opened(tmp_path, open_terminal)
    terminal.type("L")
    terminal.wait("TPDO1 to which RPDO?", "6:rpdo1  6040:00", "6:rpdo3  maps nothing")
    terminal.type("1")
    terminal.wait("6:rpdo1 receives 5:tpdo1 with 0x185", "[link-command]", "6:rpdo1 changed, not written")
    terminal.type("n2")
    terminal.wait(" RPDO1 changed, not written")
    terminal.row("RPDO1 ", "0x185", "6 B   6040:00 0007:00")
    terminal.type(F2)
    fill(terminal, "save as", "linked.yaml")
    terminal.wait("linked.yaml: 6:rpdo1 written")
    made = pdo_of(read_network_config(str(tmp_path / "linked.yaml")), 6, "rpdo1")
    assert (made.cob_id, made.enabled) == (0x185, True)
    assert [word.text for word in made.mapping or ()] == ["controlword", "0007:00/32"]
    terminal.type(ESCAPE)


def test_the_plan_of_a_file_names_errors_and_forces_nothing(tmp_path: Path, open_terminal: Open) -> None:
    terminal = opened(tmp_path, open_terminal, columns=120, rows=40)
    click(terminal, "COB-ID        0x185")
    terminal.wait("> COB-ID")
    terminal.type(ENTER)
    fill(terminal, "COB-ID", "0x285")
    terminal.wait("[can-id-clash]")
    terminal.type(F5)
    terminal.wait("PLAN", "error: CAN-ID 0x285 is already used", "Nothing was")
    assert "forced" not in terminal.text
    terminal.type(ESCAPE + ESCAPE + "y")
    assert terminal.ended() == 0


def test_the_plan_of_a_file_has_all_changed_nodes(tmp_path: Path, open_terminal: Open) -> None:
    terminal = opened(tmp_path, open_terminal, columns=120, rows=40)
    terminal.type(F5)
    terminal.wait("nothing to plan: the file already has these values")
    terminal.type("L1")
    terminal.wait("6:rpdo1 receives 5:tpdo1 with 0x185", "6:rpdo1 changed, not written")
    terminal.type(F5)
    terminal.wait("PLAN", "node 6 other (Gen4)", "0x1400:01")
    assert "node 5 drive" not in terminal.text
    terminal.type(ESCAPE + "e")
    terminal.wait("TPDO1, 6:rpdo1 changed, not written")
    terminal.type(F5)
    terminal.wait("PLAN", "node 5 drive (Gen4)", "0x1800:01", "node 6 other (Gen4)", "0x1400:01")


def test_the_findings_of_check_are_listed_with_their_places(tmp_path: Path, open_terminal: Open) -> None:
    """Those of other nodes, too: the line of the chosen PDO has its own only."""
    terminal = opened(tmp_path, open_terminal, columns=120, rows=40)
    terminal.type("L1")
    terminal.wait("6:rpdo1 changed, not written", "check: 0 errors, 2 warnings: c lists them")
    terminal.type("c")
    terminal.wait("FINDINGS", "6:rpdo1: ", "[unwatched-link]", "[hears-no-command]")
    terminal.type(ESCAPE)
    terminal.until(lambda: "FINDINGS" not in terminal.text, "the list gone")


def test_edits_after_the_file_was_written_are_called_discarded(tmp_path: Path, open_terminal: Open) -> None:
    terminal = opened(tmp_path, open_terminal, columns=120, rows=40)
    terminal.type("e" + F10)
    terminal.wait("overwrite it")
    terminal.type("y" + ENTER)
    terminal.wait("net.yaml: 5:tpdo1 written", "as the file has it")
    terminal.type("e")
    terminal.wait("TPDO1 changed, not written")
    terminal.type(ESCAPE)
    terminal.wait("leave without?")
    terminal.type("y")
    assert terminal.ended() == 0
    assert "net.yaml: 5:tpdo1 left as it was written: later edits discarded" in terminal.text


def test_an_empty_rpdo_is_linked_to_the_objects_that_one_chooses(tmp_path: Path, open_terminal: Open) -> None:
    terminal = opened(tmp_path, open_terminal, columns=120, rows=40)
    terminal.type("L3")
    terminal.wait('which object of node 6 receives 6041:00 "Statusword", 16 bits?', "s  skip it")
    terminal.type("s")
    terminal.wait(
        'which object of node 6 receives 606C:00 "Velocity actual value", 32 bits?', '60FF:00 "Target velocity"'
    )
    terminal.type("s")
    terminal.wait("not linked: 6:rpdo3 maps nothing, and no object of its node was chosen")
    terminal.type("L3")
    terminal.wait("receives 6041:00")
    terminal.type("s")
    terminal.wait("receives 606C:00")
    terminal.type(DOWN * 5)
    terminal.row("> ", '60FF:00 "Target velocity"')
    terminal.type(ENTER)
    terminal.wait("6:rpdo3 receives 5:tpdo1 with 0x185", "[link-target]")
    terminal.type("n2")
    terminal.row("RPDO3 ", "0x185", "6 B")
    terminal.type(F2)
    fill(terminal, "save as", "linked.yaml")
    terminal.wait("linked.yaml: 6:rpdo3 written")
    made = pdo_of(read_network_config(str(tmp_path / "linked.yaml")), 6, "rpdo3")
    assert [word.text for word in made.mapping or ()] == ["0006:00/16", "target_velocity"]


@pytest.mark.parametrize("answer", ["y", "n"])
def test_a_link_offers_a_heartbeat_consumer_if_the_file_has_the_heartbeat(
    tmp_path: Path, open_terminal: Open, answer: str
) -> None:
    terminal = opened(tmp_path, open_terminal)
    other_node(terminal, "2", 6)
    terminal.type("L1")
    terminal.wait("node 5 does not watch the heartbeat of node 6: add it, 1250 ms? [y/N]")
    terminal.type(answer)
    terminal.wait("5:rpdo1 receives 6:tpdo1")
    terminal.type(F2)
    fill(terminal, "save as", "linked.yaml")
    terminal.wait("linked.yaml: 5:rpdo1", "written")
    (drive, *_) = read_network_config(str(tmp_path / "linked.yaml")).nodes
    assert [(watch.producer, watch.time_ms) for watch in drive.watches] == ([(6, 1250)] if answer == "y" else [])


def test_an_rpdo_as_the_producer_of_a_link_is_refused_with_what_to_do(tmp_path: Path, open_terminal: Open) -> None:
    terminal = opened(tmp_path, open_terminal)
    terminal.type(DOWN * 5)
    terminal.until(lambda: any(line.startswith(">  RPDO1") for line in terminal.lines), "RPDO1")
    terminal.type("L")
    terminal.wait("RPDO1 is an RPDO: choose a TPDO with up and down, then L links an RPDO to it")


@pytest.mark.parametrize(("columns", "rows"), [(80, 24), (120, 40)])
def test_screens_of_a_network_file_look_as_they_did(
    request: pytest.FixtureRequest, tmp_path: Path, open_terminal: Open, columns: int, rows: int
) -> None:
    terminal = opened(tmp_path, open_terminal, columns=columns, rows=rows)
    shown: list[str] = []

    def keep(view: str, keys: str, *texts: str) -> None:
        terminal.type(keys)
        terminal.wait(*texts)
        shown.append("\n".join([f"==== {view}", *terminal.lines]))

    keep("as opened", "", "no EDS of node 7", "> ")
    keep("which RPDO", "L", "TPDO1 to which RPDO?", "6:rpdo5")
    keep("which object", "3", "which object of node 6 receives 6041:00", "skip it")
    keep("linked", ESCAPE + "L1", "6:rpdo1 receives 5:tpdo1", "check: 0 errors", "2 warnings")
    keep("which node", "n", "which node?", "6 other (Gen4)")
    keep("other node", "2", "node 6 ", "RPDO1 changed, not written", "check: 0 errors", "2 warnings")
    keep("save", F2, "save as: pdos.dvt_", "Esc no")
    keep("leaving", ESCAPE + ESCAPE, "6:rpdo1 changed and not written: leave without?")
    compare(request, f"file_{columns}x{rows}.txt", shown)
