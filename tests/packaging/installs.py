"""`python -m tests.packaging.installs WHEEL SDIST PYTHON...`: install each into fresh environments, and try it.

Prints a table in Markdown: what was installed how, seconds, size, and if README's first command, `doctor` and
`tour` at a terminal ended with 0. `--frozen PROGRAM` (repeatable) tries programs that `scripts/freeze.py` made.
"""

from __future__ import annotations

import argparse
import subprocess
import sys
import time
from pathlib import Path
from tempfile import TemporaryDirectory

import pexpect

from tests.packaging.lowest import lower_bounds, wanted
from tests.surroundings import ROOT, clean_environment, homes

_TOUR_S = 120


def tried(program: Path, folder: Path) -> str:
    """`passed`, or which of the three failed."""
    environment = clean_environment() | homes(folder)
    failed = [
        name
        for name, words in (
            ("script", ["--sim", "gen4", "run", str(ROOT / "scripts/pdo_config.dvt")]),
            ("doctor", ["--sim", "gen4", "doctor"]),
        )
        if subprocess.run([program, *words], cwd=folder, env=environment, capture_output=True, check=False).returncode
    ]
    tour = pexpect.spawn(str(program), ["tour"], cwd=str(folder), env=environment, timeout=_TOUR_S, encoding="utf-8")
    tour.send("\n" * 20)
    tour.expect(pexpect.EOF)
    tour.close()
    failed += ["tour"] if tour.exitstatus else []
    return f"failed: {', '.join(failed)}" if failed else "passed"


def size(path: Path) -> str:
    """Megabytes of the files below *path*, or of the file."""
    files = [path] if path.is_file() else [file for file in path.rglob("*") if file.is_file() and not file.is_symlink()]
    return f"{sum(file.stat().st_size for file in files) / 1e6:.0f} MB"


def row(*cells: str) -> None:
    """Print *cells* as a row."""
    print("|", " | ".join(cells), "|", flush=True)


def installed(python: str, package: Path, constraints: Path | None) -> None:
    """Install *package* with *python*, try it, and print its row."""
    with TemporaryDirectory(prefix="dvtcli-install-") as place:
        folder, environment = Path(place), Path(place, "venv")
        (folder / "home").mkdir()
        subprocess.run([python, "-m", "venv", environment], check=True)
        before = time.monotonic()
        more = ["-c", str(constraints)] if constraints else []
        subprocess.run([environment / "bin/pip", "install", "-q", *more, package], check=True)
        seconds = time.monotonic() - before
        version = subprocess.run([python, "-V"], capture_output=True, text=True, check=True).stdout.split()[1]
        form = "wheel" if package.suffix == ".whl" else "source archive"
        result = tried(environment / "bin/dvtcli", folder / "home")
        row(version, "oldest" if constraints else "newest", form, f"{seconds:.0f} s", size(environment), result)


def main() -> None:
    """Print the table."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("wheel", type=Path)
    parser.add_argument("sdist", type=Path)
    parser.add_argument("python", nargs="*", default=[sys.executable])
    parser.add_argument("--frozen", type=Path, action="append", default=[])
    asked = parser.parse_args()
    row("Python", "dependencies", "installed from", "time", "size", "README's first command, `doctor`, `tour`")
    row(*["---"] * 6)
    with TemporaryDirectory(prefix="dvtcli-lowest-") as place:
        constraints = Path(place, "lowest.txt")
        constraints.write_text("\n".join(lower_bounds(wanted())), encoding="utf-8")
        for python in asked.python:
            for package in (asked.wheel, asked.sdist):
                for chosen in (constraints, None):
                    installed(python, package.resolve(), chosen)
        for program in asked.frozen:
            form = "frozen folder" if (program.parent / "_internal").is_dir() else "frozen, one file"
            home = Path(place, form)
            home.mkdir()
            whole = program.parent if form == "folder" else program
            row("its own", "newest", form, "", size(whole), tried(program.resolve(), home))


if __name__ == "__main__":
    main()
