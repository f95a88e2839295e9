"""The folder exercises/ is shipped as the package kfcourse.exercises; everything else is said in
pyproject.toml."""

from setuptools import find_namespace_packages, find_packages, setup

SETS = [f"kfcourse.exercises.{folder}" for folder in find_namespace_packages("exercises")]

setup(
    packages=[*find_packages(include=["kfcourse*"]), "kfcourse.exercises", *SETS],
    package_dir={"kfcourse.exercises": "exercises"},
)
