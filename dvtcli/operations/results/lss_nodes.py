"""What LSS found and changed, as answers. Knows no terminal and no session."""

from __future__ import annotations

from dataclasses import dataclass
from typing import ClassVar

from dvtcli.domain.lss_services import LssAddress
from dvtcli.domain.nmt import UNCONFIGURED
from dvtcli.domain.several import join_some
from dvtcli.errors import DvtcliError, State, ended_with
from dvtcli.operations.results.documents import Answer, Document, Short


@dataclass(frozen=True, slots=True)
class HeardAt(Short):
    """How many *frames* and *error_frames* came while a bus was listened to at *bit_rate* (bit/s)."""

    bit_rate: int
    frames: int
    error_frames: int

    def document(self) -> Document:
        """One bit rate of `dvtcli.bit-rate/1`."""
        return {"bit_rate": self.bit_rate, "frames": self.frames, "error_frames": self.error_frames}


@dataclass(frozen=True, slots=True)
class BitRateFound(Answer):
    """The *bit_rate* (bit/s) at which frames come without errors; None where there is none, or the bus is silent.

    *heard* is what came at each bit rate that was tried, in *seconds* each; *complete* whether all of the standard's
    were tried, or the one was found. *listen_only*: not a word was said.
    """

    renderer: ClassVar = "bit_rate_lines:bit_rate_lines"

    bus: str
    bit_rate: int | None
    heard: tuple[HeardAt, ...]
    seconds: float
    listen_only: bool = True
    complete: bool = True

    def __bool__(self) -> bool:
        return self.bit_rate is not None

    @property
    def silent(self) -> bool:
        """Whether nothing came at all, neither frames nor errors."""
        return not any(heard_at.frames or heard_at.error_frames for heard_at in self.heard)

    @property
    def exit_code(self) -> int:
        """1 where no bit rate was found."""
        return 0 if self else 1

    @property
    def failure_of_document(self) -> DvtcliError | None:
        """What a program is told where the exit code is not 0."""
        return None if self else ended_with(1, f"no bit rate was found on {self.bus}")

    def document(self) -> Document:
        """`dvtcli.bit-rate/1`."""
        return {
            "schema": "dvtcli.bit-rate/1",
            "bus": self.bus,
            "bit_rate": self.bit_rate,
            "silent": self.silent,
            "heard": [heard_at.document() for heard_at in self.heard],
            "seconds": self.seconds,
            "listen_only": self.listen_only,
            "complete": self.complete,
        }


def _identity(address: LssAddress) -> Document:
    return {
        "vendor_id": address.vendor,
        "product_code": address.product,
        "revision": address.revision,
        "serial": address.serial,
    }


@dataclass(frozen=True, slots=True)
class LssNode(Short):
    """A node that an LSS master found by its *address*; *node_id* is None where it was not told.

    *confirmed* says whether exactly one node answered to that address; *profile* is the family that it is of.
    """

    address: LssAddress
    node_id: int | None = None
    confirmed: bool = True
    profile: str = ""

    def document(self) -> Document:
        """One node of `dvtcli.lss/1`."""
        known = None if self.node_id == UNCONFIGURED else self.node_id
        return {**_identity(self.address), "node": known, "confirmed": self.confirmed, "profile": self.profile}


@dataclass(frozen=True, slots=True)
class LssFound(Answer):
    """The nodes that *action* (`scan`, `select`, `identify`) found, with how many *requests* of ours, in *seconds*.

    *free* is a node-ID that nobody answers with, for a node that a scan found.
    *answered* is how many nodes without a node-ID said so, *within* whether a node within ranges did; None where that
    was not asked.
    """

    renderer: ClassVar = "lss_lines:found_lines"

    action: str
    nodes: tuple[LssNode, ...] = ()
    answered: int | None = None
    requests: int = 0
    seconds: float = 0.0
    dry_run: bool = False
    within: bool | None = None
    free: int | None = None

    def __bool__(self) -> bool:
        return bool(self.nodes) or self.within is True

    @property
    def exit_code(self) -> int:
        """1 where a node was found, and did not answer to its address, or more than one did."""
        return 0 if all(node.confirmed for node in self.nodes) else 1

    @property
    def failure_of_document(self) -> DvtcliError | None:
        """What a program is told where the exit code is not 0."""
        unsure = [str(node.address) for node in self.nodes if not node.confirmed]
        text = f"not exactly one node answered to {join_some(unsure)}"
        return ended_with(1, text) if unsure else None

    def document(self) -> Document:
        """`dvtcli.lss/1`."""
        return {
            "schema": "dvtcli.lss/1",
            "action": self.action,
            "nodes": [node.document() for node in self.nodes],
            "without_node_id": self.answered,
            "within": self.within,
            "free_node_id": self.free,
            "requests": self.requests,
            "seconds": self.seconds,
            "dry_run": self.dry_run,
        }


@dataclass(frozen=True, slots=True)
class LssGiven(Short):
    """A node by its *address* that had node-ID *before* (255: none) and has *node_id* now; *name* is a file's for it.

    *stored* says whether it answered that it keeps the node-ID, *proved* whether it came back with it after a reset.
    """

    address: LssAddress
    before: int
    node_id: int
    stored: bool = False
    name: str = ""
    proved: bool = False

    def document(self) -> Document:
        """One node of `dvtcli.lss-change/1`."""
        before = None if self.before == UNCONFIGURED else self.before
        return {
            **_identity(self.address),
            "name": self.name,
            "before": before,
            "node": None if self.node_id == UNCONFIGURED else self.node_id,
            "stored": self.stored,
            "proved": self.proved,
        }


@dataclass(frozen=True, slots=True)
class LssChanged(Answer):
    """What *action* (`node-id`, `store`, `assign`) changed: nodes that were seen with their node-ID afterwards.

    *wanted* is the node-ID that a dry run was about; *missing* are nodes of a file that were not found.
    """

    renderer: ClassVar = "lss_lines:changed_lines"

    action: str
    nodes: tuple[LssGiven, ...] = ()
    wanted: int | None = None
    missing: tuple[str, ...] = ()
    dry_run: bool = False

    @property
    def exit_code(self) -> int:
        """1 where a node of the file was not found."""
        return 1 if self.missing else 0

    @property
    def failure_of_document(self) -> DvtcliError | None:
        """What a program is told where the exit code is not 0."""
        if not self.missing:
            return None
        state: State = "left_changed" if self.nodes and not self.dry_run else "unchanged"
        return ended_with(1, f"not found: {join_some(self.missing)}", state=state)

    def document(self) -> Document:
        """`dvtcli.lss-change/1`."""
        return {
            "schema": "dvtcli.lss-change/1",
            "action": self.action,
            "nodes": [node.document() for node in self.nodes],
            "missing": list(self.missing),
            "dry_run": self.dry_run,
        }


@dataclass(frozen=True, slots=True)
class LssBitRate(Answer):
    """The bit rate (bit/s) that a bus with all its *nodes* was changed to: each was seen there afterwards.

    *before* is what it ran at, None where that was not looked at.
    """

    renderer: ClassVar = "lss_lines:bit_rate_lines"
    exit_code: ClassVar[int] = 0

    bit_rate: int
    before: int | None = None
    nodes: tuple[LssGiven, ...] = ()
    dry_run: bool = False

    def document(self) -> Document:
        """`dvtcli.lss-bit-rate/1`."""
        return {
            "schema": "dvtcli.lss-bit-rate/1",
            "bit_rate": self.bit_rate,
            "before": self.before,
            "nodes": [
                {
                    **_identity(node.address),
                    "node": node.document()["node"],
                    "stored": node.stored,
                    "proved": node.proved,
                }
                for node in self.nodes
            ],
            "dry_run": self.dry_run,
        }
