"""The documentation's reference, made from the code.

`python -m tests.documentation.reference` rewrites what is generated.

A page in `docs/`, or README, holds a generated part between two comments; the rest of the page is written by hand:

    <!-- generated: rules -->
    …
    <!-- end of generated -->

Two pages are long and nothing but generated: they are not kept, and `built/` has what stands around their parts.
`PARTS` has the function for each name. The product never imports this.
"""

from __future__ import annotations

import re
from collections.abc import Callable, Iterator
from functools import cache
from importlib import import_module
from pathlib import Path

from tests.surroundings import ROOT

DOCS = ROOT / "docs"
REWRITE = "python -m tests.documentation.reference"
#: the name of a part -> `module:function` in this room
PARTS = {
    "tasks": "commands:tasks",
    "commands-by-task": "commands:by_task",
    "commands": "commands:every_command",
    "dvt-words": "commands:dvt_words",
    "options": "options:table",
    "settings": "options:settings",
    "errors": "errors:table",
    "exit-codes": "errors:numbers",
    "documents": "documents:every_document",
    "schemas": "documents:every_schema",
    "abort-codes": "rules:abort_codes",
    "rules": "rules:table",
    "eds-rules": "eds_rules:table",
    "eds-keys": "eds_keys:keys",
    "network-rules": "network_rules:table",
    "recording-rules": "recording_rules:table",
    "network-keys": "network:keys",
    "profiles": "families:profiles",
    "profile-values": "families:profile_values",
    "simulated": "families:simulated",
    "simulated-values": "families:simulated_values",
    "rooms": "house:rooms",
    "senders": "house:senders",
    "walks": "walks:walks",
    "roll-backs": "walks:roll_backs",
    "faults": "faults:faults",
    "signals": "faults:signals",
    "python-calls": "api:calls",
    "python-commands": "calls:by_command",
    "python-answers": "api:answers",
    "python-fixtures": "api:fixtures",
}
_PART = re.compile(r"(<!-- generated: ([a-z-]+) -->\n).*?(<!-- end of generated -->)", re.S)


#: a page that is not kept -> the text around its parts
BUILT = {DOCS / "reference" / path.name: path for path in (Path(__file__).parent / "built").glob("*.md")}


def pages() -> list[Path]:
    """README and every page of the documentation that is kept."""
    return [ROOT / "README.md", *sorted({*DOCS.rglob("*.md")} - BUILT.keys())]


def names(text: str) -> Iterator[str]:
    """The parts that a page's *text* holds."""
    return (found[2] for found in _PART.finditer(text))


def rewritten(text: str) -> str:
    """A page's *text* with its generated parts as the code has them now."""
    return _PART.sub(lambda found: f"{found[1]}\n{part(found[2])}\n\n{found[3]}", text)


@cache
def part(name: str) -> str:
    """The generated part *name*."""
    module, _, function = PARTS[name].partition(":")
    make: Callable[[], Iterator[str]] = getattr(import_module(f"{__name__}.{module}"), function)
    return "\n".join(make()).strip("\n")
