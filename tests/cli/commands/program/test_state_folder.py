"""The state folder is the user's alone: made so whatever the umask, refused where it is not, never led elsewhere."""

from __future__ import annotations

import json
import os
import stat
import subprocess
import sys
from pathlib import Path

import pytest

from tests import process
from tests.process import documents
from tests.simulator.serve.served import PATIENCE_S, Served, bus_words, own_environment, served

pytestmark = [
    pytest.mark.skipif(os.name != "posix", reason="Windows has no owners and modes of this kind"),
    pytest.mark.drawn(6, "state folder"),
]


def run(server: Served, *words: str, umask: int = 0o022, state: str = "state-home") -> subprocess.CompletedProcess[str]:
    """Run dvtcli on the served node under *umask*, with the state folder below *state* of the test's folder."""
    env = own_environment(server.folder) | {"XDG_STATE_HOME": str(server.folder / state)}
    words = words if "--text" in words else ("--json", *words)
    return process.run(
        [*bus_words(server.port), "-n", "1", *(word for word in words if word != "--text")], env=env, umask=umask
    )


def mode(path: Path) -> int:
    return stat.S_IMODE(path.lstat().st_mode)


def refused(ran: subprocess.CompletedProcess[str], path: Path, why: str, hint: str) -> None:
    """It ended with 6, naming the file, why, and the cure; nothing was done."""
    (error,) = documents(ran.stdout)
    assert (ran.returncode, error["exit_code"], error["error"], error["state"]) == (6, 6, "safety", "unchanged")
    assert error["text"].startswith(f"{path} is not used: {why}"), error["text"]
    assert hint in error["hint"]


def event_timer_ms(server: Served) -> int:
    """What the node itself holds, read by a second dvtcli with a state folder of its own."""
    (document,) = documents(run(server, "read", "1800:5", state="other").stdout)
    value = document["value"]
    assert isinstance(value, int)
    return value


@pytest.mark.parametrize("umask", [0o000, 0o022, 0o277])
def test_everything_is_the_users_alone_whatever_the_umask(tmp_path: Path, umask: int) -> None:
    with served(tmp_path, "gen4@1") as server:
        ran = run(server, "set", "tpdo1", "--timer", "70", umask=umask)
        assert ran.returncode == 0, ran.stderr
        assert event_timer_ms(server) == 70
    state = tmp_path / "state-home"
    made = [state, *state.rglob("*")]
    files = [path for path in made if path.is_file()]
    assert {path.parent.name for path in files} == {"locks", "backups", "changes"}
    assert {mode(path) for path in made if path.is_dir()} == {0o700}
    assert not [path for path in files if mode(path) & 0o177]


@pytest.mark.parametrize("which", ["", "locks", "journals", "backups"])
def test_a_folder_that_others_can_write_is_refused_with_the_cure(tmp_path: Path, which: str) -> None:
    with served(tmp_path, "gen4@1") as server:
        assert run(server, "set", "tpdo1", "--timer", "70").returncode == 0
        folder = tmp_path / "state-home" / "dvtcli" / which
        folder.mkdir(exist_ok=True)
        folder.chmod(0o777)
        refused(run(server, "set", "tpdo1", "--timer", "80"), folder, "everybody can write it", f"chmod o-w {folder}")
        assert event_timer_ms(server) == 70
        folder.chmod(0o700)
        assert run(server, "set", "tpdo1", "--timer", "80").returncode == 0
        assert event_timer_ms(server) == 80


def test_a_folder_that_others_can_write_stands_in_nobodys_way_who_only_reads(tmp_path: Path) -> None:
    folder = tmp_path / "state-home" / "dvtcli"
    folder.mkdir(parents=True)
    folder.chmod(0o777)
    with served(tmp_path, "gen4@1") as server:
        ran = run(server, "read", "1018:1")
        assert (ran.returncode, documents(ran.stdout)[0]["value"]) == (0, 30)
        assert f"{folder} is not used" in ran.stderr


@pytest.mark.parametrize("target", ["precious", "gone"])
def test_a_lock_that_is_a_link_is_not_followed(tmp_path: Path, target: str) -> None:
    (tmp_path / "precious").write_text("years of work\n")
    with served(tmp_path, "gen4@1") as server:
        locks = tmp_path / "state-home" / "dvtcli" / "locks"
        locks.mkdir(parents=True, mode=0o700)
        for folder in (locks, locks.parent, locks.parent.parent):
            folder.chmod(0o700)
        lock = locks / f"socketcand_127.0.0.1_{server.port}-1.lock"
        lock.symlink_to(tmp_path / target)
        refused(run(server, "set", "tpdo1", "--timer", "70"), lock, "it is a symbolic link", "remove it")
        assert (tmp_path / "precious").read_text() == "years of work\n"
        assert not (tmp_path / "gone").exists()

        lock.unlink()
        os.link(tmp_path / "precious", lock)
        refused(run(server, "set", "tpdo1", "--timer", "70"), lock, "it is another file's second name", "remove it")
        assert (tmp_path / "precious").read_text() == "years of work\n"

        lock.unlink()
        os.mkfifo(lock)
        refused(run(server, "set", "tpdo1", "--timer", "70"), lock, "it is not a regular file", "remove it")
        lock.unlink()
        assert run(server, "set", "tpdo1", "--timer", "70").returncode == 0
        assert event_timer_ms(server) == 70


def test_a_lock_that_all_could_write_becomes_the_users(tmp_path: Path) -> None:
    with served(tmp_path, "gen4@1") as server:
        assert run(server, "set", "tpdo1", "--timer", "70").returncode == 0
        (lock,) = (tmp_path / "state-home").rglob("*.lock")
        lock.chmod(0o666)
        assert run(server, "set", "tpdo1", "--timer", "80").returncode == 0
        assert mode(lock) == 0o600


@pytest.mark.skipif(os.name != "posix" or os.geteuid() != 0, reason="only root can give files away")
def test_what_belongs_to_somebody_else_is_refused(tmp_path: Path) -> None:
    with served(tmp_path, "gen4@1") as server:
        assert run(server, "set", "tpdo1", "--timer", "70").returncode == 0
        (lock,) = (tmp_path / "state-home").rglob("*.lock")
        for path in (lock, lock.parent, lock.parent.parent):
            os.chown(path, 12345, 12345)
            refused(run(server, "set", "tpdo1", "--timer", "80"), path, "it belongs to user 12345", "")
            os.chown(path, 0, 0)
        assert event_timer_ms(server) == 70


def test_a_journal_of_somebody_else_is_not_written_to_a_device(tmp_path: Path) -> None:
    journal = tmp_path / "x.json"
    step = {"object": [0x1800, 5], "before": "4600", "after": "5000"}
    with served(tmp_path, "gen4@1") as server:
        identity = dict.fromkeys(("vendor", "product", "revision", "serial"))
        for sub_index, name in enumerate(("vendor", "product"), 1):
            identity[name] = documents(run(server, "read", f"1018:{sub_index}").stdout)[0]["value"]
        bus = f"socketcand:127.0.0.1:{server.port}"
        document = {"schema": "dvtcli.journal/1", "bus": bus, "node": 1, "identity": identity, "changes": [step]}
        journal.write_text(json.dumps(document))
        journal.chmod(0o666)
        before = event_timer_ms(server)
        refused(run(server, "recover", str(journal), "--yes"), journal, "everybody can write it", "chmod o-w")
        assert event_timer_ms(server) == before


def test_the_traceback_of_a_bug_is_the_users_alone(tmp_path: Path) -> None:
    """In the state folder; in the system's where the state folder is not the user's alone."""
    program = (
        "import sys\nfrom dvtcli.cli.view.output import Output\nfrom dvtcli.cli.conversation import Conversation\n"
    )
    program += "from dvtcli.cli.boundary import exit_code_of\n"
    program += "sys.exit(exit_code_of(Conversation(Output()), lambda: 1 / 0))\n"
    for state in ("state-home", "link"):
        ran = subprocess.run(
            [sys.executable, "-c", program], capture_output=True, encoding="utf-8", umask=0,
            env=own_environment(tmp_path) | {"XDG_STATE_HOME": str(tmp_path / state), "TMPDIR": str(tmp_path)},
            timeout=PATIENCE_S, check=False,
        )  # fmt: skip
        assert ran.returncode == 70
        where = Path(ran.stderr.rpartition("report it with ")[2].split()[0])
        assert (mode(where), "ZeroDivisionError" in where.read_text()) == (0o600, True)
        if state == "state-home":
            assert where.parent == tmp_path / state / "dvtcli" / "crash"
            assert mode(where.parent) == 0o700
            (tmp_path / "elsewhere").mkdir()
            (tmp_path / "link" / "dvtcli").mkdir(parents=True)
            (tmp_path / "link" / "dvtcli").chmod(0o777)
            (tmp_path / "link" / "dvtcli" / "crash").symlink_to(tmp_path / "elsewhere")
        else:
            assert where.parent == tmp_path, "the system's folder, where the state folder is not ours alone"


#: what is in the way: of the state folder, above it, of a folder in it that every change needs
IN_THE_WAY = ["dvtcli", "", "a link", "dvtcli/locks", "dvtcli/journals"]
READING = ["pdo", "read 1018:1", "scan", "verify net.yaml", "plan net.yaml", "diff net.yaml", "monitor --duration 0.1",
           "nmt start", "doctor"]  # fmt: skip
CHANGING = ["set tpdo1 --timer 70", "write 1800:5 70", "apply net.yaml"]


def in_the_way(folder: Path, what: str) -> Path:
    """Put a file, or a link that leads nowhere, in the place of a folder below *folder*; the state's home."""
    home = folder / "state-home"
    path = home / ("dvtcli" if what == "a link" else what)
    for parent in reversed(path.relative_to(folder).parents):
        (folder / parent).mkdir(mode=0o700, exist_ok=True)
    if what == "a link":
        path.symlink_to(folder / "nowhere")
    else:
        path.write_text("x\n")
    return path


@pytest.mark.parametrize("what", IN_THE_WAY)
def test_a_file_in_the_place_of_the_state_folder_stops_changes_only(tmp_path: Path, what: str) -> None:
    (tmp_path / "net.yaml").write_text(
        "nodes: {drive: {node_id: 1, profile: gen4, tpdo: {1: {enabled: true, event_timer: 70}}}}\n"
    )
    path = in_the_way(tmp_path, what)
    with served(tmp_path, "gen4@1") as server:
        before = event_timer_ms(server)
        assert before != 70
        for line in READING:
            ran = run(server, "--text", *line.replace("net.yaml", str(tmp_path / "net.yaml")).split())
            assert ran.returncode in ((0, 3) if line != "doctor" else (6,)), (line, ran.stdout, ran.stderr)
            said = " ".join(ran.stderr.split()).replace("- ", "-")
            assert f"note: {path} is not used: it is " in said or line == "scan", (line, ran.stderr)
        for line in CHANGING:
            ran = run(server, "--yes", *line.replace("net.yaml", str(tmp_path / "net.yaml")).split())
            error = documents(ran.stdout)[-1]
            assert (ran.returncode, error["error"], error["state"]) == (6, "safety", "unchanged"), (line, error)
        assert event_timer_ms(server) == before
        assert not list(tmp_path.glob("**/crash"))
        path.rename(path.with_name(f"{path.name}.old"))  # what the hint says
        assert run(server, "--yes", "set", "tpdo1", "--timer", "70").returncode == 0
        assert event_timer_ms(server) == 70


@pytest.mark.skipif(os.name != "posix" or os.geteuid() != 0, reason="only root can become somebody without rights")
@pytest.mark.parametrize("bits", [0o500, 0o000])
def test_a_state_folder_without_rights_stops_changes_only(tmp_path: Path, bits: int) -> None:
    """Looked at from inside a process that gave up its rights: `unusable` and the lock are all that decide."""
    folder = tmp_path / "state"
    folder.mkdir()
    folder.chmod(bits)
    for parent in tmp_path.parents:
        assert parent.exists()
    program = (
        "import os,sys\nfrom pathlib import Path\nfrom dvtcli.device.change.private_file import unusable\n"
        "from dvtcli.device.change.change_guard import ChangeGuard\nfrom dvtcli.errors import SafetyRefusal\n"
        f"os.chown({str(folder)!r}, 65534, 65534)\nos.chdir({str(tmp_path)!r})\nos.setgroups([])\n"
        "os.setgid(65534)\nos.setuid(65534)\nfolder = Path('state')\n"
        "print(unusable(folder / 'locks').text)\nkeeper = ChangeGuard(folder, folder / 'locks', 'can0', 5)\n"
        "try:\n    keeper.lock_or_refuse()\nexcept SafetyRefusal as refused:\n    print('refused', refused.text)\n"
    )
    ran = subprocess.run([sys.executable, "-c", program], capture_output=True, encoding="utf-8", check=False,
                         timeout=PATIENCE_S)  # fmt: skip
    assert "it cannot be written" in ran.stdout, ran.stderr
    assert "refused" in ran.stdout, ran.stderr


def test_a_file_in_the_place_of_program_notes_tells_of_no_download(tmp_path: Path) -> None:
    in_the_way(tmp_path, "dvtcli/programs")
    with served(tmp_path, "gen4@1") as server:
        ran = run(server, "pdo", "tpdo1")
        assert (ran.returncode, "was not completed" in ran.stderr) == (0, False)


def test_a_bug_before_the_bus_is_open_says_that_nothing_was_sent(tmp_path: Path) -> None:
    program = (
        "import sys\nfrom dvtcli.cli.view.output import Output\nfrom dvtcli.cli.conversation import Conversation\n"
        "from dvtcli.cli.boundary import exit_code_of\nsys.exit(exit_code_of(Conversation(Output()), lambda: 1 / 0))\n"
    )
    ran = subprocess.run(
        [sys.executable, "-c", program], capture_output=True, encoding="utf-8", env=own_environment(tmp_path),
        timeout=PATIENCE_S, check=False,
    )  # fmt: skip
    assert ran.returncode == 70
    assert "state   unchanged: nothing was sent" in ran.stderr
