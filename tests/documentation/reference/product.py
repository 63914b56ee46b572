"""What of the product the reference is made from, and where it lives: the one place to mend after a move."""

from __future__ import annotations

from dvtcli.cli.catalogue import task_sections
from dvtcli.cli.dvt.words import WORDS
from dvtcli.cli.global_options import PREFIX
from dvtcli.cli.lexer import split
from dvtcli.cli.registry import REGISTRY
from dvtcli.domain.profile import DeviceProfile
from dvtcli.domain.rules.finding import Rule
from dvtcli.errors import DvtcliError
from dvtcli.files.profiles import builtin_names, builtin_path, load_profile, reasons
from dvtcli.operations.user.options import START_ONLY
from dvtcli.operations.user.settings import ALIASES, PASSCODE, USERS_OWN
from dvtcli.simulator.device.simulated_faults import FORMS as FAULT_FORMS
from dvtcli.simulator.network.family_file import family_eds, family_names
from dvtcli.simulator.network.signals import _FORMS as SIGNAL_FORMS
from tests.house.source import PACKAGE

#: the folder with the families, one folder each
SIMULATED = PACKAGE / "families"

__all__ = [
    "ALIASES", "FAULT_FORMS", "PASSCODE", "PREFIX", "REGISTRY", "SIGNAL_FORMS", "SIMULATED", "START_ONLY", "USERS_OWN",
    "WORDS", "DeviceProfile", "DvtcliError", "Rule", "builtin_names", "builtin_path", "family_eds", "family_names",
    "load_profile", "reasons", "split", "task_sections",
]  # fmt: skip
