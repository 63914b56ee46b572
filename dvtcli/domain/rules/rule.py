"""How a file declares the rules that it checks, so that their names are known without a device to break them on.

Knows no rule and checks nothing: the declarations stand in the files that use them, as their `RULES`.
"""

from __future__ import annotations

from typing import NamedTuple

from dvtcli.domain.profile import Severity

ERROR = (Severity.ERROR,)
WARNING = (Severity.WARNING,)
NOTE = (Severity.NOTE,)


class Rule(NamedTuple):
    """One rule: its *name*, how strongly it is meant, where it speaks (*sense*), and who says so (*source*).

    *aborts* are the SDO abort codes that a device answers where the rule is broken. Strongest severity first.
    """

    name: str
    severities: tuple[Severity, ...]
    sense: str
    source: str
    aborts: tuple[int, ...] = ()
