"""A node that restarts while a change is planned, or between two lines: what is said of it then is so."""

from __future__ import annotations

from pathlib import Path
from xml.etree import ElementTree as ET

import pytest

from dvtcli.device.change.applied import Progress
from dvtcli.device.read_pdos import read_pdo
from dvtcli.domain.nmt import NmtCommand, NmtState
from dvtcli.domain.pdo import Pdo
from dvtcli.errors import DvtcliError
from dvtcli.simulator.device.simulated_faults import Fault
from dvtcli.simulator.device.strict_device import StrictDevice
from dvtcli.simulator.network.family_file import family_eds, load_family
from tests.cli.commands.bench import Bench, Ran
from tests.harness.sample import heavy
from tests.laws.bench import DirectSdo, booted, dictionary
from tests.virtual_time import VirtualTimeBus

TPDO1, TPDO2 = Pdo.parse("tpdo1"), Pdo.parse("tpdo2")


class Restarting(StrictDevice):
    """A device that restarts once, after its answer *at* (1: the next one), where that is not 0."""

    at = 0

    def upload(self, index: int, sub_index: int) -> bytes:
        data = super().upload(index, sub_index)
        if self.at:
            self.at -= 1
            if not self.at:
                self.nmt(NmtCommand.RESET_NODE)
        return data


class Counting(StrictDevice):
    """A device that counts its answers to uploads."""

    uploads = 0

    def upload(self, index: int, sub_index: int) -> bytes:
        self.uploads += 1
        return super().upload(index, sub_index)


def device(family: str) -> Restarting:
    """One that is OPERATIONAL."""
    made = booted(family)
    restarting = Restarting(made.dictionary, made.family, made.node_id)
    restarting.boot_up()
    restarting.nmt(NmtCommand.START)
    return restarting


def bench(node: StrictDevice, *faults: str, family: str = "generic") -> Bench:
    """As the prompt of a process of its own on a bus where *node* outlives it."""
    bus = VirtualTimeBus([node], faults=[Fault.parse(one) for one in faults], timeout_s=0.3, simulated=False)
    return Bench((), {"yes": True, "node": node.node_id, "eds": str(family_eds(family))}, bus)


def ended(made: Bench, line: str) -> Ran:
    """A line as a command of its own, with what its end said."""
    ran = made.run(line)
    try:
        made.session.end_line(ran.code, alone=True)
    except DvtcliError as failed:
        return Ran(failed.exit_code, ran.stdout, failed.text)
    return ran


@pytest.mark.drawn(2)
@pytest.mark.parametrize("family", ["generic", "gen4"])
@pytest.mark.parametrize("line", ["undo", "undo --backup"])
def test_a_node_that_restarts_while_an_undo_looks_at_it_is_operational_at_its_end(line: str, family: str) -> None:
    """Whether what a restart brought back is what was to be put back, or had to be written before it."""

    def left(at: int) -> tuple[Restarting, Ran]:
        """The device after an undo at whose answer *at* it restarted, and how the undo ended."""
        node = device(family)
        with bench(node, family=family) as one:
            assert ended(one, "map tpdo1 6041 --timer 20").code == 0
            node.at = at
            return node, ended(one, line)

    most = 1000
    answers = most - left(most)[0].at
    ends = set()
    step = 11 if line == "undo" else 33
    for at in range(answers - 1, max(0, answers - 250), -step):  # behind the last answer nobody can see it
        node, ran = left(at)
        if ran.code:
            assert "unchanged: nothing was written" in ran.stderr or "unstored values are lost" in ran.stderr
        else:
            assert node.state is NmtState.OPERATIONAL, (at, ran.stderr)
        ends.add("nothing was written" in ran.stdout)
    assert ends == {True, False}


def test_a_change_that_was_rolled_back_over_a_restart_does_not_say_that_everything_is_as_it_was() -> None:
    node = device("generic")
    with bench(node) as one:
        assert ended(one, "set tpdo2 --timer 70").code == 0
    with bench(node, "reset@3=0") as one:
        ran = one.run("map tpdo1 606C 6041")
    assert ran.code == 5
    assert read_pdo(DirectSdo(node), TPDO2).communication.event_timer == 0
    said = " ".join(ran.stderr.split())
    assert "rolled back: TPDO1 is as it was, read back equal; node 1 restarted: other unstored values" in said
    assert "everything is as before" not in said


@heavy
@pytest.mark.parametrize("faults", [("alters@2=1801:01:0xC0000299",), ("reset-at-read@{}=0", "no-boot-up")])
def test_an_atomic_script_holds_all_that_it_set_at_its_end(faults: tuple[str, ...], tmp_path: Path) -> None:
    """Whatever a later line altered of what an earlier one had set, or a restart that nobody heard took of it."""
    script = tmp_path / "x.dvt"
    script.write_text("set tpdo2 --timer 9\nwrite 1017 77\nset tpdo3 --timer 30\n")
    codes = set()
    for at in range(10, 60, 16) if len(faults) > 1 else [0]:
        node = device("generic")
        before = read_pdo(DirectSdo(node), TPDO2)
        with bench(node, *(one.format(at) for one in faults)) as one:
            ran = ended(one, f"run {script} --atomic")
        held = read_pdo(DirectSdo(node), TPDO2)
        if ran.code == 0:
            assert held.communication.event_timer == 9, (at, ran.stdout)
            assert node.value(0x1017, 0) == b"\x4d\x00"
            assert held.communication.cob_id == before.communication.cob_id
        else:
            assert ran.code in (1, 5), ran.stderr
            assert held == before
            assert "the changes of the script are reverted" in ran.stderr
        codes.add(ran.code)
    assert codes - {0}


@pytest.mark.parametrize("form", ["junit", "github"])
def test_what_fails_behind_the_last_line_is_in_the_report(form: str, tmp_path: Path) -> None:
    """Every line has worked, and the script fails at its end: no report of it is without a failure."""
    script = tmp_path / "x.dvt"
    script.write_text("set tpdo2 --timer 9\nset tpdo3 --timer 30\n")
    with bench(device("generic"), "alters@2=1801:01:0xC0000299") as one:
        ran = one.run(f"run {script} --atomic --format {form}")
    ran.failed(1, "no longer has the values")
    if form == "github":
        assert f"::error file={script},line=1,title=run::" in ran.stdout
        assert ran.stdout.splitlines()[-1] == "3 lines, 1 failed, 0 not reached"
        return
    suites = ET.fromstring(ran.stdout)  # noqa: S314 - our own
    assert (suites.attrib["tests"], suites.attrib["failures"]) == ("3", "1")
    last = suites[0][2]
    assert (last.attrib["name"], last[0].tag) == (f"1: run {script}", "failure")
    assert "no longer has the values of the script" in last[0].attrib["message"]
    assert last.find("system-out") is None, "what the line before it said is that line's"


def test_an_atomic_script_that_was_taken_back_is_looked_at_once_more(tmp_path: Path) -> None:
    """A node restarts, unheard, once its lines were undone, while the other node's are: it is not as it was."""
    first, second = booted(), StrictDevice(dictionary("generic"), load_family("generic"), 2)
    bus = VirtualTimeBus([first, second], timeout_s=0.3, simulated=False)
    (tmp_path / "x.dvt").write_text("set 2:tpdo3 --timer 44\nset 1:tpdo1 --timer 55\nread 5FFF\n")
    steps: list[int] = []

    def took(step: Progress) -> None:
        steps.append(step.node)
        if steps == [2, 2, 1, 2, 1]:
            second.restart()
            second.boot_up()
            second.take_outbox()

    with Bench((), {"yes": True, "node": 1}, bus) as one:
        one.session.open_network().on_step = took
        assert one.run("pdo tpdo1").code == one.run("set 2:tpdo3 --timer 33").code == 0
        ran = one.run(f"run {tmp_path / 'x.dvt'} --atomic")
    assert steps == [2, 2, 1, 2, 1]
    assert ran.code == 7
    assert "it does not have its earlier values: TPDO3 event timer is 0" in " ".join(ran.stderr.split())


@heavy
def test_nodes_that_are_as_they_were_do_not_count_one_that_restarted_before_the_plan_was_made() -> None:
    """Node 1 restarts while `undo --all` looks at it: what it held in RAM is lost, and nothing puts that back."""
    told = set()
    for at in range(4, 30, 5):
        nodes = [device("generic"), StrictDevice(dictionary("generic"), load_family("generic"), 2)]
        options, bus = {"yes": True, "node": 1}, VirtualTimeBus(nodes, timeout_s=0.3, simulated=False)
        with Bench((), options, bus) as one:
            assert one.run("set 1:tpdo1 --timer 9").code == one.run("set 2:tpdo1 --timer 8").code == 0
            nodes[0].at = at
            ran = one.run("undo --all")
        timer = read_pdo(DirectSdo(nodes[0]), TPDO1).communication.event_timer
        text = " ".join(ran.stderr.split())
        assert ran.code or not timer
        if ran.code:
            assert timer == 9 or "every node is unchanged" not in text, (at, text)
            told.add("node 1 restarted: other unstored values are lost" in text)
    assert told == {True}


class RestartsAtStart(StrictDevice):
    """A device that restarts instead of going back to OPERATIONAL, when it is *armed*, once."""

    armed = False

    def nmt(self, command: int) -> None:
        if self.armed and command == NmtCommand.START:
            self.armed, command = False, NmtCommand.RESET_NODE
        super().nmt(command)


def test_an_atomic_script_whose_node_restarts_on_its_way_back_to_operational_is_taken_back(tmp_path: Path) -> None:
    """All its lines have worked and were read back by then; the other node does not keep its half of the script."""
    made = booted("gen4")
    first = RestartsAtStart(made.dictionary, made.family, 1)
    second = StrictDevice(made.dictionary, made.family, 2)
    for one in (first, second):
        one.boot_up()
        one.nmt(NmtCommand.START)
    before = [read_pdo(DirectSdo(one), TPDO1) for one in (first, second)]
    first.armed = True
    script = tmp_path / "x.dvt"
    script.write_text("set 1:tpdo1 --timer 70\nset 2:tpdo1 --timer 80\n")
    bus = VirtualTimeBus([first, second], timeout_s=0.3, simulated=False)
    with Bench((), {"yes": True, "eds": str(family_eds("gen4"))}, bus) as one:
        ran = ended(one, f"run {script} --atomic")
    assert ran.code == 1, ran.stderr
    assert "node 1 restarted: unstored values are lost (TPDO1)" in ran.stderr
    assert "rolled back: the changes of the script are reverted and verified" in ran.stderr
    assert [read_pdo(DirectSdo(one), TPDO1) for one in (first, second)] == before
    assert [one.state for one in (first, second)] == [NmtState.OPERATIONAL] * 2


@pytest.mark.parametrize("suffix", [".jsonl", ".dcf"])
def test_a_backup_is_of_one_life_of_the_node(suffix: str, tmp_path: Path) -> None:
    """It restarts before its last answers: the backup is read again, and holds what the node came up with."""
    file, node = tmp_path / f"whole{suffix}", device("generic")
    counted = Counting(node.dictionary, node.family, node.node_id)
    counted.boot_up()
    with bench(counted) as one:
        assert one.run(f"backup {file}").code == 0
    for left in (1, 2, 3):
        node = device("generic")
        node.download(0x1800, 5, (33).to_bytes(2, "little"))
        node.at = counted.uploads - left
        with bench(node) as one:
            ran = one.run(f"backup {file} --force --yes")
            assert ran.code == 0, ran.stderr
            assert "restarted during the reading, which is repeated" in ran.stderr
            compared = one.run(f"compare {file} --json")
        assert compared.document["differences"] == [], left
