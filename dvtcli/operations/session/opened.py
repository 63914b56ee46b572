"""The user of a session (options, reporter, consent, secrets), and its bus, opened at first use.

With the bus: its nodes, their twins under --dry-run, the traffic tap.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import AbstractContextManager, contextmanager
from functools import cached_property
from typing import TYPE_CHECKING, Any

from dvtcli.device.cancellation import Cancellation
from dvtcli.errors import (
    DRY_RUN,
    BusUnavailable,
    DvtcliError,
    InputFileError,
    LeftChanged,
    NoAnswer,
    SafetyRefusal,
    UsageError,
)
from dvtcli.operations.user.options import Options

if TYPE_CHECKING:
    from pathlib import Path

    from dvtcli.device.change.change_group import ChangeGroup
    from dvtcli.device.node import Node
    from dvtcli.domain.hint import Hint
    from dvtcli.domain.network.received_traffic import LastFrames
    from dvtcli.domain.ports import CanopenBus
    from dvtcli.operations.session.open_network import Network, OpenBus, StartSimulation
    from dvtcli.operations.session.serve import ServeRequest, Serving
    from dvtcli.operations.session.simulated_nodes import Simulated
    from dvtcli.operations.user.secret_objects import Secrets
    from dvtcli.operations.user.session_user import Reporter
    from dvtcli.operations.user.settings import Settings


def judge_lost_bus(error: DvtcliError, acts: Callable[[], Sequence[str]]) -> None:
    """Mark *error* as of unknown state if a lost bus says `unchanged` after *acts* of this line were sent."""
    if not isinstance(error, BusUnavailable) or error.state != "unchanged" or error.state_text is not None:
        return
    if sent := acts():
        error.state = "unknown"
        from dvtcli.domain.text import join_some

        error.state_text = f"unknown: {join_some(sent)} was sent before that; read the device again"


def read_in_vain(error: DvtcliError) -> DvtcliError:
    """Return the read error behind *error* if a twin was left changed, else *error*.

    A twin's failed roll-back predicts the node's state only if the node still answers.
    """
    cause: BaseException | None = error
    while isinstance(cause, LeftChanged):
        cause = cause.__cause__
    return cause if isinstance(cause, BusUnavailable | NoAnswer) else error


class Opened:
    """The user's part of a session, and its bus: of the options, or by *open_bus*; *reporter* gets messages."""

    def __init__(
        self, options: Options | None = None, reporter: Reporter | None = None, *, open_bus: OpenBus | None = None
    ) -> None:
        self.reporter = reporter or _nobody()
        self.base = self.options = options or Options()
        self.cancellation = Cancellation()
        self._agreed = False
        #: called when the bus is about to be opened
        self.on_open: Callable[[], None] = lambda: None
        self._open_bus = open_bus
        #: makes the bus of simulated nodes; None: the default
        self.simulate: StartSimulation | None = None
        self._network: Network | None = None
        self._twin: Network | None = None
        self._untap: Callable[[], None] | None = None
        #: the error while the bus is lost; None otherwise
        self._gone: str | None = None
        #: bit rate set since the bus was opened (bit/s), used again when it is reopened
        self._set_rate: int | None = None
        #: the last frames, if recorded all the time: at the prompt, or in a script (`keep_frames`)
        self.frames: LastFrames | None = None
        self._keeps_frames = False
        #: whether a lost bus is waited for
        self.comes_back = False
        #: files made by the current line, as named
        self.made: list[str] = []

    @cached_property
    def settings(self) -> Settings:
        """All settings at the start of a program: options, variables and files."""
        from dvtcli.operations.user.settings import Settings

        return Settings()

    def require_settings(self) -> None:
        """Raise errors of the settings; reports a project file's ignored keys, or first use, once."""
        for said in self.settings.required():
            self.reporter.warning(str(said))

    def chosen_by(self) -> str:
        """Describe what chose the bus: option, variable or file."""
        return self.settings.chosen_by()

    @property
    def in_script(self) -> bool:
        """Tell whether lines run one after another, unattended."""
        return False

    @property
    def dry_run(self) -> bool:
        """Tell whether writes go to twins."""
        return self.options.dry_run

    def doing(self) -> str:
        """Describe the current work for another dvtcli that waits for a node; here without a name."""
        return ""

    def consent(self, question: str | Callable[[], str], node_id: int | None = None) -> None:
        """Ask *question* (or its result if callable), about a node if given, if somebody can answer.

        Returns on yes, else raises SafetyRefusal.
        """
        if not self._agreed:
            self.consent_anew(question, node_id)

    def consent_anew(self, question: str | Callable[[], str], node_id: int | None = None) -> None:
        """Ask even inside `agreed`, for what no earlier question named."""
        if not (self.options.yes or self.dry_run):
            from dvtcli.domain.hint import Action, Hint

            text = question if isinstance(question, str) else question()
            self.require_yes(text, node_id, Hint(Action.AGREE, why="give {} to answer yes"))

    def require_yes(self, question: str, node_id: int | None, hint: Hint, refused: str = "not done") -> None:
        """Ask *question*, ignoring --yes; raises SafetyRefusal on no, or with *hint* if nobody can answer.

        *refused* says what did not happen.
        """
        with self.cancellation.released():  # Ctrl-C here is a no to everything that the question was for
            answer = self.reporter.ask(question)
        if answer is None:
            raise SafetyRefusal(f"{self.reporter.unanswered}: {question}", node=node_id, hint=hint)
        if not answer:
            raise SafetyRefusal(f"{refused}: the answer was no", node=node_id)

    def require_typed(self, question: str, word: str, node_id: int, hint: Hint) -> None:
        """Ask for *word* to be typed, ignoring --yes, except in a dry run; raises SafetyRefusal as `require_yes`."""
        if self.dry_run:
            return
        with self.cancellation.released():
            answer = self.reporter.confirm(question, word)
        if answer is None:
            raise SafetyRefusal(f"{self.reporter.unanswered}: {question}", node=node_id, hint=hint)
        if not answer:
            raise SafetyRefusal(f"not done: {word} was not typed", node=node_id)

    @contextmanager
    def agreed(self) -> Iterator[None]:
        """Suppress questions in a block: it was consented to, or rolls back."""
        self._agreed = True
        try:
            yield
        finally:
            self._agreed = False

    @property
    def state_folder(self) -> Path:
        """Return the folder of journals, locks and backups."""
        from dvtcli.operations.user.change_files import state_folder

        return state_folder(self.options)

    @cached_property
    def secrets(self) -> Secrets:
        """The passcodes to hide, on the bus and in lines."""
        from dvtcli.operations.user.secret_objects import Secrets

        return Secrets.known()

    @contextmanager
    def under(self, **given: Any) -> Iterator[None]:
        """Let other options, by their names in `Options`, count while the block runs, `dry_run=True` above all."""
        try:
            with self._under(given):
                yield
        finally:
            self._apply()

    @contextmanager
    def _under(self, given: Mapping[str, Any]) -> Iterator[None]:
        """Use the *given* options; their effect on the bus stays until the next `_apply`."""
        outer = self.base
        fresh_twin = given.get("dry_run") and not outer.dry_run
        self.base = self.options = outer._replace(**given)
        self._apply()
        try:
            yield
        except DvtcliError as error:
            if not self.dry_run:
                judge_lost_bus(error, self.acts)
                raise
            told = read_in_vain(error)
            told.state, told.state_text = "unchanged", None
            if self._twin is not None and not isinstance(told, (InputFileError, UsageError)):
                told.details.insert(0, (DRY_RUN, "this was the node's twin; nothing was sent"))
            if told is not error:
                raise told from None
            raise
        finally:
            if fresh_twin:
                self._twin = None
            self.base = self.options = outer

    def _apply(self) -> None:
        """Apply the options in force to the bus."""
        if self._network is not None:
            self._obey(self._network.bus)
        self._watch()

    def _obey(self, bus: CanopenBus) -> None:
        bus.set_timeout(self.options.timeout)
        bus.set_bus_share(self.options.bus_share)

    def _watch(self) -> None:
        """Attach the traffic tap only under -v: a tap costs time per frame."""
        if self._network is None or bool(self.options.verbose) == (self._untap is not None):
            return
        if self._untap is not None:
            self._untap()
            self._untap = None
        else:
            followed, traffic = self.secrets.in_frames(unknown=True), self.reporter.traffic
            self._untap = self._network.bus.tap(
                lambda frame, sent: traffic(frame, sent=sent, secret=followed.value_in(frame))
            )

    @property
    def network(self) -> Network:
        """The bus with its nodes, or their twins under --dry-run; opened on first use."""
        network = self.open_network()
        if not self.dry_run:
            return network
        if self._twin is None:
            from dvtcli.operations.session.twin_network import twin_of

            self._twin = twin_of(network)
        return self._twin

    def open_network(self) -> Network:
        """Return the bus with its nodes, even under --dry-run; opened at first use. Raises BusUnavailable if lost."""
        if self._gone is not None:
            raise BusUnavailable(self._gone, hint="the line was not run; type it again when the bus is back")
        if self._network is None:
            self.require_settings()
            self.on_open()
            with self._chooser_said():
                bus, simulated = self._first_bus()
            if any(simulated_node.holds_values for simulated_node in simulated):
                self._tell_not_simulated(simulated)
            if self.options.verbose:
                self.reporter.note(f"{bus.name} is open, chosen by {self.chosen_by()}")
            self._network = self._network_on(bus, simulated)
            self._obey(bus)
            if self.options.bus_share and bus.bitrate is None and not bus.simulated:
                from dvtcli.domain.hint import Action, Hint, verbatim

                self.reporter.note(
                    Hint(
                        Action.GIVE,
                        {"bus_share": None},
                        f"has no effect: the bit rate of {verbatim(bus.name)} is unknown",
                    )
                    + Hint(Action.GIVE_BIT_RATE, why="says it")
                )
            self._watch()
            self._keep_frames_of(bus)
        if self._network.left:
            self._network.meet_again()
        return self._network

    def _tell_not_simulated(self, simulated: tuple[Simulated, ...]) -> None:
        from dvtcli.operations.session.simulated_nodes import not_simulated

        for text in not_simulated(simulated):
            self.reporter.warning(text)

    def keep_frames(self) -> None:
        """Keep the last frame of each CAN-ID from now on; for several lines on a bus."""
        if self.frames is None:
            self._keeps_frames = True
            if self._network is not None:
                self._keep_frames_of(self._network.bus)

    def _keep_frames_of(self, bus: CanopenBus) -> None:
        if not self._keeps_frames:
            return
        from time import monotonic

        from dvtcli.domain.network.received_traffic import LastFrames

        frames = self.frames = LastFrames()
        bus.tap(lambda frame, _sent: frames.take(frame, monotonic()))

    def _first_bus(self) -> tuple[CanopenBus, tuple[Simulated, ...]]:
        """Open the bus of the options, with its simulated nodes; --reconnect waits for it."""
        from dvtcli.operations.session.open_network import bus_of

        def opened() -> tuple[CanopenBus, tuple[Simulated, ...]]:
            return bus_of(self.base, self._open_bus, self.simulate)

        if not self.options.reconnect:
            return opened()
        from dvtcli.operations.session.open_network import first_bus

        return first_bus(opened, self.options, self.reporter.bus)

    def bus_again(self) -> CanopenBus:
        """Open the bus of the options again, from any thread; raises BusUnavailable."""
        from dvtcli.operations.session.open_network import bus_of

        given = self.base if self._set_rate is None else self.base._replace(bitrate=self._set_rate)
        return bus_of(given, self._open_bus, self.simulate)[0]

    def take_bit_rate(self, bit_rate: int) -> None:
        """Record that the bus runs at *bit_rate* (bit/s) from now on, whatever the options are."""
        self._set_rate = bit_rate

    def leave_bus(self, why: str) -> None:
        """Drop the bus with *why*, the error for all users until `take_bus`."""
        assert self._network is not None  # noqa: S101 - it was open
        self._gone = why
        self._network.leave()

    def take_bus(self, bus: CanopenBus) -> None:
        """Continue with the reopened *bus*; earlier reads of its nodes are void."""
        assert self._network is not None  # noqa: S101 - it was open
        network = self._network_on(bus, ())
        network.continue_from(self._network)
        self._network, self._twin, self._untap, self._gone = network, None, None, None
        self._obey(bus)
        self._watch()
        self._keep_frames_of(bus)

    def _network_on(self, bus: CanopenBus, simulated: tuple[Simulated, ...]) -> Network:
        from dvtcli.operations.session.open_network import network_on_bus

        return network_on_bus(
            self,
            bus,
            simulated,
            is_last_change=lambda: self.ends_with_line,
            comes_back=self.comes_back,
            group=self.group,
        )

    @property
    def ends_with_line(self) -> bool:
        """Tell whether the current line is the last."""
        return False

    @contextmanager
    def _chooser_said(self) -> Iterator[None]:
        """If the bus does not open, say which setting chose it."""
        try:
            yield
        except BusUnavailable as failed:
            from dvtcli.operations.user.settings import NOBODY

            if (by := self.chosen_by()) != NOBODY:
                failed.details.append(("chosen by", by))
            elif described := self.settings.described_buses():
                failed.hint = described + failed.hint if failed.hint else described
            failed.at_start = True
            raise
        except UsageError as wrong:
            wrong.at_start = True
            raise

    def serving(self, wanted: ServeRequest) -> AbstractContextManager[Serving]:
        """Serve simulated nodes to other programs instead of opening a bus."""
        from dvtcli.operations.session.serve import serving

        self.require_settings()
        self.on_open()
        return serving(self.base, wanted, self.reporter.warning, self.reporter.bus)

    @property
    def is_open(self) -> bool:
        """Tell whether the bus was opened."""
        return self._network is not None

    @property
    def wire(self) -> CanopenBus:
        """The bus itself, also under --dry-run: to listen to, never to write to."""
        assert self._network is not None  # noqa: S101 - who listens has opened it
        return self._network.bus

    @property
    def bus(self) -> CanopenBus:
        """The bus, or the twin's under --dry-run."""
        return self.network.bus

    @cached_property
    def group(self) -> ChangeGroup:
        """Return the changes that are kept or rolled back together, as in an atomic script."""
        from dvtcli.device.change.change_group import ChangeGroup

        return ChangeGroup()

    def met_nodes(self) -> Iterator[Node]:
        """Yield every node met so far, and every twin."""
        for network in (self._network, self._twin):
            yield from tuple(network.nodes.values()) if network else ()

    def writes(self) -> dict[int, int]:
        """Count writes and stores per node-ID, without twins, whatever their result."""
        nodes = {node.node_id: node for node in (*self.left_nodes(), *self._nodes())}
        return {node_id: node.boot_snapshot.writes + node.pending.stores for node_id, node in nodes.items()}

    def acts(self) -> list[str]:
        """Return what was sent since the last call that nodes act on, without twins; called at a line's start."""
        return [] if self._network is None else self._network.bus.acts()

    def seen_nodes(self) -> dict[int, Node]:
        """Return met nodes by node-ID, or their twins under --dry-run; opens nothing, even after a loss."""
        network = self._twin if self.dry_run else self._network
        return {} if network is None else network.nodes

    def left_nodes(self) -> list[Node]:
        """The nodes as they were when the bus was gone, as far as they were not met since."""
        return [] if self._network is None else list(self._network.left.values())

    def _nodes(self) -> list[Node]:
        return list(self._network.nodes.values()) if self._network is not None else []

    def warn_of_disturbances(self) -> None:
        """Warn of disturbed SDO channels: another client, two nodes with the same node-ID."""
        for text in self._network.bus.disturbances() if self._network is not None else ():
            self.reporter.warning(text)

    def close(self) -> None:
        """Leave the bus."""
        self._twin = None
        if self._network is not None:
            self._network.close()
            self._network = self._untap = None


def _nobody() -> Reporter:
    from dvtcli.operations.user.session_user import NullReporter

    return NullReporter()
