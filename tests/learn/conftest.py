"""What `learn` saves into a test's own home is known to no other test."""

from __future__ import annotations

from collections.abc import Iterator

import pytest

from dvtcli.files.profile.library import read_anew


@pytest.fixture(autouse=True)
def profiles_of_this_home(surroundings: object) -> Iterator[None]:
    """A process reads each profile once; here each test has another home."""
    read_anew()
    yield
    read_anew()
