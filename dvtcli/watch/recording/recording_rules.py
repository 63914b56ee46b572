"""All rules about recordings, and their evaluation in one pass over the frames."""

from __future__ import annotations

from collections.abc import Callable, Iterator

from dvtcli.domain.lint.lint_rule import WARNING, LintRule
from dvtcli.domain.ports import Frame
from dvtcli.domain.text import plural
from dvtcli.watch.decoder import Layout
from dvtcli.watch.heard_objects import is_boot_up
from dvtcli.watch.recording.frame_problems import FRAME_RULES, AnswerProblems, LengthProblems
from dvtcli.watch.recording.node_problems import NODE_RULES, NodeProblems
from dvtcli.watch.recording.problems import Moment, Problem, TimesOf
from dvtcli.watch.recording.sdo_problems import SDO_RULES, SdoProblems
from dvtcli.watch.sdo_transfers import SdoTransfers

ERROR_FRAMES = LintRule(
    "error-frames", WARNING, "error frames were recorded", "ISO 11898-1: error flags; wiring, termination, bit rate"
)
RECORDING_RULES: tuple[LintRule, ...] = (*SDO_RULES, *NODE_RULES, *FRAME_RULES, ERROR_FRAMES)
#: services by the function code of their default CAN-IDs
_SDO, _OF_NODES = frozenset({0x580, 0x600}), frozenset({0x000, 0x080, 0x580, 0x600, 0x700})
_TPDOS, _REQUESTS = frozenset({0x180, 0x280, 0x380, 0x480}), 0x600


class RecordingCheck:
    """Checks the frames of one bus in order.

    *layout_of* a frame is what its sender maps; *name_of* node-ID, index and sub-index is an object's name, or empty.
    """

    def __init__(self, layout_of: Callable[[Frame], Layout], name_of: Callable[[int, int, int], str]) -> None:
        self._sdo, self._answers = SdoProblems(name_of), AnswerProblems()
        self._nodes, self._lengths = NodeProblems(), LengthProblems(layout_of)
        self._transfers = SdoTransfers()
        self._last: Moment | None = None
        self._errors: TimesOf[str] = TimesOf()

    def take(self, number: int, frame: Frame) -> None:
        """Look at *frame*, which has this *number* in its recording."""
        moment = Moment(number, frame.timestamp_s)
        service = frame.can_id & 0x780
        if not frame.extended and service in _OF_NODES:
            self._nodes.take(moment, frame, self._last or moment)
            node_id = frame.can_id & 0x7F
            if is_boot_up(frame):
                self._transfers.forget(node_id)
                self._sdo.start(node_id)
                self._answers.start(node_id)
            elif service in _SDO and not frame.remote:
                step = self._transfers.take((node_id, "SDO"), frame.data, request=service == _REQUESTS)
                self._sdo.take(moment, frame, step)
                self._answers.take(moment, frame, step)
        elif not frame.extended and service in _TPDOS:
            self._nodes.take_pdo(frame.can_id & 0x7F)
        self._lengths.take(moment, frame)
        self._last = moment

    def take_error(self, number: int, time_s: float) -> None:
        """Look at an error frame, which has this *number* in its recording."""
        self._errors.note(Moment(number, time_s), "")

    def problems(self) -> Iterator[Problem]:
        """Return the problems in the frames so far."""
        if self._last is not None:
            yield from self._sdo.problems()
            yield from self._nodes.problems(self._last)
            yield from self._answers.problems(self._last)
            yield from self._lengths.problems()
        for moments in self._errors.values():
            yield Problem(
                ERROR_FRAMES, plural(moments.times, "error frame"), "all nodes",
                "wiring, termination, and a node with another bit rate", moments,
            )  # fmt: skip
