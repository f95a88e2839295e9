# make book   the book        make test   every check        make help   the rest
PYTHON ?= python3
ifeq ($(OS),Windows_NT)
  BIN := .venv/Scripts
else
  BIN := .venv/bin
endif
INSTALLED := .venv/installed

.DEFAULT_GOAL := help
.NOTPARALLEL:
.PHONY: help book test lint unit notebooks lock clean distclean install figure benchmark

help:
	@echo "make book       execute the chapters and build the book in _build/html"
	@echo "make test       lint, types, unit tests, documentation examples, the book, nbval on its notebooks"
	@echo "make lint       ruff check, ruff format --check, mypy"
	@echo "make unit       unit tests and documentation examples only"
	@echo "make install    the virtual environment .venv only"
	@echo "make benchmark  speed of the engine, as ratios"
	@echo "make figure     the figure of README.md"
	@echo "make lock       compile requirements.txt from pyproject.toml"
	@echo "make clean      remove the book;  make distclean  removes .venv too"
	@echo "Another interpreter for .venv:  make PYTHON=python3.12 book"

book: $(INSTALLED)
	$(BIN)/python book/build.py

test: lint unit book notebooks
	@echo "All checks passed."

lint: $(INSTALLED)
	$(BIN)/ruff check .
	$(BIN)/ruff format --check .
	$(BIN)/mypy

unit: $(INSTALLED)
	$(BIN)/pytest -q -n auto --ignore tests/test_book.py

# Executes every notebook of the built book once more and compares all outputs; so it does with the worked solutions of the
# exercises, for variants of different kinds: multiplicative noises, a sine meter, a vector state.
CHECKED := --variant 53 --variant 5 --variant 20
notebooks: $(INSTALLED)
	$(BIN)/kfcourse solutions $(CHECKED) --out _build/solutions
	KFCOURSE_BOOK=required $(BIN)/pytest -q -n 2 --dist loadscope --nbval --nbval-current-env tests/test_book.py _build/jupyter_execute _build/solutions

figure: $(INSTALLED)
	$(BIN)/python book/readme_figure.py

benchmark: $(INSTALLED)
	$(BIN)/python benchmarks/engine.py

install: $(INSTALLED)

$(INSTALLED): requirements.txt pyproject.toml
	@$(PYTHON) -c 'import sys; v = sys.version_info[:2]; v >= (3, 11) or sys.exit("kfcourse needs Python 3.11 or newer, and $(PYTHON) is %d.%d; name another one: make PYTHON=python3.12 $(MAKECMDGOALS)" % v)' \
	  || { command -v $(PYTHON) >/dev/null || echo "No $(PYTHON) found: install Python 3.11 or newer, or name it: make PYTHON=/path/to/python3 $(MAKECMDGOALS)"; exit 1; }
	$(PYTHON) -m venv .venv
	$(BIN)/python -m pip install --quiet --disable-pip-version-check -r requirements.txt
	$(BIN)/python -m pip install --quiet --disable-pip-version-check --no-deps --editable .
	@touch $@

lock: $(INSTALLED)
	CUSTOM_COMPILE_COMMAND='make lock' $(BIN)/pip-compile --quiet --upgrade --all-extras --strip-extras --no-annotate --no-emit-index-url \
	  --no-emit-find-links --no-emit-trusted-host --no-emit-options --output-file requirements.txt pyproject.toml

clean:
	rm -rf _build .pytest_cache .mypy_cache .ruff_cache

distclean: clean
	rm -rf .venv kfcourse.egg-info
