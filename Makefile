# Everything sets itself up: all that is needed is python3 (3.11 or newer), a C++ compiler and make;
# for the tests of the dashboard also Chromium, which root gets by itself on Debian.
PYTHON ?= python3
VENV := .venv
BIN := $(VENV)/bin

# A fleet is many processes, and each starts about a fifth of a second sooner from bytecode.
unexport PYTHONDONTWRITEBYTECODE

KERNELS := $(wildcard swarm/kernels/*.cpp swarm/kernels/*.hpp) swarm/kernels/CMakeLists.txt

.PHONY: demo test test-all test-computed test-processes browser lint audit format kernels sanitize soak chaos fuzz clean help
.PHONY: dist check-dist sbom wheels check-units check-machines check-image

help:
	@echo "make demo    fly the paper's mission with real processes on this machine"
	@echo "make test    checks and the test suite"
	@echo "make test-all  the same with the slow tests, which guard what is rare"
	@echo "make lint    the checks alone: ruff, mypy, import-linter, known weaknesses of packages"
	@echo "make audit   ask whether weaknesses of what is installed are known"
	@echo "make format  put the sources into shape"
	@echo "make kernels build the C++ kernels again and write their type stub"
	@echo "make sanitize  test the kernels under the address and undefined-behaviour sanitizers"
	@echo "make soak    play 10000 random missions with faults in virtual time (SEEDS=N for more)"
	@echo "make chaos   kill and restart real processes at random moments of whole missions, 60 flights"
	@echo "make fuzz    throw a million hostile inputs of each firmware at a bridge (STEPS=N for more)"
	@echo "make dist    source distribution and a wheel for this machine, into dist/"
	@echo "make check-dist  install both elsewhere, use them, and build them again to the same bytes"
	@echo "make sbom    bill of materials of that wheel, into dist/"
	@echo "make wheels  wheels for all machines, into dist/wheels/; needs Docker or Podman"
	@echo "make check-units  boot systemd in a container, and kill and freeze the services of a fleet (root)"
	@echo "make check-machines  fly a fleet on two network namespaces, and pull the cable between them (root)"
	@echo "make check-image  build the images, fly in them, compose fleets (Docker or Podman; says what was not tried)"
	@echo "make clean   remove what was built and installed here"

demo: $(VENV)/.installed
	$(BIN)/swarm run table-1 --method greedy

# What the marker `slow` says (pyproject.toml) is for the night: `make test-all`.
TESTED := -m "not slow"
# What only computes is tested beside the checks. Tests with real processes have the machine to
# themselves: beside others they fly more slowly, and take longer than both in turn.
test: $(VENV)/.installed-dev browser
	+$(MAKE) --no-print-directory -j 2 lint test-computed TESTED='$(TESTED)'
	+$(MAKE) --no-print-directory test-processes TESTED='$(TESTED)'

test-all: TESTED :=
test-all: test

# Tells all at its end, lest two reports be mixed.
COMPUTED := build/test-computed.txt
test-computed: $(VENV)/.installed-dev
	@mkdir -p $(dir $(COMPUTED))
	@echo "tests/unit and tests/faults go on beside the checks and report at their end ($(COMPUTED))"
	@$(BIN)/python -m pytest -n 2 --dist worksteal $(TESTED) tests/unit tests/faults >$(COMPUTED) 2>&1; \
	status=$$?; cat $(COMPUTED); exit $$status

test-processes: $(VENV)/.installed-dev browser
	$(BIN)/python -m pytest -n 8 --dist worksteal $(TESTED) tests/contract tests/process tests/sitl

# The dashboard is tested in a real browser: Chromium under one of these names.
CHROMIUM := chromium chromium-browser google-chrome
browser:
	@for name in $(CHROMIUM); do command -v $$name >/dev/null && exit 0; done; \
	if [ "$$(id -u)" = 0 ] && command -v apt-get >/dev/null; then \
		echo "installing chromium for the tests of the dashboard"; \
		apt-get update -qq && DEBIAN_FRONTEND=noninteractive \
			apt-get install -y -qq --no-install-recommends chromium >/dev/null; \
	else \
		echo "make test: no Chromium found; install one of $(CHROMIUM), on Debian: sudo apt-get install chromium" >&2; \
		exit 1; \
	fi

lint: $(VENV)/.installed-dev
	$(BIN)/ruff format --check .
	$(BIN)/ruff check .
	nice $(BIN)/mypy
	$(BIN)/lint-imports
	$(BIN)/python -m tests.release.audit

audit: $(VENV)/.installed-dev
	$(BIN)/python -m tests.release.audit --must-answer

format: $(VENV)/.installed-dev
	$(BIN)/ruff format .
	$(BIN)/ruff check --fix .

$(VENV)/bin/python:
	@$(PYTHON) -c 'import sys; sys.exit("Python 3.11 or newer is needed, this is " + sys.version.split()[0] if sys.version_info < (3, 11) else 0)'
	@command -v $${CXX:-c++} >/dev/null || \
		{ echo "make: no C++ compiler; on Debian: sudo apt-get install g++" >&2; exit 1; }
	$(PYTHON) -m venv $(VENV)

# The build tools are installed beside the project, so that a change in one kernel compiles one file.
kernels: $(VENV)/.installed-dev
	$(BIN)/python -m pip install --quiet --disable-pip-version-check --no-deps \
		--no-build-isolation --editable .
	$(BIN)/python -m nanobind.stubgen --quiet --module swarm.kernels._kernels \
		--include-private --output-file swarm/kernels/_kernels.pyi
	$(BIN)/ruff format --quiet swarm/kernels/_kernels.pyi

# A copy of the tree with kernels of its own. Python starts without `site` (-S), which would point it
# at the installed kernels, and with the sanitizer's library before all others.
SANITIZED := build/sanitize
sanitize: $(VENV)/.installed-dev
	$(BIN)/cmake -G Ninja -S swarm/kernels -B $(SANITIZED)/cmake -DPECKORDER_SANITIZE=ON \
		-DCMAKE_MAKE_PROGRAM=$(CURDIR)/$(BIN)/ninja -DPython_EXECUTABLE=$(CURDIR)/$(BIN)/python
	$(BIN)/cmake --build $(SANITIZED)/cmake
	rm -rf $(SANITIZED)/tree && mkdir -p $(SANITIZED)/tree
	cp -R swarm coordinator agent sim tests pyproject.toml $(SANITIZED)/tree
	cp $(SANITIZED)/cmake/_kernels*.so $(SANITIZED)/tree/swarm/kernels
	cd $(SANITIZED)/tree && \
		LD_PRELOAD="$$(c++ -print-file-name=libasan.so) $$(c++ -print-file-name=libstdc++.so)" \
		ASAN_OPTIONS=detect_leaks=0 UBSAN_OPTIONS=print_stacktrace=1 PYTHONMALLOC=malloc \
		PYTHONPATH="$$($(CURDIR)/$(BIN)/python -c 'import sysconfig; print(sysconfig.get_path("platlib"))')" \
		$(CURDIR)/$(BIN)/python -S -m pytest -q --capture sys --timeout 600 tests/unit/swarm/kernels \
		tests/unit/swarm/separation/test_traffic_glance.py

# Bytecode is written by whoever imports a module first: of all the modules of all packages few are.
PIP_INSTALL := $(BIN)/python -m pip install --quiet --disable-pip-version-check --no-compile

# The demo needs no extra; a dashboard, a plot or a recording is what one asks for next.
$(VENV)/.installed: pyproject.toml swarm/__init__.py $(KERNELS) | $(VENV)/bin/python
	@echo "installing into $(VENV), and compiling the kernels: two or three minutes, in silence"
	$(PIP_INSTALL) --editable '.[ground]'
	@touch $@

$(VENV)/.installed-dev: pyproject.toml swarm/__init__.py $(KERNELS) | $(VENV)/bin/python
	@echo "installing into $(VENV) all that tests need, too: some minutes, in silence"
	$(PIP_INSTALL) --editable '.[dev]'
	@touch $@ $(VENV)/.installed

$(VENV)/.installed-release: $(VENV)/.installed-dev
	$(PIP_INSTALL) --editable '.[dev,release]'
	@touch $@

# The same commit gives the same bytes on every day: files carry the time of the commit.
RELEASE := SOURCE_DATE_EPOCH=$$(git log -1 --format=%ct)

dist: $(VENV)/.installed-release
	rm -rf dist
	$(RELEASE) $(BIN)/python -m build

check-dist: dist
	$(BIN)/python -m cibuildwheel --platform linux --print-build-identifiers
	$(BIN)/python -m tests.release.check_dist dist

sbom: $(VENV)/.installed-release
	$(BIN)/python -m tests.release.bill dist/*.whl

wheels: $(VENV)/.installed-release
	$(RELEASE) $(BIN)/python -m cibuildwheel --output-dir dist/wheels

SEEDS ?= 10000
soak: $(VENV)/.installed
	$(BIN)/swarm soak --seeds $(SEEDS)

chaos: $(VENV)/.installed-dev
	$(BIN)/python -m tests.chaos --jobs 2

STEPS ?= 1000000
SEED ?= 1
fuzz: $(VENV)/.installed-dev
	$(BIN)/python -m tests.benchmarks.fuzz_bridge --steps $(STEPS) --seed $(SEED)

# A real systemd in a container; as root on a machine with debootstrap and systemd-nspawn.
check-units: $(VENV)/.installed-dev
	deploy/checks/units.sh

check-machines: $(VENV)/.installed-dev
	deploy/checks/machines.sh

check-image: $(VENV)/.installed-dev
	deploy/checks/image.sh

clean:
	rm -rf $(VENV) build dist *.egg-info .pytest_cache .mypy_cache .ruff_cache .import_linter_cache .hypothesis
