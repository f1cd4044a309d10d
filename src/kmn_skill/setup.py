"""Installs kmn_skill."""

import runpy
from pathlib import Path

from setuptools import find_packages, setup

PACKAGE = "kmn_skill"
EXECUTABLES = runpy.run_path(f"{PACKAGE}/executables.py")["EXECUTABLES"]


def shared(folder: str) -> tuple[str, list[str]]:
    """Return a (destination, files) pair that puts the files of `folder` into the share."""
    return f"share/{PACKAGE}/{folder}", [str(file) for file in sorted(Path(folder).iterdir())]


setup(
    name=PACKAGE,
    version="0.1.0",
    description="Manipulation skills planned on the estimated kinematic model",
    maintainer="KMN maintainers",
    maintainer_email="maintainers@example.org",
    license="Apache-2.0",
    packages=find_packages(exclude=["test", "test.*"]),
    package_data={PACKAGE: ["py.typed"]},
    data_files=[
        ("share/ament_index/resource_index/packages", [f"resource/{PACKAGE}"]),
        (f"share/{PACKAGE}", ["package.xml"]),
        shared("launch"),
        shared("rviz"),
    ],
    zip_safe=False,
    entry_points={
        "console_scripts": [f"{name} = {PACKAGE}.__main__:main" for name in EXECUTABLES],
    },
)
