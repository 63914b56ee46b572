"""Operations from plain Python: a session made in one line, without click, words or a screen."""

from __future__ import annotations

import subprocess
import sys
from dataclasses import dataclass, field

import pytest

from dvtcli.domain.nmt import NmtCommand, NmtState
from dvtcli.domain.pdo import Direction, Pdo
from dvtcli.domain.ports import Frame
from dvtcli.domain.request import PdoRequest
from dvtcli.errors import SafetyRefusal, UsageError
from dvtcli.operations.changes.change import configure
from dvtcli.operations.changes.store_restore import restore_defaults, store_settings
from dvtcli.operations.pdos.edit_pdos import configure_from_text, pdo_as_text
from dvtcli.operations.results.frames import BusEvent
from dvtcli.operations.session.session import Session
from dvtcli.operations.user.options import Options, options_of
from tests.harness.sample import heavy

TPDO3 = Pdo(Direction.TPDO, 3)


def timer(milliseconds: int) -> dict[Pdo, PdoRequest]:
    return {TPDO3: PdoRequest(event_timer=milliseconds)}


@dataclass
class Heard:
    """A teller that keeps everything and answers with *answer*."""

    answer: bool | None = None
    notes: list[str] = field(default_factory=list)
    warnings: list[str] = field(default_factory=list)
    asked: list[str] = field(default_factory=list)
    frames: list[tuple[int, bool]] = field(default_factory=list)
    progressed: list[tuple[str, int, int]] = field(default_factory=list)
    unanswered: str = "nobody is asked"

    def note(self, text: str) -> None:
        self.notes.append(text)

    def warning(self, text: str) -> None:
        self.warnings.append(text)

    def bus(self, event: BusEvent) -> None:
        self.notes.append(repr(event))

    def instruct(self, text: str) -> None:
        self.notes.append(text)

    def ask(self, question: str) -> bool | None:
        self.asked.append(question)
        return self.answer

    def confirm(self, question: str, word: str) -> bool | None:
        self.asked.append(f"{question} {word}")
        return self.answer

    def progress(self, text: str, done: int, total: int) -> None:
        self.progressed.append((text, done, total))

    def traffic(self, frame: Frame, *, sent: bool, secret: slice | None) -> None:
        if frame.can_id != 0x701:  # its boot-up comes when it comes
            self.frames.append((frame.can_id, sent))


def test_a_change_is_made_remembered_and_stored() -> None:
    with Session(Options(sim=("gen4",))) as session:
        node = session.node()
        changed = configure(session, node, timer(50))
        assert [change.label for change in changed.plan.changes] == ["TPDO3"]
        assert node.pdo(TPDO3).communication.event_timer == 50
        assert store_settings(session, node, None).word == "store"
        assert session.record.lines == [(1, "set tpdo3 --timer 50"), (1, "store")]
        assert session.record.of(2) == []


def test_under_a_dry_run_the_twin_changes_only() -> None:
    with Session(Options(sim=("gen4",))) as session:
        before = session.node().pdo(TPDO3)
        with session.under(dry_run=True):
            assert configure(session, session.node(), timer(50)).dry_run
            assert session.node().pdo(TPDO3).communication.event_timer == 50
        assert session.node().pdo(TPDO3) == before
        with session.under(dry_run=True):
            assert session.node().pdo(TPDO3) == before, "each dry run has twins of its own"
        assert session.record.lines == []


def test_nobody_answers_unless_somebody_listens() -> None:
    with Session(Options(sim=("gen4",))) as session, pytest.raises(SafetyRefusal, match="no terminal to answer on"):
        restore_defaults(session, session.node(), None, prove=False)
    for answer in (False, True):
        received = Heard(answer)
        with Session(Options(sim=("gen4",)), received) as session:
            if answer:
                assert restore_defaults(session, session.node(), None, prove=False).exit_code == 0
            else:
                with pytest.raises(SafetyRefusal, match="the answer was no"):
                    restore_defaults(session, session.node(), None, prove=False)
        assert len(received.asked) == 1


def test_traffic_is_told_while_the_options_ask_for_it() -> None:
    received = Heard()
    with Session(Options(sim=("gen4",)), received) as session:
        node = session.node()
        node.sdo.upload(0x1000, 0)
        assert received.frames == []
        with session.under(verbose=1):
            node.sdo.upload(0x1000, 0)
        assert received.frames == [(0x601, True), (0x581, False)]
        node.sdo.upload(0x1000, 0)
        assert len(received.frames) == 2


def test_at_the_end_a_node_is_in_the_state_it_was_found_in() -> None:
    with Session(Options(sim=("gen4",), yes=True)) as session:
        node = session.node()
        session.bus.send_nmt(NmtCommand.START, 1)
        configure(session, node, timer(50))
        assert node.access.state() is NmtState.PRE_OPERATIONAL
        session.end_line(0)
        assert node.access.state() is NmtState.OPERATIONAL


def test_which_node_is_meant_must_be_said() -> None:
    with Session(Options(interface="virtual", channel="nobody-here")) as session, pytest.raises(UsageError):
        session.node()


@pytest.mark.parametrize(
    ("given", "said"),
    [
        ({"bitrate": 12}, "bit rates are 1000…1000000 bit/s"),
        ({"bitrate": "fast"}, "'fast' is not a bit rate"),
        ({"bitrate": "250"}, "did you mean 250k?"),
        ({"bitrate": "2M"}, "'2M' is not a bit rate"),
        ({"bitrate": "k"}, "'k' is not a bit rate"),
        ({"timeout": 0}, "a time-out is 0.001…600 seconds"),
        ({"node": 128}, "node-IDs are 1…127"),
        ({"format": "xml"}, "'xml' is not one of 'text', 'json', 'jsonl'"),
        ({"bus_kwargs": ("fd",)}, "a setting is KEY=VALUE"),
        ({"chanel": "can0"}, "unknown option 'chanel'"),
    ],
)
def test_options_are_checked_before_a_bus_is_touched(given: dict[str, object], said: str) -> None:
    with pytest.raises(UsageError, match=said):
        options_of(given)


def test_options_are_taken_as_a_command_line_takes_them() -> None:
    given = {"node": "0x10", "bitrate": "500000", "timeout": "0.2", "sim": ["gen4"], "channel": 0, "dry_run": True}
    assert options_of(given) == Options(node=16, bitrate=500_000, timeout=0.2, sim=("gen4",), channel="0", dry_run=True)


@pytest.mark.parametrize(
    ("typed", "rate"),
    [("250000", 250_000), (250_000, 250_000), ("250k", 250_000), ("250K", 250_000), ("1M", 1_000_000),
     ("125 kbit/s", 125_000), ("83333", 83_333)],
)  # fmt: skip
def test_a_bit_rate_is_written_in_bits_or_thousands_of_bits(typed: object, rate: int) -> None:
    assert options_of({"bitrate": typed}).bitrate == rate


@heavy
def test_plain_python_needs_neither_click_nor_a_terminal() -> None:
    code = (
        "import sys\n"
        "from dvtcli.operations.user.options import Options\n"
        "from dvtcli.operations.session.session import Session\n"
        "with Session(Options(sim=('generic',))) as session:\n"
        "    print(session.node().title)\n"
        "print(*sorted({'click', 'prompt_toolkit'} & set(sys.modules)))\n"
    )
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    assert done.stdout.splitlines()[1:] == [""]


def test_a_text_that_was_edited_meanwhile_takes_nothing_of_somebody_else_back() -> None:
    with Session(Options(sim=("generic",))) as session:
        seen = pdo_as_text(session, TPDO3)
        edited = seen.replace("event_timer_ms: 0", "event_timer_ms: 70")
        assert edited != seen
        session.wire.sdo(1).download(0x1802, 5, b"\x21\0")
        with pytest.raises(SafetyRefusal, match="changed after the editor was opened"):
            configure_from_text(session, TPDO3, edited, seen=seen)
        again = pdo_as_text(session, TPDO3)
        assert configure_from_text(
            session, TPDO3, again.replace("event_timer_ms: 33", "event_timer_ms: 70"), seen=again
        )
