"""Installs kmn_sim."""

import runpy

from setuptools import find_packages, setup

PACKAGE = "kmn_sim"
EXECUTABLES = runpy.run_path(f"{PACKAGE}/executables.py")["EXECUTABLES"]

setup(
    name=PACKAGE,
    version="0.1.0",
    description="Simulated robot, articulated object and depth camera",
    maintainer="KMN maintainers",
    maintainer_email="maintainers@example.org",
    license="Apache-2.0",
    packages=find_packages(exclude=["test", "test.*"]),
    package_data={PACKAGE: ["py.typed"]},
    data_files=[
        ("share/ament_index/resource_index/packages", [f"resource/{PACKAGE}"]),
        (f"share/{PACKAGE}", ["package.xml"]),
    ],
    zip_safe=False,
    entry_points={
        "console_scripts": [f"{name} = {PACKAGE}.__main__:main" for name in EXECUTABLES],
    },
)
