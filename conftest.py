"""What pytest collects: Python examples of the README too, executed in order as one test
session."""

import gc

from sybil import Sybil
from sybil.parsers.markdown import PythonCodeBlockParser

# SymPy makes much and leaves little: looking for garbage so often takes a twentieth of the time
gc.set_threshold(50_000, 20, 50)

pytest_collect_file = Sybil(parsers=[PythonCodeBlockParser()], patterns=["README.md"]).pytest()
