"""Every package of both lock files has a wheel for each platform and Python, by what the registry
lists.

uv evaluates the markers for the other platform; pip would for this one.
"""

import os
import subprocess
import sys
from collections.abc import Callable
from pathlib import Path

import pytest

REPO = Path(__file__).parents[2]
PLATFORMS = ("aarch64-apple-darwin", "aarch64-manylinux_2_28", "x86_64-manylinux_2_28")
PYTHONS = ("3.11", "3.12", "3.13", "3.14")
AS_PIP = {"UV_SYSTEM_CERTS": "true"}
"""The certificates of the system and, with PIP_INDEX_URL, the registry that pip uses."""
if "PIP_INDEX_URL" in os.environ:
    AS_PIP["UV_DEFAULT_INDEX"] = os.environ["PIP_INDEX_URL"]
UNREACHABLE = ("error sending request", "dns error", "Failed to fetch", "offline")


@pytest.mark.parametrize("platform", PLATFORMS)
def test_every_locked_package_has_a_wheel(
    platform: str, tmp_path: Path, trials: Callable[[int, int], int]
) -> None:
    """requirements-dev.lock holds all of requirements.lock. A short run tries the newest Python
    alone, and on x86-64, which has another engine for it, the oldest too.
    """
    tried = PYTHONS[trials(-1, 0) :]
    if platform.startswith("x86_64"):
        tried = tuple(dict.fromkeys((PYTHONS[0], *tried)))
    for python in tried:
        words = [
            "--dry-run",
            "--quiet",
            "--python-platform",
            platform,
            "--python-version",
            python,
            "--only-binary",
        ]
        words += [
            ":all:",
            "--require-hashes",
            "--target",
            str(tmp_path),
            "-r",
            "requirements-dev.lock",
        ]
        uv = Path(sys.executable).with_name("uv")
        env = os.environ | AS_PIP
        done = subprocess.run(
            [uv, "pip", "install", *words],
            cwd=REPO,
            env=env,
            capture_output=True,
            text=True,
            timeout=120,
        )
        if done.returncode and any(sign in done.stderr for sign in UNREACHABLE):
            pytest.skip("no registry of packages can be reached")
        assert done.returncode == 0, f"Python {python}: {done.stderr}"


def test_the_lock_of_tests_holds_all_of_the_other() -> None:
    pins = [
        {
            line.partition(" ")[0]
            for line in (REPO / name).read_text().splitlines()
            if "==" in line.partition(" ")[0]
        }
        for name in ("requirements.lock", "requirements-dev.lock")
    ]
    assert len(pins[0]) > 20 and pins[0] <= pins[1]


def test_the_engine_of_each_platform_is_locked() -> None:
    """A marker that holds nowhere would leave a platform without one, and with no error."""
    lock = (REPO / "requirements.lock").read_text()
    (pybullet,) = [line for line in lock.splitlines() if line.startswith("pybullet==")]
    (mujoco,) = [line for line in lock.splitlines() if line.startswith("mujoco-core==")]
    assert (
        "python_full_version < '3.12' and platform_machine == 'x86_64' and sys_platform == 'linux'"
        in pybullet
    )
    for platform in (
        "python_full_version >= '3.12' and platform_machine == 'x86_64' and sys_platform == "
        "'linux'",
        "platform_machine == 'arm64' and sys_platform == 'darwin'",
        "platform_machine == 'aarch64' and sys_platform == 'linux'",
    ):
        assert platform in mujoco
