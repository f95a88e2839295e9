# make book   the book        make test   every check        make help   the rest
ifeq ($(OS),Windows_NT)
  BIN := .venv/Scripts
else
  BIN := .venv/bin
endif
# The interpreter of .venv: the one that is named; else the one of a finished .venv as long as it runs; else python3.
ifndef PYTHON
  PYTHON := $(or $(if $(wildcard .venv/installed),$(shell $(BIN)/python -c "print('$(BIN)/python')" 2>/dev/null)),python3)
endif

# Small matrices: several threads in one process cost more than they gain, and processes share the machine.
export OMP_NUM_THREADS := 1
# Many processes import the package: compiled once, not by each.
unexport PYTHONDONTWRITEBYTECODE

.DEFAULT_GOAL := help
.NOTPARALLEL:
.PHONY: help literature book page test nightly quick lint unit notebooks lock lock-check clean distclean install figure benchmark fuzz

help:
	@echo "make book        execute the chapters and build the book in _build/html"
	@echo "make page NAME=beyond/drive   one page alone, to look at: half a minute; links to other pages lead nowhere"
	@echo "make test        lint, types, unit tests, documentation examples, the book, nbval on its notebooks"
	@echo "make nightly     the same, and the tests marked slow: coverage of intervals, hostile processes, all pages"
	@echo "make quick       lint, types and the tests of the house, of formulas and of linear filters: a minute of CPU"
	@echo "make lint        ruff check, ruff format --check, mypy, the columns of the pages"
	@echo "make unit        unit tests and documentation examples only"
	@echo "make install     the virtual environment .venv only"
	@echo "make fuzz        20,000 generated formulas, models and files of variants; 300 are part of make unit"
	@echo "make benchmark   speed of the engine, as ratios"
	@echo "make literature  the figures of the literature beside ours"
	@echo "make figure      the figure of README.md"
	@echo "make lock        compile requirements.txt from pyproject.toml; all versions anew: make UPGRADE=--upgrade lock"
	@echo "make lock-check  does requirements.txt fit pyproject.toml, and every Python and system?"
	@echo "make clean       remove the book;  make distclean  removes .venv too"
	@echo "Another interpreter for .venv:  make PYTHON=python3.12 book"

book: install
	$(BIN)/python book/build.py

# One page and the front page, in a folder of their own; outputs of its cells are kept until the package changes.
# Of what Sphinx says, all but that the other pages are not there.
PAGE := _build/page/_build/html
page: install
	@test -f "book/$(NAME).md" || { echo "make page NAME=beyond/drive: the name of a file book/NAME.md without its ending" >&2; exit 1; }
	@test -z "$$(find kfcourse exercises -name '*.py' -newer _build/page/_toc.yml 2>&1)" || rm -rf _build/page
	@rm -rf $(PAGE) && mkdir -p _build/page _build/sample
	@printf 'format: jb-book\nroot: intro\nchapters:\n  - file: %s\n' "$(NAME)" > _build/page/_toc.yml
	@$(BIN)/jupyter-book build book --config _config.yml --toc "$(CURDIR)/_build/page/_toc.yml" --path-output _build/page -q 2>&1 \
	  | grep -vE "unknown document|undefined label|no page '|cross-reference|not found:|equation not found|could not find bibtex key" || true
	@test -f "$(PAGE)/$(NAME).html" && echo "The page: $(CURDIR)/$(PAGE)/$(NAME).html"

# What a change needs; the tests marked slow run every night.
CHOSEN := -m "not slow"
test: lint unit book notebooks

nightly:
	$(MAKE) CHOSEN= test

# Named, since pytest takes twenty seconds to collect all tests.
QUICK := tests/test_house.py tests/test_laws.py tests/symbolic tests/linear
quick: lint
	$(BIN)/pytest -q -n 0 $(CHOSEN) $(QUICK)

# The types of the package as it is installed: with the exercises in it.
TYPED := _build/typed
lint: install
	$(BIN)/ruff check .
	$(BIN)/ruff format --check .
	rm -rf $(TYPED) && mkdir -p $(TYPED) && cp -r kfcourse $(TYPED) && cp -r exercises $(TYPED)/kfcourse
	$(BIN)/mypy
	$(BIN)/python .ci/columns.py

unit: install
	$(BIN)/pytest -q -n auto --dist loadscope $(CHOSEN) --ignore tests/test_book.py

# Other cases each time; what fails is shown with the case, as small as can be.
CASES := 20000
fuzz: install
	KFCOURSE_CASES=$(CASES) $(BIN)/pytest -q -n auto --hypothesis-show-statistics tests/test_generated.py tests/exercises/derivations

# Executes every notebook of the built book once more and compares all outputs but pictures, which therefore are not drawn
# again; so it does with the worked solutions of the exercises, for variants of different kinds: multiplicative noises, a sine
# meter, a vector state.
CHECKED := --variant 53 --variant 5 --variant 20
notebooks: install
	$(BIN)/kfcourse solutions $(CHECKED) --out _build/solutions
	JUPYTER_DEFAULT_PROVISIONER_NAME=kfcourse-forked PYTHONSTARTUP=$(CURDIR)/.ci/no_pictures.py KFCOURSE_BOOK=required \
	  $(BIN)/pytest -q -n 2 --dist loadscope --nbval --nbval-current-env $(CHOSEN) tests/test_book.py _build/jupyter_execute _build/solutions

literature: install
	$(BIN)/python book/chapters.py beyond/literature

figure: install
	$(BIN)/python book/readme_figure.py

benchmark: install
	$(BIN)/python benchmarks/engine.py
	$(BIN)/python benchmarks/exact.py
	$(BIN)/python benchmarks/looking_back.py
	$(BIN)/python benchmarks/jumps.py

.venv/installed: requirements.txt pyproject.toml
	$(PYTHON) -m venv .venv
	$(BIN)/python -m pip install --quiet --require-hashes -r requirements.txt
	$(BIN)/python -m pip install --quiet --no-deps --no-build-isolation --editable .
	@touch .venv/installed

install:
	@$(PYTHON) -c "" 2>/dev/null || { echo "$(PYTHON) does not start. Install Python 3.11 or newer, or name it: make PYTHON=/path/to/python3 $(MAKECMDGOALS)" >&2; exit 1; }
	@$(PYTHON) -c 'import sys; v = sys.version_info[:2]; v >= (3, 11) or sys.exit("$(PYTHON) is Python %d.%d, too old: 3.11 or newer is needed. Name another one: make PYTHON=python3.12 $(MAKECMDGOALS)" % v)'
	@$(MAKE) --no-print-directory .venv/installed

# One lock for all: versions and hashes for every Python from 3.11.0 on and every system. Versions stay unless a bound forces them.
COMPILE := pip compile --quiet --universal --python-version 3.11.0 --generate-hashes --all-extras --no-annotate \
  --no-emit-index-url --no-emit-find-links --custom-compile-command "make lock"
lock: install
	$(BIN)/uv $(COMPILE) $(UPGRADE) --output-file requirements.txt pyproject.toml

# Compiled again, nothing changes; and every requirement has a wheel, with its hash, for each Python and system.
lock-check: install
	@mkdir -p _build && cp requirements.txt _build/requirements.txt
	@$(BIN)/uv $(COMPILE) --output-file _build/requirements.txt pyproject.toml
	@diff -u requirements.txt _build/requirements.txt || { echo "requirements.txt does not fit pyproject.toml: make lock"; exit 1; }
	@for python in 3.11.0 3.12 3.13 3.14; do for system in linux macos windows; do \
	  echo "Python $$python, $$system"; \
	  $(BIN)/uv pip install --quiet --dry-run --target _build/none --python-version $$python --python-platform $$system \
	    --require-hashes --only-binary :all: -r requirements.txt || exit 1; \
	done; done
	@rm -rf _build/none _build/requirements.txt

clean:
	rm -rf _build .pytest_cache .mypy_cache .ruff_cache

distclean: clean
	rm -rf .venv kfcourse.egg-info
