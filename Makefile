# Two commands, each doing its own set-up:  make demo   make test
# Bytecode is kept whatever the user's setting: without it, the start of a process takes twice as long.
export PYTHONDONTWRITEBYTECODE :=

PYTHON ?= python3
BIN := .venv/bin
PYTEST := $(BIN)/pytest -n auto --maxprocesses 8 --dist loadfile --no-loadscope-reorder
NARROW := VBAA_BENCH_VECTOR_WIDTH=4
OLDEST := OPENBLAS_CORETYPE=Prescott NPY_DISABLE_CPU_FEATURES="X86_V3 X86_V4 AVX512_ICL AVX512_SPR" NUMBA_CPU_NAME=x86-64

.PHONY: demo test ci docs narrow oldest seeds golden libraries lock dist clean

demo: libraries
	$(BIN)/vbaa-bench run scenes/quickstart.yaml

test: libraries
	$(BIN)/ruff check .
	$(BIN)/ruff format --check .
	$(PYTEST) -m "not thorough"

# What takes longer: types; many samples, all scenes, the laboratory; images with narrow vectors of
# the renderer; estimates with the oldest kernels.
ci: libraries docs
	$(BIN)/mypy
	$(PYTEST) -m thorough
	$(NARROW) $(PYTEST) -m "not thorough" tests/vbaa_bench/render tests/vbaa_bench/generation
	$(OLDEST) $(PYTEST) -m "not thorough" tests/solver

# The documentation as a site in build/docs, which needs no network.
docs: .venv/ready
	$(BIN)/sphinx-build --quiet --fail-on-warning --keep-going -c docs . build/docs

# All tests as on other processors: with narrow vectors of the renderer, and with the oldest kernels
# of OpenBLAS, NumPy and Numba.
narrow: libraries
	$(NARROW) $(PYTEST)

oldest: libraries
	$(OLDEST) $(PYTEST)

# By how many standard deviations assertions hold, over 20 seeds:  make seeds PART=1/8 TESTS=tests/solver
PART ?= 1/1
TESTS ?= tests
seeds: libraries
	$(BIN)/python -m tests.margins --part $(PART) $(TESTS)

# Whether this version makes the same as another one:  make golden BASE=COMMIT
golden: libraries
	$(BIN)/python -m tests.golden $(BASE)

# uv comes from PyPI at a pinned hash; --target also works where Debian protects its own site-packages.
.tools/bin/uv: requirements-uv.lock
	$(PYTHON) -m pip install --quiet --require-hashes --upgrade --target .tools -r requirements-uv.lock
	touch $@

.venv/ready: .tools/bin/uv requirements.lock pyproject.toml
	.tools/bin/uv venv --quiet --allow-existing --no-python-downloads --python $(PYTHON) .venv
	.tools/bin/uv pip sync --quiet --python $(BIN)/python --require-hashes requirements.lock
	.tools/bin/uv pip install --quiet --python $(BIN)/python --no-deps --no-build-isolation --editable .
	touch $@

# The renderer needs libatomic, and libLLVM >= 16 to be fast: installed where apt and root allow it.
libraries: .venv/ready
	@$(BIN)/vbaa-bench doctor --install --quiet

lock: .tools/bin/uv
	.tools/bin/uv pip compile --quiet --universal --generate-hashes --no-emit-index-url --no-header --no-annotate \
		--python-version 3.11 --extra dev pyproject.toml -o requirements.lock

# Wheel and sdist, in build/dist.
dist: .venv/ready
	$(BIN)/python -m hatchling build -d build/dist

# Rendered data, runs/, are kept: they take hours.
clean:
	rm -rf .venv .tools build *.egg-info
