"""Each job of `jobs.py` sends and hears what its golden file has, frame by frame in order for each node.

`pytest tests/wire --update-transcripts` rewrites the golden files; a frame that changes needs a reason in the commit.
"""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path

import pytest

from dvtcli.domain.ports import Frame
from dvtcli.simulator.device.simulated_faults import Fault
from tests.bus.devices import device, unknown
from tests.cli.commands.bench import Bench
from tests.virtual_time import VirtualTimeBus
from tests.wire.frames import by_node
from tests.wire.jobs import FILES, JOBS, Job

GOLDENS = Path(__file__).parent / "goldens"


def recorded(job: Job) -> Iterator[str]:
    """The lines of the golden file of *job*."""
    for name, text in FILES.items():
        Path(name).write_text(text, encoding="utf-8")
    devices = []
    for family, _, node_id in (node.partition("@") for node in job.nodes):
        made = unknown if family == "lely" else device
        devices.append(made(int(node_id), family))
    frames: list[tuple[Frame, bool]] = []

    def process(faults: tuple[str, ...]) -> Bench:
        bus = VirtualTimeBus(devices, faults=[Fault.parse(word) for word in faults], simulated=False)
        bus.tap(lambda frame, sent: frames.append((frame, sent)))
        return Bench((), {"yes": True} | ({"node": job.selected} if job.selected else {}), bus)

    yield f"nodes: {' '.join(job.nodes)}"
    if job.faults:
        yield f"faults: {' '.join(job.faults)}"
    bench = process(job.faults)
    for line in job.lines:
        if line == "---":
            bench.session.close()
            bench = process(())
            continue
        frames.clear()
        ran = bench.run(line)
        yield f"$ {line}"
        yield from by_node(frames)
        yield f"  exit code {ran.code}"
    bench.session.close()


@pytest.mark.drawn(6)
@pytest.mark.parametrize("job", JOBS, ids=[job.name for job in JOBS])
def test_a_job_sends_the_frames_that_it_sent(job: Job, pytestconfig: pytest.Config) -> None:
    golden = GOLDENS / f"{job.name}.txt"
    text = "".join(f"{line}\n" for line in recorded(job))
    if pytestconfig.getoption("--update-transcripts"):
        golden.write_text(text, encoding="utf-8")
    assert text == golden.read_text("utf-8"), f"{job.name}: pytest tests/wire --update-transcripts rewrites it"


def test_there_is_a_golden_file_for_each_job_and_no_other() -> None:
    assert sorted(path.stem for path in GOLDENS.iterdir()) == sorted(job.name for job in JOBS)
    assert len(JOBS) >= 60
