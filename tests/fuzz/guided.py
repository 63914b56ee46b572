"""One target under atheris, which keeps what reaches new code: `python -m tests.fuzz.guided TARGET RUNS SECONDS DIR`.

Atheris is no dependency: nothing but `fuzz_long.py --atheris` starts this. DIR gets the corpus, and what fails.
"""

from __future__ import annotations

import sys
from pathlib import Path
from random import Random

SEEDS = 200


def main(target: str, runs: str, seconds: str, folder: str) -> None:
    """Fuzz *target*; does not return: the exit code is 0 unless something was found."""
    import atheris

    with atheris.instrument_imports(include=["dvtcli"]):
        from tests.fuzz.targets import TARGETS
    from tests.fuzz.drive import workshop
    from tests.fuzz.grammar import make

    corpus = Path(folder).resolve() / target
    corpus.mkdir(parents=True, exist_ok=True)
    for number in range(SEEDS):
        (corpus / f"seed{number}").write_bytes(make(target, Random(f"{target}:guided:{number}")))
    options = [
        f"-runs={runs}",
        f"-max_total_time={seconds}",
        f"-artifact_prefix={corpus}.",
        "-timeout=60",
        "-max_len=4096",
    ]
    with workshop():
        atheris.Setup([sys.argv[0], *options, str(corpus)], TARGETS[target])
        atheris.Fuzz()


if __name__ == "__main__":
    main(*sys.argv[1:])
