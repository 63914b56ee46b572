"""The tree that `errors` draws is the tree of its classes, exit codes included."""

from __future__ import annotations

import copy
import inspect
import pickle
import re
from collections.abc import Callable

import pytest

from dvtcli import errors
from dvtcli.domain.profile import Severity
from dvtcli.domain.rules import Finding

pytestmark = pytest.mark.together


def drawn() -> dict[str, int]:
    lines = re.findall(r"^\s+(?:[├└]── )?(\w+) +(\d+)\b", errors.__doc__ or "", re.M)
    return {name: int(code) for name, code in lines}


def defined() -> dict[str, int]:
    classes = inspect.getmembers(errors, inspect.isclass)
    return {name: kind.exit_code for name, kind in classes if issubclass(kind, errors.DvtcliError)}


def test_the_drawing_is_the_tree() -> None:
    assert drawn() == defined()


def test_every_failure_has_its_own_slug() -> None:
    slugs = [
        kind.slug for _, kind in inspect.getmembers(errors, inspect.isclass) if issubclass(kind, errors.DvtcliError)
    ]
    assert len(slugs) == len(set(slugs))


def test_it_is_one_level_deep() -> None:
    for name, kind in inspect.getmembers(errors, inspect.isclass):
        if issubclass(kind, errors.DvtcliError) and kind is not errors.DvtcliError:
            assert kind.__bases__ == (errors.DvtcliError,), name


def every_failure() -> list[errors.DvtcliError]:
    """One of each class, with what a caller may have found out about it."""
    found = [
        kind("what failed", node=5, place="1A00:03", why="because", hint="do this", state="rolled_back")
        for _, kind in inspect.getmembers(errors, inspect.isclass)
        if issubclass(kind, errors.DvtcliError) and kind not in (errors.SdoAborted, errors.RuleError)
    ]
    finding = Finding("pdo-length", Severity.ERROR, "9 bytes", "TPDO1", hint="map less")
    return [*found, errors.SdoAborted(0x1A00, 3, 0x06040041, node=5), errors.RuleError("no", [finding], node=5)]


@pytest.mark.parametrize("failure", every_failure(), ids=lambda one: one.slug)
@pytest.mark.parametrize("again", [lambda one: pickle.loads(pickle.dumps(one)), copy.copy], ids=["pickled", "copied"])  # noqa: S301
def test_another_process_gets_all_of_it(
    failure: errors.DvtcliError, again: Callable[[errors.DvtcliError], errors.DvtcliError]
) -> None:
    failure.details.append(("step", "0x1A00:03 <- 0x27030120"))
    failure.add_note("state: rolled_back")
    other = again(failure)
    assert type(other) is type(failure)
    assert (str(other), other.args, vars(other)) == (str(failure), failure.args, vars(failure))
