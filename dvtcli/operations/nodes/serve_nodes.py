"""Simulated nodes served to other programs until somebody ends it, and how the others find them."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path
from typing import TYPE_CHECKING

from dvtcli.errors import UsageError
from dvtcli.operations.results import Facts
from dvtcli.operations.session.serve import LOOPBACK

if TYPE_CHECKING:
    from dvtcli.operations.session.serve import ServeRequest, Serving
    from dvtcli.operations.session.session import Session

#: up to this number, nodes are named
_NAMED = 8


def serve(session: Session, wanted: ServeRequest, begun: Callable[[Facts], None], ready: Path | None = None) -> None:
    """Serve the nodes of *wanted* until Ctrl-C; calls *begun* with the address once ready.

    *ready* is a file with `HOST:PORT`, or the joined bus, until the end. Raises BusUnavailable if an address or a bus
    cannot be opened, UsageError and InputFileError for wrong words and files.
    """
    try:
        with session.serving(wanted) as served:
            if ready is not None:
                _say_ready(ready, served, wanted.address)
            begun(_facts(served, wanted.address[0] if wanted.address else LOOPBACK, session.options.bitrate))
            served.server.run()
    finally:
        if ready is not None:
            ready.unlink(missing_ok=True)


def _say_ready(ready: Path, served: Serving, where: tuple[str, int] | None) -> None:
    draft = ready.with_name(f"{ready.name}.new")
    try:
        draft.write_text(f"{where[0]}:{served.port}\n" if where else f"{served.joined}\n", encoding="utf-8")
        draft.replace(ready)
    except OSError as failed:
        raise UsageError(f"{failed.strerror}", given={"ready_file": ready}) from failed


def _facts(served: Serving, host: str, bit_rate: int | None) -> Facts:
    names = [node.label for node in served.nodes]
    more = f", and {len(names) - _NAMED} more" if len(names) > _NAMED else ""
    who = ", ".join(names[:_NAMED]) + more
    places, attach = [], ""
    if served.port is not None:
        address = f"[{host}]" if ":" in host else host
        places.append(f"listening on {address}:{served.port}")
        attach = f"dvtcli -i socketcand -c {address}:{served.port}"
        attach += "" if bit_rate is None else f" -b {bit_rate}"
    if served.joined is not None:
        places.append(f"on {served.joined}")
    rows = (
        ("host", host if served.port is not None else None),
        ("port", served.port),
        ("bus", served.joined),
        ("nodes", [node.node_id for node in served.nodes]),
    )
    here = f"{' and '.join(places)}: {who}"
    # on its own line and without a terminal's width, for copying
    lines = (f"{here}; attach with", attach, *_names(served)) if attach else (here,)
    return Facts("sim", rows, lines)


def _names(served: Serving) -> tuple[str, ...]:
    """Say where object names of served families come from; empty without a family."""
    family = next((node.family for node in served.nodes if node.family), None)
    if family is None:
        return ()
    return (f"Names of objects: --eds {family}, or `dcf: {family}` in a network file.",)
