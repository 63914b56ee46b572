"""A server that goes and comes back, and what each kind of command makes of it: real processes on both sides."""

from __future__ import annotations

import signal
from pathlib import Path
from typing import Any

import pytest

from tests.harness.forked import Forked
from tests.process import PATIENCE_S, documents, start
from tests.simulator.serve.served import Served, bus_words, own_environment, served, wait_for

GONE, BACK = "is gone (the server has closed the connection", "is back after"
#: what waits for a bus that is gone
WAITING = ("monitor", "--nodes", "5"), ("log", "x.log", "--reconnect")


def listening(server: Served, *words: str) -> Forked:
    """A dvtcli at *server*'s bus, in a process of its own."""
    return start([*bus_words(server.port), *words], env=own_environment(server.folder))


def said(process: Forked) -> str:
    return "".join(process.so_far())


def frames(process: Forked) -> int:
    return said(process).count('"dvtcli.frame/1"')


def events(process: Forked) -> list[str]:
    """What its documents say of the bus."""
    return [one["event"] for one in whole(process) if one["schema"] == "dvtcli.bus/1"]


def whole(process: Forked) -> list[dict[str, Any]]:
    """Its documents so far; the last one may be half written."""
    return documents(process.so_far()[0].rpartition("\n")[0])


def ended(process: Forked, number: int = signal.SIGINT) -> tuple[int, str, str]:
    """Its exit code, and what it wrote, after a signal."""
    process.send_signal(number)
    out, errors = process.communicate(PATIENCE_S)
    return process.returncode, out, errors


def test_a_monitor_goes_on_with_the_mapping_that_the_node_has_then(tmp_path: Path, port: int) -> None:
    with served(tmp_path, "gen4@5", port=port) as server:
        assert server.dvtcli("-n", "5", "map", "tpdo2", "6041", "--timer", "20").returncode == 0
        assert server.dvtcli("-n", "5", "nmt", "start").returncode == 0
        monitor = listening(server, "monitor", "--nodes", "5")
        wait_for(lambda: any(one.get("pdo") == "tpdo2" for one in whole(monitor)), "a PDO")
        before = [one for one in whole(monitor) if one.get("pdo") == "tpdo2"]
        assert list(before[0]["signals"]) == ["Statusword"]
    wait_for(lambda: events(monitor) == ["gone"], "the end of the bus to be told")
    with served(tmp_path, "gen4@5", port=port) as again:
        wait_for(lambda: events(monitor) == ["gone", "back"], "the bus to be told to be back")
        assert again.dvtcli("-n", "5", "nmt", "start").returncode == 0
        wait_for(lambda: '"Velocity actual value"' in said(monitor), "the mapping of now")
        code, out, errors = ended(monitor)
    assert code == 130
    assert GONE in errors
    assert BACK in errors
    found = documents(out)
    place = [one["schema"] for one in found].index("dvtcli.bus/1")
    signals = [list(one.get("signals", {})) if one.get("pdo") == "tpdo2" else [] for one in found]
    assert not any("Velocity actual value" in one for one in signals[:place])
    assert ["Statusword"] not in signals[place:]
    assert found[place]["bus"] == f"socketcand:127.0.0.1:{port}"
    assert found[place]["why"].startswith("the server has closed the connection")


@pytest.mark.parametrize("words", [("monitor", "--no-reconnect"), ("log", "run.asc", "-y")], ids=["monitor", "log"])
def test_who_is_not_to_wait_ends(tmp_path: Path, words: tuple[str, ...]) -> None:
    with served(tmp_path, "gen4@5") as server:
        process = listening(server, *words, *(["--nodes", "5"] if words[0] == "monitor" else []))
        wait_for(lambda: "recording" in said(process) or frames(process), "it to listen")
    _, errors = process.communicate(PATIENCE_S)
    assert process.returncode == 5
    assert "the server has closed the connection" in errors
    assert "is gone" not in errors


def test_a_log_goes_on_in_the_same_file(tmp_path: Path, port: int) -> None:
    file = tmp_path / "run.log"
    with served(tmp_path, "gen4@5", port=port) as server:
        log = listening(server, "log", str(file), "--reconnect", "--json")
        wait_for(lambda: file.exists() and file.stat().st_size > 0, "frames in the file")
    wait_for(lambda: events(log) == ["gone"], "the end of the bus to be told")
    size = file.stat().st_size
    with served(tmp_path, "gen4@5", port=port):
        wait_for(lambda: events(log) == ["gone", "back"], "the bus to be told to be back")
        wait_for(lambda: file.stat().st_size > size, "more frames in the file")
        code, out, _ = ended(log)
    assert code == 130
    facts, error = documents(out)[-2:]
    assert (error["schema"], error["error"], error["exit_code"]) == ("dvtcli.error/1", "interrupted", 130)
    assert (facts["schema"], facts["frames"]) == ("dvtcli.log/1", len(file.read_text("utf-8").splitlines()))
    assert facts["gaps"] == 1
    assert facts["gone_s"] > 0


def test_a_log_of_values_ends_where_the_node_sends_others_now(tmp_path: Path, port: int) -> None:
    file = tmp_path / "run.csv"
    with served(tmp_path, "gen4@5", port=port) as server:
        assert server.dvtcli("-n", "5", "map", "tpdo2", "6041").returncode == 0
        log = listening(server, "log", str(file), "--decode", "--nodes", "5", "--reconnect")
        wait_for(lambda: "recording" in said(log), "it to listen")
    wait_for(lambda: GONE in said(log), "the end of the bus to be told")
    with served(tmp_path, "gen4@5", port=port):
        _, errors = log.communicate(PATIENCE_S)
    assert log.returncode == 6
    assert "the nodes transmit other values than its columns" in errors


@pytest.mark.parametrize("words", WAITING, ids=["monitor", "log"])
def test_ctrl_c_ends_the_waiting_at_once(tmp_path: Path, words: tuple[str, ...]) -> None:
    with served(tmp_path, "gen4@5") as server:
        stopped = listening(server, *words)
        wait_for(lambda: "recording" in said(stopped) or frames(stopped), "it to listen")
    wait_for(lambda: GONE in said(stopped), "the end of the bus to be told")
    code, out, errors = ended(stopped)
    assert (code, "Traceback" in errors) == (130, False)
    assert ("x.log:" in out) == (words[0] == "log")


@pytest.mark.parametrize("number", [signal.SIGINT, signal.SIGTERM])
def test_a_document_says_by_which_signal_a_log_ended(tmp_path: Path, number: signal.Signals) -> None:
    with served(tmp_path, "gen4@5") as server:
        log = listening(server, "log", "x.log", "--json")
        wait_for(lambda: "recording" in said(log), "it to listen")
        code, out, _ = ended(log, number)
    facts, error = documents(out)
    assert (facts["schema"], error["schema"], error["error"]) == ("dvtcli.log/1", "dvtcli.error/1", "interrupted")
    assert (code, error["exit_code"], error["state"]) == (128 + number, 128 + number, "unchanged")


@pytest.mark.parametrize("words", WAITING, ids=["monitor", "log"])
def test_the_time_ends_the_waiting_too(tmp_path: Path, words: tuple[str, ...]) -> None:
    """On a machine that needs longer than its time to take the server away, it has more time."""
    for duration_s in (1, 4, 16, 64):
        with served(tmp_path, "gen4@5") as server:
            timed = listening(server, *words, "--duration", str(duration_s), "-y")
            wait_for(lambda timed=timed: "recording" in said(timed) or frames(timed), "it to listen")
        _, errors = timed.communicate(PATIENCE_S)
        if GONE in errors:
            break
    assert timed.returncode == 5, "what was not received to its end is no success"


def test_a_command_waits_for_a_bus_that_is_not_there_where_it_is_told_to(tmp_path: Path, port: int) -> None:
    with served(tmp_path, "gen4@5", port=port) as server:
        pass
    assert server.dvtcli("-n", "5", "read", "1018:1").returncode == 5
    reading = listening(server, "-n", "5", "read", "1018:1", "--reconnect")
    wait_for(lambda: "waiting for it" in said(reading), "it to wait")
    with served(tmp_path, "gen4@5", port=port):
        out, errors = reading.communicate(PATIENCE_S)
    assert (reading.returncode, "0x0000001E" in out) == (0, True)
    assert BACK in errors
    wrong = server.dvtcli("--reconnect", "-i", "no-such-driver", "read", "1018:1")
    assert wrong.returncode == 5, "what can never open is not waited for"


def test_nodes_that_joined_a_bus_join_it_again(tmp_path: Path, port: int) -> None:
    with served(tmp_path, "generic@9", port=port) as server:
        ready = tmp_path / "joined"
        words = ["sim", "gen4@5", *bus_words(server.port), "--reconnect", "--ready-file", str(ready)]
        joined = start(words, env=own_environment(tmp_path))
        wait_for(ready.exists, "the nodes")
        assert server.dvtcli("-n", "5", "read", "1018:1").returncode == 0
    wait_for(lambda: GONE in said(joined), "the end of the bus to be told")
    with served(tmp_path, "generic@9", port=port) as again:
        wait_for(lambda: BACK in said(joined), "the bus to be told to be back")
        assert again.dvtcli("-n", "5", "read", "1018:1").returncode == 0
        assert ended(joined)[0] == 130


def test_a_change_that_the_bus_leaves_ends_by_its_rules_and_recover_finishes_it(tmp_path: Path, port: int) -> None:
    """With --reconnect as without: nothing is written to a bus that is back by who was interrupted by its end."""
    kept = tmp_path / "kept"
    with served(tmp_path, "gen4@5", "--state", str(kept), "--fault", "bus-error@4", port=port) as server:
        before = server.dvtcli("-n", "5", "pdo", "tpdo1", "--json").stdout
        changing = server.dvtcli("-n", "5", "map", "tpdo1", "6041", "606C", "--sync", "1", "--reconnect")
        assert changing.returncode == 7, changing.stderr
        assert "recover" in changing.stderr
    with served(tmp_path, "gen4@5", "--state", str(kept), port=port) as again:
        assert again.dvtcli("-n", "5", "recover", "--yes").returncode == 0
        assert again.dvtcli("-n", "5", "pdo", "tpdo1", "--json").stdout == before


def test_a_sync_producer_ends_with_its_bus(tmp_path: Path) -> None:
    with served(tmp_path, "gen4@5") as server:
        received = listening(server, "monitor", "--nodes", "5", "--filter", "sync")
        producing = listening(server, "sync", "--period", "20", "--count", "100000", "--reconnect")
        wait_for(lambda: frames(received), "SYNC")
    _, errors = producing.communicate(PATIENCE_S)
    assert producing.returncode == 5
    assert "failed" in errors
    assert ended(received)[0] == 130
