"""`python -m tests.packaging.lowest`: the lower bounds of all dependencies as constraints, for `pip install -c`."""

from __future__ import annotations

import re
import tomllib
from collections.abc import Iterable, Iterator

from tests.surroundings import ROOT


def wanted() -> list[str]:
    """What `pip install '.[test]'` asks for, as pyproject.toml has it."""
    project = tomllib.loads((ROOT / "pyproject.toml").read_text("utf-8"))["project"]
    return [*project["dependencies"], *project["optional-dependencies"]["test"]]


def lower_bounds(requirements: Iterable[str]) -> Iterator[str]:
    """Yield `NAME==LOWEST` for each of *requirements*; ValueError if one has no lower bound."""
    for requirement in requirements:
        found = re.match(r"([\w.-]+)(?:\[[\w,-]+\])?>=([\w.]+)", requirement)
        if found is None:
            raise ValueError(f"{requirement}: no lower bound")
        yield f"{found[1]}=={found[2]}"


if __name__ == "__main__":
    print(*lower_bounds(wanted()), sep="\n")
