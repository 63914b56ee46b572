"""The laws of the house as functions of its source: each gives what breaks it, in words.

What a law lets some files do stands in its own file, each with what for, such as `MAY_SEND`; `direction` lets nobody.
`test_laws` sees that no permission is left over.

`LAWS` has them by name. `test_laws` holds the house to them, and breaks each in several ways to see that it bites. Laws
3, 4 and 9 are about what a device holds: `tests/laws`, `tests/faults` and the mutation run try them.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable

from tests.house.laws.buses import no_kind_of_bus_is_asked_for
from tests.house.laws.effects import who_only_reads_sends_nothing
from tests.house.laws.failures import ends_nowhere_else, errors_stand_in_one_tree, nothing_is_swallowed
from tests.house.laws.folders import operations_stand_in_folders
from tests.house.laws.imports import direction, independence, libraries
from tests.house.laws.laziness import nothing_heavy_is_eager
from tests.house.laws.makers import behaviours_not_vendors
from tests.house.laws.results import results_say_all_of_themselves
from tests.house.laws.senders import few_files_send
from tests.house.laws.source_tree import SourceTree
from tests.house.laws.words_out import only_view_prints

Law = Callable[[SourceTree], Iterable[str]]

LAWS: dict[str, Law] = {
    "direction": direction,
    "folders": operations_stand_in_folders,
    "independence": independence,
    "libraries": libraries,
    "buses": no_kind_of_bus_is_asked_for,
    "senders": few_files_send,
    "effects": who_only_reads_sends_nothing,
    "vendors": behaviours_not_vendors,
    "laziness": nothing_heavy_is_eager,
    "exits": ends_nowhere_else,
    "errors": errors_stand_in_one_tree,
    "swallowing": nothing_is_swallowed,
    "printing": only_view_prints,
    "results": results_say_all_of_themselves,
}
