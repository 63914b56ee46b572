"""What `help` looks up: an SDO abort code with its usual causes, or a rule."""

from __future__ import annotations

from collections.abc import Iterator, Sequence

from click.formatting import wrap_text

from dvtcli.cli.view.typed_hints import typed
from dvtcli.domain.abort import abort_text, code_of
from dvtcli.domain.abort_causes import USUAL_CAUSES
from dvtcli.domain.lint import LintRule
from dvtcli.domain.rules.finding import Rule


def abort_help(name: str) -> str | None:
    """Return the meaning and the usual cause of the abort code *name*, with or without 0x; None if it is none."""
    code = code_of(name)
    if code is None:
        return None
    rules = ", ".join(rule.name for rule in _rules_of_changes() if code in rule.aborts)
    lines = [f"0x{code:08X}: {abort_text(code)}", "", *_row("cause", typed(USUAL_CAUSES[code]))]
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
