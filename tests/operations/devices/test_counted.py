"""What `compare`, `verify` and `diff` say that they compared: all that they did, also what nobody would write."""

from __future__ import annotations

from pathlib import Path

from tests.cli.commands.bench import Bench
from tests.operations.devices.test_apply_file import made
from tests.small_eds import U16, U32, Eds, var


def test_settings_that_nobody_writes_are_counted_where_they_are_equal(tmp_path: Path) -> None:
    """A device without PDOs: each object is one to all of them."""
    eds, file = Eds(), tmp_path / "node.dcf"
    eds.variable(0x1000, var("Device type", U32, 0, "ro"))
    eds.variable(0x1017, var("Heartbeat time", U16, 0))
    for index in (0x2000, 0x2001, 0x2002):
        eds.variable(index, var(f"Gain {index - 0x2000}", U16, 5))
    eds.info |= {"VendorNumber": 0x301, "ProductNumber": 0x302}
    eds.record(0x1018, "Identity", {n: var(f"Part {n}", U32, 0x300 + n, "ro") for n in (1, 2)})
    (tmp_path / "gains.eds").write_text(eds.text(), encoding="utf-8")
    with Bench((f"{tmp_path / 'gains.eds'}@5",)) as bench:
        assert bench.run(f"export {file}").code == 0
        count = bench.run(f"compare {file} --json").document["objects"]
        verified = bench.run(f"verify {file} --json").document
        assert (verified["objects"], verified["parameters"], verified["equal"]) == (count, count, True)
        (node,) = bench.run(f"diff {file} --json").document["nodes"]
        assert (node["also_equal"], node["unchanged"] + node["also_equal"]) == (3, count)
        assert "= 3 more settings equal to the file, not written" in bench.run(f"plan {file}").stdout
        plan = tmp_path / "plan.json"
        assert bench.run(f"plan {file} -o {plan}").code == 0
        (applied,) = bench.run(f"apply {plan} --json").document["nodes"]
        assert applied["also_equal"] == 3, "a saved plan says it as well"
        assert bench.run("write 2001 6").code == 0
        assert bench.run(f"verify {file}").stdout.splitlines()[-1].startswith(f"1 of {count} objects differs")
        assert bench.run(f"diff {file} --json").document["nodes"][0]["also_equal"] == 2
        assert bench.run(f"verify {file} --format junit").stdout.count("<testcase") == count


def test_pdos_are_counted_beside_the_objects(tmp_path: Path) -> None:
    file = made(tmp_path, "generic", "dcf")
    with Bench(("generic@5",)) as bench:
        verified = bench.run(f"verify {file} --json").document
        (node,) = bench.run(f"diff {file} --json").document["nodes"]
        assert verified["pdos"] + verified["objects"] == node["unchanged"] + node["also_equal"]


def test_what_the_file_does_not_say_of_a_pdo_is_not_counted(tmp_path: Path) -> None:
    file = tmp_path / "node.jsonl"
    with Bench(("generic@5",)) as bench:
        assert bench.run(f"backup {file}").code == 0
        assert bench.run(f"verify {file} --json").document["unsaid"] == 0, "a whole backup leaves nothing unsaid"
        head, *lines = file.read_text("utf-8").splitlines(keepends=True)
        kept = [one for one in lines if '"1800:01"' in one or '"1017:00"' in one]
        file.write_text(head.replace(f'"objects": {len(lines)}', '"objects": 2') + "".join(kept), "utf-8")
        verified = bench.run(f"verify {file} --json").document
        assert (verified["parameters"], verified["pdos"], verified["objects"]) == (2, 1, 1)
        assert verified["unsaid"] > 0
        assert bench.run(f"compare {file} --json").document["objects"] == 2
