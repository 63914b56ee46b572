"""What `help` looks up: an SDO abort code with its usual causes, or a rule."""

from __future__ import annotations

from collections.abc import Iterator, Sequence

from click.formatting import wrap_text

from dvtcli.domain.abort import abort_text, code_of
from dvtcli.domain.lint import LintRule
from dvtcli.domain.rules.finding import Rule

#: The usual cause of each abort code of CiA 301, and what to do.
USUAL_CAUSES = {
    0x0503_0000: "a second SDO client, or lost frames: end the other master, try again",
    0x0504_0000: "the device waited too long for the next frame: a full bus; try again",
    0x0504_0001: "the device does not know this kind of transfer, or a second client uses the SDO channel",
    0x0504_0002: "a fault of the device's block transfer",
    0x0504_0003: "lost frames in a block transfer: try again",
    0x0504_0004: "lost or altered data in a block transfer: try again",
    0x0504_0005: "the device is short of memory: use fewer transfers at once, or reset it",
    0x0601_0000: "the object is locked now: it needs another NMT state or a login, or this firmware lacks it",
    0x0601_0001: "none: the object has no readable value",
    0x0601_0002: "a fixed mapping or COB-ID, or the device needs a login first",
    0x0602_0000: "wrong index (indices are hexadecimal here), or the EDS is of another revision",
    0x0604_0041: "`objects --mappable tpdo` (or `rpdo`); check the direction and the length",
    0x0604_0042: "more than 64 bits in the PDO, or more entries than the device allows",
    0x0604_0043: "another parameter excludes this value: see the device's manual",
    0x0604_0047: "the device's configuration contradicts itself: see its manual, or `restore`",
    0x0606_0000: "often the EEPROM: try again, then suspect the device",
    0x0607_0010: "the object's length differs from the EDS: `read` it, or use `--as u16`",
    0x0607_0012: "the same: use a shorter type",
    0x0607_0013: "the same: use a longer type",
    0x0609_0011: "sub-indices are hexadecimal here; the array may be shorter in this firmware",
    0x0609_0030: "out of range; at 0x1800:02 or 0x1A00 often a PDO that must be disabled first, which dvtcli does",
    0x0609_0031: "above the object's upper limit: `objects` shows the limit in the EDS",
    0x0609_0032: "below the object's lower limit",
    0x0609_0036: "write the other limit first",
    0x060A_0023: "the SDO channel is in use by another client",
    0x0800_0000: "a wrong state of the device, or a missing login; the error history (`faults`) may have the cause",
    0x0800_0020: "a wrong signature, or the device cannot store now",
    0x0800_0021: "the device is operated locally: switch it to remote",
    0x0800_0022: "the device needs PRE-OPERATIONAL (`nmt preop`), or the power stage off",
    0x0800_0023: "the device is not configured, or in its boot loader",
    0x0800_0024: "the value does not exist yet",
}


def abort_help(name: str) -> str | None:
    """Return the meaning and the usual cause of the abort code *name*, with or without 0x; None if it is none."""
    code = code_of(name)
    if code is None:
        return None
    rules = ", ".join(rule.name for rule in _rules_of_changes() if code in rule.aborts)
    lines = [f"0x{code:08X}: {abort_text(code)}", "", *_row("cause", USUAL_CAUSES[code])]
    lines += _row("rules", f"checked before a write: {rules}; `help RULE` explains a rule") if rules else []
    lines += _row("source", "CiA 301, table 22")
    return "\n".join([*lines, "", "An error shows `why` if the device's profile gives the code another cause."])


def rule_help(name: str) -> str | None:
    """Return the severity, condition and source of the rule *name*, for each kind of check; None if it is none."""
    found = [row for kind, rules in _every_rule() for row in _rule_lines(kind, rules, name)]
    return "\n".join([f"{name}: a rule", *found]) if found else None


def _rules_of_changes() -> tuple[Rule, ...]:
    from dvtcli.device.access_level import RULES as LOGIN_RULES
    from dvtcli.device.change import apply_plan
    from dvtcli.operations.changes import undo
    from dvtcli.operations.network.check_networks import rules_of_changes
    from dvtcli.operations.objects import write_object
    from dvtcli.operations.pdos import sync
    from dvtcli.operations.session import consent

    others = (apply_plan, undo, write_object, sync, consent)
    return (*rules_of_changes(), *LOGIN_RULES, *(rule for file in others for rule in file.RULES))


def _every_rule() -> Iterator[tuple[str, Sequence[Rule | LintRule]]]:
    """Iterate over the kinds of checks with their rules."""
    from dvtcli.domain.network.check.network_rules import NETWORK_RULES
    from dvtcli.files.device_lint import EVERY_RULE
    from dvtcli.operations.network.check_networks import FILE_RULES
    from dvtcli.watch.recording_checks.recording_rules import RECORDING_RULES, UNREADABLE

    yield "of a change (`map`, `set`, `write`, `link`, `plan`, `apply`)", _rules_of_changes()
    yield "of `check`, for a network", (*FILE_RULES, *NETWORK_RULES)
    yield "of `check`, for a recording", (*RECORDING_RULES, UNREADABLE)
    yield "of `eds check`", EVERY_RULE


def _rule_lines(kind: str, rules: Sequence[Rule | LintRule], name: str) -> Iterator[str]:
    for rule in rules:
        if rule.name != name:
            continue
        severities = rule.severities if isinstance(rule, Rule) else (rule.severity,)
        yield from ("", f"  {' or '.join(map(str, severities))} {kind}")
        yield from _row("finding", rule.sense)
        yield from _row("source", "a rule of dvtcli" if rule.source == "ours" else rule.source)
        if isinstance(rule, Rule):
            yield from (line for code in rule.aborts for line in _row("code", f"0x{code:08X}: {abort_text(code)}"))
        elif rule.hint:
            yield from _row("hint", rule.hint)


def _row(label: str, text: str) -> list[str]:
    """Return *text* after its *label*, in lines of at most 100 columns."""
    return wrap_text(text, 100, f"  {label:<7}  ", " " * 11).splitlines()
