"""Options of the test run."""

from __future__ import annotations

import os
from collections.abc import Iterator

import pytest
from hypothesis import settings

#: a machine under load is slow, and no less right for it
settings.register_profile("unhurried", deadline=None)
settings.load_profile("unhurried")
#: `pytest --hypothesis-profile=thorough` looks at thirty times as many examples of every law.
settings.register_profile("thorough", max_examples=3000, deadline=None)


def pytest_addoption(parser: pytest.Parser) -> None:
    parser.addoption("--eds-corpus", metavar="DIR", help="folder of real EDS and DCF files to read; none: skipped")
    parser.addoption(
        "--update-transcripts", action="store_true", help="rewrite golden sessions with what is printed now"
    )
    parser.addoption("--serve-frames", type=int, default=8000, metavar="N", help="frames to 4 clients of sim [8000]")
    parser.addoption("--rounds", type=int, default=8, metavar="N", help="rounds of four dvtcli at once [8]")
    parser.addoption("--fuzz", type=int, default=20_000, metavar="N", help="hostile inputs in all [20000]")
    parser.addoption("--signals", type=int, default=12, metavar="N", help="signals in the middle of a change [12]")


@pytest.fixture(scope="session", autouse=True)
def state_folder(tmp_path_factory: pytest.TempPathFactory) -> Iterator[None]:
    """Locks, journals, backups and what `undo` remembers are this run's own: nobody's home is read or written."""
    before = os.environ.get("XDG_STATE_HOME")
    os.environ["XDG_STATE_HOME"] = str(tmp_path_factory.mktemp("state"))
    yield
    if before is None:
        del os.environ["XDG_STATE_HOME"]
    else:
        os.environ["XDG_STATE_HOME"] = before
