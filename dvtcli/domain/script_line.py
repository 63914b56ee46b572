"""Script lines that repeat a change on a fresh device, in the long form, and a script's shortest equivalent."""

from __future__ import annotations

from collections.abc import Collection, Iterable, Iterator, Mapping, Sequence

from dvtcli.domain.cob_id import CobId
from dvtcli.domain.pdo import Pdo, PdoCommunicationParameter, PdoConfig, PdoMappingEntry
from dvtcli.domain.plan import PdoChange, Plan, Step, ValueChange, plan_pdo
from dvtcli.domain.request import MPDO_COUNTS
from dvtcli.domain.rules.can_id import restricted_use

#: End of a line about a PDO that a backup does not restore.
LEFT_ALONE, STAYS_OFF = "and is not changed", "it stays off"
REMARKS = (LEFT_ALONE, STAYS_OFF)


def change_lines(plan: Plan) -> list[str]:
    """A line for each change of *plan*, with every value written out."""
    return [line for change in plan.changes for line in _lines(change)]


def _lines(change: PdoChange | ValueChange) -> Iterator[str]:
    if isinstance(change, ValueChange):
        yield value_line(change.step, change.step.after)
    elif change.steps:
        yield change_line(change)


def value_line(step: Step, data: bytes) -> str:
    """The `write` line that sets the object of *step* to *data*."""
    return f"write {step.object} {_value(data)}"


def _value(data: bytes) -> str:
    """Bytes as a value with its type, so that the line needs no EDS."""
    if len(data) in (1, 2, 4, 8):
        return f"0x{int.from_bytes(data, 'little'):0{2 * len(data)}X} --as u{8 * len(data)}"
    return f"{data.hex()} --as os"


def change_line(change: PdoChange) -> str:
    """The line, or lines, for a PDO change; empty without changes."""
    if not change.steps:
        return ""
    before, after, pdo = change.before, change.after, change.pdo
    words = [*_parameter_words(before.communication, after.communication)]
    if after.mpdo is None and (before.mapping != after.mapping or before.mpdo is not None):
        return map_line(pdo, after) if after.mapping else "\n".join(_empty(pdo, words))
    if after.mpdo is not None and _first(after) not in ((), before.entries[:1]):
        return "\n".join(_mpdo_lines(pdo, after))
    if after.mpdo is not None and before.mpdo != after.mpdo:
        words += _mpdo_words(after.mpdo)
    if before.enabled != after.enabled and not words:
        return f"{'enable' if after.enabled else 'disable'} {pdo}"
    if before.enabled and not after.enabled:
        words.append("--off")
    line = " ".join([f"set {pdo}", *words])
    return line if before.enabled or not after.enabled else f"{line}\nenable {pdo}"


def _first(config: PdoConfig) -> tuple[PdoMappingEntry, ...]:
    """The object in sub-index 1 of an MPDO's mapping; empty if it has none."""
    return tuple(entry for entry in config.multiplexed if entry.raw)


def _mpdo_words(count: int) -> list[str]:
    return ["--mpdo", next(kind for kind, held in MPDO_COUNTS.items() if held == count)]


def _mpdo_lines(pdo: Pdo, config: PdoConfig) -> list[str]:
    """Lines that make *pdo* the MPDO *config* from any state: an MPDO keeps the object that was mapped first."""
    words = [*_parameter_words(None, config.communication)]
    first = _first(config)
    mapped = [f"map {pdo}", *map(str, first), *words, "--off"] if first else [f"set {pdo}", *words]
    made = [f"set {pdo}", *_mpdo_words(config.count)]
    lines = [f"clear {pdo}", " ".join(mapped), " ".join(made)]
    return [*lines, f"enable {pdo}"] if config.enabled else lines


def login_line(level: int, user: int | None) -> str:
    """The line that logs in at *level*, as *user* or as the family's user."""
    return f"login {level}" if user is None else f"login {level} --user {user}"


def map_line(pdo: Pdo, config: PdoConfig) -> str:
    """The `map` line that sets *pdo* to *config* from any state."""
    words = [f"map {pdo}", *map(str, config.mapping), *_parameter_words(None, config.communication)]
    return " ".join(words if config.enabled else [*words, "--off"])


def whole_line(pdo: Pdo, config: PdoConfig) -> str:
    """The full configuration of *pdo* for people; a comment for an MPDO or an inconsistent PDO."""
    remark = _remark(pdo, config)
    return f"# {remark}" if remark else "; ".join(whole_lines(pdo, config))


def _remark(pdo: Pdo, config: PdoConfig) -> str:
    """Why a backup leaves *pdo* alone: it is an MPDO, or inconsistent, which no line can set up."""
    if config.mpdo is not None:
        return f"{pdo} is a multiplexed PDO (count 0x{config.mpdo:02X})"
    if not config.inconsistency:
        return ""
    words = " ".join([*map(str, config.mapping), *_parameter_words(None, config.communication)])
    return f"{pdo} is inconsistent ({config.inconsistency}): {words}"


def _parameter_words(before: PdoCommunicationParameter | None, after: PdoCommunicationParameter) -> Iterator[str]:
    identifier = after.cob_id
    if before is None or before.cob_id.enabled() != identifier.enabled():
        yield f"--cob-id {identifier}"
        if identifier.extended:
            yield "--extended"
        yield "--rtr" if identifier.rtr_allowed else "--no-rtr"
    if after.transmission_type is not None and (before is None or before.transmission_type != after.transmission_type):
        yield f"--type {after.transmission_type}"
    if after.inhibit_time is not None and (before is None or before.inhibit_time != after.inhibit_time):
        yield f"--inhibit {after.inhibit_time / 10:g}"
    if after.event_timer is not None and (before is None or before.event_timer != after.event_timer):
        yield f"--timer {after.event_timer}"
    start = after.sync_start_value
    if start is not None and (start if before is None else before.sync_start_value != start):
        yield f"--sync-start {start}"


def backup_lines(
    identity: Mapping[str, int | None], pdos: Mapping[Pdo, PdoConfig], fixed: Collection[Pdo] = ()
) -> list[str]:
    """A script that sets all *pdos* to this configuration, on a device with this *identity* only.

    The script disables PDOs first, since other nodes may use a CAN-ID by the time it runs; except PDOs in *fixed*,
    whose COB-IDs are read-only. Parts that no script could set become comments.
    """
    pin = identity_line(identity)
    lines = ["# dvtcli script 1", *([pin] if pin else []), serial_line(identity)]
    movable = [str(pdo) for pdo, config in pdos.items() if not _remark(pdo, config) and pdo not in fixed]
    lines += [f"disable {' '.join(movable)}"] if movable else []
    return [*lines, *(line for pdo, config in pdos.items() for line in backup_of(pdo, config))]


def backup_of(pdo: Pdo, config: PdoConfig) -> list[str]:
    """Backup lines for *pdo*."""
    remark = _remark(pdo, config)
    return [f"# {remark} {LEFT_ALONE}"] if remark else whole_lines(pdo, config)


def serial_line(identity: Mapping[str, int | None]) -> str:
    """The comment with the device's serial number."""
    serial = identity.get("serial")
    return "# no serial number" if serial is None else f"# serial number 0x{serial:08X}"


def identity_line(identity: Mapping[str, int | None]) -> str:
    """The line that requires this *identity*, except for the serial number; empty without identity."""
    words = [f"{name}=0x{value:08X}" for name, value in identity.items() if value is not None and name != "serial"]
    return f"require identity {' '.join(words)}" if words else ""


def whole_lines(pdo: Pdo, config: PdoConfig) -> list[str]:
    """Lines that set *pdo* to *config* from any state; disabled, with a remark, if its CAN-ID is restricted."""
    if config.mpdo is not None:
        return _mpdo_lines(pdo, config)
    cob_id = config.communication.cob_id
    if config.mapping and config.enabled and not (cob_id.extended or _is_free(cob_id)):
        off = config.disabled()
        return [
            map_line(pdo, off),
            f"# {pdo} was enabled with CAN-ID {cob_id}, which CiA 301 does not allow for PDOs: {STAYS_OFF}",
        ]
    if config.mapping:
        return [map_line(pdo, config)]
    return _empty(pdo, [*_parameter_words(None, config.communication)])


def _is_free(cob_id: CobId) -> bool:
    return cob_id.fits_frame and restricted_use(cob_id.can_id) is None


def _empty(pdo: Pdo, words: list[str]) -> list[str]:
    """Lines that empty *pdo*, and set the parameters *words*."""
    return [f"clear {pdo}", *([" ".join([f"set {pdo}", *words])] if words else [])]


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
        now = now.disabled()
    return change_line(plan_pdo(pdo, now, after[pdo])).splitlines()
