# Everything runs in a virtual environment of its own; nothing else needs to be installed than
# Python 3.11 or newer (with venv) and make; without a C compiler, the build fetches one.

PYTHON ?= python3
VENV ?= .venv
BIN := $(VENV)/bin
DEMO := demo
# what `make bench` compares with, in an environment of its own; what cannot be installed is left out
BENCH := .venv-bench
# the environment with what the tests need
TESTED := $(BIN)/.tested
PEERS := casadi scikit-sundae heyoka exudyn pydy numba
WORKERS ?= 2
# the one that is done first takes from the tests of the other
PARALLEL := -n $(WORKERS) --dist worksteal
# mutants, or random models, that each long test of `make fuzz` tries
FUZZ_COUNT ?= 1000
# mutants of each area that `make mutants` tries
MUTANTS ?= 40

#: What runs the core: its own tests and those of integrations.
CORE_TESTS := tests/unit/engine/integrate/test_run.py tests/unit/engine/integrate/test_engine.py tests/unit/engine/lowering/test_compiler.py \
              tests/unit/engine/integrate/test_batch.py tests/unit/engine/core/test_native.py tests/unit/engine/taylor/test_layers.py tests/unit/engine/core/test_program_vectors.py \
              tests/unit/engine/constraints/test_initial_batch.py tests/physics/test_event_times.py tests/unit/engine/integrate/test_switching_run.py tests/property/test_property_elimination.py tests/property/test_property_tapes.py \
              tests/physics/test_stiff.py

.PHONY: help install core wasm targets demo test test-kernels test-fma fuzz mutants lint coverage docs docs-check gallery dist wheels bench sanitize valgrind clean

help: ## Show the targets
	@grep -hE '^[a-z-]+:.*##' $(MAKEFILE_LIST) | sed -E 's/:.*## /\t/' | expand -t 14

install: $(BIN)/.installed ## Set up the virtual environment with lagcli

$(BIN)/.installed: pyproject.toml
	$(PYTHON) -m venv $(VENV)
	$(BIN)/python -m pip install --quiet --disable-pip-version-check --upgrade pip
	@# the bytecode of all packages takes most of the time and 100 MB: runs write what they use
	$(BIN)/python -m pip install --quiet --disable-pip-version-check --no-compile --editable .
	@# an editable installation leaves this to the first run, which may not be allowed to
	$(BIN)/python -m compileall -q lagcli
	@touch $@

core: install ## Compile what has changed in the core
	$(BIN)/python building/core_library.py

# the compiler for other platforms, 100 MB
$(BIN)/.zig: building/core_library.py $(BIN)/.installed
	$(BIN)/python -m pip install --quiet --disable-pip-version-check \
	  $$(cd building && $(abspath $(BIN))/python -c "import core_library; print(core_library.ZIG)")
	@touch $@

wasm: $(BIN)/.zig ## Compile the core to WebAssembly, for pages that simulate a model
	$(BIN)/python building/wasm.py

targets: $(TESTED) $(BIN)/.zig ## Compile the core for WebAssembly and five platforms, by ziglang
	$(BIN)/python -m pytest -m slow tests/unit/engine/core/test_targets.py

demo: install ## Derive the slider-crank's equations, simulate it, and write a report on it
	@mkdir -p $(DEMO)
	$(BIN)/lagcli derive models/slider_crank.yaml
	$(BIN)/lagcli simulate models/slider_crank.yaml --force -o $(DEMO)/slider_crank.h5
	$(BIN)/lagcli info $(DEMO)/slider_crank.h5
	$(BIN)/lagcli report $(DEMO)/slider_crank.h5 --force --quiet -o $(DEMO)/slider_crank.html
	@echo
	@echo "report: $(CURDIR)/$(DEMO)/slider_crank.html"
	@echo "next:   $(BIN)/lagcli export models/slider_crank.yaml -o page.html   # a page that simulates"

test: $(TESTED) ## Run the tests; some of them: make test TESTS=tests/cli
	@# the next run needs the rewritten assertions, which take as long as all imports
	PYTHONDONTWRITEBYTECODE= $(BIN)/python -m pytest $(PARALLEL) $(TESTS)

# flags of the processor, and the kernels of OpenBLAS that need them: each rounds differently
KERNELS := sse4_2:Nehalem avx:Sandybridge avx2:Haswell avx512bw:SkylakeX
test-kernels: $(TESTED) ## Run the tests with each of OpenBLAS' kernels that this processor executes
	for kernel in $(KERNELS); do \
	  grep -qw "$${kernel%%:*}" /proc/cpuinfo || continue; \
	  echo "OPENBLAS_CORETYPE=$${kernel##*:}"; \
	  OPENBLAS_CORETYPE=$${kernel##*:} $(BIN)/python -m pytest $(PARALLEL) $(TESTS) || exit 1; \
	done

# setuptools adds to a wheel what it copied for earlier ones
CLEAN_BUILD := rm -rf build/lib.*

# A second build, beside the installed one. Tests marked `bits` are left out, because only without
# contraction do the core and the reference round alike; others compare values with a tolerance.
test-fma: $(TESTED) ## Run the core's tests with a core that multiplies and adds in one operation
	@grep -qw fma /proc/cpuinfo || { echo "this processor has no fused multiply-add"; exit 1; }
	$(CLEAN_BUILD)
	LAGCLI_CONTRACTION="-ffp-contract=fast -mfma" $(BIN)/python -m pip install --quiet \
	  --disable-pip-version-check --no-deps --upgrade --target build/fma .
	LAGCLI_CONTRACTION=fast PYTHONPATH=build/fma:. $(BIN)/pytest -p no:cacheprovider \
	  -m "not slow and not fuzz and not bits" $(CORE_TESTS)

fuzz: $(TESTED) ## Run all tests of many damaged files and random cases: make fuzz FUZZ_COUNT=10000
	LAGCLI_FUZZ_COUNT=$(FUZZ_COUNT) $(BIN)/python -m pytest $(PARALLEL) -m fuzz tests

mutants: $(TESTED) ## Change the code in random places, and count the changes that tests notice: make mutants MUTANTS=100
	$(BIN)/python tests/mutation/mutate.py --count $(MUTANTS)

# What an extra of pyproject.toml lists, without building lagcli again
$(BIN)/.extra-%: $(BIN)/.installed
	$(BIN)/python -c "import tomllib; \
	  print(*tomllib.load(open('pyproject.toml', 'rb'))['project']['optional-dependencies']['$*'], sep='\n')" \
	  > $@.txt
	$(BIN)/python -m pip install --quiet --disable-pip-version-check --requirement $@.txt
	@mv $@.txt $@

# the tests run thousands of processes, which share the bytecode; some packages have files that are
# no Python on purpose
$(TESTED): $(BIN)/.extra-test
	$(BIN)/python -m compileall -q -j $(WORKERS) $(VENV)/lib > /dev/null || true
	@touch $@

lint: $(TESTED) $(BIN)/.extra-lint ## Check style, types and spelling
	$(BIN)/ruff check .
	$(BIN)/ruff format --check .
	$(BIN)/mypy
	$(BIN)/codespell README.md CHANGELOG.md CONTRIBUTING.md SECURITY.md docs lagcli models tests
	$(BIN)/proselint --config .proselintrc.json check README.md CHANGELOG.md CONTRIBUTING.md SECURITY.md docs

coverage: $(TESTED) $(BIN)/.extra-coverage ## Run the tests; report the lines they reach, by package
	@mkdir -p build
	$(BIN)/python -m pytest $(PARALLEL) --cov --cov-report=json:build/coverage.json --cov-report=
	$(BIN)/python tests/support/coverage_by_package.py build/coverage.json

docs: $(BIN)/.extra-docs ## Build the documentation as pages, build/site/index.html
	NO_MKDOCS_2_WARNING=1 $(BIN)/mkdocs build --quiet

dist: $(BIN)/.extra-dist ## Build dist/*.tar.gz and *.whl; try the wheel in an empty environment
	rm -rf dist
	$(BIN)/python -m build --outdir dist .
	$(BIN)/python tests/support/try_wheel.py dist/*.whl

# the core is compiled here, all else comes from the source distribution
wheels: $(BIN)/.extra-dist wasm ## Build dist/*.tar.gz and the wheels of all platforms; check them, and run this one's
	rm -rf dist
	$(BIN)/python -m build --outdir dist .
	$(BIN)/python building/wheels.py dist/*.whl
	$(BIN)/python tests/support/check_wheels.py dist/*.whl
	$(BIN)/python tests/support/try_wheel.py --tests dist

$(BENCH)/.installed: pyproject.toml
	$(PYTHON) -m venv $(BENCH)
	$(BENCH)/bin/python -m pip install --quiet --disable-pip-version-check --upgrade pip
	$(BENCH)/bin/python -m pip install --quiet --disable-pip-version-check cython setuptools
	for peer in $(PEERS); do \
	  $(BENCH)/bin/python -m pip install --quiet --disable-pip-version-check $$peer \
	    || echo "$$peer is not available"; \
	done
	@touch $@

bench: $(TESTED) $(BENCH)/.installed ## Run the long tests; measure beside other programs
	$(BIN)/python -m pytest -m slow --durations=0
	$(BIN)/python tests/benchmark/shell_loop.py
	$(BIN)/python tests/benchmark/sweep_rows.py
	$(BIN)/python tests/benchmark/native_code.py
	$(BIN)/python tests/benchmark/exported_code.py
	$(BIN)/python tests/benchmark/event_log_size.py
	$(BIN)/python tests/benchmark/fitting.py
	$(BIN)/python tests/benchmark/prompt_times.py
	$(BENCH)/bin/python -m pip install --quiet --disable-pip-version-check .
	cd tests/benchmark && $(CURDIR)/$(BENCH)/bin/python -m comparison

gallery: $(BIN)/.extra-pictures ## Make the pictures, animations and reports of the models in docs/gallery
	$(BIN)/python docs/gallery/build.py
	$(BIN)/python docs/images/build.py
	$(BIN)/python docs/first_picture.py

docs-check: $(TESTED) ## Run the commands and check the statements of the documentation
	$(BIN)/python -m pytest tests/docs

# A second build, beside the installed one. The interpreter itself is not instrumented, so the
# runtime libraries are loaded before it, and its own memory pools and leaks are left out.
sanitize: $(TESTED) ## Run the core's tests with the address and undefined-behaviour sanitizers
	$(CLEAN_BUILD)
	CFLAGS="-O1 -fsanitize=address,undefined -fno-sanitize-recover=all -g" \
	  LDFLAGS="-fsanitize=address,undefined" $(BIN)/python -m pip install --quiet \
	  --disable-pip-version-check --no-deps --upgrade --target build/sanitized .
	LD_PRELOAD="$$(gcc -print-file-name=libasan.so) $$(gcc -print-file-name=libubsan.so)" \
	  ASAN_OPTIONS=detect_leaks=0 PYTHONMALLOC=malloc PYTHONPATH=build/sanitized:. \
	  $(BIN)/pytest -p no:cacheprovider $(CORE_TESTS)

# The interpreter and NumPy give valgrind a lot to say about themselves: what counts is what it says
# about the core, whose frames show its library's name or, with debug information, its files'.
CORE_FILES := $(shell find lagcli/engine/core -name '*.c' | sed 's|.*/||; s/\.c$$//' | paste -sd '|')
valgrind: $(TESTED) ## Run tests of the core under valgrind (Debian: valgrind); takes minutes
	@mkdir -p build
	PYTHONMALLOC=malloc valgrind --leak-check=no --error-limit=no --log-file=build/valgrind.log \
	  $(BIN)/python -m pytest -p no:cacheprovider tests/unit/engine/integrate/test_run.py \
	  -k "eliminate or replaced or redundant or damping or blocks"
	! grep -E -A 12 "liblagcore|\(($(CORE_FILES))\.c:" build/valgrind.log

clean: ## Remove what the targets made
	rm -rf $(VENV) $(BENCH) $(DEMO) docs/gallery/index.html docs/gallery/pages build *.egg-info .pytest_cache .mypy_cache .ruff_cache .hypothesis
