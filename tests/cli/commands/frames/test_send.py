"""`send FRAME…`: what is asked about, what is sent, and what is said of it."""

from __future__ import annotations

from pathlib import Path

import pytest
from hypothesis import given
from hypothesis import strategies as st

from dvtcli.cli.view.answers.frame_lines import outcome_text
from dvtcli.domain.ports import Frame
from dvtcli.errors import BusUnavailable
from dvtcli.operations.frames.send_frames import send_frames
from dvtcli.operations.session.session import Session
from dvtcli.operations.user.options import Options
from dvtcli.operations.user.session_user import NullReporter
from dvtcli.simulator.network.family_file import family_eds
from dvtcli.watch.frame_effect import Parties, effects
from dvtcli.watch.statistics import Lateness
from tests.cli.commands.bench import Bench
from tests.drawn_frames import drawn
from tests.small_eds import U8, U32, Eds, var
from tests.virtual_time import VirtualTimeBus

FRAMES = drawn(st.integers(0, 0x7FF), st.binary(max_size=8), remote=st.booleans())


def sent_by(bench: Bench) -> list[tuple[float, Frame]]:
    """What is sent from now on besides SDO of our own reading, with the bus's time."""
    found: list[tuple[float, Frame]] = []
    bus = bench.session.open_network().bus

    def note(frame: Frame, ours: bool) -> None:
        if ours and frame.can_id not in range(0x601, 0x680):
            found.append((bus.now_s(), frame))

    bus.tap(note)
    return found


@given(FRAMES)
def test_a_service_is_always_asked_about(frame: Frame) -> None:
    """Whatever its bytes are, a CAN-ID of a service, or of the pre-defined connection set, is said to have effects."""
    said = effects(frame, Parties())
    is_free = frame.can_id in (*range(0x001, 0x080), *range(0x101, 0x181), *range(0x680, 0x701), *range(0x780, 0x800))
    is_function_alone = frame.can_id % 0x80 == 0 and frame.can_id not in (0x000, 0x080, 0x100)
    is_lss = frame.can_id in (0x7E4, 0x7E5)
    is_pdo = 0x181 <= frame.can_id < 0x580
    expected = is_lss or not (is_free or is_function_alone or (is_pdo and frame.remote))
    assert bool(said) is expected


@pytest.mark.parametrize(
    ("frame", "why"),
    [
        ("000#0100", "NMT start: all nodes go to OPERATIONAL"),
        ("000#8101", "node 1 goes through a restart"),
        ("080#", "SYNC"),
        ("100#000000000000", "TIME"),
        ("085#1081010000000000", "EMCY of node 5"),
        ("301#102700000000", "received by RPDO2 of node 1"),
        ("181#1027", "sent by TPDO1 of node 1"),
        ("205#1027", "received by RPDO1 of node 5 by the pre-defined connection set"),
        ("601#4018100000000000", "SDO request to node 1: it reads"),
        ("601#2B17100007000000", "SDO request to node 1: it writes"),
        ("581#4018100000000000", "SDO answer of node 1"),
        ("705#05", "heartbeat of node 5"),
        ("701#R", "node guarding of node 1"),
        ("7E5#0401000000000000", "LSS"),
    ],
)
def test_what_nodes_act_on_needs_consent(frame: str, why: str) -> None:
    with Bench() as bench:
        sent = sent_by(bench)
        ran = bench.run(f"send {frame}")
        assert (ran.code, sent) == (6, []), ran.stderr
        assert why in ran.stderr
        assert "--yes" in ran.stderr


@pytest.mark.parametrize("frame", ["7A0#1027", "201#1027", "18FF0102#00", "181#R"])
def test_what_nobody_acts_on_is_just_sent(frame: str) -> None:
    """RPDO1 of the Gen4 has 0x201 and is off; a remote frame carries nothing."""
    with Bench() as bench:
        sent = sent_by(bench)
        ran = bench.run(f"send {frame} --json")
        assert (ran.code, ran.document["sent"]) == (0, 1), ran.stderr
        assert [one.can_id for _, one in sent] == [int(frame.partition("#")[0], 16)]


@pytest.fixture
def moved(tmp_path: Path) -> str:
    """A device whose EMCY and SDO servers are not where the pre-defined connection set has them."""
    eds = Eds()
    eds.variable(0x1014, var("COB-ID EMCY", U32, 0x7B1))
    eds.record(0x1200, "SDO server 1", {1: var("Request", U32, 0x601, "ro"), 2: var("Answer", U32, 0x581, "ro")})
    eds.record(0x1201, "SDO server 2", {1: var("Request", U32, 0x6B2), 2: var("Answer", U32, 0x3B3)})
    eds.variable(0x1012, var("COB-ID TIME", U32, 0x800007B5))
    eds.record(
        0x1280, "SDO client 1", {1: var("Request", U32, 0x6C2), 2: var("Answer", U32, 0x7C2), 3: var("Server", U8, 9)}
    )
    eds.record(0x1281, "SDO client 2", {1: var("Request", U32, 0x80000000), 2: var("Answer", U32, 0x80000000)})
    eds.record(0x1283, "SDO client 4", {1: var("Request", U32, 0x2000B6B6), 2: var("Answer", U32, 0x7C3)})
    eds.record(0x1203, "SDO server 4", {1: var("Request", U32, 0x800007B4), 2: var("Answer", U32, 0x2000B5B5)})
    path = tmp_path / "moved.eds"
    path.write_text(eds.text(), "utf-8")
    return f"{path}@1"


@pytest.mark.parametrize(
    ("frame", "why"),
    [
        ("7B1#0010010000000000", "EMCY of node 1"),
        ("6B2#4018100000000000", "SDO2 request to node 1: it reads"),
        ("6B2#2B17100007000000", "SDO2 request to node 1: it writes"),
        ("3B3#4018100000000000", "SDO2 answer of node 1: whoever"),
        ("0000B5B5#4018100000000000", "SDO4 answer of node 1: whoever"),
        ("7B5#000000000000", "TIME: nodes set their clocks"),
        ("6C2#2B17100007000000", "SDO request to node 9: it writes"),
        ("7C2#4018100000000000", "SDO answer of node 9: whoever"),
        ("0000B6B6#4018100000000000", "SDO request: it reads"),
        ("7C3#4018100000000000", "SDO answer: whoever asks"),
    ],
)
def test_services_that_a_node_has_elsewhere_need_consent(frame: str, why: str, moved: str, tmp_path: Path) -> None:
    with Bench((moved,)) as bench:
        path = tmp_path / "run.log"
        path.write_text(f"(1.0) can0 {frame}\n", "utf-8")
        for line in (f"send {frame}", f"replay {path}"):
            sent = sent_by(bench)
            ran = bench.run(line)
            assert (ran.code, why in ran.stderr, sent) == (6, True, []), ran.stderr


def test_a_service_that_is_off_is_none(moved: str) -> None:
    with Bench((moved,)) as bench:
        assert bench.run("send 7B4#00").code == 0


def test_time_that_a_node_neither_takes_nor_sends_is_none(tmp_path: Path) -> None:
    eds = Eds()
    eds.variable(0x1012, var("COB-ID TIME", U32, 0x7B5))
    path = tmp_path / "no_time.eds"
    path.write_text(eds.text(), "utf-8")
    with Bench((f"{path}@1",)) as bench:
        assert bench.run("send 7B5#00").code == 0


def test_a_dry_run_sends_nothing() -> None:
    with Bench() as bench:
        sent = sent_by(bench)
        ran = bench.run("send 000#0101 7A0#00 --every 10ms --for 1s --dry-run --yes --json")
        assert (ran.code, sent) == (0, [])
        assert (ran.document["dry_run"], ran.document["wanted"], ran.document["handed_over"]) == (True, 200, 0)


def test_it_is_sent_each_so_often() -> None:
    with Bench() as bench:
        sent = sent_by(bench)
        ran = bench.run("send 7A0#01 7A1#02 --every 250ms --for 1s --json")
        assert ran.code == 0
        began_s = sent[0][0]
        assert [(round(at_s - began_s, 6), one.can_id) for at_s, one in sent] == [
            (n / 4, can_id) for n in range(4) for can_id in (0x7A0, 0x7A1)
        ]
        assert ran.document["late_max_ms"] == 0
        assert bench.run("send 7A0#01 --count 3 --json").document["sent"] == 3


def test_a_can_id_without_a_sign_of_data_is_no_empty_frame() -> None:
    with Bench() as bench:
        sent = sent_by(bench)
        ran = bench.run("send 7A0")
        assert (ran.code, sent) == (2, [])
        assert "7A0#" in ran.stderr
        assert bench.run("send 7A0#").code == 0
        assert [frame for _, frame in sent] == [Frame(0x7A0, b"")]


def test_what_has_no_end_is_not_counted_to_it() -> None:
    told: list[tuple[str, int, int]] = []

    class Broken(NullReporter):
        """Breaks off when it is told how far it is."""

        def progress(self, text: str, done: int, total: int) -> None:
            if "sent" in text:
                told.append((text, done, total))
                session.cancellation.asked(130, insists=False)

    with Session(Options(sim=("generic",)), Broken()) as session:
        result = send_frames(session, ["7A0#11", "7A1#22"], 0.1)
    ((text, done, total),) = told
    assert (text, total) == (f"{done} frames sent", 0)
    assert outcome_text(result.outcome).startswith(f"{result.outcome.handed} frames sent")


def test_nmt_by_hand_is_nmt() -> None:
    """What was heard of the node's state is forgotten with the command, and the node obeys."""
    with Bench() as bench:
        assert bench.run("send 000#0101 --yes").code == 0
        assert bench.run("node --json").document["nodes"][0]["state"] == "OPERATIONAL"
        assert bench.run("send 000#0201 --yes").code == 0
        assert bench.run("read 1017").code == 6  # it was heard to be STOPPED


def test_an_sdo_by_hand_is_read_back() -> None:
    with Bench() as bench:
        assert bench.run("read 1017 --json").document["value"] != 7
        assert bench.run("send 601#2B17100007000000 --yes").code == 0
        assert bench.run("read 1017 --json").document["value"] == 7


def test_a_network_file_says_who_takes_it(tmp_path: Path) -> None:
    network = tmp_path / "press.yaml"
    network.write_text(
        "nodes:\n  drive:\n    node_id: 5\n    profile: gen4\n    rpdo:\n"
        "      1:\n        enabled: true\n        cob_id: 0x6A0\n"
        "        mapping: [0x6040]\n",
        "utf-8",
    )
    with Bench() as bench:
        ran = bench.run(f"send 6A0#0600 --dbc {network}")
        ran.failed(6, "received by RPDO1 of node 5")
        assert bench.run("send 6A0#0600").code == 0


def test_it_is_said_what_each_one_is() -> None:
    with Bench() as bench:
        said = bench.run("send 181#3706 601#2B17100007000000 --yes").stderr
        assert "181#3706  TPDO1, node 1: 6041:00 operation enabled (0x0637)" in said
        assert "write 1017:00 Producer heartbeat time = 7 ms" in said


def test_a_passcode_is_neither_shown_nor_kept() -> None:
    """A login that is sent as a frame is as secret as one that is written."""
    with Bench(("gen4-locked",)) as bench:
        line = "send 601#2B00500244440000 --yes"
        assert bench.session.is_secret(line)
        assert not bench.session.is_secret("send 601#2B17100007000000")
        sent = bench.session.open_network().bus
        received: list[Frame] = []
        sent.tap(lambda frame, ours: received.append(frame) if ours else None)
        for ran in (bench.run(line), bench.run(f"{line} --json")):
            assert ran.code == 0
            assert "4444" not in ran.stdout + ran.stderr
        assert [frame.data[4:6] for frame in received if frame.data[0] == 0x2B] == [b"DD", b"DD"]


@pytest.mark.parametrize(
    "line", ["7A0", "0x7A0 ", "185##1027", "185#102", "7A0#00 --count 2 --for 1s", "7A0#00 --every 0", "20000000#"]
)
def test_what_is_no_frame_is_exit_2(line: str) -> None:
    with Bench() as bench:
        sent = sent_by(bench)
        assert (bench.run(f"send {line} --yes").code, sent) == (2, [])


class Failing(VirtualTimeBus):
    """A bus that takes three frames of 0x7A0 and is full then."""

    taken = 0

    def send(self, frame: Frame) -> None:
        if frame.can_id == 0x7A0:
            self.taken += 1
            if self.taken > 3:
                raise BusUnavailable(f"{self.name} failed (send)", why="No buffer space available")
        super().send(frame)


class Complaining(VirtualTimeBus):
    """A bus on which nobody acknowledges: each frame of ours is answered by an error frame."""

    def send(self, frame: Frame) -> None:
        self.destroyed += 1
        super().send(frame)


def test_what_the_interface_did_not_take_is_not_counted() -> None:
    with Bench((), bus=Failing([], simulated=False)) as bench:
        ran = bench.run("send 7A0#00 --count 9 --json")
        assert (ran.code, ran.document["sent"], ran.document["wanted"]) == (5, 3, 9)
        assert "failed (send)" in ran.document["failure"]
    with Bench((), bus=Failing([], simulated=False)) as bench:
        said = bench.run("send 7A0#00 --count 9")
        assert "3 of 9 frames sent" in said.stdout
        assert "No buffer space available" in said.stderr


def test_frames_that_errors_followed_are_not_called_sent() -> None:
    with Bench((), bus=Complaining([], simulated=False)) as bench:
        ran = bench.run("send 7A0#00 --json")
        assert (ran.code, ran.document["sent"], ran.document["handed_over"]) == (1, None, 1)
    with Bench((), bus=Complaining([], simulated=False)) as bench:
        ran = bench.run("send 7A0#00")
        assert "1 frame handed to the interface" in ran.stdout
        assert "error frames were received" in ran.stderr


def test_on_a_bus_of_others_it_listens_for_who_takes_it() -> None:
    """A node that nobody named, and that is heard by its heartbeat alone, takes 0x301."""
    with Bench(("gen4@1",)) as simulated:
        devices = [node.device for node in simulated.session.open_network().bus.nodes]  # type: ignore[attr-defined]
        for device in devices:
            device.download(0x1017, 0, (500).to_bytes(2, "little"))
            device.download(0x1401, 1, (0x800006A0).to_bytes(4, "little"))
            device.download(0x1401, 1, (0x6A0).to_bytes(4, "little"))
        bus = VirtualTimeBus(devices, simulated=False)
        with Bench((), {"eds": str(family_eds("gen4"))}, bus=bus) as bench:
            ran = bench.run("send 6A0#000000000000")
            ran.failed(6, "RPDO2 of node 1")


@given(st.lists(st.floats(0, 10), min_size=1, max_size=50))
def test_lateness_is_never_said_too_small(times: list[float]) -> None:
    late = Lateness()
    for one in times:
        late.add(one)
    nearly = late.nearly_all_s()
    assert late.most_s == max(times)
    assert nearly is not None
    assert nearly <= max(times)
    assert sum(one <= nearly + 1e-12 for one in times) >= 0.99 * len(times)
