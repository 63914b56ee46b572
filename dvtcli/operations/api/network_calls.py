"""Use all nodes of a bus together: network files and links, as methods. Prints nothing."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Literal

from dvtcli.domain.network.network_config import Endpoint
from dvtcli.domain.pdo import Pdo
from dvtcli.domain.times import counts
from dvtcli.errors import UsageError
from dvtcli.operations.api.called_hints import errors_in_calls, in_calls
from dvtcli.operations.api.checks import (
    check_options,
    dbc_options,
    flags,
    number,
    path,
    refuse_recordings,
    whole,
    word,
    words,
    wrong,
)
from dvtcli.operations.network.network_load import LoadOptions, network_load
from dvtcli.operations.user.options import BIT_RATES, Options

if TYPE_CHECKING:
    from dvtcli.domain.store import ProveBy
    from dvtcli.operations.api.calls import Calls
    from dvtcli.operations.network.draw_network import PictureOptions
    from dvtcli.operations.results import NetworkApplied, NetworkLoad, NetworkPlanned, NetworksChecked
    from dvtcli.operations.session.session import Session

_END = "a TPDO of a node, such as '5:tpdo3' or 'drive:tpdo3', and its inhibit time in ms"


def load_options(
    for_s: float, bit_rate: int | None, sync_ms: float | None, inhibit_ms: Mapping[str, float] | None
) -> LoadOptions:
    """Convert the arguments of `Bus.load`; raises UsageError if invalid."""
    number("for_s", for_s, "a number of seconds, 0…3600", high=3600)
    if bit_rate is not None:
        whole("bit_rate", bit_rate, "a bit rate (bit/s)", BIT_RATES[-1], low=BIT_RATES[0])
    if sync_ms is not None:
        number("sync_ms", sync_ms, "a number of milliseconds, 0…100000", high=100_000)
    if not isinstance(inhibit_ms, Mapping | None):
        raise wrong("inhibit_ms", inhibit_ms, _END)
    inhibit = dict(_inhibit(end, time) for end, time in (inhibit_ms or {}).items())
    return LoadOptions(for_s, bit_rate, sync_ms or None, None, inhibit)


def _inhibit(end: str, time_ms: float) -> tuple[tuple[int | str | None, Pdo], int]:
    node, colon, name = str(end).rpartition(":")
    is_number = not colon or node[:1].isdigit() or not node
    try:
        pdo = Pdo.parse(name)
        node_id = int(node) if colon and is_number else None
        if not pdo.is_tpdo or (node_id is not None and not 1 <= node_id <= 127):
            raise ValueError(end)
        return (node_id if is_number else node, pdo), counts(time_ms, 100, 0xFFFF)
    except (ValueError, TypeError) as unfit:
        raise wrong("inhibit_ms", {end: time_ms}, _END) from unfit


_AN_END = "a PDO with its node: '1:tpdo1'"


def endpoints(*words: str) -> list[Endpoint]:
    """Parse PDOs with nodes; raises UsageError if invalid."""
    return [_endpoint(end_word) for end_word in words]


def _endpoint(text: str) -> Endpoint:
    head, _, tail = word("producer, consumers", text, _AN_END).partition(":")
    if not head.isdecimal() or not 1 <= int(head[:4]) <= 127:
        raise UsageError(f"{text!r}: {_AN_END}, node-IDs are 1…127")
    try:
        return Endpoint(int(head), Pdo.parse(tail))
    except ValueError as failed:
        raise UsageError(str(failed)) from failed


def heartbeat_of(heartbeat_ms: int | None, *, watched: bool) -> int | Literal[False] | None:
    """Return a link's heartbeat option; raises UsageError for a time without a consumer."""
    if heartbeat_ms is None:
        return None if watched else False
    if not watched:
        raise UsageError(
            "heartbeat=False changes no heartbeats, but heartbeat_ms sets a heartbeat: give only one of them"
        )
    return whole("heartbeat_ms", heartbeat_ms, "a heartbeat in ms", 0xFFFF, low=1)


class NetworkCalls:
    """A bus with its nodes as a network; `Bus` adds its opening and single nodes."""

    def __init__(self, session: Session, calls: Calls) -> None:
        self._session = session
        self._calls = calls

    def plan(
        self,
        file: str | Path,
        *,
        trust_stamp: bool = False,
        include: Sequence[str] = (),
        to_manager: int | None = None,
    ) -> NetworkPlanned:
        """Plan the writes for *file*: a network file (YAML), a DCF, an XDC or a backup (.jsonl).

        Reads the nodes and writes nothing. *include* are manufacturer-specific objects that a DCF, an XDC or a backup
        may write as well: `2001`, `2001:1` or `2000-2FFF`. *trust_stamp* skips nodes whose 0x1020 has the file's stamp;
        the result names them. *to_manager* (1…127) plans for this CANopen manager alone, which downloads the file's
        values to each other node at its boot-up (0x1F22). Raises InputFileError with all errors of the file; RuleError
        with all refusals of the rules, on all nodes, except PDOs or objects that devices lack: these are `plan.lacking`
        of the result, which has all other differences, and which `apply` refuses; SafetyRefusal if a node is another
        device than in the file.
        """
        from dvtcli.operations.network.network_files import plan_file

        chosen = str(path("file", file))
        flags(trust_stamp=trust_stamp)
        included, manager = words("include", include), _manager("to_manager", to_manager)
        return self._calls.run(
            lambda: plan_file(self._session, chosen, trust_stamp=trust_stamp, include=included, manager=manager)
        )

    def import_network(
        self,
        file: str | Path,
        folder: str | Path | None = None,
        *,
        from_manager: int | None = None,
        yes: bool = False,
    ) -> tuple[str, ...]:
        """Import every answering node and the links between them to the network *file* (.yaml).

        *folder*: its EDS, DCF, XDD and XDC files instead of the bus; *from_manager* (1…127): what this CANopen manager
        downloads to its nodes (0x1F22, CiA 302-3). Returns remarks, empty for none: omissions, differing layouts.
        Overwriting needs *yes*. Raises NoAnswer if no node answers, UsageError for another suffix, if the file cannot
        be written, or if the node is no manager.
        """
        from dvtcli.operations.exchange.import_network import import_network

        chosen = str(path("file", file))
        files = None if folder is None else str(path("folder", folder))
        manager = _manager("from_manager", from_manager)
        done = self._calls.run(lambda: import_network(self._session, chosen, files, manager), yes=yes)
        return tuple(map(in_calls, dict(done.rows)["notes"]))

    def export(
        self,
        file: str | Path,
        *,
        services: Sequence[str] = (),
        split_bits: bool = False,
        everything: bool = False,
        twice: bool = False,
        yes: bool = False,
    ) -> tuple[str, ...]:
        """Export all answering nodes: to a DBC file (.dbc), or a nodelist (.cpj) with a DCF each.

        *services*, *split_bits* and *everything* are for a DBC file, as in `dvtcli.convert`; *twice* for a nodelist, as
        in a node's `export`. Returns omissions, empty for none. Overwriting needs *yes*. Raises NoAnswer if no node
        answers; UsageError for another suffix, or if a file cannot be written.
        """
        from dvtcli.operations.exchange.export_file import export_all

        chosen = str(path("file", file))
        flags(twice=twice)
        options = dbc_options(services, split_bits=split_bits, everything=everything)
        done = self._calls.run(lambda: export_all(self._session, chosen, twice=twice, options=options), yes=yes)
        said = dict(done.rows)
        return tuple(said.get("left_out", said.get("notes", ())))

    def load(
        self,
        file: str | Path | None = None,
        *,
        for_s: float = 3.0,
        bit_rate: int | None = None,
        sync_ms: float | None = None,
        inhibit_ms: Mapping[str, float] | None = None,
    ) -> NetworkLoad:
        """Compute the worst-case bus load by the network *file* (None: nodes on the bus); true if all of it fits.

        The bus is measured for *for_s* seconds (0…3600). *bit_rate* (bit/s) replaces the bus's own, *sync_ms* is the
        period of SYNC in ms, *inhibit_ms* has inhibit times in ms: `{"5:tpdo3": 40}`. Writes nothing. Raises as `plan`;
        UsageError for an invalid PDO.
        """
        chosen = None if file is None else str(path("file", file))
        options = load_options(for_s, bit_rate, sync_ms, inhibit_ms)
        return self._calls.run(lambda: network_load(self._session, chosen, options))

    def report(
        self,
        target: str | Path,
        file: str | Path | None = None,
        *,
        title: str | None = None,
        bit_rate: int | None = None,
        for_s: float | None = None,
        yes: bool = False,
    ) -> tuple[str, ...]:
        """Draw the nodes on the bus to *target*: a page (.html), or their wiring alone (.svg, .dot).

        The page also has differences from the network *file*. *title* is its heading; *bit_rate* (bit/s) replaces the
        bus's own. The bus is recorded for *for_s* seconds (0…3600; None: 2, or not at all if nobody else can be on it).
        Returns remarks. Overwriting needs *yes*. Raises NoAnswer if no node answers; UsageError for another suffix, or
        if *target* cannot be written.
        """
        from dvtcli.operations.network.draw_network import draw_network

        chosen, other = str(path("target", target)), None if file is None else str(path("file", file))
        options = picture_options(title, bit_rate, for_s)
        done = self._calls.run(lambda: draw_network(self._session, chosen, other, options), yes=yes)
        return tuple(dict(done.rows)["notes"])

    def check(
        self,
        *files: str | Path,
        rules: Sequence[str] = (),
        without: Sequence[str] = (),
        strict: bool = False,
        bit_rate: int | None = None,
        for_s: float | None = None,
    ) -> NetworksChecked:
        """Check network *files*, the nodes on the bus, and both against each other; true if nothing is wrong.

        Applies *rules* (empty: all) except *without*; *strict* treats warnings as errors. *bit_rate* (bit/s) replaces
        the bus's own. The bus is recorded for *for_s* seconds (0…3600; None: 2, or not at all if nobody else can be on
        it). Read errors of a file are findings. Writes nothing. Raises UsageError for an unknown rule, or a recording.
        """
        from dvtcli.operations.network.check_live import check_all

        chosen = [str(path("files", file)) for file in files]
        refuse_recordings(chosen)
        options = check_options(rules, without, bit_rate, for_s, strict=strict)
        return self._calls.run(lambda: check_all(self._session, chosen, options))

    def apply(
        self,
        file: str | Path,
        *,
        prove: bool = False,
        trust_stamp: bool = False,
        include: Sequence[str] = (),
        to_manager: int | None = None,
        yes: bool = False,
        force: bool = False,
    ) -> NetworkApplied:
        """Bring the nodes to the state of *file*, as in `plan`, or of a plan saved by `dvtcli plan -o`: all or none.

        Asks first, unless *yes*; *force* is as for a node's changes; *trust_stamp*, *include* and *to_manager* as in
        `plan`. After all nodes were verified, those with `store` in the file store; *prove* then restarts and compares
        each. A fault on a node rolls back every node; raises LeftChanged if a roll-back or a store failed,
        SafetyRefusal if a node has changed since the plan was saved.
        """
        from dvtcli.operations.network.network_files import apply_file

        chosen = str(path("file", file))
        flags(prove=prove, trust_stamp=trust_stamp)
        prove_by: ProveBy | None = "reset" if prove else None
        included = words("include", include)
        manager = _manager("to_manager", to_manager)
        return self._calls.run(
            lambda: apply_file(
                self._session, chosen, prove=prove_by, trust_stamp=trust_stamp, include=included, manager=manager
            ),
            changes=True,
            yes=yes,
            force=force,
        )

    def link(
        self,
        producer: str,
        *consumers: str,
        heartbeat_ms: int | None = None,
        heartbeat: bool = True,
        yes: bool = False,
        force: bool = False,
    ) -> NetworkApplied:
        """Link the RPDOs *consumers* to the TPDO *producer* (`1:tpdo1`, `5:rpdo2`): on all nodes, or on none.

        An RPDO's entries are placed where the TPDO transmits them; dummies skip the rest. The TPDO keeps its CAN-ID if
        allowed. The consumers consume the producer's heartbeat, set by *heartbeat_ms* (1…65535), unless *heartbeat* is
        False. Raises RuleError if the layouts do not fit, else as `apply`.
        """
        from dvtcli.operations.plans.link_pdos import link_pdos

        sender, *hearers = endpoints(producer, *consumers)
        flags(heartbeat=heartbeat)
        asked = heartbeat_of(heartbeat_ms, watched=heartbeat)
        return self._calls.run(lambda: link_pdos(self._session, sender, hearers, heartbeat=asked), yes=yes, force=force)

    def unlink(
        self, producer: str, *consumers: str, heartbeat: bool = True, yes: bool = False, force: bool = False
    ) -> NetworkApplied:
        """Disable the RPDOs *consumers* of the TPDO *producer*, which stays enabled for other consumers.

        A node with no other link to the producer's node stops consuming its heartbeat, unless *heartbeat* is False.
        Raises UsageError if an RPDO does not receive the TPDO.
        """
        from dvtcli.operations.plans.link_pdos import unlink_pdos

        sender, *hearers = endpoints(producer, *consumers)
        flags(heartbeat=heartbeat)
        return self._calls.run(
            lambda: unlink_pdos(self._session, sender, hearers, heartbeat=heartbeat),
            changes=True,
            yes=yes,
            force=force,
        )


def _manager(name: str, manager: int | None) -> int | None:
    return None if manager is None else whole(name, manager, "a node-ID", 127, low=1)


def report(
    target: str | Path, file: str | Path, *, title: str | None = None, bit_rate: int | None = None, yes: bool = False
) -> tuple[str, ...]:
    """Draw the network *file* to *target*: a page (.html), or its wiring alone (.svg, .dot); needs no bus.

    *title* is its heading (None: the file's name); *bit_rate* (bit/s) is the bus's. Returns remarks. Overwriting needs
    *yes*. Raises InputFileError with all errors of *file*; UsageError for another suffix, or if *target* cannot be
    written.
    """
    from dvtcli.operations.network.draw_network import draw_network
    from dvtcli.operations.session.session import Session

    chosen, source, options = (
        str(path("target", target)),
        str(path("file", file)),
        picture_options(title, bit_rate, None),
    )
    with errors_in_calls(), Session(Options(yes=yes)) as session:
        done = draw_network(session, chosen, source, options)
    return tuple(dict(done.rows)["notes"])


def picture_options(title: str | None, bit_rate: int | None, for_s: float | None) -> PictureOptions:
    """How a program wants a picture, checked; UsageError for a wrong argument."""
    from dvtcli.operations.network.draw_network import PictureOptions

    if title is not None:
        word("title", title, "what stands at the top of the page")
    if bit_rate is not None:
        whole("bit_rate", bit_rate, "a bit rate (bit/s)", BIT_RATES[-1], low=BIT_RATES[0])
    if for_s is not None:
        number("for_s", for_s, "a number of seconds, 0…3600", high=3600)
    return PictureOptions(title, bit_rate, for_s)
