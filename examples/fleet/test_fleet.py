"""The files of a fleet run commands that exist, the same ones on a Swarm and on Kubernetes."""

import shlex
from pathlib import Path
from typing import Any

import yaml

from services.sim.__main__ import parser

HERE = Path(__file__).parent


def containers() -> dict[str, Any]:
    """Those of Kubernetes by name."""
    parts = yaml.safe_load_all((HERE / "kubernetes.yaml").read_text())
    pods = [part["spec"]["template"]["spec"] for part in parts if part["kind"] == "Deployment"]
    return {one["name"].replace("-", "_"): one for pod in pods for one in pod["containers"]}


def test_a_swarm_and_kubernetes_run_the_same() -> None:
    services = yaml.safe_load((HERE / "fleet.yml").read_text().replace("${SHARDS:-3}", "3"))[
        "services"
    ]
    there = containers()
    assert {name: shlex.split(one["command"]) for name, one in services.items()} == {
        name: one["args"] for name, one in there.items()
    }
    for name, one in services.items():
        assert one["healthcheck"]["test"] == f"holozen doctor --health {name}"
        assert there[name]["livenessProbe"]["exec"]["command"] == shlex.split(
            one["healthcheck"]["test"]
        )
        assert one["deploy"]["resources"]["limits"] and there[name]["resources"]["limits"]
    sim = parser().parse_args(there["sim"]["args"][1:])
    assert sim.stopped and sim.shard.count == 3 == services["sim"]["deploy"]["replicas"]
