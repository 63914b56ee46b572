"""Who works on the soak's bus, and whether what they were told is what the node holds."""

from __future__ import annotations

import json
import os
import random
import subprocess
import sys
import threading
import time
from collections import Counter
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

from tests.benchmarks.bench_serve import ROOT, Sim
from tests.benchmarks.soak_cable import Cable
from tests.benchmarks.soak_growth import Growth
from tests.benchmarks.soak_truth import Held, Truth

EDS = ROOT / "dvtcli/families/gen4/gen4.eds"
#: objects that gen4 maps, with their lengths in bits
_OBJECTS = {"6041:00": 16, "606C:00": 32, "6C01:01": 16, "6C01:02": 16, "6C01:03": 16}
_DISABLED = 1 << 31
#: how often `recover` is tried before it is said that it does not get through
_TRIES = 40


@dataclass
class Tally:
    """How often what happened, and each state that was wrong."""

    counts: Counter[str]
    wrong: list[str]
    _lock: threading.Lock = field(default_factory=threading.Lock)

    def count(self, what: str) -> None:
        """Once more."""
        with self._lock:
            self.counts[what] += 1

    def is_wrong(self, what: str) -> None:
        """A node holds what it should not."""
        with self._lock:
            self.wrong.append(what)
        print(f"WRONG: {what}", flush=True)


@dataclass(frozen=True)
class Change:
    """A piece of work: a method of `import dvtcli`'s node, or a command, of that name, with what it is given."""

    name: str
    pdo: int = 0
    objects: tuple[str, ...] = ()
    timer_ms: int = 0

    @classmethod
    def by_lot(cls, lots: random.Random) -> Change:
        """One that is allowed."""
        name = lots.choice(["map", "map", "set", "set", "disable", "enable"])
        objects: list[str] = []
        for one in lots.sample(sorted(_OBJECTS), lots.randint(1, 4)):
            if sum(_OBJECTS[each] for each in (*objects, one)) <= 64:
                objects.append(one)
        return cls(name, lots.randint(1, 2), tuple(objects) if name == "map" else (), lots.randint(1, 200) * 10)

    def words(self) -> list[str]:
        """As a command."""
        timer = ["--timer", str(self.timer_ms)] if self.name == "set" else []
        return [self.name, f"tpdo{self.pdo}", *self.objects, *timer]

    def asked(self) -> dict[str, Any]:
        """As a call."""
        options = {"timer_ms": self.timer_ms} if self.name == "set" else {}
        return {"do": self.name, "words": [f"tpdo{self.pdo}", *self.objects], "options": options}

    def applied(self, before: Held) -> Held:
        """What *before* becomes by it."""
        after, communication, mapping = dict(before), 0x17FF + self.pdo, 0x19FF + self.pdo
        if self.name == "set":
            after[communication, 5] = self.timer_ms
        elif self.name == "disable":
            after[communication, 1] |= _DISABLED
        else:
            after[communication, 1] &= ~_DISABLED
        if self.name == "map":
            after = {place: value for place, value in after.items() if place[0] != mapping or place[1] == 0}
            after[mapping, 0] = len(self.objects)
            for number, one in enumerate(self.objects, 1):
                index, sub = (int(part, 16) for part in one.split(":"))
                after[mapping, number] = index << 16 | sub << 8 | _OBJECTS[one]
        return after


def _parts(held: Held) -> dict[int, Held]:
    """Each PDO for itself, by its number and direction."""
    parts: dict[int, Held] = {}
    for (index, sub), value in held.items():
        parts.setdefault(index & ~0x200, {})[index, sub] = value
    return parts


class Judge:
    """What *truth* may hold after each piece of work; what it holds else is wrong."""

    def __init__(self, truth: Truth, tally: Tally, who: str) -> None:
        self.truth, self._tally, self._who = truth, tally, who
        self.now = truth.held()
        #: what a restart may bring back, and every state that an undo may go back to
        self.stored, self.history = [self.now], [self.now]
        self._restarts = truth.restarts

    def look(self, what: str, *allowed: Held, each: bool = False, change: Change | None = None) -> None:
        """Read the node after *what*: it holds one of *allowed*; over a restart, or with *each*, each PDO does.

        A restart before the first step of *change* lets that be made on what was stored.
        """
        after = self.truth.held()
        restarted, self._restarts = self.truth.restarts != self._restarts, self.truth.restarts
        if after not in allowed:
            stored = self.stored if restarted else []
            states = [*allowed, self.now, *stored]
            states += [change.applied(one) for one in stored] if change is not None else []
            odd = _of_none(after, states) if restarted or each else _differences(after, allowed)
            if odd:
                self._tally.is_wrong(f"{self._who}: {what}; restarted: {restarted}; {odd}")
        self._tally.count(f"{self._who}: judged{' over a restart' if restarted else ''}")
        self.now = after
        self.history.append(after)

    def may_be_stored(self) -> None:
        """A store was asked for: a restart may bring back what the node holds now."""
        self.stored.append(self.now)


def _of_none(after: Held, states: list[Held]) -> str:
    """The PDOs of *after* that are as in none of *states*, with those that are alike the most."""
    odd = []
    for index, part in _parts(after).items():
        others = [_parts(state)[index] for state in states]
        if part not in others:
            near = max(others, key=lambda other: len(part.items() & other.items()))
            odd.append(f"PDO {index:04X}: {_differences(part, (near,))}")
    return "; ".join(odd)


def _differences(after: Held, allowed: tuple[Held, ...]) -> str:
    places = sorted({place for state in allowed for place in state if after.get(place) != state[place]})
    return ", ".join(
        f"{index:04X}:{sub:02X} is {after.get((index, sub), -1):X}, not "
        + " or ".join(f"{state.get((index, sub), -1):X}" for state in allowed)
        for index, sub in places[:6]
    )


class Worker:
    """Somebody who changes *node_id* over *cable*, with a state folder of its own below *home*."""

    name = ""

    def __init__(self, node_id: int, cable: Cable, server: Sim, lots: random.Random, tally: Tally, home: Path) -> None:
        self.node_id, self.cable, self.lots, self.tally = node_id, cable, lots, tally
        self.journals = home / f"state-{self.name}"
        self.environment = os.environ | {"HOME": str(home), "PYTHONPATH": str(ROOT)}
        self.judge = Judge(Truth(server, node_id), tally, self.name)
        bus = [f"--bus-kwargs={key}={value}" for key, value in (("host", "127.0.0.1"), ("port", cable.port))]
        self.command = [sys.executable, "-m", "dvtcli", "-i", "socketcand", "-c", "can0", *bus, "-n", str(node_id)]
        self.command += ["--eds", str(EDS), "--journal", str(self.journals), "--yes"]

    def work(self, over: threading.Event) -> None:
        """Work until it is *over*."""
        try:
            while not over.is_set():
                self.once()
        finally:
            self.end()

    def once(self) -> None:
        raise NotImplementedError

    def end(self) -> None:
        """Let go of everything."""
        self.judge.truth.close()

    def judged(self, change: Change, said: dict[str, Any], before: Held) -> None:
        """After a *change* that ended as it *said*: with a code, a state, and words."""
        what, expected = " ".join(change.words()), change.applied(before)
        code, state, text = said["code"], said["state"], said["text"]
        self.tally.count(f"{self.name}: {what.split(maxsplit=1)[0]} ended with {code}")
        if code == 7 or (code == 6 and "recover" in text):
            self.recover()
            self.judge.look(f"{what} ended with {code}, then recover", before)
        elif code == 0:
            self.judge.look(f"{what} was done", expected, change=change)
        elif state == "unknown":
            self.judge.look(f"{what} ended with {code}, the state unknown", before, expected, change=change)
        else:
            self.judge.look(f"{what} ended with {code}, {state}: {text}", before)

    def recover(self) -> None:
        """Finish what was interrupted, however often the bus fails meanwhile."""
        for _ in range(_TRIES):
            done = subprocess.run(
                [*self.command, "recover"], check=False, env=self.environment, capture_output=True, text=True
            )
            self.tally.count(f"{self.name}: recover ended with {done.returncode}")
            if done.returncode == 0:
                return
            time.sleep(0.2)
        self.tally.is_wrong(f"{self.name}: recover does not get through: {done.stderr[-400:]}")


class Program(Worker):
    """A Python program with `import dvtcli`, which lives as long as the soak."""

    name = "program"

    def __init__(self, *given: Any) -> None:
        super().__init__(*given)
        words = [
            "tests/benchmarks/soak_program.py",
            str(self.cable.port),
            str(self.node_id),
            str(self.journals),
            str(EDS),
        ]
        self.process = subprocess.Popen(
            [sys.executable, *words], env=self.environment, cwd=ROOT, text=True,
            stdin=subprocess.PIPE, stdout=subprocess.PIPE,
        )  # fmt: skip

    @staticmethod
    def process_id(workers: list[Any]) -> int:
        """The process of the program among *workers*."""
        return next(worker.process.pid for worker in workers if isinstance(worker, Program))

    def once(self) -> None:
        """A change, sometimes its undo or a store."""
        before, change = self.judge.now, Change.by_lot(self.lots)
        said = self.ask(change.asked())
        self.judged(change, said, before)
        lot = self.lots.random()
        if lot < 0.5:
            before = self.judge.now
            said = self.ask({"do": "undo"})
            self.tally.count(f"{self.name}: undo ended with {said['code']}")
            if said["code"] == 7 or "recover" in said["text"]:
                self.recover()
            # of an earlier restart it may be told at the end only, with the state unknown: it was done then
            done = said["code"] == 0 or said["state"] == "unknown"
            self.judge.look(f"undo ended with {said}", *(self.judge.history if done else [before]), each=done)
        elif lot < 0.6:
            said = self.ask({"do": "store"})
            self.tally.count(f"{self.name}: store ended with {said['code']}")
            self.judge.may_be_stored()
            self.judge.look(f"store ended with {said}", self.judge.now)

    def ask(self, asked: dict[str, Any]) -> dict[str, Any]:
        """What the program answers."""
        assert self.process.stdin is not None
        assert self.process.stdout is not None
        self.process.stdin.write(json.dumps(asked) + "\n")
        self.process.stdin.flush()
        line = self.process.stdout.readline()
        assert line, "the program has ended"
        answer: dict[str, Any] = json.loads(line)
        return answer

    def end(self) -> None:
        self.process.communicate()
        super().end()


class Killed(Worker):
    """One command after the other; some are killed, some store and prove it."""

    name = "commands"

    def once(self) -> None:
        """A change; now and then it is killed in the middle, or followed by a store."""
        before, change = self.judge.now, Change.by_lot(self.lots)
        child = subprocess.Popen(
            [*self.command, "--json", *change.words()], env=self.environment, text=True,
            stdout=subprocess.PIPE, stderr=subprocess.DEVNULL,
        )  # fmt: skip
        try:
            said, _ = child.communicate(timeout=self.lots.uniform(0.2, 1.5) if self.lots.random() < 0.4 else None)
        except subprocess.TimeoutExpired:
            child.kill()
            child.communicate()
            self.tally.count(f"{self.name}: killed")
            self.recover()
            self.judge.look(f"{change.words()} was killed, then recover", before, change.applied(before), change=change)
            return
        errors = [one for one in map(json.loads, said.splitlines()) if one["schema"].startswith("dvtcli.error/")]
        state = str(errors[0]["state"]) if errors else "done"
        answer = {"code": child.returncode, "state": state, "text": json.dumps(errors)}
        self.judged(change, answer, before)
        if self.lots.random() < 0.2:
            done = subprocess.run(
                [*self.command, "store", "--prove"], check=False, env=self.environment, capture_output=True
            )
            self.tally.count(f"{self.name}: store --prove ended with {done.returncode}")
            held = self.judge.now
            self.judge.may_be_stored()
            if done.returncode == 7:
                self.recover()
            self.judge.look(f"store --prove ended with {done.returncode}", held)


@dataclass
class Listening:
    """A dvtcli that listens for as long as it can, and is started again where it ends; *words* are its command."""

    words: list[str]
    cable: Cable
    tally: Tally
    home: Path
    growth: Growth

    def work(self, over: threading.Event) -> None:
        """Listen until it is *over*."""
        name = self.words[0]
        bus = [f"--bus-kwargs={key}={value}" for key, value in (("host", "127.0.0.1"), ("port", self.cable.port))]
        command = [
            sys.executable,
            "-m",
            "dvtcli",
            "-i",
            "socketcand",
            "-c",
            "can0",
            "--yes",
            "--reconnect",
            *bus,
            *self.words,
        ]
        environment = os.environ | {"HOME": str(self.home), "PYTHONPATH": str(ROOT)}
        while not over.is_set():
            child = subprocess.Popen(command, env=environment, stdout=subprocess.DEVNULL, stderr=subprocess.PIPE)
            self.growth.watch(name, child.pid)
            while child.poll() is None and not over.wait(0.1):
                pass
            if child.poll() is None:
                child.terminate()
            _, said = child.communicate()
            if not over.is_set():
                self.tally.count(f"{name}: ended with {child.returncode}")
                if child.returncode not in (5, 143) or b"Traceback" in said:
                    self.tally.is_wrong(f"{name} ended with {child.returncode}: {said[-400:]!r}")
                over.wait(0.3)
