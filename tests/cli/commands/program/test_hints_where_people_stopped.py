"""What is said where people stopped: the next step, and never one that is refused, too."""

from __future__ import annotations

import pytest

from tests.bus.devices import device, unknown
from tests.cli.commands.bench import Bench
from tests.process import dvtcli
from tests.virtual_time import VirtualTimeBus


def test_a_file_takes_the_bytes_of_one_node() -> None:
    with Bench((), {"node": (1, 3), "profile": "generic"}, VirtualTimeBus([device(1), device(3)])) as bench:
        ran = bench.run("read 1008 -o all.bin")
        ran.failed(2, "read 1:1008 -o")
        assert "take several" not in ran.stderr
        assert bench.run("read 1:1008 -o one.bin").code in (0, 1)  # not every device has a name


@pytest.mark.parametrize("line", ["-n 1,5 read 1017", "--node 5 read 1017"])
def test_a_node_in_front_of_a_line_is_told_how(line: str) -> None:
    with Bench() as bench:
        ran = bench.run(line)
        ran.failed(2, "`node 5` selects")
        assert bench.run("read 1:1017").code == 0


def test_text_for_what_is_taken_for_a_number() -> None:
    """Without an EDS the type is guessed by the length; that is said with what writes text."""
    with Bench((), {"node": 1, "profile": "generic"}, VirtualTimeBus([unknown(1)])) as bench:
        ran = bench.run("write 6081 abc")
        ran.failed(2, "--as vs writes text")
        assert "--as vs" not in bench.run("write 6081 abc --as u8").stderr
    with Bench(("gen4@1",)) as bench:
        assert "--as vs" not in bench.run("write 1017 abc").stderr, "its EDS says that it is a number"


def test_a_long_value_is_cut_and_says_how_to_have_it_all() -> None:
    from dvtcli.cli.view.answers.value_lines import value_lines
    from dvtcli.cli.view.typed_hints import typed
    from dvtcli.domain.hint import Hint
    from dvtcli.domain.object_scalings import cut_bytes
    from dvtcli.operations.results.values import ValueRead

    assert cut_bytes(bytes(128)).count("00") == 128
    assert cut_bytes(bytes(3000)).endswith("… 3,000 bytes")
    *_, hint = next(value_lines(ValueRead(1, "2007:00", "", bytes(3000), bytes(3000), "os"), 80))
    assert isinstance(hint, Hint)
    assert typed(hint) == "`read 2007:00 -o FILE` has all"


def test_help_network_is_a_topic() -> None:
    with Bench() as bench:
        assert "apply line.yaml" in bench.run("help network").stdout


@pytest.mark.parametrize(("words", "says"), [
    (["--sim", "gen4"], "no command: standard input is empty"),
    (["--sim", "scan"], "`dvtcli --sim gen4 scan`"),
    (["--sim", "gen4", "--sim", "pdo"], "`dvtcli --sim gen4 pdo`"),
])  # fmt: skip
def test_nothing_to_do_is_no_success(words: list[str], says: str) -> None:
    done = dvtcli(*words)
    assert (done.returncode, says in done.stderr, done.stdout) == (2, True, "")
    assert dvtcli(*words, "--json").returncode == 2
