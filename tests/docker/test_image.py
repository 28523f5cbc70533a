"""What is in the image, and what is not."""

from collections.abc import Callable

import pytest

from .stack import ROOT, docker

pytestmark = [pytest.mark.needs("docker", "docker-compose"), pytest.mark.timeout(1800)]

# bytes; 397e6 with the stand-in base, which is 191e6 of it, and the view with all it needs 53e6
LARGEST = 420e6

# Prints the modules of every process that have no byte code on disk.
UNCOMPILED = """
import importlib.util, os, sys
import holozen.cli.up, holozen.cli.topic, holozen.cli.node, holozen.cli.service, holozen.robot.files.xacro, xacro
import holozen.sim.__main__, holozen.sim.loop, holozen.sim.spawn, holozen.teleop.__main__, holozen.teleop.app
import holozen.teleop.session, holozen.controller.__main__, holozen.pose_service.__main__
import holozen.view.__main__, holozen.view.open_page
files = {getattr(module, "__file__", None) or "" for module in list(sys.modules.values())}
print(*[f for f in files if f.endswith(".py") and not os.path.exists(importlib.util.cache_from_source(f))])
"""  # noqa: E501


def inside(image: str, *words: str) -> str:
    """The output of a command in a new container, started as compose would."""
    return docker(
        "run", "--rm", "--read-only", "--network=none", "--entrypoint", words[0], image, *words[1:]
    ).strip()


def test_the_user_is_not_root_and_owns_nothing_of_the_program(image: str) -> None:
    assert inside(image, "id", "-u") == "10001"
    assert inside(image, "find", "/holozen", "/opt/venv", "-writable", "!", "-type", "l") == ""


def test_the_tree_holds_what_runs_and_nothing_else(image: str) -> None:
    wanted = {"holozen", "services", "extensions", "urdf", "meshes", "worlds"}
    wanted |= {"LICENSE", "README.md", "pyproject.toml", "setup.py", "requirements.lock"}
    assert set(inside(image, "ls", "-A", "/holozen").split()) == wanted


def test_the_package_is_installed_and_not_linked_to_the_tree(image: str) -> None:
    where = inside(image, "python", "-I", "-c", "import holozen.sim; print(holozen.sim.__file__)")
    assert where == "/opt/venv/lib/python3.11/site-packages/holozen/sim/__init__.py"


def test_nothing_is_recompiled_at_each_start(image: str) -> None:
    assert inside(image, "python", "-I", "-c", UNCOMPILED) == ""


def test_every_service_runs_from_the_tree_too(image: str) -> None:
    each = 'for service in services/*/; do python -m services."$(basename "$service")" --help; done'
    services = len([*ROOT.glob("services/*/__main__.py")])
    assert inside(image, "sh", "-c", each).count("usage: ") == services


def test_without_arguments_the_image_explains_its_use(image: str) -> None:
    assert "usage: holozen VERB" in docker("run", "--rm", "--network=none", image)


def test_the_image_is_not_larger_than_it_has_to_be(
    image: str, record_property: Callable[[str, object], None]
) -> None:
    size = int(docker("image", "inspect", "--format", "{{.Size}}", image))
    record_property("image_bytes", size)
    assert size < LARGEST
