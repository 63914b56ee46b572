"""Option, variable, project's file, user's file: the stronger wins, a bus whole; who chose it is named."""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path

import pytest

from tests.cli.commands.program.settings_bench import Place, place
from tests.cli.prompt.conftest import Open, open_terminal
from tests.process import documents

__all__ = ["open_terminal"]
#: vendor-IDs of the served node and of a simulated family
GEN4, TMCM = 30, 0x286


@pytest.fixture(scope="module")
def served_place(tmp_path_factory: pytest.TempPathFactory) -> Iterator[Place]:
    with place(tmp_path_factory.mktemp("order")) as found:
        yield found


@pytest.fixture
def here(served_place: Place) -> Iterator[Place]:
    yield served_place
    for path in (*served_place.folder.rglob("dvtcli.toml"), *served_place.folder.rglob("config.toml")):
        path.unlink()


def project(here: Place, text: str) -> Path:
    path = here.project / "dvtcli.toml"
    path.write_text(text)
    return path


def own(here: Place, text: str) -> Path:
    path = here.home / ".config" / "dvtcli" / "config.toml"
    path.parent.mkdir(parents=True, exist_ok=True)
    path.write_text(text)
    return path


def bus_words(here: Place) -> list[str]:
    host = ["--bus-kwargs", "host=127.0.0.1", "--bus-kwargs", f"port={here.relay.port}"]
    return ["-i", "socketcand", "-c", "can0", *host]


def test_each_source_wins_over_the_ones_below(here: Place) -> None:
    own(here, "sim = 'tmcm'\ntimeout = 1.25\n")
    assert here.read() == TMCM
    project(here, here.bus + "timeout = 1.5\n")
    assert here.read() == GEN4
    assert here.read(DVTCLI_SIM="tmcm") == TMCM
    assert here.read("--sim", "gen4", DVTCLI_SIM="tmcm") == GEN4


def test_a_stronger_source_replaces_a_bus_whole_and_the_reverse(here: Place) -> None:
    visitors = here.relay.visitors
    project(here, here.bus)
    assert here.read("--sim", "tmcm") == TMCM
    assert here.relay.visitors == visitors, "the bus of the file was opened"
    project(here, "sim = 'tmcm'\nfault = ['refuse@1=0x06040041']\nsignal = ['606C=const(1)']\n")
    assert here.read(*bus_words(here)) == GEN4
    bus = {"DVTCLI_INTERFACE": "socketcand", "DVTCLI_CHANNEL": "can0"}
    assert here.read(**bus, DVTCLI_BUS_KWARGS=f"host=127.0.0.1 port={here.relay.port}") == GEN4
    # an interface says nothing of another one's channel and keys
    project(here, here.bus)
    ran = here.run("-n", "1", "-i", "virtual", "--json", "doctor")
    (said,) = [check["text"] for check in documents(ran.stdout)[0]["checks"] if check["check"] == "settings"]
    assert "interface = virtual (option)" in said
    assert "can0" not in said
    assert "host" not in said


def test_behind_the_command_is_as_strong(here: Place) -> None:
    project(here, here.bus)
    ran = here.run("read", "1018:1", "--sim", "tmcm", "--json")
    assert documents(ran.stdout)[0]["value"] == TMCM


def test_a_part_of_a_bus_changes_the_bus_of_a_weaker_source(here: Place) -> None:
    project(here, here.bus.replace("can0", "no-such-channel") + "node = 5\n")
    assert here.read("-c", "can0", "-n", "1") == GEN4
    assert here.run("read", "1018:1", "-c", "can0").returncode == 5, "node 5 of the file"


def test_one_source_that_says_both_is_wrong(here: Place) -> None:
    assert here.run("--sim", "gen4", *bus_words(here), "pdo").returncode == 2
    assert here.run("--bus", "bench", "--sim", "gen4", "pdo").returncode == 2


def test_tables_describe_buses_and_their_keys(here: Place) -> None:
    path = project(
        here,
        f"""
sim = "tmcm"
[bus_kwargs]
fd = false

[bus.bench]
interface = "socketcand"
channel = "can0"
node = 1
[bus.bench.bus_kwargs]
host = "127.0.0.1"
port = {here.relay.port}

[bus.desk]
sim = ["tmcm@7"]
node = 7
""",
    )
    assert here.read() == TMCM
    assert here.read("--bus", "bench") == GEN4
    assert here.read(DVTCLI_BUS="bench") == GEN4
    ran = here.run("--bus", "desk", "--json", "read", "1018:1")
    document = documents(ran.stdout)[0]
    assert (document["node"], document["value"]) == (7, TMCM)
    assert documents(here.run("--bus", "desk", "-n", "8", "--json", "read", "1018:1").stdout)[0]["node"] == 8
    assert here.read("--sim", "gen4", DVTCLI_BUS="bench") == GEN4
    error = here.refused("--bus", "nosuch", "read", "1018:1", code=2, error="usage")
    assert error["text"] == "--bus nosuch: no such bus"
    assert "bench, desk" in error["hint"]
    assert here.run("--bus", "nosuch", "help").returncode == 0
    ran = here.run("--bus", "bench", "-v", "read", "1018:1")
    assert f"is open, chosen by [bus.bench] of {path} (--bus)" in ran.stderr


def test_the_users_own_file_describes_buses_too(here: Place) -> None:
    own(here, f"[bus.bench]\n{here.bus}")
    assert here.read("--bus", "bench") == GEN4
    project(here, '[bus.bench]\nsim = "tmcm"\n')
    assert here.read("--bus", "bench") == TMCM


def test_who_chooses_a_bus_is_named_when_it_is_opened(here: Place) -> None:
    name = f"socketcand:127.0.0.1:{here.relay.port}"
    words = ["-n", "1", "-v", "read", "1018:1"]
    assert f"note: {name} is open, chosen by --interface" in here.run(*bus_words(here), *words).stderr
    bus = {"DVTCLI_INTERFACE": "socketcand", "DVTCLI_CHANNEL": "can0"}
    kwargs = {"DVTCLI_BUS_KWARGS": f"host=127.0.0.1 port={here.relay.port}"}
    assert f"note: {name} is open, chosen by DVTCLI_INTERFACE" in here.run(*words, **bus, **kwargs).stderr
    path = project(here, here.bus)
    assert f"note: {name} is open, chosen by {path}" in here.run(*words).stderr
    assert "chosen by" not in here.run("-n", "1", "read", "1018:1").stderr
    checks = documents(here.run("-n", "1", "--json", "doctor").stdout)[0]["checks"]
    assert f"{name} opened, chosen by {path}" in [check["text"] for check in checks if check["check"] == "bus"]

    project(here, 'interface = "nosuch"\nchannel = "x"\n')
    failed = here.run("-n", "1", "read", "1018:1")
    assert failed.returncode == 5
    assert f"chosen by {path}" in " ".join(failed.stderr.split())
    (here.home / "can.conf").write_text("[default]\ninterface = nosuch\nchannel = x\n")
    path.unlink()
    assert "chosen by ~/can.conf" in " ".join(here.run("-n", "1", "read", "1018:1").stderr.split())
    (here.home / "can.conf").unlink()


def test_the_prompt_says_who_chose_its_bus(open_terminal: Open, tmp_path: Path) -> None:
    (tmp_path / "dvtcli.toml").write_text('interface = "virtual"\nchannel = "order"\n')
    terminal = open_terminal(columns=200)
    terminal.wait(f"The bus was chosen by {tmp_path}/dvtcli.toml.")
    (tmp_path / "dvtcli.toml").write_text('sim = "gen4"\n')
    terminal = open_terminal(columns=200)
    terminal.wait(f"No CAN hardware is used (chosen by {tmp_path}/dvtcli.toml).")


def test_a_prompt_whose_settings_are_not_trusted_does_not_begin(open_terminal: Open, tmp_path: Path) -> None:
    (tmp_path / "dvtcli.toml").write_text('sim = "gen4"\n')
    (tmp_path / "dvtcli.toml").chmod(0o666)
    terminal = open_terminal(columns=250)
    assert terminal.ended() == 6
    assert "is not trusted: everybody can write it" in terminal.text
