"""All rules about recordings, and their evaluation in one pass over the frames."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping
from functools import partial

from dvtcli.domain.can_ids import EMCY_BASE, HEARTBEAT_BASE, NMT_ID, SDO_REQUEST_BASE, SDO_RESPONSE_BASE, SYNC_ID
from dvtcli.domain.lint import ERROR, WARNING, LintRule
from dvtcli.domain.objects import SDO_SERVERS
from dvtcli.domain.pdo import PdoCommunicationParameter
from dvtcli.domain.ports import Frame
from dvtcli.domain.text import plural
from dvtcli.watch.decoder import Address, Layout, server_layouts
from dvtcli.watch.recording_checks.frame_problems import (
    FRAME_RULES,
    MASTER_RULES,
    RPDO_RULES,
    AnswerProblems,
    LengthProblems,
    MasterProblems,
    NodePdo,
    RecordedMappings,
    RpdoProblems,
)
from dvtcli.watch.recording_checks.node_problems import NODE_RULES, NodeProblems
from dvtcli.watch.recording_checks.problems import Moment, Problem, TimesOf, joined
from dvtcli.watch.recording_checks.sdo_problems import SDO_RULES, SdoProblems
from dvtcli.watch.recording_checks.stream_problems import STREAM_RULES, KnownTpdos, StreamProblems
from dvtcli.watch.sdo_transfers import SdoTransfers, is_boot_up

ERROR_FRAMES = LintRule(
    "error-frames", WARNING, "error frames were recorded", "ISO 11898-1: error flags; wiring, termination, bit rate"
)
#: of a file that cannot be read, if others can
UNREADABLE = LintRule("recording-file", ERROR, "the recording cannot be read", "the formats of recordings")
RECORDING_RULES: tuple[LintRule, ...] = (
    *SDO_RULES, *NODE_RULES, *FRAME_RULES, *RPDO_RULES, *MASTER_RULES, *STREAM_RULES, ERROR_FRAMES,
)  # fmt: skip
#: services of each node that need no more than its node-ID, by the function code of their default CAN-IDs
_OF_NODES = frozenset({EMCY_BASE, HEARTBEAT_BASE})
#: name of each node's default SDO server
_DEFAULT = "SDO"
_PDOS, _TPDO = range(0x180, 0x580), 0x080
#: EMCY, TPDO1 to TPDO4, SDO response and heartbeat of a node, each plus its node-ID
_SENT_BASES = (0x080, 0x180, 0x280, 0x380, 0x480, 0x580, 0x700)
_Watch = Callable[[Moment, Frame], None]


class RecordingCheck:
    """Checks the frames of one bus in order.

    *layout_of* a frame is what its sender maps; *name_of* node-ID, index and sub-index is an object's name, or empty.
    *rpdos* are the RPDOs that a file describes, with their CAN-IDs, *tpdos* its TPDOs with their parameters; *bit_rate*
    is the bus's (bit/s), None: unknown.
    """

    def __init__(
        self, layout_of: Callable[[Frame], Layout], name_of: Callable[[int, int, int], str],
        rpdos: Mapping[NodePdo, Address] | None = None, bit_rate: int | None = None,
        tpdos: Mapping[NodePdo, PdoCommunicationParameter] | None = None,
    ) -> None:  # fmt: skip
        self._layout_of = layout_of
        self._nodes, self._mappings = NodeProblems(), RecordedMappings()
        self._lengths = LengthProblems(layout_of, self._mappings)
        self._sdo, self._answers = SdoProblems(name_of, self._nodes), AnswerProblems(self._nodes)
        self._masters = MasterProblems()
        self._rpdos, self._streams = RpdoProblems(rpdos or {}), StreamProblems(bit_rate)
        self._tpdos, self._transfers = KnownTpdos(tpdos or {}), SdoTransfers()
        self._senders = {
            (told.cob_id.can_id, told.cob_id.extended): node_id for (node_id, _), told in (tpdos or {}).items()
        }
        self._last: Moment | None = None
        self._errors: TimesOf[str] = TimesOf()
        self._watches: dict[Address, _Watch] = {}
        self._servers: dict[Address, Layout] = {}

    def take(self, number: int, frame: Frame) -> None:
        """Look at *frame*, which has this *number* in its recording."""
        moment, address = Moment(number, frame.timestamp_s), (frame.can_id, frame.extended)
        watch = self._watches.get(address)
        if watch is None:
            layout = self._servers.get(address) or self._layout_of(frame)
            watch = self._watches[address] = self._watch_of(address, layout)
        watch(moment, frame)
        self._lengths.take(moment, frame)
        self._streams.take(moment, frame)
        self._last = moment

    def _watch_of(self, address: Address, layout: Layout) -> _Watch:
        """Return what looks at the frames of *address*; default CAN-IDs go before other *layout*s than SDO servers."""
        service, (can_id, extended) = layout.service, address
        function, node_id = (-1, 0) if extended else (can_id & 0x780, can_id & 0x7F)
        name, _, way = service.label.partition(" ")
        if service.kind == "sdo" and service.node is not None and name != _DEFAULT:
            return partial(self._take_sdo, (service.node, name), request=way == "request")
        if can_id == NMT_ID and not extended:
            return self._take_command
        if function in (SDO_RESPONSE_BASE, SDO_REQUEST_BASE) and node_id:
            return partial(self._take_sdo, (node_id, _DEFAULT), request=function == SDO_REQUEST_BASE)
        if function in _OF_NODES:
            return self._take_sync if can_id == SYNC_ID else self._take_of_node
        if service.kind == "pdo" or function in _PDOS:
            sender = node_id if function in _PDOS and function & _TPDO else 0
            return partial(self._take_pdo, self._senders.get(address, sender))
        return _nothing

    def _take_command(self, moment: Moment, frame: Frame) -> None:
        self._nodes.take(moment, frame, self._last or moment)
        self._masters.take_command(moment, frame.data)

    def _take_sync(self, moment: Moment, frame: Frame) -> None:
        self._nodes.take(moment, frame, self._last or moment)
        self._streams.take_sync()

    def _take_of_node(self, moment: Moment, frame: Frame) -> None:
        self._nodes.take(moment, frame, self._last or moment)
        if is_boot_up(frame):
            node_id = frame.can_id & 0x7F
            self._transfers.drop(node_id)
            self._sdo.start(node_id)
            self._answers.start(node_id)
            self._masters.start(node_id)
            self._mappings.start(moment, node_id)

    def _take_sdo(self, channel: tuple[int, str], moment: Moment, frame: Frame, *, request: bool) -> None:
        if channel[1] == _DEFAULT:
            self._nodes.take(moment, frame, self._last or moment)
        if frame.remote:
            return
        step = self._transfers.take(channel, frame.data, request=request)
        self._sdo.take(moment, channel, frame.data, step, request=request)
        is_other = self._masters.take_sdo(moment, channel, step, request=request)
        self._answers.take(moment, channel, frame.data, step, request=request, is_other=is_other)
        self._rpdos.take(moment, channel[0], step)
        self._mappings.take(moment, channel[0], step)
        self._tpdos.take(channel[0], step)
        if step.step == "done" and step.place is not None and step.place[0] in SDO_SERVERS:
            servers = server_layouts(channel[0], {step.place: int.from_bytes(step.data, "little")})
            self._servers |= servers
            for address in servers:
                self._watches.pop(address, None)

    def _take_pdo(self, sender: int, moment: Moment, frame: Frame) -> None:
        if frame.remote:
            return
        if sender:
            self._nodes.take_pdo(moment, sender)
        self._streams.take_pdo(moment, frame)

    def take_error(self, number: int, time_s: float) -> None:
        """Look at an error frame, which has this *number* in its recording."""
        self._errors.note(Moment(number, time_s), "")

    def has_sent(self, node_id: int) -> bool:
        """Tell whether a frame so far is of node *node_id*: by its TPDOs in the file, else by the default CAN-IDs."""
        of_node = {(base + node_id, False) for base in _SENT_BASES}
        own = {address for address in of_node if self._senders.get(address, node_id) == node_id}
        own |= {address for address, sender in self._senders.items() if sender == node_id}
        return not own.isdisjoint(self._lengths.sent)

    def problems(self) -> Iterator[Problem]:
        """Return the problems in the frames so far, each once with all its moments."""
        return joined(self._problems())

    def _problems(self) -> Iterator[Problem]:
        if self._last is not None:
            yield from self._sdo.problems(self._last)
            yield from self._nodes.problems(self._last)
            yield from self._answers.problems(self._last)
            yield from self._masters.problems()
            yield from self._lengths.problems()
            yield from self._rpdos.problems(self._lengths.sent, self._nodes)
            yield from self._streams.problems(self._tpdos.event_driven())
        for moments in self._errors.values():
            yield Problem(
                ERROR_FRAMES, plural(moments.times, "error frame"), "all nodes",
                "wiring, termination, and a node with another bit rate", moments,
            )  # fmt: skip


def _nothing(_moment: Moment, _frame: Frame) -> None:
    """Look at no more than the frame's length."""
