"""Installs the nodes, offline tools, configuration and weights of kmn_perception."""

import runpy
from pathlib import Path

from setuptools import find_packages, setup

PACKAGE = "kmn_perception"
EXECUTABLES = runpy.run_path(f"{PACKAGE}/executables.py")["EXECUTABLES"]


def shared(folder: str) -> list[tuple[str, list[str]]]:
    """List (destination, files) pairs that put all files below `folder` into the share."""
    folders = [Path(folder), *(path for path in Path(folder).rglob("*") if path.is_dir())]
    return [
        (
            f"share/{PACKAGE}/{path}",
            [str(file) for file in sorted(path.iterdir()) if file.is_file()],
        )
        for path in folders
        if path.is_dir()
    ]


setup(
    name=PACKAGE,
    version="0.1.0",
    description="Morphing parameters of articulated objects from depth images",
    maintainer="KMN maintainers",
    maintainer_email="maintainers@example.org",
    license="Apache-2.0",
    packages=find_packages(exclude=["test", "test.*"]),
    package_data={PACKAGE: ["py.typed"]},
    data_files=[
        ("share/ament_index/resource_index/packages", [f"resource/{PACKAGE}"]),
        (f"share/{PACKAGE}", ["package.xml"]),
        *shared("config"),
        *shared("data"),
        *shared("environment"),
        *shared("launch"),
        *shared("weights"),
    ],
    zip_safe=False,
    entry_points={
        "console_scripts": [f"{name} = {PACKAGE}.__main__:main" for name in EXECUTABLES],
    },
)
