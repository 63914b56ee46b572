"""Options of the test run."""

from __future__ import annotations

import gc
import os
import shutil
import signal
import sys
from collections.abc import Iterator
from importlib.util import find_spec
from pathlib import Path

import pytest
from hypothesis import HealthCheck, settings

from tests import process
from tests.harness import branches, costs, sample
from tests.harness.compiled import compile_share
from tests.surroundings import Places, clean_environment, own_ground, own_place, set_environment

#: a machine under load is slow, and no less right for it
_UNHURRIED = settings(deadline=None, suppress_health_check=[HealthCheck.too_slow])
settings.register_profile("unhurried", _UNHURRIED, max_examples=10)
settings.load_profile("unhurried")
#: `pytest --hypothesis-profile=thorough` looks at as many times more examples of every law.
settings.register_profile("many", _UNHURRIED, max_examples=60)
settings.register_profile("thorough", _UNHURRIED, max_examples=3000)


def pytest_addoption(parser: pytest.Parser) -> None:
    parser.addoption("--eds-corpus", metavar="DIR", help="folder of real EDS and DCF files to read; none: skipped")
    parser.addoption(
        "--update-transcripts", action="store_true", help="rewrite golden sessions with what is printed now"
    )
    parser.addoption(
        "--fresh-python", action="store_true", help="a new Python for each dvtcli, instead of a fork of one"
    )
    parser.addoption("--branches", metavar="FOLDER", help="count the ways through the code into a folder")
    parser.addoption("--costs", metavar="FOLDER", help="measure what each test takes of the processors, into a folder")
    parser.addoption("--frozen", metavar="PROGRAM", help="a program that scripts/freeze.py made; none: skipped")
    parser.addoption("--no-skips", action="store_true", help="run tests whose packages are missing, too: they fail")
    parser.addoption("--oddities", type=int, default=3, metavar="N", help="generated files on the whole way [3]")
    parser.addoption("--serve-frames", type=int, default=8000, metavar="N", help="frames to 4 clients of sim [8000]")
    parser.addoption("--rounds", type=int, default=3, metavar="N", help="rounds of four dvtcli at once [3]")
    parser.addoption("--fuzz", type=int, default=2000, metavar="N", help="hostile inputs in all [2000]")
    parser.addoption("--cells", type=int, default=1, metavar="N", help="faults for each sequence of the matrix [1]")
    parser.addoption("--every-size", action="store_true", help="golden screens in each size of terminal, not in one")
    parser.addoption("--answers", type=int, default=6, metavar="N", help="answers behind which a node restarts [6]")
    parser.addoption("--hosts", type=int, default=4, metavar="N", help="hosts of a fleet, three of them faulty [4]")
    parser.addoption("--kills", type=int, default=2, metavar="N", help="kills in the middle of an atomic script [2]")
    parser.addoption("--networks", type=int, default=6, metavar="N", help="drawn networks with two faults each [6]")
    parser.addoption("--nodes", type=int, default=5, metavar="N", help="nodes of the large network [5]")
    parser.addoption("--learn", type=int, default=4, metavar="N", help="families, faults and kills in learn [4]")
    parser.addoption("--elsewhere", type=int, default=4, metavar="N", help="tests as on Windows or macOS [4]")
    parser.addoption("--frame-sets", type=int, default=100, metavar="N", help="random sets of frames on a wire [100]")
    parser.addoption("--block-bytes", type=int, default=20_000, metavar="N", help="longest block transfer [20000]")
    parser.addoption("--signals", type=int, default=8, metavar="N", help="signals in the middle of a change [8]")
    parser.addoption(
        "--cases",
        choices=("lot", "rest", "more", "all"),
        help="of `drawn` tests: the lot, the rest, the lot and more of the rest, or all [lot; all if some are named]",
    )
    parser.addoption("--share", type=int, default=1, metavar="N", help="of the rest: one case of N, by lot [1]")


@pytest.hookimpl(optionalhook=True)
def pytest_xdist_auto_num_workers(config: pytest.Config) -> int:
    """Two for each core, and one more: half of a test is waiting for a process or a time-out.

    Not more, since each worker reads the product and the tests first, which is ten seconds of a processor for all, and
    more than the tests of a room that only computes. Two for each core if some tests are named, and one more than cores
    for what is quick.
    """
    cores = len(os.sched_getaffinity(0)) if hasattr(os, "sched_getaffinity") else os.cpu_count() or 1
    if config.option.markexpr == "quick":
        return cores + 1
    return 2 * cores + 1 if config.args_source is pytest.Config.ArgsSource.TESTPATHS else 2 * cores


def pytest_collection(session: pytest.Session) -> None:
    """What is collected stays to the end: looking for garbage meanwhile is half of the work, and finds none."""
    gc.disable()
    if session.config.args_source is pytest.Config.ArgsSource.TESTPATHS:  # all tests are to be collected
        compile_share()


def pytest_collection_finish() -> None:
    """From here on garbage is looked for as in dvtcli's own process, and not in what was collected."""
    from dvtcli.__main__ import NEW_OBJECTS  # not sooner: branches of what is imported by then are not counted

    gc.freeze()
    gc.set_threshold(NEW_OBJECTS)
    gc.enable()


@pytest.hookimpl(wrapper=True)
def pytest_collection_modifyitems(config: pytest.Config, items: list[pytest.Item]) -> Iterator[None]:
    """Mark what is a lot and what is quick, before `-m` looks; then leave out what the lot did not draw, and order."""
    sample.mark_quick(items)
    sample.mark_many(items)
    if not config.getoption("--no-skips"):
        _skip_lacking(items)
    yield
    left_out = sample.left_out(items, config, config.getoption("cases"))
    if left_out:
        items[:] = [item for item in items if item not in left_out]
        config.hook.pytest_deselected(items=list(left_out))
    _order(items)


def _is_installed(package: str) -> bool:
    try:
        return find_spec(package) is not None
    except ModuleNotFoundError:  # what it is part of
        return False


def _skip_lacking(items: list[pytest.Item]) -> None:
    """Skip those of *items* that need a package which is not installed."""
    for item in items:
        for marker in item.iter_markers("needs"):
            (package,) = marker.args
            if not _is_installed(package):
                reason = f"{package} is not installed: pip install -e '.[test,more-tests,style]'"
                item.add_marker(pytest.mark.skip(reason=reason))


def _order(items: list[pytest.Item]) -> None:
    """Order *items* in the parts that xdist makes of all, one a worker: it takes from others' tails when it is done.

    What takes long begins early: `long` tests, most of which wait, go to the heads of every other part, so that the
    processors have something to do meanwhile. What has something large to read once in a process, `together`, goes
    behind them to one part. Nothing else changes in the order that pytest-randomly made.
    """
    marks = {item: sample.marks(item) for item in items}
    early = [item for item in items if "long" in marks[item]]
    rest = [item for item in items if "long" not in marks[item]]
    rest.sort(key=lambda item: "together" not in marks[item])
    workers = int(os.environ.get("PYTEST_XDIST_WORKER_COUNT", "1"))
    ordered: list[pytest.Item] = []
    for number in range(workers):
        first = [] if number % 2 else early[number // 2 :: (workers + 1) // 2]
        others = max(0, (len(items) - len(ordered)) // (workers - number) - len(first))
        ordered += [*first, *rest[:others]]
        del rest[:others]
    items[:] = ordered


def pytest_configure(config: pytest.Config) -> None:
    """In every worker, before any test is read: nobody's wishes for dvtcli, Python or a terminal count."""
    process.FRESH_PYTHON |= config.getoption("--fresh-python")
    if config.option.cases is None:  # a worker is told what this process decides
        named = getattr(config.option, "file_or_dir", None) or config.option.keyword  # `--help` has no files
        config.option.cases = "all" if named or config.option.markexpr == "quick" else "lot"
    if config.option.eds_corpus:  # each test has a working folder of its own
        config.option.eds_corpus = str(Path(config.option.eds_corpus).absolute())
    set_environment(clean_environment() | _for_workers(config))
    # A shell starts what it does not wait for without SIGINT, nohup without SIGHUP: dvtcli would start so, too.
    for name, usual in (("SIGINT", signal.default_int_handler), ("SIGHUP", signal.SIG_DFL)):
        number = getattr(signal, name, None)  # Windows has no SIGHUP
        if number is not None and signal.getsignal(number) is signal.SIG_IGN:
            signal.signal(number, usual)
    sys.dont_write_bytecode = False  # hundreds of processes start, and would compile all of it again each
    if config.option.branches is not None:
        _count_branches(config)
    if config.option.costs is not None and not _only_hands_out(config):
        config.pluginmanager.register(costs.Costs(config.rootpath / config.option.costs))


def _count_branches(config: pytest.Config) -> None:
    """Count in this process; the one that only hands tests to others empties the folder first."""
    folder = config.rootpath / config.option.branches
    if _only_hands_out(config):
        shutil.rmtree(folder, ignore_errors=True)
    else:
        branches.count()
        config.add_cleanup(lambda: branches.write(folder))


def _only_hands_out(config: pytest.Config) -> bool:
    """Whether this process runs no test, and only hands them to its workers."""
    return bool(getattr(config.option, "numprocesses", None)) and not hasattr(config, "workerinput")


def _for_workers(config: pytest.Config) -> dict[str, str]:
    """Options from a variable, which a worker has to read too: `--branches` counts where the tests are."""
    has_workers = _only_hands_out(config)
    kept = ["PYTEST_ADDOPTS"] + ["PYTHONPATH"] * ("TESTS_ELSEWHERE" in os.environ)  # which is where its double is
    return {key: os.environ[key] for key in kept if has_workers and key in os.environ}


@pytest.fixture(scope="session", autouse=True)
def ground(tmp_path_factory: pytest.TempPathFactory) -> Iterator[Places]:
    """The home and working folder of what lives longer than a test, and the folders of the tests."""
    base = own_ground(tmp_path_factory.getbasetemp())
    folder = base / "places"
    folder.mkdir()
    with own_place(folder / "all"):
        # matplotlib looks for fonts, for seconds, in each home that is new to it
        os.environ["MPLCONFIGDIR"] = str(base.parent if "PYTEST_XDIST_WORKER" in os.environ else base)
        yield Places(folder)


@pytest.fixture(autouse=True)
def surroundings(ground: Places) -> Iterator[Path]:
    """Each test's own home, XDG folders, working folder and variables."""
    with ground.another() as work:
        yield work


@pytest.fixture
def port() -> Iterator[int]:
    """A port for servers that come and go, which no other test gets meanwhile."""
    from tests.simulator.serve.served import reserved_port

    with reserved_port() as port:
        yield port
