"""The rules, from the `RULES` of the files that check them, and SDO abort codes, from the text of `help`."""

from __future__ import annotations

import ast
from collections.abc import Iterator
from importlib import import_module

from dvtcli.cli.view.typed_hints import typed
from dvtcli.domain.abort import abort_text
from dvtcli.domain.abort_causes import USUAL_CAUSES
from tests.documentation.reference.markdown import cell, code
from tests.documentation.reference.markdown import table as markdown_table
from tests.documentation.reference.product import Rule
from tests.house.source import PACKAGE, Module, modules


def declared() -> list[Rule]:
    """Every rule that any file declares."""
    found: list[Rule] = []
    for module in modules():
        if _declares(module):
            dotted = ".".join([PACKAGE.name, *module.path.relative_to(PACKAGE).with_suffix("").parts])
            found += import_module(dotted).RULES
    return found


def _declares(module: Module) -> bool:
    return "RULES" in module.text and any(  # most files need not be parsed
        isinstance(node, ast.Assign) and [ast.unparse(target) for target in node.targets] == ["RULES"]
        for node in module.tree.body
    )


def table() -> Iterator[str]:
    """Name, severity, sense, abort codes and source of each rule, by name."""
    header = ("rule", "is", "where", "code", "source")
    return markdown_table(header, (_row(rule) for rule in sorted(declared())))


def abort_codes() -> Iterator[str]:
    """Each SDO abort code with its meaning and its usual cause."""
    rows = ((f"0x{code:08X}", cell(abort_text(code)), cell(typed(cause))) for code, cause in USUAL_CAUSES.items())
    return markdown_table(("code", "meaning", "usual cause, and what to do"), rows)


def _row(rule: Rule) -> tuple[str, ...]:
    codes = ", ".join(f"0x{abort:08X}" for abort in rule.aborts)
    return code(rule.name), ", ".join(rule.severities), cell(rule.sense), codes, cell(rule.source)
