"""Where nobody said the bit rate, who asks several nodes says what that costs, and what to do; only where it holds."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path
from typing import Any, NoReturn

import pytest

from dvtcli.domain.hint import Hint
from dvtcli.operations.devices.verify_nodes import verify
from dvtcli.operations.exchange.import_network import import_network
from dvtcli.operations.network.network_files import apply_file, plan_file
from dvtcli.operations.session.session import Session
from dvtcli.operations.user.options import Options
from dvtcli.operations.user.session_user import NullReporter
from dvtcli.simulator.network.family_file import family_eds
from tests.harness.sample import heavy
from tests.operations.network.bench import device
from tests.surroundings import HOMES
from tests.virtual_time import VirtualTimeBus

NODES = (1, 5, 9)
FILE = "".join(f"n{node_id}: {{node_id: {node_id}, tpdo: {{1: {{event_timer: 40}}}}}}\n" for node_id in NODES)
#: with the action that a command line writes as its option, Python as its argument
NOTE = (
    "the bit rate of virtual time is not known: its 3 nodes are read one after the other, which takes long, and "
    "without a limit of the bus load for a running machine; faster with name the bit rate or bitrate = 250000 in "
    "dvtcli.toml"
)


def no_script(file: str, node_id: int | None = None) -> NoReturn:
    """What a script would set: none is compared here."""
    raise AssertionError(file, node_id)


#: what is done with a file, as the commands of that name
DOES: dict[str, Callable[[Session, str], object]] = {
    "plan": plan_file,
    "diff": lambda session, file: plan_file(session, file, tells=True),
    "apply": apply_file,
    "import": lambda session, file: import_network(session, file.replace("net", "live")),
    "verify": lambda session, file: verify(session, no_script, file=file),
    "save": lambda session, file: plan_file(session, file, f"{file}.json"),
}
#: what takes a plan that was saved
TAKES = {"saved": lambda session, file: apply_file(session, f"{file}.json")}
#: several lines of one session
SEVERAL = {"all": lambda session, file: [does(session, file) for name, does in DOES.items() if name != "import"]}


class Listener(NullReporter):
    """Keeps the notes about the bit rate."""

    def __init__(self) -> None:
        self.notes: list[str] = []

    def note(self, text: Hint | str) -> None:
        if "bit rate" in str(text):
            self.notes.append(str(text))


@pytest.fixture(autouse=True)
def own_home(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    for name in HOMES:
        monkeypatch.setenv(name, str(tmp_path / "home"))


class Objects(VirtualTimeBus):
    """A gateway that reads and writes objects, and carries no frames."""

    @property
    def carries_frames(self) -> bool:
        return False


def noted(
    tmp_path: Path, does: str, *, bus: type[VirtualTimeBus] = VirtualTimeBus, bit_rate: int | None = None,
    simulated: bool = False, text: str = FILE, **options: Any,
) -> list[str]:  # fmt: skip
    """What is said of the bit rate where the network file *text*, or a plan of it, goes through *does*."""
    wire = bus([device(node_id, "generic") for node_id in NODES], simulated=simulated)
    wire.bitrate = bit_rate
    file, told = tmp_path / "net.yaml", Listener()
    file.write_text(text)
    given = Options(yes=True, journal=str(tmp_path / "files"))._replace(**options)
    with Session(given, told, open_bus=lambda _options: wire) as session:
        for node_id in NODES:
            session.open_network().files.own_eds[node_id] = family_eds("generic")
        (DOES | TAKES | SEVERAL)[does](session, str(file))
    return told.notes


@pytest.mark.parametrize("does", DOES)
def test_it_is_said_by_each_command_that_asks_several_nodes(tmp_path: Path, does: str) -> None:
    assert noted(tmp_path, does) == [NOTE]
    if does == "save":
        assert noted(tmp_path, "saved") == [NOTE]


@heavy
def test_it_is_said_once_a_session(tmp_path: Path) -> None:
    assert noted(tmp_path, "all") == [NOTE]


def test_it_is_said_once_a_bus_that_was_gone_and_is_back(tmp_path: Path) -> None:
    devices, told = [device(node_id, "generic") for node_id in NODES], Listener()
    file = tmp_path / "net.yaml"
    file.write_text(FILE)
    first, again = VirtualTimeBus(devices, simulated=False), VirtualTimeBus(devices, simulated=False)
    given = Options(yes=True, journal=str(tmp_path / "files"), eds="generic")
    with Session(given, told, open_bus=lambda _options: first) as session:
        session.comes_back = True
        plan_file(session, str(file))
        session.leave_bus("it is gone")
        session.take_bus(again)
        plan_file(session, str(file))
    assert told.notes == [NOTE]


@heavy
def test_it_is_not_said_where_it_costs_nothing(tmp_path: Path) -> None:
    assert noted(tmp_path, "plan", bit_rate=250_000) == []
    assert noted(tmp_path, "plan", simulated=True) == []
    assert noted(tmp_path, "plan", bus=Objects) == []
    assert noted(tmp_path, "apply", dry_run=True) == []
    assert noted(tmp_path, "plan", text=FILE.splitlines()[0]) == []
    assert noted(tmp_path, "plan", node=(5, 9)) == [NOTE.replace("3 nodes", "2 nodes")]
