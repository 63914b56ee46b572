"""Simulated nodes served to other programs until somebody ends it, and how the others find them."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path
from typing import TYPE_CHECKING

from dvtcli.errors import UsageError
from dvtcli.operations.opening.serve import LOOPBACK
from dvtcli.operations.results import Facts

if TYPE_CHECKING:
    from dvtcli.operations.opening.serve import Serving, Wanted
    from dvtcli.operations.session.session import Session

#: more nodes than these are counted, not named
_NAMED = 8


def serve(session: Session, wanted: Wanted, begun: Callable[[Facts], None], ready: Path | None = None) -> None:
    """Serve the nodes of *wanted* until Ctrl-C; *begun* is told where, once clients can come.

    *ready* is a file that has `HOST:PORT`, or the joined bus, from then until the end. BusUnavailable where an address
    or a bus is not to be had, UsageError and InputFileError for wrong words and files.
    """
    try:
        with session.serving(wanted) as served:
            if ready is not None:
                _say_ready(ready, served, wanted.address)
            begun(_facts(served, wanted.address[0] if wanted.address else LOOPBACK))
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
        raise UsageError(f"--ready-file {ready}: {failed.strerror}") from failed


def _facts(served: Serving, host: str) -> Facts:
    names = [one.label for one in served.nodes]
    more = f", and {len(names) - _NAMED} more" if len(names) > _NAMED else ""
    who = ", ".join(names[:_NAMED]) + more
    places, attach = [], ""
    if served.port is not None:
        places.append(f"listening on {f'[{host}]' if ':' in host else host}:{served.port}")
        attach = f"dvtcli -i socketcand -c can0 --bus-kwargs host={host} --bus-kwargs port={served.port}"
    if served.joined is not None:
        places.append(f"on {served.joined}")
    rows = (
        ("host", host if served.port is not None else None),
        ("port", served.port),
        ("bus", served.joined),
        ("nodes", [one.node_id for one in served.nodes]),
    )
    here = f"{' and '.join(places)}: {who}"
    # in a line of its own and a terminal's width it can be copied
    return Facts("sim", rows, (f"{here}; attach with", attach) if attach else (here,))
