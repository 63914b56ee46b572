"""dvtcli on Windows' standard library and files: changes, journals, locks, signals, encodings, folders, processes.

The real program in a process of its own, in which Windows' double stands before anything is imported.
"""

from __future__ import annotations

import importlib.util
import json
import re
import subprocess
import sys
from collections.abc import Callable, Iterator
from pathlib import Path

import pytest

from dvtcli.cli.lexer import split
from dvtcli.cli.prompt.line import cut
from tests.cli.prompt.terminal import Terminal
from tests.cli.prompt.wire import Wire
from tests.elsewhere.running import WINDOWS, Ran, run, start, variables
from tests.harness.sample import heavy
from tests.process import ROOT, SCRIPTS
from tests.simulator.serve.served import bus_words, wait_for

pytestmark = pytest.mark.skipif(sys.platform != "linux", reason="the double stands on Linux")

MAP = ("map", "tpdo1", "6C01:1", "606C", "6041", "--cob-id", "0x201", "--sync", "1")
CTRL_BREAK = 21
STATE = Path("AppData/Local/dvtcli/dvtcli")


class Machine:
    """A Windows user with a home, and a node 5 on a bus that survives whoever writes to it."""

    def __init__(self, home: Path) -> None:
        self.home, self.wire = home, Wire()
        self.words = [*bus_words(self.wire.port), "-n", "5", "--eds", str(self.wire.eds), "--yes"]

    def run(self, *words: str, **variables: str) -> Ran:
        return run(WINDOWS, self.home, *self.words, *words, **variables)

    def killed(self, step: int) -> None:
        """A change that ends at its *step*-th write, as from the task manager."""
        with self.wire.at_work:
            child = start(WINDOWS, self.home, *self.words, *MAP)
            self.wire.at_download = lambda number: child.kill() if number == step else None
        assert Ran(WINDOWS, child).code == -9
        self.wire.at_download = lambda _number: None

    def journals(self) -> list[Path]:
        return sorted((self.home / STATE / "journals").glob("*.json"))


@pytest.fixture
def machine(tmp_path: Path) -> Iterator[Machine]:
    made = Machine(tmp_path)
    yield made
    made.wire.close()


def python(home: Path, code: str) -> subprocess.Popen[bytes]:
    """*code* in a Python there, in the folder *home*."""
    return subprocess.Popen(
        [sys.executable, "-c", code], cwd=home, env=variables(WINDOWS, home),
        stdin=subprocess.PIPE, stdout=subprocess.PIPE, stderr=subprocess.PIPE,
    )  # fmt: skip


LOCK = """
from pathlib import Path
from dvtcli.device.change.lock import NodeLock
lock = NodeLock(Path("state/journals"), "can0", 5)
"""
PROBE = """
import os, sys, select, signal
print(sys.platform, os.name, hasattr(os, "fork"), hasattr(signal, "SIGHUP"))
for name in ("fcntl", "termios", "pwd", "resource"):
    try:
        exec(f"import {name}")
        print(name)
    except ImportError:
        pass
with open("held", "w") as file:
    file.write("\\u20ac\\n")
    for act in (lambda: os.replace("held", "x"), lambda: os.unlink("held")):
        try:
            act()
        except PermissionError:
            print("held")
print(open("held", "rb").read())
try:
    open("a:b", "w")
except OSError:
    print("no name")
try:
    select.select([0], [], [], 0)
except OSError:
    print("no socket")
"""


def test_doctor_names_the_libraries_of_windows(machine: Machine) -> None:
    document = json.loads(run(WINDOWS, machine.home, "--sim", "gen4", "--json", "doctor").stdout)
    (drivers,) = (check["text"] for check in document["checks"] if check["check"] == "drivers")
    for named in ("PCANBasic.dll", "canlib32.dll", "vcinpl2.dll", "libusb-1.0.dll", "not on this system: socketcan"):
        assert named in drivers


def test_the_double_is_strict(tmp_path: Path) -> None:
    """What the other tests rely on: names are missing, open files stay, text has the code page."""
    ran = Ran(WINDOWS, python(tmp_path, PROBE))
    assert ran.stdout == "win32 nt False False\nheld\nheld\nb'\\x80\\r\\n'\nno name\nno socket\n", ran.stderr


@heavy
def test_a_change_an_undo_a_store_and_where_they_are_kept(machine: Machine) -> None:
    assert machine.run(*MAP).code == 0
    ran = machine.run("undo", "--all")
    assert ran.code == 0, ran.stderr
    ran = machine.run("store", "--prove")
    assert ran.code == 0, ran.stderr
    assert "proved" in ran.stdout
    assert (machine.home / STATE).is_dir()
    assert sorted(path.name for path in machine.home.iterdir()) == ["AppData"]


def test_a_killed_change_is_put_back_by_recover(machine: Machine) -> None:
    machine.killed(step=4)
    (journal,) = machine.journals()
    assert machine.run(*MAP).code == 6
    ran = machine.run("recover")
    assert ran.code == 0, ran.stderr
    assert not journal.exists()
    assert "0x185" in machine.run("pdo", "tpdo1").stdout


@heavy
def test_a_damaged_journal_is_set_aside_with_a_name_that_windows_takes(machine: Machine) -> None:
    machine.killed(step=3)
    (journal,) = machine.journals()
    journal.write_bytes(b"{")
    ran = machine.run("recover", "--discard")
    assert ran.code == 0, ran.stderr
    assert not machine.journals()
    assert any("discarded" in path.name for path in journal.parent.iterdir())


def test_a_scanner_that_holds_a_new_file_for_a_moment_is_waited_for(machine: Machine) -> None:
    ran = machine.run(*MAP, TESTS_BUSY_FIRST="3")
    assert ran.code == 0, ran.stderr
    assert not machine.journals()


def test_a_state_file_that_nobody_lets_go_stops_before_the_first_write(machine: Machine) -> None:
    ran = machine.run(*MAP, TESTS_BUSY_FIRST="1000000")
    assert ran.code != 0
    assert "nothing was written" in ran.stderr
    assert machine.wire.downloads == 0


def test_one_writer_at_a_time_until_its_process_ends(tmp_path: Path) -> None:
    """The lock is held by the system for a process, and others can read who holds it."""
    first = python(tmp_path, LOCK + "lock.take()\nprint('held', flush=True)\nimport time\ntime.sleep(600)\n")
    assert first.stdout is not None
    try:
        assert first.stdout.readline() == b"held\r\n"
        second = Ran(WINDOWS, python(tmp_path, LOCK + "lock.take(0)\n"))
        assert f"another dvtcli (process {first.pid}) is changing node 5" in second.stderr
    finally:
        first.kill()
        first.communicate()
    assert Ran(WINDOWS, python(tmp_path, LOCK + "lock.take(0)\nprint('free')\n")).stdout == "free\n"


def test_ctrl_break_ends_a_change_as_a_closed_terminal_does(machine: Machine) -> None:
    with machine.wire.at_work:
        child = start(WINDOWS, machine.home, *machine.words, *MAP)
        machine.wire.at_download = lambda number: child.send_signal(CTRL_BREAK) if number == 4 else None
    ran = Ran(WINDOWS, child)
    assert ran.code == 128 + CTRL_BREAK, ran.stderr
    assert "rolled back: everything is as before" in ran.stderr
    machine.wire.at_download = lambda _number: None
    assert "0x185" in machine.run("pdo", "tpdo1").stdout
    assert not machine.journals()


def test_what_the_code_page_lacks_is_replaced_and_lines_end_as_there(tmp_path: Path) -> None:
    eds = tmp_path / "greek.eds"
    text = (ROOT / "dvtcli/families/gen4/gen4.eds").read_text("utf-8")
    eds.write_text(text.replace("ParameterName=Statusword", "ParameterName=Κατάσταση – Größe"), "utf-8")
    ran = run(WINDOWS, tmp_path, "--sim", "gen4", "--eds", str(eds), "read", "6041")
    assert ran.code == 0, ran.stderr
    assert "– Größe" in ran.stdout
    assert ran.raw.count(b"\n") == ran.raw.count(b"\r\n") > 0
    assert b"\r\r\n" not in ran.raw


@heavy
def test_scripts_network_files_and_eds_with_windows_line_ends(tmp_path: Path) -> None:
    for name in ("scripts/pdo_config.dvt", "examples/traction.yaml", "dvtcli/families/gen4/gen4.eds"):
        (tmp_path / Path(name).name).write_bytes((ROOT / name).read_bytes().replace(b"\n", b"\r\n"))
    ran = run(
        WINDOWS, tmp_path, "--sim", "gen4", "--eds", str(tmp_path / "gen4.eds"), "run", str(tmp_path / "pdo_config.dvt")
    )
    assert ran.code == 0, ran.stderr
    sim = [word for node in ("gen4@1", "generic@5", "generic@9") for word in ("--sim", node)]
    network = str(tmp_path / "traction.yaml")
    assert run(WINDOWS, tmp_path, *sim, "plan", network).code == 0
    ran = run(WINDOWS, tmp_path, *sim, "apply", network, "--yes")
    assert ran.code == 0, ran.stderr


@pytest.mark.skipif(importlib.util.find_spec("_tkinter") is None, reason="Python has no _tkinter here")
def test_a_tcl_script_and_its_process(tmp_path: Path) -> None:
    ran = run(WINDOWS, tmp_path, "--sim", "gen4", "run", str(SCRIPTS / "pdo_config.tcl"))
    assert ran.code == 0, ran.stderr


@heavy
def test_files_that_commands_write(tmp_path: Path) -> None:
    out = tmp_path / "out.dvt"
    ran = run(WINDOWS, tmp_path, "--sim", "gen4", "run", "-", stdin=f'set tpdo1 --timer 70\nsave "{out}"\n'.encode())
    assert ran.code == 0, ran.stderr
    assert b"timer" in out.read_bytes()
    network = tmp_path / "bus.yaml"
    ran = run(WINDOWS, tmp_path, "--sim", "gen4", "export", str(network))
    assert ran.code == 0, ran.stderr
    assert run(WINDOWS, tmp_path, "check", str(network)).code == 0
    ran = run(WINDOWS, tmp_path, "--sim", "gen4", "log", str(tmp_path / "bus.asc"), "--duration", "0.2")
    assert ran.code == 0, ran.stderr


def test_sim_serves_others_keeps_its_state_and_ends_at_ctrl_break(tmp_path: Path) -> None:
    state, ready = tmp_path / "state", tmp_path / "ready"
    words = ("sim", "gen4@1", "--listen", "127.0.0.1:0", "--ready-file", str(ready), "--state", str(state))
    server = start(WINDOWS, tmp_path, *words)
    try:
        wait_for(lambda: ready.exists() or server.poll() is not None, "the nodes")
        assert server.poll() is None, Ran(WINDOWS, server).stderr
        client = [*bus_words(int(ready.read_text().rpartition(":")[2])), "-n", "1", "--yes"]
        ran = run(WINDOWS, tmp_path, *client, "set", "tpdo1", "--timer", "70")
        assert ran.code == 0, ran.stderr
        assert run(WINDOWS, tmp_path, *client, "store").code == 0
        assert run(WINDOWS, tmp_path, *client, "set", "tpdo1", "--timer", "80").code == 0
        assert run(WINDOWS, tmp_path, *client, "store").code == 0, "what is there is replaced"
        server.send_signal(CTRL_BREAK)
        assert Ran(WINDOWS, server).code == 128 + CTRL_BREAK
    finally:
        server.kill()


def test_doctor_finds_serial_ports_by_their_names_there(tmp_path: Path) -> None:
    ports = r"\Device\USBSER000=COM3 \Device\Serial0=COM12"
    ran = run(WINDOWS, tmp_path, "doctor", "--json", TESTS_SERIAL_PORTS=ports)
    found = [one for one in json.loads(ran.stdout)["checks"] if one["check"] == "interface"]
    assert [re.split(r"\s+", one["text"])[:2] for one in found] == [["slcan", "COM3"], ["slcan", "COM12"]]


@pytest.fixture
def console(tmp_path: Path) -> Iterator[Callable[..., Terminal]]:
    """Terminals of a Windows user, whose console gives itself no TERM."""
    opened: list[Terminal] = []

    def make(*words: str, **more: str) -> Terminal:
        command = ["env", "-u", "TERM", sys.executable, "-m", "dvtcli", "--sim", "gen4", *words]
        opened.append(Terminal(tmp_path, command=command, environment=variables(WINDOWS, tmp_path, **more)))
        return opened[-1]

    yield make
    for terminal in opened:
        terminal.close()


def test_the_monitor_has_a_whole_console(console: Callable[..., Terminal]) -> None:
    terminal = console("monitor")
    terminal.wait("q quit")
    assert "MONITOR sim" in terminal.text


@heavy
def test_the_prompt_and_the_users_pager_whose_name_has_a_blank(
    console: Callable[..., Terminal], tmp_path: Path
) -> None:
    pager = tmp_path / "my pager"
    pager.write_text("#!/bin/sh\nread line && echo paged by mine\n")
    pager.chmod(0o755)
    terminal = console(PAGER=f'"{pager}"')
    terminal.wait_prompt()
    terminal.type("objects\r")
    terminal.wait("paged by mine")


def test_drive_letters_and_backslashes_stay_in_a_line() -> None:
    words = split(r'--eds "C:\Program Files\a b.eds" D:\x\y.dvt')
    assert words == ["--eds", r"C:\Program Files\a b.eds", r"D:\x\y.dvt"]
    line, destination = cut(r"pdo > D:\out.txt")
    assert destination is not None
    assert (line.strip(), destination.sign, destination.target) == ("pdo", ">", r"D:\out.txt")


def test_settings_are_read_and_kept_where_windows_has_them(tmp_path: Path) -> None:
    folder = tmp_path / "AppData/Local/dvtcli/dvtcli"
    folder.mkdir(parents=True)
    (folder / "config.toml").write_bytes(b'sim = ["gen4"]\r\nnode = 1\r\n')
    ran = run(WINDOWS, tmp_path, "pdo", "tpdo1")
    assert ran.code == 0, ran.stderr


@heavy
def test_a_reader_that_leaves_is_no_error(tmp_path: Path) -> None:
    child = start(WINDOWS, tmp_path, "--sim", "gen4", "objects")
    assert child.stdout is not None
    child.stdout.close()
    child.stdout = None
    ran = Ran(WINDOWS, child)
    assert ran.code in (0, 141), ran.stderr
    assert "Traceback" not in ran.stderr
