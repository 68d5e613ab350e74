# Everything a newcomer needs, from nothing but Python 3.11 and make.
PYTHON ?= $(shell command -v python3.11 || command -v python3)
VENV := .venv
BIN := $(VENV)/bin
READY := $(VENV)/.ready
READY_TEST := $(VENV)/.ready-test
export OMP_NUM_THREADS := 1
export OPENBLAS_NUM_THREADS := 1
# a module compiled by one process is compiled for the next, whatever the shell says
export PYTHONDONTWRITEBYTECODE :=
# a fault of the program fails what is made, as a traceback does
export SIMBENCH_RAISE := 1

.PHONY: bench check leak real results test test-all rules lint perf shares docs site clean

bench: $(READY)            ## the main job: simulate a labelled grid, run the detectors, score them
	rm -rf runs/bench
	$(BIN)/simbench run chapter -o runs/bench --method fast,oracle -j 2
	$(BIN)/simbench score runs/bench --truth predicted --report runs/bench/report.html

test: $(READY_TEST) rules  ## the tests of every change, and the rules of the house
	$(BIN)/python -m pytest -n 2 --dist worksteal -m "not slow" --ignore=results/studies/tests

test-all: lint             ## these, the types, and what only a release needs
	FUZZ=120 $(BIN)/python -m pytest -n 2 --dist worksteal

rules: $(READY_TEST)       ## how the code is written, and who imports whom
	$(BIN)/ruff check .
	$(BIN)/lint-imports

lint: rules                ## these, and the types, which take as long as a quarter of the tests
	$(BIN)/pyright

check: $(READY)            ## has any detector lost accuracy against the committed baseline?
	rm -rf runs/ci
	$(BIN)/simbench run ci -o runs/ci -j 2 >/dev/null
	$(BIN)/simbench check runs/ci --against results/baseline

real: $(READY)             ## every record of real loops, every method and every verb, by loop and by unit
	@mkdir -p runs
	$(BIN)/simbench detect ../shared/data/real --labels ../shared/data/real/records.csv --method full \
		--method likelihood --why > runs/real_records.txt
	(echo; $(BIN)/python benchmarks/verbs_on_records.py ../shared/data/real \
		../shared/data/real/records.csv) >> runs/real_records.txt
	mv runs/real_records.txt results/real_records.txt

results: $(READY_TEST)     ## every file of results/ again, or those of FILES, by the commands that results/README.md lists; the studies' own tests
	@mkdir -p runs
	$(BIN)/python -m results.studies.remake $(FILES)
	$(BIN)/python -m pytest -n 2 --dist worksteal -q -m "not slow" results/studies/tests

leak: $(READY)             ## can a scenario's settings alone predict its label? They must not
	$(BIN)/python -m results.studies.leak

perf: $(READY_TEST)        ## what the loop, each detector and a whole scenario cost: ratios and shares of CPU time
	@failed=0; for part in perf perf_detectors perf_shares; do \
		$(BIN)/python benchmarks/$$part.py || failed=1; done; exit $$failed

shares: $(READY_TEST)      ## what a scenario is made of, against the committed shares: never times
	$(BIN)/python benchmarks/perf_shares.py

docs: $(READY_TEST)        ## the gallery, and every published number beside ours
	$(BIN)/simbench figure all -o results/figures
	@mkdir -p runs
	$(BIN)/simbench simulate docs/example/loop.toml -o runs/example.csv --seed 1
	$(BIN)/simbench gap diagnose runs/example.csv --baseline docs/example/model.toml --picture results/figures/gap-example.svg
	$(BIN)/python -m results.studies.chapter --isdb ../shared/data/real
	$(BIN)/python -m results.studies.gallery

site: $(READY_TEST)        ## tutorials that run, API, detectors, formats, glossary as pages
	$(BIN)/python -m sphinx -W --keep-going -q docs/site runs/site

# the product alone, and with what tests, studies and pages need; modules are compiled when first imported, kernels by a first record
INSTALL = (test -x $(BIN)/pip || $(PYTHON) -m venv $(VENV)) && \
	$(BIN)/pip install --quiet --disable-pip-version-check --no-compile -c constraints.txt -e

$(READY): pyproject.toml constraints.txt
	$(INSTALL) .
	@mkdir -p runs
	$(BIN)/simbench simulate docs/example/loop.toml -o runs/warm.csv --seed 1 > runs/warm.txt
	$(BIN)/simbench detect runs/warm.csv > runs/warm.txt  # compiles the kernels: the first use finds them
	touch $@

$(READY_TEST): pyproject.toml constraints.txt
	$(INSTALL) '.[test]'
	touch $(READY) $@

clean:
	rm -rf $(VENV) build runs *.egg-info
