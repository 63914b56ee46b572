"""How much memory `decode -o` takes at most for a recording, by layout and number of signals.

    python -m tests.benchmarks.bench_values [--frames 1000000] [--most 150]

Each conversion is a process of its own, as on a machine that has dvtcli with the extra `[parquet]`: python-can imports
asammdf wherever that is installed, which takes 100 MB by itself and is left out here. The frames are those of nodes
with four TPDOs of eight bytes, in turn. Ends with 1 where one takes more than --most MB. A million frames take some
ten minutes in all.
"""

from __future__ import annotations

import argparse
import random
import subprocess
import sys
import tempfile
from pathlib import Path

from tests.benchmarks.figures import ROOT

#: form and number of signals, which is a multiple of 8
CASES = ((".csv", "", 200), (".parquet", "long", 8), (".parquet", "long", 2000), (".parquet", "wide", 144))
_ENTRY = """
import sys
sys.modules["asammdf"] = None
from dvtcli.__main__ import entry
sys.argv[1:] = {words!r}
try:
    entry()
finally:
    with open("/proc/self/status") as file:
        print("peak", next(line.split()[1] for line in file if line.startswith("VmHWM:")), file=sys.stderr)
"""


def recording(folder: Path, frames: int, signals: int) -> tuple[Path, Path]:
    """A recording of *frames* frames with *signals* different signals, and the network file that says what they are."""
    pdos, drawn = signals // 8, random.Random(1)
    nodes: dict[int, list[int]] = {}
    for number in range(pdos):
        nodes.setdefault(1 + number // 4, []).append(number % 4)
    lines = ["defaults: {prune: true}", "nodes:"]
    for node, own in nodes.items():
        lines += [f"  n{node}:", f"    node_id: {node}", "    profile: generic", "    tpdo:"]
        for pdo in own:
            mapping = ", ".join(f"{0x2000 + 8 * pdo + signal:04X}:01/8" for signal in range(8))
            lines += [
                f"      {pdo + 1}: {{cob_id: 0x{0x180 + 0x100 * pdo + node:X}, enabled: true, mapping: [{mapping}]}}"
            ]
    network, log = folder / f"n{signals}.yaml", folder / f"n{signals}.log"
    network.write_text("\n".join(lines) + "\n", "utf-8")
    with log.open("w", encoding="ascii") as file:
        for number in range(frames):
            can_id = 0x181 + number % pdos // 4 + 0x100 * (number % pdos % 4)
            file.write(f"({1700000000 + number / 1000:.6f}) can0 {can_id:03X}#{drawn.getrandbits(64):016X}\n")
    return log, network


def peak_mb(folder: Path, files: tuple[Path, Path], suffix: str, layout: str) -> float:
    """What the conversion of *files* takes at most (MB)."""
    log, network = files
    words = ["-y", "decode", str(log), "-d", str(network), "-o", str(folder / f"out{suffix}")]
    words += ["--layout", layout] if layout else []
    done = subprocess.run(
        [sys.executable, "-c", _ENTRY.format(words=words)], capture_output=True, encoding="utf-8", cwd=ROOT, check=False
    )
    assert done.returncode == 0, done.stderr
    return int(done.stderr.split()[-1]) / 1024


def main() -> None:
    """Measure each case and print it."""
    parser = argparse.ArgumentParser(prog="python -m tests.benchmarks.bench_values")
    parser.add_argument("--frames", type=int, default=1_000_000)
    parser.add_argument("--most", type=float, default=150.0, metavar="MB")
    options = parser.parse_args()
    peaks = []
    with tempfile.TemporaryDirectory() as name:
        for suffix, layout, signals in CASES:
            files = recording(Path(name), options.frames, signals)
            peaks.append(peak_mb(Path(name), files, suffix, layout))
            print(
                f"{options.frames} frames, {signals:4} signals, {layout or suffix:5}  {peaks[-1]:6.1f} MB", flush=True
            )
    sys.exit(max(peaks) > options.most)


if __name__ == "__main__":
    main()
