"""Every expected failure, as one small tree; the shell prints them at one boundary.

    DvtcliError                    1
    ├── UsageError                 2   unknown name, malformed argument
    ├── InputFileError             4   a file exists, its content is invalid
    ├── RuleError                  1   a rule refused a change before any write
    ├── SdoAborted                 1   the device refused one SDO
    ├── DeviceRefused              1   the device refused a change, or reads back differently; rolled back
    ├── Restarted                  1   a node lost a change before it was stored
    ├── JournalKept                1   all is as planned, but the journal cannot be removed
    ├── TakenBack                  1   a line of an atomic script failed; rolled back
    ├── ResultsLost                1   all is done, but the results cannot be written
    ├── NoAnswer                   5   a node is silent
    ├── SdoProtocolError           5   a node sends an invalid answer
    ├── BusUnavailable             5   the bus cannot be opened, or died
    ├── SafetyRefusal              6   identity differs, stale plan, unanswered question
    ├── LeftChanged                7   roll-back failed too
    ├── Bug                       70   a fault in dvtcli itself
    └── Interrupted              130   the user stopped a command; rolled back

The number is the exit code.
"""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from typing import TYPE_CHECKING, Any, Literal, NamedTuple

if TYPE_CHECKING:
    from dvtcli.domain.hint import Hint
    from dvtcli.domain.plan import Change
    from dvtcli.domain.rules import Finding
    from dvtcli.domain.rules.finding import FileComplaint
    from dvtcli.domain.store import WhoStored

#: How the line is labelled that says that a failure was a twin's.
DRY_RUN = "dry run"
State = Literal["unchanged", "rolled_back", "left_changed", "unknown"]
#: the less is as it was before the command, the later
_STATES: tuple[State, ...] = ("unchanged", "rolled_back", "unknown", "left_changed")


class DvtcliError(Exception):
    """A failure that the user can act on.

    *text* says what happened and where; *why* gives the reason, *hint* the next step, *state* the state of the device;
    *node* is a node-ID, *place* an object (`1A00:03`) or a `FILE:LINE`, *abort* an SDO abort code. *given* are the
    arguments concerned, as in a `Hint`, each with its value, or None for its name alone: the command line and the API
    write them in front of the text, each in its form.
    """

    exit_code = 1
    slug = "failed"

    def __init__(
        self,
        text: str,
        *,
        node: int | None = None,
        place: str | None = None,
        abort: int | None = None,
        why: str | None = None,
        hint: Hint | str | None = None,
        state: State = "unchanged",
        given: Mapping[str, object] | None = None,
    ) -> None:
        super().__init__(text)
        self.text = text
        self.given = given or {}
        self.node = node
        self.place = place
        self.abort = abort
        self.why = why
        self.hint = hint
        self.state: State = state
        #: the state in words, if the words for *state* do not fit
        self.state_text: str | None = None
        #: the state of each node, by node-ID, if the command was about several and they fared differently
        self.nodes: dict[int, State] = {}
        #: whether the start's own options are wrong, whichever line of a script found out
        self.at_start = False
        #: true if the failed action was never meant for the bus and cannot be forced
        self.rehearsed = False
        #: whether the command that failed writes nothing to nodes anyway
        self.only_looked = False
        #: `FILE:LINE` of earlier script lines with changes that stay
        self.stays: tuple[str, ...] = ()
        #: the differences from the results of these lines, read after the failure; None if not read
        self.stays_differing: tuple[str, ...] | None = None
        #: the further errors found beside it, as in other lines of a script
        self.others: tuple[DvtcliError, ...] = ()
        #: the command to view its frames, empty without frames
        self.traced_by = ""
        #: further labelled lines for the screen, e.g. ("step", "0x1A00:03 <- 0x27030120")
        self.details: list[tuple[str, str]] = []

    @property
    def worst_state(self) -> State:
        """The state of all nodes that the command was about: that of the one of which least is as it was."""
        return max((self.state, *self.nodes.values()), key=_STATES.index)

    def beside(self, done: Iterable[int], failures: Iterable[DvtcliError], text: str) -> None:
        """Note the nodes *done*, which went back, and those of *failures*; *text* says what was done."""
        self.nodes = dict.fromkeys(done, "rolled_back")
        if self.nodes:
            from dvtcli.domain.text import all_nodes

            self.details.append(("done", f"{all_nodes(self.nodes)}: {text}"))
        failed_states: dict[int, State] = {}
        for failed in failures:
            if failed.node is not None:
                states = (failed.state, failed_states.get(failed.node, failed.state))
                failed_states[failed.node] = max(states, key=_STATES.index)
        if self.nodes or len(failed_states) > 1:
            self.nodes |= failed_states

    def __reduce__(self) -> tuple[object, ...]:
        """Pickle and copy the error with all of its fields."""
        return _made_again, (type(self), *self.args), vars(self)


def _made_again(kind: type[DvtcliError], *args: object) -> DvtcliError:
    return kind.__new__(kind, *args)


def worst_of(failures: Sequence[DvtcliError]) -> DvtcliError:
    """The failure of which least is as it was, the first of equal ones."""
    return max(failures, key=lambda failed: _STATES.index(failed.state))


def ended_with(exit_code: int, text: str, *, hint: Hint | str | None = None, state: State = "unchanged") -> DvtcliError:
    """Why an answer whose own screen says all of it ended with *exit_code*: for documents."""
    is_signal = exit_code > 128
    failed = (Interrupted if is_signal else DvtcliError)(text, hint=hint, state=state)
    failed.exit_code = exit_code
    return failed


class UsageError(DvtcliError):
    """An argument or command is not understood."""

    exit_code = 2
    slug = "usage"


class InputFileError(DvtcliError):
    """A file's content is invalid; *place* is `FILE:LINE` or `FILE:LINE:COLUMN`.

    *complaints* are all errors in the file, if more than the first was searched; *outcome*: the action not done, empty
    if none was meant. *hides_others*: checks that need a correct file were skipped.
    """

    exit_code = 4
    slug = "input_file"
    complaints: tuple[FileComplaint, ...] = ()
    outcome = "nothing was sent"
    hides_others = False


class RuleError(DvtcliError):
    """A rule refused a change before anything was written; *findings* name the rules, *can_force* whether force helps.

    *complaints* are the requesting places in a file, if known.
    """

    slug = "rules"

    def __init__(
        self, text: str, findings: Sequence[Finding], *, node: int | None = None, can_force: bool = True
    ) -> None:
        first = findings[0]
        super().__init__(text, node=node, place=first.place, abort=first.abort, hint=first.hint)
        self.findings = tuple(findings)
        self.can_force = can_force
        self.complaints: tuple[FileComplaint, ...] = ()


class SdoAborted(DvtcliError):
    """The device answered an SDO request with an abort code.

    *index* and *sub_index* are the object's, *code* is the abort code.
    """

    slug = "sdo_abort"

    def __init__(self, index: int, sub_index: int, code: int, *, node: int | None = None) -> None:
        from dvtcli.domain.abort import abort_text

        self.index, self.sub_index, self.code = index, sub_index, code
        place = f"{index:04X}:{sub_index:02X}"
        super().__init__(f"0x{place} refused: {abort_text(code)} (0x{code:08X})", node=node, place=place, abort=code)


class DeviceRefused(DvtcliError):
    """The device refused a step, or reads back differently from the written value.

    *read_back* is the present and the expected value of an object written alone.
    """

    read_back: tuple[bytes, bytes] | None = None

    slug = "device_refused"


class Restarted(DvtcliError):
    """A node restarted unexpectedly and lost unstored changes."""

    slug = "restarted"


class JournalKept(DvtcliError):
    """A change was made as planned, or undone, and verified, but its journal cannot be removed."""

    slug = "journal_kept"


class TakenBack(DvtcliError):
    """A line of an atomic script failed by its exit code (`verify`); the script was rolled back."""

    slug = "taken_back"


class ResultsLost(DvtcliError):
    """The results of a command cannot be written to their destination; the command's work is done."""

    slug = "results_lost"


class NoAnswer(DvtcliError):
    """A node did not answer within the time-out."""

    exit_code = 5
    slug = "no_answer"


class SdoProtocolError(DvtcliError):
    """A node's answers break the SDO protocol."""

    exit_code = 5
    slug = "sdo_protocol"


class BusUnavailable(DvtcliError):
    """The bus cannot be opened, or it died."""

    exit_code = 5
    slug = "bus"
    #: true if the bus may open later with the same options and waiting makes sense
    may_come = False
    #: whether what was to be sent is known not to have left this computer
    never_sent = False


class SafetyRefusal(DvtcliError):
    """Refused for safety; nothing was written."""

    exit_code = 6
    slug = "safety"


def stopped_node(node_id: int) -> SafetyRefusal:
    """The refusal to continue with a node that is STOPPED."""
    from dvtcli.domain.hint import Action, Hint

    return SafetyRefusal(
        f"node {node_id} is STOPPED: it answers no SDO",
        node=node_id,
        hint=Hint(Action.ENTER_PRE_OPERATIONAL, {"node": node_id}),
    )


class LeftObject(NamedTuple):
    """A difference of node *node_id* from before: *label* is its PDO or object, *place* the object (`1800:05`).

    *place* is None if the PDO could not be read; *holds* and *before* are None if unknown. *text* is the difference in
    words.
    """

    node_id: int
    label: str
    place: str | None
    holds: bytes | None
    before: bytes | None
    text: str
    #: true if the value was read, or is known to be unreadable
    is_known: bool = True


class LeftChanged(DvtcliError):
    """Roll-back failed too: the device is left changed.

    *stores* names the nodes of a network that have stored, if not all did. *left* are the objects that differ from
    before, *as_before* the PDOs and objects of each node as before, all read after the last write; *guarded* are the
    changes to be rolled back, by node-ID.
    """

    exit_code = 7
    slug = "left_changed"
    stores: WhoStored | None = None

    def __init__(self, *args: Any, **kwargs: Any) -> None:
        super().__init__(*args, **kwargs)
        self.left: tuple[LeftObject, ...] = ()
        self.as_before: dict[int, tuple[str, ...]] = {}
        self.guarded: dict[int, tuple[Change, ...]] = {}


class Bug(DvtcliError):
    """A fault in dvtcli itself."""

    exit_code = 70
    slug = "bug"


class Interrupted(DvtcliError):
    """The user stopped a command; its changes were rolled back.

    The Python API raises KeyboardInterrupt in its place.
    """

    exit_code = 130
    slug = "interrupted"
