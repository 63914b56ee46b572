"""Read who has a node-ID by SDO: 0x1018 is the LSS address. Sends no LSS, changes nothing."""

from __future__ import annotations

from contextlib import suppress
from typing import TYPE_CHECKING

from dvtcli.device.read_pdos import read_identity
from dvtcli.domain.hint import Action, Hint
from dvtcli.domain.lss_services import LssAddress
from dvtcli.errors import NoAnswer, SafetyRefusal, SdoAborted, SdoProtocolError

if TYPE_CHECKING:
    from collections.abc import Callable, Collection

    from dvtcli.domain.ports import CanopenBus

#: 0x1018:1..4 of a node; None for missing numbers.
Identity = tuple[int | None, ...]
#: attempts to identify a node
_ASKED = 3
#: time-out of a node-ID that may be unused (s)
_ANSWER_S = 0.05


def answers(bus: CanopenBus, node_id: int) -> bool:
    """Tell whether SDO requests to *node_id* are answered, even with nonsense."""
    try:
        bus.sdo(node_id).upload(0x1000, 0)
    except NoAnswer:
        return False
    except (SdoAborted, SdoProtocolError):
        return True
    return True


def identity_on(bus: CanopenBus, node_id: int) -> Identity | None:
    """Read 0x1018 of *node_id*, None without an answer, after retries."""
    for _ in range(_ASKED):
        with suppress(NoAnswer, SdoProtocolError):
            return tuple(read_identity(bus.sdo(node_id), sub_index) for sub_index in (1, 2, 3, 4))
    return None


def who_is_there(bus: CanopenBus, heard: Collection[int]) -> dict[int, Identity | None]:
    """Read 0x1018 of every node-ID that was *heard* or answers; None if unreadable."""
    found: dict[int, Identity | None] = {}

    def ask(node_id: int) -> None:
        if _answers_soon(bus, node_id) or node_id in heard:
            found[node_id] = identity_on(bus, node_id)

    def asking(node_id: int) -> Callable[[], None]:
        return lambda: ask(node_id)

    for failed in bus.side_by_side([asking(node_id) for node_id in range(1, 128)]):
        raise failed
    return dict(sorted(found.items()))


def free_node_id(bus: CanopenBus) -> int | None:
    """Return the lowest node-ID (1..127) not heard and without SDO answer; None if there is none."""
    heard = bus.heard_nodes()
    silent = (node_id for node_id in range(1, 128) if node_id not in heard and not _answers_soon(bus, node_id))
    return next((node_id for node_id in silent if not answers(bus, node_id)), None)


def _answers_soon(bus: CanopenBus, node_id: int) -> bool:
    try:
        bus.sdo(node_id).upload(0x1000, 0, timeout_s=_ANSWER_S, retries=0)
    except NoAnswer:
        return False
    except (SdoAborted, SdoProtocolError):
        pass  # somebody is there
    return True


def require_on(bus: CanopenBus, address: LssAddress, node_id: int) -> None:
    """Raises NoAnswer if *node_id* does not answer, SafetyRefusal if its 0x1018 does not fit *address*."""
    identity = identity_on(bus, node_id)
    if identity is None:
        raise NoAnswer(f"{address} did not come up as node {node_id}", node=node_id)
    if not _is(identity, address):
        raise SafetyRefusal(
            f"node {node_id} is another device than the one with {address}", node=node_id,
            why=f"its 0x1018 says {in_words(identity)}",
        )  # fmt: skip


def is_on(bus: CanopenBus, address: LssAddress, node_id: int) -> bool:
    """Tell whether the node with *address* answers SDO as *node_id*."""
    identity = identity_on(bus, node_id)
    return identity is not None and _is(identity, address)


def in_words(identity: Identity) -> str:
    """Print 0x1018, missing numbers as `-`."""
    return " ".join("-" if part is None else f"0x{part:X}" for part in identity)


def _is(identity: Identity, address: LssAddress) -> bool:
    """Tell whether 0x1018 fits *address*: its vendor, and every other number present."""
    told = zip(identity, address.parts, strict=True)
    return identity[0] is not None and all(part in (None, wanted) for part, wanted in told)


def address_of(bus: CanopenBus, node_id: int) -> LssAddress:
    """Return the LSS address of *node_id* by 0x1018; raises NoAnswer, SafetyRefusal if incomplete."""
    identity = identity_on(bus, node_id)
    if identity is None:
        raise NoAnswer(
            f"node {node_id} does not answer", node=node_id, hint=Hint(Action.FIND_NODES, why="shows who is there")
        )
    vendor, product, revision, serial = identity
    if vendor is None or product is None or revision is None or serial is None:
        raise SafetyRefusal(
            f"node {node_id} does not tell its whole LSS address (0x1018:1..4)", node=node_id,
            hint="without vendor, product, revision and serial number no LSS master can select it",
        )  # fmt: skip
    return LssAddress(vendor, product, revision, serial)
