"""Shorten a script to the lines that lead to the same configuration."""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import replace

from dvtcli.domain.pdo import Pdo, PdoConfig
from dvtcli.domain.plan import plan_pdo
from dvtcli.domain.script_line import change_line, whole_lines

_ON_PDOS = ("map", "set", "clear", "enable", "disable")
#: Lines that a node may need to accept the others.
_OPENING = ("login", "nmt preop", "fpo")


def end_state(lines: Iterable[str], before: Mapping[Pdo, PdoConfig], after: Mapping[Pdo, PdoConfig]) -> list[str]:
    """Lines that bring a node from *before* to the final state after *lines*, without trial and error.

    *before* and *after* are the PDOs changed by *lines*, before the first and after the last line; a PDO missing in
    *before* is written completely. `store` stays if nothing was changed after it; `restore` discards all lines
    before it.
    """
    flat = [line for entry in lines for line in entry.splitlines()]
    head, rest = _since_restore(flat)
    known = {} if head else before
    last = {key: number for number, line in enumerate(rest) for key in _keys(line)}
    opening = list(dict.fromkeys(line for line in rest if line.startswith(_OPENING) and not line.endswith(" op")))
    changed = [key for key, _ in sorted(last.items(), key=lambda item: item[1])]
    pdos = [key for key in changed if isinstance(key, Pdo) and key in after]
    early = _in_the_way(pdos, known, after)
    body = [f"disable {' '.join(map(str, early))}"] if early else []
    for key in changed:
        if not isinstance(key, Pdo):
            body.append(rest[last[key]])
        elif key in after:
            body += _pdo_lines(key, known, after, disabled=key in early)
    stores = [line for line in rest[max(last.values(), default=-1) + 1 :] if line.split()[0] == "store"]
    stored = list(dict.fromkeys(stores)) if body or not last else []
    return [*head, *opening, *body, *stored] if head or body or stored else []


def left_out_stores(lines: Iterable[str], ended: Iterable[str]) -> list[str]:
    """Stores among *lines*, since the last `restore`, that are missing in the shortened script *ended*."""
    _, rest = _since_restore([line for entry in lines for line in entry.splitlines()])
    kept = set(ended)
    return [line for line in dict.fromkeys(rest) if line.split()[0] == "store" and line not in kept]


def touched(lines: Iterable[str]) -> set[Pdo]:
    """PDOs that *lines* set."""
    keys = (key for entry in lines for line in entry.splitlines() for key in _keys(line))
    return {key for key in keys if isinstance(key, Pdo)}


def _since_restore(lines: Sequence[str]) -> tuple[list[str], list[str]]:
    """The last `restore` with the resets after it, and the remaining lines; no head without a restore."""
    at = max((number for number, line in enumerate(lines) if line.split()[0] == "restore"), default=None)
    if at is None:
        return [], list(lines)
    behind = at + 1
    while behind < len(lines) and lines[behind].startswith("nmt reset-"):
        behind += 1
    return list(lines[at:behind]), list(lines[behind:])


def _keys(line: str) -> list[Pdo | str]:
    """PDOs that *line* sets, or words for an object or a pin; empty if it sets nothing."""
    command, *words = line.split()
    if command in _ON_PDOS:
        return [Pdo.parse(word) for word in words if _is_pdo(word)]
    if command == "write":
        in_pdo = Pdo.at(int(words[0].partition(":")[0], 16)) is not None
        return [] if in_pdo else [f"write {words[0]}"]  # its PDO has a line of its own
    return [" ".join([command, *words[:-1]])] if command == "vpdo" else []


def _is_pdo(word: str) -> bool:
    try:
        Pdo.parse(word)
    except ValueError:
        return False
    return True


def _in_the_way(pdos: Sequence[Pdo], before: Mapping[Pdo, PdoConfig], after: Mapping[Pdo, PdoConfig]) -> list[Pdo]:
    """PDOs that hold a CAN-ID which an earlier PDO in the script is to get."""
    found = []
    for number, pdo in enumerate(pdos):
        held = before[pdo].communication.cob_id if pdo in before else None
        wanted = [after[other].communication.cob_id for other in pdos[:number]]
        if held is not None and held.valid and any(cob_id.valid and cob_id.can_id == held.can_id for cob_id in wanted):
            found.append(pdo)
    return found


def _pdo_lines(
    pdo: Pdo, before: Mapping[Pdo, PdoConfig], after: Mapping[Pdo, PdoConfig], *, disabled: bool
) -> list[str]:
    if pdo not in before:
        return whole_lines(pdo, after[pdo])
    now = before[pdo]
    if disabled:
        now = replace(now, communication=replace(now.communication, cob_id=now.communication.cob_id.disabled()))
    return change_line(plan_pdo(pdo, now, after[pdo])).splitlines()
