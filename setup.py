"""The packages of the wheel, by the folders that there are: an extension that was deleted needs no
edit.
"""

import os

from setuptools import find_packages, setup

DATA = ("meshes", "urdf", "worlds")

os.chdir(os.path.dirname(os.path.abspath(__file__)))
within = {folder: find_packages(folder) for folder in ("holozen", "services", "extensions")}
setup(
    packages=[
        "holozen",
        *(f"holozen.{name}" for names in (*within.values(), DATA) for name in names),
    ],
    package_dir={
        **{
            f"holozen.{name}": f"{folder}/{name}"
            for folder in ("services", "extensions")
            for name in within[folder]
            if "." not in name
        },
        **{f"holozen.{name}": name for name in DATA},
    },
)
