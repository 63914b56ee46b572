"""`check` of recordings: each fault is found once, with its frames; healthy recordings have none."""

from __future__ import annotations

import json
import re
import signal
import subprocess
import sys
import time
from collections.abc import Callable, Iterable
from pathlib import Path
from random import Random
from xml.etree import ElementTree as ET

import pytest
from hypothesis import given
from hypothesis import strategies as st

from dvtcli.domain.ports import Frame
from dvtcli.files.recordings.recording_file import Recorder, read_recording
from dvtcli.watch.decoder import Decoder
from dvtcli.watch.recording_checks.recording_rules import RECORDING_RULES, RecordingCheck
from tests.drawn_frames import drawn
from tests.process import PATIENCE_S, documents, dvtcli
from tests.simulator.serve.served import bus_words, own_environment, served
from tests.small_recording import BEGIN_S
from tests.watch.test_sdo_transfers import by_blocks

pytestmark = [pytest.mark.drawn(8, "recording checks")]

Planted = list[tuple[float, int, str]]


def heartbeats(first_s: float, last_s: float, node_id: int = 5, state: int = 5) -> Planted:
    """A heartbeat each 100 ms."""
    return [(number / 10, 0x700 + node_id, f"{state:02X}") for number in range(int(10 * first_s), int(10 * last_s))]


def pdos(first_s: float, last_s: float, data: str = "11223344 5566", can_id: int = 0x185) -> Planted:
    return [(number / 20 + 0.01, can_id, data) for number in range(int(20 * first_s), int(20 * last_s))]


def syncs(first_s: float, last_s: float) -> Planted:
    return [(number / 50 + 0.005, 0x080, "") for number in range(round(50 * first_s), round(50 * last_s))]


def write(at_s: float, place: str, value: str, answer: str = "60") -> Planted:
    """An expedited download to node 5, of *value* in the order on the bus, and its answer: taken, or an abort code."""
    index, sub_index = place.split(":")
    begin = f"{index[2:]}{index[:2]}{sub_index}"
    command = 0x23 | (4 - len(value) // 2) << 2
    answered = f"60{begin}00000000" if answer == "60" else f"80{begin}{answer}"
    return [(at_s, 0x605, f"{command:02X}{begin}{value:0<8}"), (at_s + 0.001, 0x585, answered)]


def read(at_s: float, place: str, answer: str) -> Planted:
    index, sub_index = place.split(":")
    begin = f"{index[2:]}{index[:2]}{sub_index}"
    return [(at_s, 0x605, f"40{begin}00000000"), (at_s + 0.001, 0x585, answer.replace("PLACE", begin))]


def mapped(at_s: float) -> Planted:
    """TPDO1 is mapped anew, as the standard wants it."""
    return [
        *write(at_s, "1800:01", "85010080"), *write(at_s + 0.01, "1A00:00", "00"),
        *write(at_s + 0.02, "1A00:01", "10004160"), *write(at_s + 0.03, "1A00:02", "20006C60"),
        *write(at_s + 0.04, "1A00:00", "02"), *write(at_s + 0.05, "1800:01", "85010000"),
    ]  # fmt: skip


def at_times(times_s: Iterable[float], can_id: int, *data: str) -> Planted:
    """A frame at each of *times_s*, with *data* by turns."""
    return [(at_s, can_id, data[number % len(data)]) for number, at_s in enumerate(times_s)]


def every(period_s: float, first_s: float, last_s: float) -> list[float]:
    return [first_s + number * period_s for number in range(round((last_s - first_s) / period_s))]


def segmented(at_s: float, *, toggles: tuple[int, int, int] = (0, 1, 0)) -> Planted:
    """An upload of 2100:03 of node 5 in three segments, with these toggle bits."""
    rows: list[tuple[int, str]] = [(0x605, "4000210300000000"), (0x585, "4100210315000000")]
    for number, toggle in enumerate(toggles):
        rows += [(0x605, f"{0x60 | number % 2 << 4:02X}00000000000000")]
        rows += [(0x585, f"{toggle << 4 | (number == 2):02X}{f'{number + 0x41:02X}' * 7}")]
    return [(at_s + number / 1000, *row) for number, row in enumerate(rows)]


def written_rpdo(at_s: float) -> Planted:
    """RPDO1 of node 5 is enabled with 0x205."""
    return write(at_s, "1400:01", "05020000")


FAMILIES = ("canopennode", "espac", "gen4", "generic", "lely", "no-boot-up", "no-entry-zero", "roboteq", "tmcm")
#: 4 s of a node that does what it is to do
HEALTHY = [*heartbeats(0, 4), *pdos(0.5, 4), *mapped(0.2)]
WITHOUT_HEARTBEATS = [*pdos(0.5, 4), *mapped(0.2)]
#: what is added to, or stands instead of, healthy traffic, and the text and the frames' time that are found
PLANTED: dict[str, tuple[Planted, str, float]] = {
    "refused-write": (HEALTHY + write(2.0, "1A02:01", "10004160", "41000406"),
                      "write to 1A02:01 mapped object 1 refused: abort 0x06040041, ", 2.001),
    "refused-read": (HEALTHY + read(2.0, "2000:01", "80PLACE22000008"),
                     "read of 2000:01 refused: abort 0x08000022", 2.001),
    "sdo-given-up": ([*HEALTHY, (2.0, 1541, "4000200100000000"), (2.5, 1541, "8000200100000405")],
                     "read of 2000:01 given up: abort 0x05040000, SDO protocol timed out", 2.5),
    "absent-object": (HEALTHY + read(2.0, "1F80:00", "80PLACE00000206"),
                      "node 5 does not have the objects that were read: 1F80:00", 2.001),
    "pdo-left-disabled": (HEALTHY + mapped(2.0)[:-2], "TPDO1 of node 5 was configured, but not enabled again", 2.001),
    "mapping-half-done": (HEALTHY + mapped(2.0)[:-4],
                          "TPDO1 of node 5 was disabled, written to and not enabled again", 2.001),
    "mapping-empty": (HEALTHY + mapped(2.0)[:4], "TPDO1 of node 5 has count 0", 2.001),
    "boot-up-in-operation": ([*HEALTHY, (2.05, 1797, "00")],
                             "node 5: restarted in OPERATIONAL without an NMT command", 2.05),
    "no-boot-up": ([*heartbeats(0, 2), (2.05, 0, "8105"), *heartbeats(0, 10, 6)],
                   "node 5: sends nothing in the 7.85 s since an NMT reset", 2.05),
    "heartbeat-stops": (WITHOUT_HEARTBEATS + heartbeats(0, 2), "node 5: sends no heartbeat in the last", 1.9),
    "heartbeat-late": (WITHOUT_HEARTBEATS + heartbeats(0, 2) + heartbeats(2.5, 4),
                       "node 5: heartbeat 600 ms after the one before; usual: 100 ms", 2.5),
    "emergency-not-reset": ([*HEALTHY, (2.02, 133, "1081010000000000")], "node 5: EMCY 0x8110, ", 2.02),
    "emergency-reset": ([*HEALTHY, (2.02, 133, "1081010000000000"), (2.52, 133, "0000000000000000")],
                        "node 5: EMCY 0x8110, ", 2.02),
    "pdo-other-length": ([*HEALTHY, (4.0, 389, "1122")], "0x185: the frame has 2 bytes, ", 4.0),
    "two-senders": (HEALTHY + pdos(2, 3, "1122", 0x3C0) + [
                        (at_s + 0.02, can_id, "112233") for at_s, can_id, _ in pdos(2, 3, can_id=0x3C0)],
                    "0x3C0 alternates between 2 and 3 bytes", 2.06),
    "two-nodes-answer": (HEALTHY + read(2.0, "1018:04", "43PLACE01000000") + [(2.002, 0x585, "4318100402000000")],
                         "node 5: requests are answered twice", 2.002),
    "sdo-no-answer": ([*HEALTHY, (2.0, 0x605, "4018100400000000"), *read(3.0, "1018:04", "43PLACE01000000")],
                      "node 5: 1 request without an answer", 2.0),
    "sync-late": ([*HEALTHY, *syncs(0, 2), *syncs(2.3, 4)], "SYNC 320 ms after the one before; usual: ", 2.305),
    "sdo-segments": (HEALTHY + segmented(2.0, toggles=(0, 1, 1)), "read of 2100:03: segments are missing", 2.007),
    "sync-jitter": ([*HEALTHY, *at_times([n / 50 + 0.005 + (0.008 if n in range(31, 120, 9) else 0)
                                          for n in range(200)], 0x080, "")],
                    "SYNC 12 to 28 ms after the one before; usual: 20 ms", 0.633),
    "two-sync-producers": ([*HEALTHY, *syncs(0, 4), *at_times(every(0.02, 1.009, 4), 0x080, "")],
                  "SYNC comes at alternately short and long intervals", 1.105),
    "two-heartbeats": ([*HEALTHY, *at_times(every(0.1, 1.033, 4), 0x705, "05")],
                       "node 5: its heartbeats come at alternately short and long intervals", 1.5),
    "rpdo-not-sent": (HEALTHY + written_rpdo(0.3), "RPDO1 of node 5 is 0x205, which no node transmits", 0.301),
    "two-masters": ([*HEALTHY, (2.0, 0x605, "4018100400000000"), (2.001, 0x605, "4041600000000000"),
                      (2.002, 0x585, "4318100401000000"), (2.003, 0x585, "4B41600037060000")],
                     "node 5: 1 request within another transfer", 2.001),
    "pdo-floods": ([*HEALTHY, *at_times(every(0.001, 2.0, 2.3), 0x1A5, *(f"{n:02X}" for n in range(100)))],
                   "0x1A5 was received up to 100 times in 0.1 s", 2.0),
    "sdo-unasked": ([*HEALTHY, *read(2.0, "1018:04", "43PLACE01000000"), (2.2, 0x585, "4B41600037060000")],
                    "node 5: 1 answer without a request", 2.2),
    "error-frames": ([*HEALTHY, (2.0, 0x20000004, "0000000000000000")], "1 error frame", 2.0),
}  # fmt: skip


def recorded(path: Path, planted: Planted) -> Path:
    if path.suffix == ".log":  # error frames, too
        path.write_text("".join(
            f"({BEGIN_S + at_s:.6f}) can0 {can_id:0{3 if can_id <= 0x7FF else 8}X}#{data.replace(' ', '')}\n"
            for at_s, can_id, data in sorted(planted)
        ))  # fmt: skip
        return path
    with Recorder(path) as recorder:
        for at_s, can_id, data in sorted(planted):
            recorder.write(Frame(can_id, bytes.fromhex(data), timestamp_s=BEGIN_S + at_s))
    return path


def test_each_rule_is_planted() -> None:
    """The load of the bus needs its bit rate, a default mapping a network file: both have a test of their own."""
    assert {*PLANTED} | {"bus-load", "pdo-other-than-default"} == {rule.name for rule in RECORDING_RULES}


@pytest.mark.parametrize("rule", sorted(PLANTED))
def test_a_fault_is_found_with_its_frames(tmp_path: Path, rule: str) -> None:
    frames, says, at_s = PLANTED[rule]
    path = recorded(tmp_path / "run.log", frames)
    done = dvtcli("check", str(path), "--json")
    (report,) = documents(done.stdout)[0]["files"]
    (found,) = report["findings"]
    assert found["rule"] == rule
    assert says in found["text"]
    numbers = [number for number, (time_s, _, _) in enumerate(sorted(frames), 1) if time_s == pytest.approx(at_s)]
    assert found["frames"][0] in numbers
    assert done.returncode == (0 if found["severity"] == "note" else 3), done.stderr
    shown = dvtcli("check", str(path))
    assert f"{says}" in shown.stdout
    assert f"[{rule}]" in shown.stdout
    assert "check first: " in shown.stdout
    assert dvtcli("check", str(path), "--without", rule).returncode == 0


ANY_FRAMES = drawn(
    st.sampled_from([0, 0x080, 0x085, 0x185, 0x585, 0x605, 0x705]) | st.integers(0, 0x7FF),
    st.sampled_from([bytes.fromhex(data.replace(" ", "")) for _, _, data in mapped(0)]) | st.binary(max_size=8),
    extended=st.booleans(), remote=st.booleans(), timestamp_s=st.floats(0, 100),
)  # fmt: skip


@given(st.lists(ANY_FRAMES, max_size=40))
def test_whatever_was_recorded_is_judged(frames: list[Frame]) -> None:
    """No frame is too odd, and each problem names frames that there are."""
    check = RecordingCheck(Decoder().layout, lambda _node_id, _index, _sub_index: "")
    for number, frame in enumerate(frames, 1):
        check.take(number, frame)
    for problem in sorted(check.problems(), key=lambda problem: problem.order):
        assert problem.moments.numbers
        assert {*problem.moments.numbers} <= {*range(1, len(frames) + 1)}
        assert problem.text


@pytest.mark.parametrize("suffix", [".log", ".asc", ".blf"])
def test_a_healthy_recording_has_no_problem(tmp_path: Path, suffix: str) -> None:
    path = recorded(tmp_path / f"run{suffix}", HEALTHY)
    done = dvtcli("check", str(path))
    assert (done.returncode, done.stdout.count("\n")) == (0, 1), done.stdout
    assert done.stdout.endswith(" frames in 4.0 s; no problem\n")


def findings(planted: Planted) -> list[tuple[str, str]]:
    """Rule and text of each problem in *planted* frames, one after the other if at one time."""
    check = RecordingCheck(Decoder().layout, lambda _node_id, _index, _sub_index: "")
    for number, (at_s, can_id, data) in enumerate(sorted(planted, key=lambda each: each[0]), 1):
        check.take(number, Frame(can_id, bytes.fromhex(data), can_id > 0x7FF, timestamp_s=at_s))
    return [
        (problem.rule.name, problem.text) for problem in sorted(check.problems(), key=lambda problem: problem.order)
    ]


def jittered(period_s: float, first_s: float, last_s: float, share: float = 0.1) -> list[float]:
    """Times with a period that are off by up to *share* of it, as a driver's time stamps are."""
    draw = Random(7)
    return [at_s + share * period_s * draw.random() for at_s in every(period_s, first_s, last_s)]


def counted(times_s: Iterable[float], can_id: int) -> Planted:
    """A frame at each of *times_s* with another value each time."""
    return [(at_s, can_id, f"{number & 0xFFFF:04X}{number * 7 & 0xFF:02X}") for number, at_s in enumerate(times_s)]


_SYNCS_1_MS = at_times(every(0.001, 0, 3), 0x080, "")
#: what buses do where nothing is wrong
HEALTHY_BUSES: dict[str, Planted] = {
    "heartbeats alone": [*heartbeats(0, 4), *heartbeats(0, 4, 6), *heartbeats(0, 4, 7, state=127)],
    "a PDO with each SYNC of 1 ms": [*_SYNCS_1_MS, *counted(every(0.001, 0.0003, 3), 0x185),
                                     *counted(every(0.001, 0.0004, 3), 0x285)],
    "a timer of 1 ms without SYNC": counted(jittered(0.001, 0, 3), 0x185),
    "time stamps that are not even": [*at_times(jittered(0.02, 0, 4), 0x080, ""),
                                      *at_times(jittered(0.1, 0, 4), 0x705, "05")],
    "SYNC with a counter": at_times(every(0.02, 0, 4), 0x080, *(f"{n:02X}" for n in range(1, 11))),
    "a switch that goes on and off": [(n + at_s, 0x185, data) for n in range(20)
                                      for at_s, data in ((0.0, "00"), (0.3, "01"))],
    "events now and then": counted([0.1, 0.11, 0.4, 0.45, 0.5, 1.9, 2.0, 2.6], 0x185),
    "a start with a boot-up and NMT": [(0.0, 0x705, "00"), (0.1, 0x000, "0105"), *heartbeats(0.2, 4)],
    "two nodes that are read by one client": [
        *[row for n in range(20) for row in read(0.1 * n + 0.01, "6041:00", "4BPLACE37060000")],
        *[(at_s + 0.002, can_id + 1, data) for n in range(20) for at_s, can_id, data in
          read(0.1 * n + 0.01, "6041:00", "4BPLACE37060000")]],
    "guarding": [row for n in range(40) for row in ((n / 10, 0x705, f"{5 | n % 2 << 7:02X}"),)],
    "states that a master commands": [row for n in range(5) for row in (
        (n + 0.0, 0x000, "8005"), *write(n + 0.1, "1017:00", "6400"), (n + 0.5, 0x000, "0105"),
        *heartbeats(n + 0.6, n + 1))],
    "an EMCY that only says that all is well": [*heartbeats(0, 4), (1.0, 0x085, "0000000000000000")],
    "segments with toggle bits": [*HEALTHY, *segmented(2.0)],
    "an RPDO that its master sends": [*HEALTHY, *written_rpdo(0.3), *counted(every(0.05, 0.4, 4), 0x205)],
}  # fmt: skip


def parameters(kind: int, timer_ms: int, *, is_read: bool) -> Planted:
    """The COB-ID, type and event timer of TPDO1 of node 5, written or read before anything else."""
    values = ("1800:01", "85010000"), ("1800:02", f"{kind:02X}"), ("1800:05", timer_ms.to_bytes(2, "little").hex())
    return [
        row
        for number, (place, value) in enumerate(values)
        for row in (
            read(number / 100, place, f"{0x43 | (4 - len(value) // 2) << 2:02X}PLACE{value:0<8}")
            if is_read
            else write(number / 100, place, value)
        )
    ]


@pytest.mark.parametrize("is_read", [True, False])
@pytest.mark.parametrize(
    ("kind", "timer_ms", "is_found"), [(255, 0, True), (254, 0, False), (255, 1, False), (1, 0, False)]
)
def test_an_even_flood_of_events_alone_is_told_from_a_cyclic_pdo(
    kind: int, timer_ms: int, is_read: bool, is_found: bool
) -> None:
    """Frames each 1 ms are all that is sent: the PDO's parameters in the recording tell which it is."""
    syncs_1_ms = _SYNCS_1_MS if kind == 1 else []
    frames = [*parameters(kind, timer_ms, is_read=is_read), *syncs_1_ms, *counted(jittered(0.001, 0.05, 3), 0x185)]
    found = [("pdo-floods", "0x185 was received up to 100 times in 0.1 s")] if is_found else []
    assert findings(frames) == found


@pytest.mark.parametrize("is_read", [True, False])
@pytest.mark.parametrize(("cob_id", "is_found"), [("85010080", False), ("850100C0", False), ("85010040", True)])
def test_the_can_id_of_a_disabled_pdo_is_not_its_own(cob_id: str, is_read: bool, is_found: bool) -> None:
    """A node may have a disabled TPDO with the CAN-ID that another sends with a timer."""
    places = (("1800:01", "43PLACE"), ("1800:02", "4FPLACEFF000000"), ("1800:05", "4BPLACE00000000"))
    rows = [
        row
        for number, (place, answer) in enumerate(places)
        for row in read(number / 100, place, answer + ("" if number else cob_id))
    ]
    if not is_read:
        rows[:2] = write(0.0, "1800:01", cob_id)
    found = findings([*rows, *counted(every(0.001, 0.05, 3), 0x185)])
    assert ("pdo-floods" in {rule for rule, _ in found}) == is_found


def test_a_timer_that_was_switched_off_at_the_end_is_no_flood() -> None:
    frames = [*parameters(255, 1, is_read=False), *counted(every(0.001, 0.05, 3), 0x185)]
    assert findings([*frames, *write(3.0, "1800:05", "0000")]) == []


@pytest.mark.parametrize(("timer", "is_found"), [("", True), (", event_timer: 1", False)])
def test_a_network_file_tells_an_even_flood_from_a_timer(tmp_path: Path, timer: str, is_found: bool) -> None:
    path = recorded(tmp_path / "run.log", counted(every(0.001, 0, 3), 0x185))
    (tmp_path / "net.yaml").write_text(
        "nodes: {drive: {node_id: 5, dcf: gen4, tpdo: {1: {cob_id: 0x185, transmission: 255, mapping: "
        f"[6041:00]{timer}}}}}}}}}\n"
    )
    done = dvtcli("check", str(path), "-d", str(tmp_path / "net.yaml"), "--rule", "pdo-floods")
    assert (done.returncode, "[pdo-floods]" in done.stdout) == (3 if is_found else 0, is_found), done.stdout


@pytest.mark.parametrize("bus", HEALTHY_BUSES)
def test_a_healthy_bus_has_no_problem(bus: str) -> None:
    assert findings(HEALTHY_BUSES[bus]) == []


TIME_OUT = [(2.0, 0x605, "4000200100000000"), (2.5, 0x605, "8000200100000405")]
SILENT = [*TIME_OUT, (2.6, 0x605, "4018100400000000"), (4.0, 0x080, "")]
ALIVE, STOP = heartbeats(0, 4), (1.0, 0x000, "0205")
STOPPED_LATER = [*heartbeats(0, 1), *heartbeats(1.0, 4, state=4)]


def looks(planted: Planted, rules: set[str]) -> set[str]:
    """What to check first, of each problem by *rules* in *planted* frames."""
    check = RecordingCheck(Decoder().layout, lambda _node_id, _index, _sub_index: "")
    for number, (at_s, can_id, data) in enumerate(sorted(planted), 1):
        check.take(number, Frame(can_id, bytes.fromhex(data), timestamp_s=at_s))
    return {problem.look for problem in check.problems() if problem.rule.name in rules}


def number_of(planted: Planted, at_s: float, can_id: int) -> int:
    (number,) = [n for n, frame in enumerate(sorted(planted), 1) if frame[:2] == (at_s, can_id)]
    return number


ANSWERED_ONCE = read(0.05, "1018:04", "43PLACE01000000")


@pytest.mark.parametrize(("frames", "at_s", "can_id", "says"), [
    ([*STOPPED_LATER, STOP], 1.0, 0x000, "the NMT stop in frame {}: a STOPPED node answers no SDO request"),
    ([STOP], 1.0, 0x000, "the NMT stop in frame {}: a STOPPED node answers no SDO request"),
    ([(1.0, 0x000, "0200")], 1.0, 0x000, "the NMT stop in frame {}: a STOPPED node answers no SDO request"),
    (STOPPED_LATER, 1.0, 0x705, "the heartbeat in frame {}: a STOPPED node answers no SDO request"),
    (heartbeats(0, 1.5), 1.4, 0x705, "whether the node was on: it sent no heartbeat after frame {}"),
])  # fmt: skip
def test_a_stopped_or_silent_node_is_named_as_the_cause(frames: Planted, at_s: float, can_id: int, says: str) -> None:
    """The transfers that were given up, and the requests without an answer, follow from it."""
    planted = [*frames, *SILENT, *ANSWERED_ONCE]
    looked = looks(planted, {"sdo-given-up", "sdo-no-answer"})
    assert looked == {says.format(number_of(planted, at_s, can_id))}


UNKNOWN = {
    "whether the node is on, and how busy it and the bus are",
    "whether the node restarted or was busy at that time",
}


def asked(at_s: float) -> Planted:
    """A request to node 5 without an answer that is given up after half a second."""
    return [(at_s, 0x605, "4000200100000000"), (at_s + 0.5, 0x605, "8000200100000405")]


def unanswered(at_s: float) -> Planted:
    """A request to node 5 that is neither answered nor given up."""
    return [(at_s, 0x605, "4018100400000000"), (6.0, 0x080, "")]


@pytest.mark.parametrize("request_of", [asked, unanswered])
@pytest.mark.parametrize("command", ["0205", "0200"])
@pytest.mark.parametrize(("after_s", "is_cause"), [(-0.5, True), (0.05, True), (0.2, False), (0.45, False), (2, False)])
def test_only_a_stop_before_the_answer_was_due_is_a_cause(
    request_of: Callable[[float], Planted], command: str, after_s: float, is_cause: bool
) -> None:
    """Whenever the request is judged: at the client's abort, or at the end of the recording."""
    planted = [*ANSWERED_ONCE, *request_of(2.0), (2.0 + after_s, 0x000, command), (6.0, 0x081, "0000")]
    looked = looks(planted, {"sdo-given-up", "sdo-no-answer"})
    number = number_of(planted, 2.0 + after_s, 0x000)
    says = f"the NMT stop in frame {number}: a STOPPED node answers no SDO request"
    assert looked == {says} if is_cause else len(looked) == 1 and looked < UNKNOWN


@pytest.mark.parametrize("request_of", [asked, unanswered])
@pytest.mark.parametrize(("beats", "says"), [
    ([(0, 3), (5, 6)], None),  # when it was asked, its heartbeats came
    ([(0, 3)], None),
    ([(0, 1)], "it sent no heartbeat after frame {}"),
    ([(0, 1), (3, 6)], "it sent no heartbeat for 2.1 s after frame {}"),
    ([(0, 1), (1.8, 2.7)], None),  # the silence was over before the request
])  # fmt: skip
def test_heartbeats_are_judged_at_the_time_of_the_request(
    request_of: Callable[[float], Planted], beats: list[tuple[float, float]], says: str | None
) -> None:
    frames = [row for first_s, last_s in beats for row in heartbeats(first_s, last_s)]
    planted = [*ANSWERED_ONCE, *request_of(2.05), *frames, (6.0, 0x081, "0000")]
    looked = looks(planted, {"sdo-given-up", "sdo-no-answer"})
    if says is None:
        assert len(looked) == 1
        assert looked < UNKNOWN
    else:
        assert looked == {f"whether the node was on: {says.format(number_of(planted, 0.9, 0x705))}"}


@pytest.mark.parametrize("then", [
    (3.0, 0x705, "00"), (3.0, 0x000, "8105"), (3.0, 0x605, "2B17100064000000"), (3.0, 0x705, "7F"),
])  # fmt: skip
def test_a_silence_ends_with_any_new_start(then: tuple[float, int, str]) -> None:
    planted = [*ANSWERED_ONCE, *asked(2.05), *heartbeats(0, 1), then, (6.0, 0x081, "0000")]
    says = f"it sent no heartbeat for 2.1 s after frame {number_of(planted, 0.9, 0x705)}"
    assert looks(planted, {"sdo-given-up"}) == {f"whether the node was on: {says}"}


@pytest.mark.parametrize(("answer", "is_found"), [("60", False), ("22000008", True)])
def test_a_period_changes_only_if_its_write_is_accepted(answer: str, is_found: bool) -> None:
    """A node whose heartbeats end, and SYNC that ends for a while: the write of 0 is no reason if it is refused."""
    beats = [*heartbeats(0, 2), *write(2.01, "1017:00", "0000", answer), *heartbeats(0, 6, 6)]
    syncing = [*syncs(0, 2), *write(2.01, "1006:00", "00000000", answer), *syncs(3, 5)]
    assert ("heartbeat-stops" in {rule for rule, _ in findings(beats)}) == is_found
    assert ("sync-late" in {rule for rule, _ in findings([*heartbeats(0, 6, 6), *syncing])}) == is_found


def test_a_period_goes_on_beside_writes_that_are_refused() -> None:
    """Each gap of the node's heartbeats has one of them before it."""
    bursts = [beat for at_s in range(0, 8, 2) for beat in heartbeats(at_s, at_s + 1)]
    refused = [frame for at_s in range(0, 8, 2) for frame in write(at_s + 0.95, "1017:00", "6400", "22000008")]
    rules = [rule for rule, _ in findings([*bursts, *refused, *heartbeats(0, 7, 6)])]
    assert rules == ["refused-write", "heartbeat-late"]


def test_a_node_that_answers_between_two_heartbeats_was_on() -> None:
    planted = [*ANSWERED_ONCE, *asked(2.05), *heartbeats(0, 1), *read(3.0, "1018:04", "43PLACE01000000")]
    assert looks(planted, {"sdo-given-up"}) < UNKNOWN


@pytest.mark.parametrize("frames", [
    ALIVE, [*ALIVE, STOP], [*ALIVE, STOP, (1.5, 0x000, "0105")], [*ALIVE, STOP, (1.5, 0x000, "8000")],
    [STOP, (1.5, 0x705, "00"), (1.6, 0x705, "7F")], [STOP, *read(1.5, "1018:04", "43PLACE01000000")],
    [*ALIVE, (1.0, 0x000, "0206")],
])  # fmt: skip
def test_a_node_in_another_state_is_not_the_cause(frames: Planted) -> None:
    looked = looks([*frames, *SILENT, *ANSWERED_ONCE], {"sdo-given-up", "sdo-no-answer"})
    assert looked == UNKNOWN


@pytest.mark.parametrize(("first_s", "says"), [
    (1.0, "check first: the mapping of TPDO1: SDO writes changed it to 6 bytes in frame "),
    (1.0, None),
    (0.0, "check first: whether the node's mapping is that of the file"),
])  # fmt: skip
def test_a_mapping_written_in_the_recording_is_named_as_the_cause(
    tmp_path: Path, first_s: float, says: str | None
) -> None:
    """By a file with the mapping of before, with that of after, and without any write of a mapping."""
    is_after = says is None
    mapping = "[6041, 606C]" if is_after else "[6041]"
    (tmp_path / "net.yaml").write_text(f"drive: {{node_id: 5, dcf: generic, tpdo: {{1: {{mapping: {mapping}}}}}}}\n")
    written = mapped(1.0) if first_s else []
    frames = [*pdos(0, 1, "1122"), *written, *pdos(1.1, 3)]
    path = recorded(tmp_path / "run.log", frames)
    shown = dvtcli("check", str(path), "-d", str(tmp_path / "net.yaml"), "--rule", "pdo-other-length").stdout
    number = number_of(frames, 1.041, 0x585) if first_s else ""
    expected = f"check first: the mapping of TPDO1: SDO writes changed it to 6 bytes only in frame {number}"
    assert (expected if says is None else f"{says}{number}") in shown, shown


@pytest.mark.parametrize(("node", "rule"), [
    ("dcf: generic, tpdo: {1: {mapping: [6041, 606C]}}", "pdo-other-length"),
    ("tpdo: {1: {mapping: [6041:00/16, 606C:00/32]}}", "pdo-other-length"),
    ("dcf: generic", "pdo-other-than-default"),
    ("dcf: generic, tpdo: {1: {event_timer: 20}}", "pdo-other-than-default"),
    ("heartbeat_producer: 100", ""),
])  # fmt: skip
def test_a_pdo_of_another_length_is_found_and_a_guess_is_said_as_such(tmp_path: Path, node: str, rule: str) -> None:
    """By the mapping of the file, else by the default one, which the node need not have."""
    (tmp_path / "net.yaml").write_text(f"drive: {{node_id: 5, {node}}}\n", "utf-8")
    path = recorded(tmp_path / "run.log", [*heartbeats(0, 2), *pdos(0, 2, "112233")])
    done = dvtcli("check", str(path), "-d", str(tmp_path / "net.yaml"), "--json")
    (report,) = documents(done.stdout)[0]["files"]
    found = [finding for finding in report["findings"] if finding["rule"].startswith("pdo-other")]
    assert [finding["rule"] for finding in found] == [rule] * bool(rule), report
    if rule == "pdo-other-than-default":
        assert (found[0]["severity"], done.returncode) == ("note", 0)
        assert "the default mapping of the family generic has " in found[0]["text"]
        assert "which the file does not say" in found[0]["look"]
    elif rule:
        assert (found[0]["severity"], done.returncode) == ("error", 3)


def mapping_read(at_s: float) -> Planted:
    """The mapping of TPDO1, 6 bytes, is read as masters read it: the number of entries, then the entries."""
    return [
        *read(at_s, "1A00:00", "4FPLACE02000000"), *read(at_s + 0.01, "1A00:01", "43PLACE10004160"),
        *read(at_s + 0.02, "1A00:02", "43PLACE20006C60"),
    ]  # fmt: skip


_SIX, _THREE = "11223344 5566", "112233"
_WITHOUT_LAST_ENTRY = mapping_read(0.5)[:-2]


@pytest.mark.parametrize(("frames", "noted"), [
    pytest.param([*mapped(0.5), *pdos(1, 2, _SIX)], 0, id="written"),
    pytest.param([*mapping_read(0.5), *pdos(1, 2, _SIX)], 0, id="read"),
    pytest.param([*pdos(0, 1, _SIX), *mapping_read(1.5), *pdos(2, 3, _SIX)], 0, id="read later"),
    pytest.param([*pdos(0, 1, _THREE), *mapped(1.5), *pdos(2, 3, _SIX)], 20, id="another one before the write"),
    pytest.param([*pdos(0, 1, _THREE), *mapping_read(1.5)], 20, id="another one read later"),
    pytest.param([*mapped(0.5), *pdos(1, 2, _THREE)], 20, id="another one written"),
    pytest.param([*mapping_read(0.5), *pdos(1, 2, _SIX), *pdos(2, 3, _THREE)], 20, id="another one read"),
    pytest.param([*mapped(0.5), (1.0, 0x705, "00"), *pdos(1.5, 2, _SIX)], 10, id="restarted after the write"),
    pytest.param([*_WITHOUT_LAST_ENTRY, *pdos(1, 2, _SIX)], 20, id="read in part"),
    pytest.param([
        *mapping_read(0.5), *write(0.6, "1A00:00", "00"), *write(0.61, "1A00:01", "08004160"),
        *write(0.62, "1A00:00", "01"), *pdos(1, 2, _SIX),
    ], 20, id="written after the read"),
])  # fmt: skip
def test_a_mapping_in_the_recording_itself_is_better_than_a_default_one(
    tmp_path: Path, frames: Planted, noted: int
) -> None:
    """Any start by a master writes or reads mappings: no frame that fits them has another length than it should."""
    (tmp_path / "net.yaml").write_text("drive: {node_id: 5, dcf: generic}\n", "utf-8")
    path = recorded(tmp_path / "run.log", [*heartbeats(0, 3), *frames])
    done = dvtcli("check", str(path), "-d", str(tmp_path / "net.yaml"), "--json")
    (report,) = documents(done.stdout)[0]["files"]
    found = [finding for finding in report["findings"] if finding["rule"] == "pdo-other-than-default"]
    assert [finding["times"] for finding in found] == [noted] * bool(noted), report


def blocks(at_s: float, size: int, *, is_write: bool) -> Planted:
    """A transfer of 2100:03 of node 5 by blocks of 127 segments, whose numbers look like all command specifiers."""
    value = bytes(number % 251 for number in range(size))
    return [
        (at_s + number / 10_000, 0x605 if is_request else 0x585, data.hex())
        for number, (is_request, data) in enumerate(by_blocks(value, 127, iter(()), is_write=is_write))
    ]


@pytest.mark.parametrize("is_write", [True, False])
@pytest.mark.parametrize("size", [889, 2000])
def test_segments_of_blocks_are_neither_requests_nor_answers(size: int, is_write: bool) -> None:
    transfer = blocks(2.0, size, is_write=is_write)
    assert findings(HEALTHY + transfer) == []
    refused = [*transfer[:-1], (2.9, 0x585, "8000210322000008")]
    (found,) = findings(HEALTHY + refused)
    assert found[0] == ("refused-write" if is_write else "refused-read")
    assert found[1].startswith(f"{'write to' if is_write else 'read of'} 2100:03 refused")


ASKED, ANSWERED = (0x605, "4018100400000000"), (0x585, "4318100401000000")


@pytest.mark.parametrize(("frames", "rules"), [
    ([ASKED, ANSWERED, ASKED, ANSWERED], set()),
    ([ASKED, ASKED, ANSWERED, ANSWERED], {"sdo-no-answer"}),
    ([ASKED, (0x605, "8018100400000405"), ASKED, ANSWERED, ANSWERED], {"sdo-given-up"}),
    ([ASKED, ASKED, (0x605, "4000100000000000"), ANSWERED, ANSWERED, (0x585, "4300100000000000")], {"sdo-no-answer"}),
    ([ASKED, ASKED, ANSWERED, ANSWERED, ANSWERED], {"sdo-no-answer", "two-nodes-answer"}),
    ([ASKED, ASKED, (0x705, "00"), ASKED, ANSWERED, ANSWERED],
     {"sdo-no-answer", "two-nodes-answer", "boot-up-in-operation"}),
    ([ASKED, ANSWERED, ANSWERED], {"two-nodes-answer"}),
])  # fmt: skip
def test_only_more_answers_than_requests_are_of_two_nodes(frames: list[tuple[int, str]], rules: set[str]) -> None:
    planted = [(2.0 + number / 50, *frame) for number, frame in enumerate(frames)]
    assert {rule for rule, _ in findings(HEALTHY + planted)} == rules


@pytest.mark.parametrize(("can_id", "is_found"), [
    (0x185, True), (0x3C0, True), (0x57F, True), (0x7DF, False), (0x7E8, False), (0x600, False), (0x18DA10F1, False),
    (0x18DAF110, False), (0x10000185, False),
])  # fmt: skip
def test_only_pdos_have_two_senders(can_id: int, is_found: bool) -> None:
    """Frames of ISO-TP and of other protocols have any length."""
    frames = [(1.0 + number / 100, can_id, "11" * (4 + 4 * (number & 1))) for number in range(40)]
    assert [rule for rule, _ in findings(frames)] == ["two-senders"] * is_found


@pytest.mark.parametrize(("number", "answer", "rules"), [
    (2, "60", ["mapping-empty"]), (3, "60", ["mapping-half-done"]), (4, "60", ["mapping-half-done"]),
    (5, "60", ["pdo-left-disabled"]), (5, "08000022", ["refused-write", "mapping-half-done"]), (6, "60", []),
])  # fmt: skip
def test_a_pdo_that_is_meant_to_be_off_is_no_error(number: int, answer: str, rules: list[str]) -> None:
    """*number* writes of a mapping, of which the last is taken or refused."""
    planted = mapped(2.0)[: 2 * number]
    if answer != "60":
        at_s, can_id, data = planted.pop()
        planted.append((at_s, can_id, f"80{data[2:8]}22000008"))
    assert [rule for rule, _ in findings(HEALTHY + planted)] == rules


@pytest.mark.parametrize(("then", "rule"), [
    (read(2.05, "1800:01", "43PLACE85010080"), "pdo-left-disabled"),
    (write(2.05, "1017:00", "F401"), "pdo-left-disabled"),
    (read(3.5, "1800:01", "43PLACE85010080"), "mapping-empty"),
    (write(2.05, "1A00:01", "10004160"), "mapping-half-done"),
    ([], "mapping-empty"),
])  # fmt: skip
def test_a_pdo_that_was_cleared_by_will_is_told_from_one_whose_client_ended(then: Planted, rule: str) -> None:
    """A client that goes on at once with another object was not ended after count 0; nothing else tells."""
    assert [rule for rule, _ in findings(HEALTHY + mapped(2.0)[:4] + then)] == [rule]


RESET, BOOT_UP = (0x000, "8105"), (0x705, "00")
#: 10 s of another node, and 2 s of the one that is reset
TWO_NODES = [*heartbeats(0, 10, 6), *heartbeats(0, 2)]


@pytest.mark.parametrize(("frames", "rules"), [
    ([RESET], ["no-boot-up"]),
    ([(0x000, "8200")], ["no-boot-up", "no-boot-up"]),
    ([RESET, RESET], ["no-boot-up"]),
    ([RESET, BOOT_UP], []),
    ([RESET, RESET, BOOT_UP, BOOT_UP], []),
    ([RESET, RESET, BOOT_UP, BOOT_UP, BOOT_UP], ["boot-up-in-operation"]),
    ([RESET, (0x705, "7F")], []),
    ([RESET, (0x185, "00")], []),
    ([RESET, (0x085, "0010000000000000")], ["emergency-not-reset"]),
    ([(0x000, "8107")], ["heartbeat-stops"]),
])  # fmt: skip
def test_each_reset_has_its_boot_up(frames: list[tuple[int, str]], rules: list[str]) -> None:
    others = [(at_s, can_id, data) for at_s, can_id, data in TWO_NODES if frames[0] != (0x000, "8200") or at_s < 2]
    planted = [(2.01 + number / 100, *frame) for number, frame in enumerate(frames)]
    end = [(10.0, 0x080, "")]
    assert [rule for rule, _ in findings([*others, *planted, *end])] == rules


def test_a_node_may_start_when_the_recording_ends() -> None:
    assert findings([*heartbeats(0, 2), (2.05, 0x000, "8105"), *heartbeats(0, 4, 6)]) == []


SESSION = (
    "-n 5 nmt start", "-n 5 pdo", "-n 5 set tpdo1 --timer 50", "-n 5 read 1018", "-n 5 nmt reset-node",
    "-n 5 disable tpdo1",
)  # fmt: skip


#: how long an answer or a heartbeat (each 0.5 s or faster) may take on a machine that has time (s)
_QUICK_S, _IN_TIME_S = 0.3, 1.0


def was_slow(path: Path) -> bool:
    """Whether a client, a node or the recorder waited for the processor: what it did then is no healthy session."""
    asked_s = heartbeat_s = None
    for frame in read_recording(path):
        service, at_s = frame.can_id & 0x780, frame.timestamp_s
        if service == 0x600 and frame.data[:1] == b"\x80":
            return True
        if asked_s is not None and service == 0x580 and at_s - asked_s > _QUICK_S:
            return True
        if service == 0x700 and heartbeat_s is not None and at_s - heartbeat_s > _IN_TIME_S:
            return True
        asked_s = at_s if service == 0x600 else None if service == 0x580 else asked_s
        heartbeat_s = None if frame.can_id == 0 else at_s if service == 0x700 else heartbeat_s
    return False


@pytest.mark.parametrize("family", FAMILIES)
def test_a_recorded_session_has_no_problem(tmp_path: Path, family: str) -> None:
    """On a busy machine a session may have real time-outs: then it is run again."""
    for number in range(5):
        folder = tmp_path / str(number)
        folder.mkdir()
        record_session(folder, family)
        done = dvtcli("check", str(folder / "run.log"))
        if done.returncode == 0 or not was_slow(folder / "run.log"):
            break
    assert (done.returncode, "error: " in done.stdout or "warning: " in done.stdout) == (0, False), done.stdout


@pytest.mark.parametrize("family", ["coupler", "mpdo", "safety"])
def test_a_device_that_sends_what_others_do_not_has_no_problem(tmp_path: Path, family: str) -> None:
    """Multiplexed PDOs and SRDOs are no faults."""
    log = tmp_path / "run.log"
    script = tmp_path / "record.dvt"
    script.write_text(f"nmt start\nlog {log} --for 1\n", encoding="utf-8")
    moving = ("--signal", "2000:1=ramp(0,99,1s)") if family == "mpdo" else ()
    assert dvtcli("--sim", family, *moving, "--yes", "run", str(script)).returncode == 0
    done = dvtcli("--eds", family, "check", str(log))
    sent = {frame.can_id for frame in read_recording(log)}
    assert {"mpdo": {0x181}, "safety": {0x101, 0x102}}.get(family, {0x701}) <= sent
    assert (done.returncode, "error: " in done.stdout or "warning: " in done.stdout) == (0, False), done.stdout


def record_session(tmp_path: Path, family: str) -> None:
    """Start, read, change, reset and change a node again, while its bus is recorded into `run.log`.

    A served bus holds frames back for half a second from a client that only listens (`hub_client.HOLD_S`).
    """
    with served(tmp_path, f"{family}@5") as server:
        process = subprocess.Popen(
            [sys.executable, "-m", "dvtcli", *bus_words(server.port), "log", "run.log"],
            stdout=subprocess.PIPE, stderr=subprocess.PIPE, encoding="utf-8",
            env=own_environment(tmp_path), cwd=tmp_path,
        )  # fmt: skip
        try:
            assert process.stderr is not None
            assert any("Ctrl-C ends it" in line for line in iter(process.stderr.readline, ""))
            for line in SESSION:
                done = server.dvtcli("--yes", *line.split())
                assert done.returncode == 0, done.stderr
            end_s = time.monotonic() + PATIENCE_S
            while not (tmp_path / "run.log").stat().st_size and time.monotonic() < end_s:
                time.sleep(0.05)
            process.send_signal(signal.SIGINT)
            out, err = process.communicate(timeout=PATIENCE_S)
            assert re.search(r"run\.log: [1-9][0-9]* frames", out), (out, err, process.returncode)
        finally:
            process.kill()


def test_a_full_bus_is_found_if_its_bit_rate_is_known(tmp_path: Path) -> None:
    """Of the network file, or of --at; without one the load is not judged, and not counted as judged."""
    busy = at_times(every(0.0004, 2.0, 2.5), 0x3C0, *(f"{n:02X}" * 8 for n in range(7)))
    path = recorded(tmp_path / "run.log", [*HEALTHY, *busy, *at_times(every(0.0004, 0.0, 4.0), 0x080, "")])
    counted = []
    for words in ((), ("--at", "250000"), ("--at", "1000000")):
        (report,) = documents(dvtcli("check", str(path), "--json", *words).stdout)[0]["files"]
        counted.append((report["rules"], [found["text"] for found in report["findings"]]))
    without, full, wide = counted
    assert without == (len(RECORDING_RULES), [])
    assert (full[0], wide) == (without[0] + 1, (without[0] + 1, []))
    (text,) = full[1]
    assert re.fullmatch(r"frames took up to 1\d\d% of the bit rate in 0.1 s, stuff bits aside", text)
    shown = dvtcli("check", str(path), "--at", "250000").stdout
    assert "check first: whether the bit rate is right" in shown


@pytest.mark.parametrize(("line", "is_found"), [("rpdo: {1: {cob_id: 0x205, enabled: true}}", True), ("", False)])
def test_an_rpdo_of_the_network_file_is_missed_if_the_file_names_it(tmp_path: Path, line: str, is_found: bool) -> None:
    """Those that the device has enabled by itself may be meant for nothing."""
    (tmp_path / "net.yaml").write_text(f"drive:\n  node_id: 5\n  profile: gen4\n  {line}\n")
    frames = [*heartbeats(0, 4), *at_times(every(0.1, 0.05, 4), 0x3C5, "00")]
    path = recorded(tmp_path / "run.log", frames)
    done = dvtcli("check", str(path), "-d", str(tmp_path / "net.yaml"))
    assert ("RPDO1 of node 5 is 0x205, which no node transmits" in done.stdout) is is_found, done.stdout + done.stderr
    path = recorded(tmp_path / "sent.log", [*frames, *at_times(every(0.1, 0.05, 4), 0x205, "00" * 8)])
    done = dvtcli("check", str(path), "-d", str(tmp_path / "net.yaml"))
    assert "rpdo-not-sent" not in done.stdout


def answers(first_s: float, last_s: float) -> Planted:
    """SDO responses of node 5 to reads of 1001."""
    return [
        row for n in range(int(10 * first_s), int(10 * last_s)) for row in read(n / 10, "1001:00", "4FPLACE00000000")
    ]


@pytest.mark.parametrize(
    ("frames", "is_found"),
    [
        (pdos(0, 4), True),  # its TPDOs alone
        ([(0.0, 0, "0100"), *answers(0.1, 4)], True),  # NMT start, and what shows that it is there
        ([(0.0, 0, "0105"), *answers(0.1, 4)], True),
        ([(0.0, 0, "0106"), *answers(0.1, 4)], False),  # another node is started
        ([(0.0, 0, "0100"), (0.5, 0, "8005"), *answers(0.1, 4)], False),  # PRE-OPERATIONAL again
        ([(0.0, 0, "0100"), (0.5, 0x705, "00"), *answers(0.6, 4)], False),  # it restarted
        ([(0.0, 0, "0100"), *heartbeats(0, 4, state=0x7F), *answers(0.1, 4)], False),  # its heartbeat denies it
        ([(0.0, 0, "0100"), *syncs(0, 4)], False),  # nothing of the node
        (answers(0, 4), False),
        (pdos(0, 1), False),  # too short
    ],
)
def test_an_rpdo_is_missed_of_a_node_that_is_operational_by_whatever_shows_it(
    tmp_path: Path, frames: Planted, is_found: bool
) -> None:
    (tmp_path / "net.yaml").write_text(
        "drive:\n  node_id: 5\n  profile: gen4\n  rpdo: {1: {cob_id: 0x205, enabled: true}}\n"
    )
    path = recorded(tmp_path / "run.log", frames)
    done = dvtcli("check", str(path), "-d", str(tmp_path / "net.yaml"), "--rule", "rpdo-not-sent")
    assert ("RPDO1 of node 5 is 0x205, which no node transmits" in done.stdout) is is_found, done.stdout + done.stderr
    assert done.returncode == (3 if is_found else 0)


def test_a_recording_without_the_nodes_of_the_network_file_says_so(tmp_path: Path) -> None:
    net = tmp_path / "net.yaml"
    net.write_text(
        "a: {node_id: 5, profile: gen4, tpdo: {1: {cob_id: 0x3C5, enabled: true}}}\nb: {node_id: 6, profile: gen4}\n"
    )
    for frames, unseen, said in (
        (syncs(0, 1), [5, 6], "no node of the network file sent anything, so nothing of them was checked"),
        ([*syncs(0, 1), *pdos(0, 1, can_id=0x205)], [5, 6], "no node of the network file sent anything"),
        ([*syncs(0, 1), *pdos(0, 1, "1122", 0x3C5)], [6], "no problem; node 6 of the network file sent nothing"),
        ([*heartbeats(0, 1), *heartbeats(0, 1, 6)], [], "no problem"),
    ):
        path = recorded(tmp_path / "run.log", frames)
        done = dvtcli("check", str(path), "-d", str(net))
        assert done.returncode == 0, done
        assert said in done.stdout
        assert ("no problem" in done.stdout) is (unseen != [5, 6])
        (report,) = documents(dvtcli("check", str(path), "-d", str(net), "--json").stdout)[0]["files"]
        assert report["unseen"] == unseen
    assert documents(dvtcli("check", str(path), "--json").stdout)[0]["files"][0]["unseen"] == []


def test_an_emergency_that_comes_again_and_again_is_one_finding(tmp_path: Path) -> None:
    """With the number of its messages, the first and the last time, and the frames; another code is another one."""
    again = [
        frame for number in range(21)
        for frame in ((number / 10 + 0.501, 0x085, "1082010000000000"), (number / 10 + 0.502, 0x085, "00" * 8))
    ]  # fmt: skip
    other = [(3.001, 0x085, "1081010000000000"), (3.002, 0x085, "00" * 8)]
    path = recorded(tmp_path / "run.log", [*again, *other])
    (report,) = documents(dvtcli("check", str(path), "--json").stdout)[0]["files"]
    many, single = report["findings"]
    assert ("0x8210" in many["text"], many["times"], many["frames"]) == (True, 21, list(range(1, 20, 2)))
    assert many["first"][-10:] < many["last"][-10:]
    assert ("0x8110" in single["text"], single["times"], single["frames"]) == (True, 1, [43])
    shown = dvtcli("check", str(path)).stdout
    assert shown.count("EMCY 0x8210") == 1
    assert re.search(r"21 times, at 0\.000 s to 2\.000 s", shown), shown


def test_names_and_mappings_are_of_the_eds(tmp_path: Path) -> None:
    path = recorded(tmp_path / "run.log", [*heartbeats(0, 2), *write(1.0, "1017:00", "6400", "22000008"), *pdos(0, 2)])
    done = dvtcli("--eds", "gen4", "-n", "5", "check", str(path), "--json")
    (report,) = documents(done.stdout)[0]["files"]
    assert {found["rule"] for found in report["findings"]} == {"refused-write", "pdo-other-length"}, done.stdout
    assert "the mapping in gen4.eds has" in next(
        found["text"] for found in report["findings"] if found["rule"] == "pdo-other-length"
    )


def test_channels_are_judged_by_themselves(tmp_path: Path) -> None:
    text = "".join(
        f"({BEGIN_S + at_s:.6f}) can{number % 2} {can_id:03X}#{data.replace(' ', '')}\n"
        for number, (at_s, can_id, data) in enumerate(sorted([*pdos(0, 4, "11"), *[
            (at_s + 0.01, can_id, "1122") for at_s, can_id, _ in pdos(0, 4)]]))
    )  # fmt: skip
    (tmp_path / "two.log").write_text(text)
    assert dvtcli("check", str(tmp_path / "two.log")).returncode == 0
    (tmp_path / "one.log").write_text(text.replace("can1", "can0"))
    assert dvtcli("check", str(tmp_path / "one.log")).returncode == 3


def test_reports_for_ci(tmp_path: Path) -> None:
    path = recorded(tmp_path / "run.log", PLANTED["refused-write"][0])
    junit = dvtcli("check", str(path), "--format", "junit")
    suites = ET.fromstring(junit.stdout)  # noqa: S314 - ours
    assert (junit.returncode, suites.get("tests"), suites.get("failures")) == (3, str(len(RECORDING_RULES)), "1")
    github = dvtcli("check", str(path), "--format", "github")
    assert github.stdout.startswith(f"::error file={path},line=")
    sarif = json.loads(dvtcli("check", str(path), "--format", "sarif").stdout)
    assert [found["ruleId"] for found in sarif["runs"][0]["results"]] == ["refused-write"]


@pytest.mark.parametrize(("words", "code", "says"), [
    (["cut.log"], 4, "damaged after"),
    (["absent.log"], 2, "No such file"),
    (["run.log", "net.yaml"], 2, "run.log is a recording"),
    (["run.log", "--rule", "no-such"], 2, "unknown rule 'no-such' about recordings"),
    (["net.yaml", "-d", "net.yaml"], 2, "--dbc: for recordings only"),
    (["run.log", "--live"], 2, "--live: not for a recording"),
])  # fmt: skip
def test_what_cannot_be_checked_is_said(tmp_path: Path, words: list[str], code: int, says: str) -> None:
    recorded(tmp_path / "run.log", HEALTHY)
    (tmp_path / "cut.log").write_text((tmp_path / "run.log").read_text() + "(1.0) can0 281#XY\n")
    (tmp_path / "net.yaml").write_text("n5:\n  node_id: 5\n")
    done = dvtcli("check", *words, cwd=tmp_path)
    assert (done.returncode, says in done.stderr) == (code, True), done.stderr + done.stdout


def test_each_of_several_recordings_is_judged(tmp_path: Path) -> None:
    """A missing or damaged one keeps no other from that."""
    recorded(tmp_path / "good.log", HEALTHY)
    recorded(tmp_path / "bad.log", PLANTED["refused-write"][0])
    (tmp_path / "cut.log").write_text((tmp_path / "good.log").read_text() + "(1.0) can0 281#XY\n")
    done = dvtcli("check", "none.log", "bad.log", "cut.log", "good.log", cwd=tmp_path)
    assert done.returncode == 4, done.stderr
    damaged = f"cut.log:{len(HEALTHY) + 1}: error: damaged after"
    for text in ("none.log: error: No such file", "[refused-write]", damaged, "good.log: 1"):
        assert text in done.stdout, done.stdout
    missing = dvtcli("check", "none.log", "good.log", "--json", cwd=tmp_path)
    files = documents(missing.stdout)[0]["files"]
    assert (missing.returncode, files[0]["findings"][0]["rule"], files[1]["findings"]) == (2, "recording-file", [])
    assert files[0]["findings"][0]["first"] is None
    assert files[0]["rules"] == 1, "nothing else was looked at"
    github = dvtcli("check", "none.log", "good.log", "--format", "github", cwd=tmp_path)
    assert "::error file=none.log,line=1,title=recording-file::No such file" in github.stdout
    wrong = dvtcli("check", "good.log", "bad.log", "-d", "none.yaml", cwd=tmp_path)
    assert (wrong.returncode, "none.yaml" in wrong.stderr) == (2, True)


def test_standard_input_is_checked(tmp_path: Path) -> None:
    path = recorded(tmp_path / "run.log", PLANTED["refused-write"][0])
    done = dvtcli("check", "-", stdin=path.read_text())
    assert (done.returncode, "[refused-write]" in done.stdout) == (3, True), done.stderr


_CANDUMP = "  can0  705   [1]  05\n  can0  085   [8]  20 30 81 00 00 00 00 00\n"


@pytest.mark.parametrize("name", ["pasted.txt", "pasted", "pasted.dump"])
def test_a_recording_is_known_by_its_content(name: str, tmp_path: Path) -> None:
    """As `decode` knows it, whatever it is called."""
    (tmp_path / name).write_text(_CANDUMP, "ascii")
    assert dvtcli("decode", name, cwd=tmp_path).returncode == 0
    checked = dvtcli("check", name, "--json", cwd=tmp_path)
    assert checked.stdout, checked.stderr
    assert documents(checked.stdout)[0]["schema"] == "dvtcli.recording-check/1", checked
    (tmp_path / "press.yaml").write_text("nodes:\n  drive: {node_id: 5, profile: gen4}\n", "utf-8")
    mixed = dvtcli("check", "press.yaml", name, cwd=tmp_path)
    assert (mixed.returncode, f"{name} is a recording, and others are not" in mixed.stderr) == (2, True)


def test_another_file_is_named(tmp_path: Path) -> None:
    (tmp_path / "drive.txt").write_text("[FileInfo]\nFileName=drive.eds\n")
    done = dvtcli("check", "drive.txt", cwd=tmp_path)
    assert (done.returncode, "neither a recording nor a network file: it is an EDS" in done.stderr) == (2, True)


def test_frames_without_times_are_judged_without_them(tmp_path: Path) -> None:
    """As candump prints them: which rules need times is said."""
    (tmp_path / "run.txt").write_text(_CANDUMP, "ascii")
    done = dvtcli("check", "run.txt", cwd=tmp_path)
    assert (done.returncode, "[emergency-not-reset]" in done.stdout) == (3, True), done.stderr
    assert "have no times: delays, periods, missing frames and the load were not checked" in done.stderr


def test_a_network_file_is_one_whatever_it_is_called(tmp_path: Path) -> None:
    (tmp_path / "press.txt").write_text("nodes:\n  drive: {node_id: 5, profile: gen4}\n", "utf-8")
    checked = dvtcli("check", "press.txt", cwd=tmp_path)
    assert "press.txt: 1 node" in checked.stdout, checked
    missing = dvtcli("check", "none.txt", cwd=tmp_path)
    assert (missing.returncode, "none.txt: No such file" in missing.stderr) == (2, True)
