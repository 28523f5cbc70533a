"""The benchmarks run and print their figures. How fast anything is depends on the machine, and is
not tested.
"""

import json
import os
import shutil
import subprocess
import sys
from collections.abc import Callable
from importlib.util import find_spec
from pathlib import Path

import pytest

from holozen.flags import ENGINES
from tests.present import VERBS

ROOT = Path(__file__).resolve().parents[2]
LONG = os.environ.get("HOLOZEN_LONG") == "1"
IN_PAGE = ("in the page, to motion", "in the page, to rest")
FLAGS = {"sim_loop": ["--profile"], "fleet": ["--robots", "2"]}
CASES = {
    "cli": {
        "first line, odom at 500 Hz": ["holozen", "raw zenoh", "python alone", "ratio"],
        "topic list -t": ["holozen", "raw zenoh", "python alone", "ratio"],
        "topic info odom": ["holozen", "raw zenoh", "python alone", "ratio"],
        "echo odom at 1 kHz, work": ["holozen json", "zenoh cli json", "holozen text", "ratio"],
        **{
            f"decode Odometry, {wire}": ["holozen", "json loads", "ratio"]
            for wire in ("json", "cdr")
        },
    },
    "latency": {
        "flat out": ["holozen", "raw zenoh", "ratio"],
        "flat out, typed": ["holozen", "zenoh and msgspec", "ratio"],
        "paced at 50 Hz": ["holozen", "raw zenoh", "ratio"],
        "paced at 50 Hz, typed": ["holozen", "zenoh and msgspec", "ratio"],
    },
    "startup": {
        "first line, odom at 50 Hz": ["holozen", "raw zenoh", "python alone", "ratio"],
        "up to first odom": ["holozen"],
    },
    "fleet": {
        "2 robots": ["holozen", "bare engine", "ratio"],
        "2 robots in sims": ["two", "one", "ratio"],
        "the same, unread": ["two", "one", "ratio"],
        "the same in bare engines": ["two", "one", "ratio"],
        "10 pilots among 11 bases": ["among all", "among 10", "hearing all", "ratio"],
    },
    "concave": {"driving in a house": ["one mesh", "boxes", "no house", "ratio"]},
    "record": {"50 topics at 100 Hz, sent to taken in": ["holozen"]},
    "rclpy": {
        "latency at 1000 Hz": ["rclpy node", "bus subscriber", "ratio"],
        "work at 1000 Hz": ["rclpy node", "bus subscriber", "ratio"],
    },
    "key_to_motion": {
        "to motion": ["holozen", "step and raw zenoh", "ratio"],
        "to rest": ["holozen", "step and raw zenoh", "ratio"],
    },
    "sim_loop": {
        "idle": ["holozen", "bare engine", "engine with our body", "ratio"],
        "driving": ["holozen", "bare engine", "engine with our body", "ratio"],
    },
}
NEEDS = {"record": "record", "rclpy": "run"}
"""Benchmark -> the verb whose extension it needs."""
CASES = {name: cases for name, cases in CASES.items() if NEEDS.get(name, "sim") in VERBS}
RARE = {"cli", "startup", "key_to_motion", "fleet"}
"""Those that take longest; scripts/test --long has them."""
if not LONG:
    CASES = {name: cases for name, cases in CASES.items() if name not in RARE}
if LONG and shutil.which("chromium"):  # which takes as long to start as all others run
    CASES["key_to_motion"] |= dict.fromkeys(IN_PAGE, CASES["key_to_motion"]["to rest"])
else:
    FLAGS["key_to_motion"] = ["--terminal"]
if not find_spec("pybullet"):
    # they are measured beside that engine
    CASES = {name: cases for name, cases in CASES.items() if name not in ("sim_loop", "fleet")}


def run(name: str, *words: str) -> str:
    """What a quick run prints. It starts in another folder than the root of the tree."""
    command = [sys.executable, str(ROOT / "benchmarks" / f"{name}.py"), "--quick", *words]
    done = subprocess.run(
        command, cwd="/", capture_output=True, text=True, timeout=170, check=False
    )
    assert done.returncode == 0, done.stderr
    return done.stdout


@pytest.mark.parametrize("name", CASES)  # each has its own time to run
def test_the_table_and_the_json_show_every_side_of_every_case(name: str, tmp_path: Path) -> None:
    words = FLAGS.get(name, [])
    lines = run(name, *words, "--json", str(tmp_path / "figures.json")).splitlines()
    for case, sides in CASES[name].items():
        reported = [line for line in lines if line.startswith(f"{case}  ")]
        assert [line.removeprefix(case).strip().partition("  ")[0] for line in reported] == sides
    assert any(line.startswith("aim: ") for line in lines)
    found = json.loads((tmp_path / "figures.json").read_text())
    assert found["benchmark"] == name
    in_json = {
        case["case"]: [*case["sides"], *(["ratio"] if "ratio" in case else [])]
        for case in found["cases"]
    }
    assert in_json == CASES[name]
    for figures in (figures for case in found["cases"] for figures in case["sides"].values()):
        low, high = figures["spread"]
        assert 0 < low <= high
        assert 0 < figures["p50"] <= figures["p99"]
    if name == "sim_loop":  # where a step goes
        for part in ("step: the engine", "move: read the body, set its velocity", "all of it"):
            assert any(line.endswith(f"us/step  {part}") for line in lines)
            assert 0 <= found["profile"][part] <= found["profile"]["all of it"]


WITHIN = {
    "omni": 0.5,
    "omni_rollers": 2,
    "mecanum_rollers": 3,
    "differential": 4,
    "skid": 20,
    "planar_move": 0.5,
}
"""Percent of half a second's way on the floor."""


def test_fidelity_compares_each_drive_with_its_command(
    tmp_path: Path,
    monkeypatch: pytest.MonkeyPatch,
    capsys: pytest.CaptureFixture[str],
    trials: Callable[[int, int], int],
) -> None:
    pytest.importorskip(
        "pybullet", reason="it compares both engines, and pybullet is not installed"
    )
    from benchmarks import fidelity  # here, as it reads its robots

    runs = [(fidelity.ROBOTS, fidelity.MOTIONS)]
    if not trials(0, 1):  # one motion of all that a drive can do: the others are parts of it
        monkeypatch.setattr(fidelity, "SETTLES", 0.1)  # it is put where it stands
        runs = [
            (
                {name: model},
                {"arc": fidelity.MOTIONS["arc"] if name in fidelity.TWO_SIDED else (0.2, 0.2, 0.5)},
            )
            for name, model in fidelity.ROBOTS.items()
        ]
    monkeypatch.setattr(
        sys, "argv", ["fidelity", "--quick", "--json", str(tmp_path / "figures.json")]
    )
    found, lines = [], list[str]()
    for robots, motions in runs:
        monkeypatch.setattr(fidelity, "ROBOTS", robots)
        monkeypatch.setattr(fidelity, "MOTIONS", motions)
        fidelity.main()
        lines += capsys.readouterr().out.splitlines()
        cases = json.loads((tmp_path / "figures.json").read_text())["cases"]
        assert {case["motion"] for case in cases} == set(motions)
        found += cases
    both = {(case["engine"], case["drive"], case["ground"]) for case in found}
    assert both == {
        (engine, drive, ground)
        for engine in ENGINES
        for drive in WITHIN
        for ground in ("floor", "ramp")
    }
    assert all(case["error"] < WITHIN[case["drive"]] for case in found if case["ground"] == "floor")
    assert all(case["error"] < 20 for case in found), "it drives as commanded"
    for engine, drive, ground in both:
        assert any(line.split()[:3] == [engine, drive, ground] for line in lines)
        assert f"{engine}: {drive} on the {ground}, arc, driven and commanded:" in lines


def test_the_one_beside_ros_1_names_its_requirements() -> None:
    words = [sys.executable, str(ROOT / "benchmarks" / "ros1.py")]
    done = subprocess.run(
        words, env={"PATH": "", "PYTHONPATH": str(ROOT)}, capture_output=True, text=True, timeout=60
    )
    assert (done.returncode, done.stdout) == (2, "")
    assert "needs rosmaster, rostopic, rosservice of ROS 1; run: apt-get install" in done.stderr
    assert done.stderr.count("\n") == 1
