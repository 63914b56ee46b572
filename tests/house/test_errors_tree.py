"""The tree that `errors` draws is the tree of its classes, exit codes included."""

from __future__ import annotations

import inspect
import re

import pytest

from dvtcli import errors

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
