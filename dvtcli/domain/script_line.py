"""Script lines that repeat a change on a fresh device, in the long form."""

from __future__ import annotations

from collections.abc import Collection, Iterator, Mapping
from dataclasses import replace

from dvtcli.domain.cob_id import CobId
from dvtcli.domain.mapping import PdoMappingEntry
from dvtcli.domain.pdo import Pdo, PdoCommunicationParameter, PdoConfig
from dvtcli.domain.plan import PdoChange, Plan, Step, ValueChange
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
        off = replace(config, communication=replace(config.communication, cob_id=cob_id.disabled()))
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
