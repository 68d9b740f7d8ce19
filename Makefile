# Everything a person or a machine does with this project, by name.
#   make demo | test | lint | bench | campaign | accuracy | closed-loop | motion | ways-out | gripping | evading | cues | filter-peer | audit-pairs | room   ARGS="..." is passed on
PYTHON ?= python3
BIN := .venv/bin
ARGS ?=

.PHONY: demo test lint bench campaign accuracy closed-loop motion ways-out gripping evading cues filter-peer audit-pairs room format clean
.DELETE_ON_ERROR:

# Two environments in one: what guard and station need, then what tests and benchmarks
# need as well.
.venv/core: pyproject.toml constraints.txt
	test -x $(BIN)/python || $(PYTHON) -m venv .venv
	$(BIN)/python -m pip install --quiet --disable-pip-version-check -c constraints.txt -e '.[robots,station,view]'
	touch $@

.venv/dev: .venv/core
	$(BIN)/python -m pip install --quiet --disable-pip-version-check -c constraints.txt -e '.[dev]'
	touch $@

demo: .venv/core
	$(BIN)/armguard demo $(ARGS)

test: .venv/dev
	$(BIN)/python -m pytest $(ARGS)

lint: .venv/dev
	$(BIN)/ruff format --check .
	$(BIN)/ruff check .
	$(BIN)/mypy
	$(BIN)/lint-imports

bench: .venv/dev
	$(BIN)/armguard bench all $(ARGS)

# Long runs: not part of `make test`; results are written to docs/.
campaign: .venv/dev
	$(BIN)/python benchmarks/campaign.py $(ARGS)

accuracy: .venv/dev
	$(BIN)/python benchmarks/accuracy_campaign.py $(ARGS)

closed-loop: .venv/dev
	$(BIN)/python benchmarks/closed_loop_campaign.py $(ARGS)

motion: .venv/dev
	$(BIN)/python benchmarks/motion_campaign.py $(ARGS)

ways-out: .venv/dev
	$(BIN)/python benchmarks/ways_out_campaign.py $(ARGS)

gripping: .venv/dev
	$(BIN)/python benchmarks/gripping_campaign.py $(ARGS)

evading: .venv/dev
	$(BIN)/python benchmarks/evading_campaign.py $(ARGS)

cues: .venv/dev
	$(BIN)/python benchmarks/cue_times.py $(ARGS)

filter-peer: .venv/dev
	$(BIN)/python benchmarks/filter_peer.py $(ARGS)

audit-pairs: .venv/dev
	$(BIN)/python benchmarks/audit_pairs.py $(ARGS)

room: .venv/dev
	$(BIN)/python benchmarks/room_campaign.py $(ARGS)

format: .venv/dev
	$(BIN)/ruff format .
	$(BIN)/ruff check --fix .

clean:
	rm -rf .venv build dist out src/*.egg-info
