"""Packages found by themselves; everything else stands in pyproject.toml."""

from setuptools import find_packages, setup

BESIDE = ("sims", "suites")
"""Folders at the top that install as parts of `pytest_simbench`."""

setup(
    packages=[
        *find_packages(include=["pytest_simbench", "pytest_simbench.*"]),
        *(
            f"pytest_simbench.{name}"
            for folder in BESIDE
            for name in (folder, *(f"{folder}.{part}" for part in find_packages(folder)))
        ),
    ],
    package_dir={f"pytest_simbench.{folder}": folder for folder in BESIDE},
)
