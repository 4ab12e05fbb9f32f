# Everything a fresh machine needs is Python >= 3.11 and make. All set-up happens in .venv.
PYTHON ?= python3
VENV := .venv
BIN := $(VENV)/bin
# Several threads of BLAS wait for each other on small matrices; work side by side is by processes.
export OPENBLAS_NUM_THREADS ?= 1
# Where the user forbids it, every process would compile the sources of all libraries anew: seconds each time.
export PYTHONDONTWRITEBYTECODE =
PIN := $(BIN)/pip install --quiet --disable-pip-version-check --no-compile --require-hashes --no-deps
# A solver that takes the version to solve for: pip's own would ask for the Python that runs it. 3.11 means 3.11.0 to it.
OLDEST = $(shell sed -n 's/^requires-python = ">=\(.*\)"/\1/p' pyproject.toml)
SOLVE = out/solver/bin/uv pip compile pyproject.toml --quiet --python-version $(OLDEST) --generate-hashes \
  --no-emit-index-url --no-emit-find-links --custom-compile-command "make lock"
OLD ?= benchmarks/measured.json
NEW ?= out/benchmarks.json
SOURCES := $(shell find spinlev geometry fem dynamics studies scenes -type f -not -name "*.pyc") setup.py pyproject.toml README.md LICENSE

# Slow tests are run by `validate`, those that need a browser by `test-browser`, which `validate` begins with.
FAST := not slow and not browser

.PHONY: install run develop test test-browser lint types check-pins coverage bench bench-compare bench-peers house dist dependencies docs \
  validate fuzz lock clean

# What a run needs, its 3-D pictures included; `develop` adds the other extras, and what tests it and writes its pages.
install: $(VENV)/installed

develop: $(VENV)/installed $(VENV)/developing

$(VENV)/dependencies: requirements.txt
	@$(PYTHON) -c 'import sys; sys.exit(sys.version_info < (3, 11))' || \
	  { echo "spinlev needs Python 3.11 or newer; set PYTHON=/path/to/python3.11"; exit 1; }
	@$(PYTHON) -c 'import venv, ensurepip' 2>/dev/null || \
	  { echo "$(PYTHON) cannot make environments. On Debian or Ubuntu: apt-get install python3-venv"; exit 1; }
	@echo "Installing the libraries into $(VENV), half a minute to two ..."
	$(PYTHON) -m venv $(VENV)
	$(PIN) -r requirements.txt
	@touch $@

# After the package, so that a machine that cannot load the libraries says so before it gets the rest.
$(VENV)/developing: requirements-dev.txt $(VENV)/dependencies | $(VENV)/installed
	@echo "Installing what tests and documents it, half a minute ..."
	$(PIN) -r requirements-dev.txt
	@touch $@

$(VENV)/installed: $(VENV)/dependencies $(SOURCES)
	@echo "Installing spinlev and loading it for the first time, some ten seconds ..."
	@rm -rf build
	$(BIN)/pip install --quiet --disable-pip-version-check --no-deps --no-build-isolation \
	  --config-settings editable_mode=strict --editable .
	@rm -rf *.egg-info
	@$(BIN)/python -P -m spinlev.studies.cli.installation
	@touch $@

run: install
	$(BIN)/spinlev run scenes/tilt-over-plate.toml

lint: develop
	$(BIN)/ruff check .
	$(BIN)/ruff format --check .
	$(BIN)/python tests/check_formats.py

types: develop
	cd $(VENV) && bin/mypy --config-file ../pyproject.toml --cache-dir ../.mypy_cache --num-workers 2 -p spinlev

test: lint types check-pins
	$(BIN)/pytest -n 2 --dist worksteal -m "$(FAST)"

# Report, documentation and the live page in headless Chromium (Debian: apt-get install chromium); skipped where there is none.
# The gallery's programs are not run for it: the pages are then without their output. It says how fast a slider is.
test-browser: develop
	$(BIN)/sphinx-build --quiet -D plot_gallery=0 -b html docs docs/_build/unrun
	$(BIN)/pytest -n 2 --dist worksteal tests/whole/test_explore_browser.py tests/whole/test_browser.py

# Lines that the fast tests run, in child processes too; what a killed process has left of its own count is removed.
coverage: develop
	$(BIN)/pytest -n 2 --dist worksteal -m "$(FAST)" --cov --cov-report=
	@rm -f .coverage.*
	$(BIN)/coverage report --fail-under=95
	@for p in geometry fem dynamics studies; do \
	  echo "$$p $$($(BIN)/coverage report --include="*/$$p/*" --format=total) %"; done

validate: test-browser
	$(BIN)/pytest -m slow -s

# Processor times, so that other work on the machine matters little; the report says them as ratios to the peers.
bench: develop
	@mkdir -p out
	$(BIN)/pytest benchmarks --benchmark-timer=time.process_time --benchmark-columns=min,median,rounds \
	  --benchmark-json=$(NEW)
	$(BIN)/python benchmarks/ratios.py $(NEW) | tee out/benchmarks.md

# Other people's programs on the same problems, in environments of their own under out/peers; WORK=plate does one of them.
# A row that is finished stays; RUN=--again does them anew, RUN=--second fills the second run, whose times give the spread.
bench-peers: develop
	$(BIN)/python benchmarks/peer_runs/run.py $(WORK) $(RUN)

# Size of the house, and what it should be.
house:
	@$(PYTHON) benchmarks/house.py

# Two commits: make bench in both, then make bench-compare OLD=theirs.json; by default with the one in the repository.
bench-compare: install
	$(BIN)/python benchmarks/ratios.py $(OLD) $(NEW)

fuzz: develop
	$(BIN)/python tests/fuzzing.py all 10000

# Runs the gallery's programs too, those that have changed since.
docs: develop
	$(BIN)/python docs/draw_architecture.py
	@echo "Pages, figures and examples, which are run: some minutes ..."
	$(BIN)/sphinx-build --fail-on-warning --no-color -b html docs docs/_build/html
	@echo docs/_build/html/index.html

# The page that lists them, with licences.
dependencies: develop
	$(BIN)/python docs/list_dependencies.py

# Wheel and source distribution in dist/, without a network; then the wheel is tested outside the repository.
dist: develop
	rm -rf dist build/lib build/bdist*
	@$(BIN)/python -c 'import setuptools.build_meta as b; b.build_sdist("dist"); b.build_wheel("dist")' >build/log 2>&1 || \
	  { cat build/log; exit 1; }
	@rm -rf build/lib build/bdist* build/log *.egg-info
	@ls dist
	sh tests/try_wheel.sh $(BIN)/python dist

# Pin anew for the oldest Python that the package takes, whichever Python runs this. Pins that may stay do;
# LOCK=--upgrade takes the newest. What is needed to run has the same pins.
lock:
	$(PYTHON) -m venv out/solver
	out/solver/bin/pip install --quiet --disable-pip-version-check uv
	$(SOLVE) $(LOCK) --all-extras --output-file requirements-dev.txt
	$(SOLVE) --extra view --extra build --constraints requirements-dev.txt --no-annotate --output-file requirements.txt

# Every pin admits that Python and needs nothing that is not pinned.
check-pins: develop
	$(BIN)/python tests/check_pins.py

clean:
	rm -rf $(VENV) build dist out docs/_build docs/api docs/gallery .coverage*
