"""Results of LSS."""

from __future__ import annotations

from dataclasses import dataclass
from typing import ClassVar

from dvtcli.domain.lss_services import LssAddress
from dvtcli.domain.nmt import UNCONFIGURED
from dvtcli.domain.text import join_some
from dvtcli.errors import DvtcliError, State, ended_with
from dvtcli.operations.results.documents import Answer, Document, Short


@dataclass(frozen=True, slots=True)
class ReceivedAt(Short):
    """How many *frames* and *error_frames* came while a bus was listened to at *bit_rate* (bit/s)."""

    bit_rate: int
    frames: int
    error_frames: int

    def document(self) -> Document:
        """A bit rate in `dvtcli.bit-rate/1`."""
        return {"bit_rate": self.bit_rate, "frames": self.frames, "error_frames": self.error_frames}


@dataclass(frozen=True, slots=True)
class BitRateFound(Answer):
    """The *bit_rate* (bit/s) at which frames arrive without errors; None if none, or the bus is silent.

    *heard* is the traffic at each bit rate tried for *seconds*; *complete*: all standard bit rates were tried, or it
    was found. *listen_only*: nothing was sent.
    """

    renderer: ClassVar = "lss_lines:measured_rate_lines"

    bus: str
    bit_rate: int | None
    heard: tuple[ReceivedAt, ...]
    seconds: float
    listen_only: bool = True
    complete: bool = True

    def __bool__(self) -> bool:
        return self.bit_rate is not None

    @property
    def silent(self) -> bool:
        """Tell whether the bus was silent: neither frames nor errors."""
        return not any(received_at.frames or received_at.error_frames for received_at in self.heard)

    @property
    def exit_code(self) -> int:
        """1 if no bit rate was found."""
        return 0 if self else 1

    @property
    def failure_of_document(self) -> DvtcliError | None:
        """The error for a nonzero exit code, for programs."""
        return None if self else ended_with(1, f"no bit rate was found on {self.bus}")

    def document(self) -> Document:
        """`dvtcli.bit-rate/1`."""
        return {
            "schema": "dvtcli.bit-rate/1",
            "bus": self.bus,
            "bit_rate": self.bit_rate,
            "silent": self.silent,
            "heard": [received_at.document() for received_at in self.heard],
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
    """A node found by LSS with its *address*; *node_id* is None if unknown.

    *confirmed*: exactly one node answered to the address; *profile* is its family.
    """

    address: LssAddress
    node_id: int | None = None
    confirmed: bool = True
    profile: str = ""

    def document(self) -> Document:
        """A node in `dvtcli.lss/1`."""
        known = None if self.node_id == UNCONFIGURED else self.node_id
        return {**_identity(self.address), "node": known, "confirmed": self.confirmed, "profile": self.profile}


@dataclass(frozen=True, slots=True)
class LssFound(Answer):
    """The nodes found by *action* (`scan`, `select`, `identify`), with *requests* sent in *seconds*.

    *free* is an unused node-ID for a scanned node. *answered* counts nodes without node-ID, *within* says whether a
    node is within the ranges; None if not asked.
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
        """1 if a found node did not answer to its address, or several did."""
        return 0 if all(node.confirmed for node in self.nodes) else 1

    @property
    def failure_of_document(self) -> DvtcliError | None:
        """The error for a nonzero exit code, for programs."""
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
    """A node by *address* with node-ID *before* (255: none) and *node_id* now; *name* is from the file.

    *stored*: it acknowledged the store; *proved*: it returned with the node-ID after a reset.
    """

    address: LssAddress
    before: int
    node_id: int
    stored: bool = False
    name: str = ""
    proved: bool = False

    def document(self) -> Document:
        """A node in `dvtcli.lss-change/1`."""
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
    """The changes by *action* (`node-id`, `store`, `assign`): nodes verified with their node-IDs.

    *wanted* is the node-ID of a dry run; *missing* are nodes of a file that were not found.
    """

    renderer: ClassVar = "lss_lines:changed_lines"

    action: str
    nodes: tuple[LssGiven, ...] = ()
    wanted: int | None = None
    missing: tuple[str, ...] = ()
    dry_run: bool = False

    @property
    def exit_code(self) -> int:
        """1 if a node of the file was not found."""
        return 1 if self.missing else 0

    @property
    def failure_of_document(self) -> DvtcliError | None:
        """The error for a nonzero exit code, for programs."""
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
    """The new bit rate (bit/s) of a bus and all its *nodes*, each verified.

    *before* is the old bit rate, None if unknown.
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
