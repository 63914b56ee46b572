"""`check --live --for` over socketcand, beside nodes of another process and somebody who disturbs them."""

from __future__ import annotations

import threading
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

import can
import pytest

from tests.process import documents
from tests.simulator.serve.served import Served, served

#: a refused write, and an EMCY that is not reset, of a node that is not there
FAULTS = ((0x609, "2B17100064000000"), (0x589, "8017100022000008"), (0x089, "1081010000000000"))
#: how often heartbeats come (s); node 9 has BEATS of them, then it is silent as long: often in a time of listening
EVERY_S, BEATS = 0.1, 8
#: how long nodes that are heard but do not answer are waited for (s)
SILENT_S = "1"


def _message(can_id: int, data: str) -> can.Message:
    return can.Message(arbitration_id=can_id, data=bytes.fromhex(data), is_extended_id=False)


@contextmanager
def disturbed(bus: can.BusABC, *, is_faulty: bool) -> Iterator[None]:
    """Send heartbeats of node 10 all the time; if *is_faulty*, those of node 9 stop now and then, and FAULTS come."""
    is_over = threading.Event()

    def send() -> None:
        beats = 0
        while not is_over.wait(EVERY_S):
            bus.send(_message(0x70A, "05"))
            if is_faulty and beats % (2 * BEATS) < BEATS:
                bus.send(_message(0x709, "05"))
            if is_faulty and beats % BEATS == 0:
                for can_id, data in FAULTS:
                    bus.send(_message(can_id, data))
            beats += 1

    thread = threading.Thread(target=send)
    thread.start()
    try:
        yield
    finally:
        is_over.set()
        thread.join()


def _found(server: Served, *words: str) -> tuple[int, list[dict[str, object]]]:
    ran = server.dvtcli("--timeout", SILENT_S, "-b", "125000", "--json", "check", "--live", *words)
    document = documents(ran.stdout)[0]
    assert "files" in document, document
    return ran.returncode, document["files"][0]["findings"]


@pytest.mark.long
def test_what_others_do_while_a_bus_is_listened_to_is_judged(tmp_path: Path) -> None:
    rules = {"refused-write", "emergency-not-reset", "heartbeat-stops", "heartbeat-late"}
    with served(tmp_path, "gen4@1", "tmcm@5") as server:
        bus = server.attach()
        with disturbed(bus, is_faulty=True):
            code, findings = _found(server, "--for", "8s")
            _, short = _found(server)
        found = {(finding["rule"], finding["node"]) for finding in findings if finding["rule"] in rules}
        assert code == 3
        assert {("refused-write", 9), ("emergency-not-reset", 9)} <= found
        assert {rule for rule, node in found if node == 9} & {"heartbeat-stops", "heartbeat-late"}, [
            (f["rule"], f["node"], f["text"]) for f in findings if f["node"] in (9, 10)
        ]
        assert not {finding["rule"] for finding in short} & rules, "no time is given"
        with disturbed(bus, is_faulty=False):
            _, healthy = _found(server, "--for", "3s")
        assert not {finding["rule"] for finding in healthy} & rules
