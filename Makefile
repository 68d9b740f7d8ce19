# Everything a person or a machine does with this project, by name.
#   make demo | test | lint | docs | bench | campaign | accuracy | closed-loop | motion | ways-out | gripping | evading | cues | filter-peer | audit-pairs | room | reach | batch-campaign | verify-campaign | map-campaign | coordinate-campaign | fleet-campaign | sensing | sense-campaign | sensed-loops | freedom | sensors-campaign | sensor-faults | coverage | following | attack | mutants | soak | reflex-campaign | campaigns-due | golden | dist | dist-check   ARGS="..." is passed on
PYTHON ?= python3
BIN := .venv/bin
ARGS ?=

.PHONY: demo test lint docs bench campaign accuracy closed-loop motion ways-out gripping evading cues filter-peer audit-pairs room reach batch-campaign verify-campaign map-campaign coordinate-campaign fleet-campaign sensing sense-campaign sensed-loops freedom sensors-campaign sensor-faults coverage following attack mutants soak reflex-campaign campaigns-due golden dist dist-check format clean
.DELETE_ON_ERROR:

# Two environments in one: what guard and station need, then what tests and benchmarks
# need as well. A file whose hash is not in requirements/ is not installed.
PIP_INSTALL = $(BIN)/python -m pip install --quiet --disable-pip-version-check

.venv/core: pyproject.toml requirements/core.txt
	test -x $(BIN)/python || $(PYTHON) -m venv .venv
	$(PIP_INSTALL) --require-hashes --no-deps -r requirements/core.txt
	$(PIP_INSTALL) --no-build-isolation --no-deps -e .
	touch $@

.venv/dev: .venv/core requirements/dev.txt
	$(PIP_INSTALL) --require-hashes --no-deps -r requirements/dev.txt
	$(BIN)/python -m pip check --disable-pip-version-check
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

# The site with the API reference, in build/site; and how easy the first pages read.
docs: .venv/dev
	NO_MKDOCS_2_WARNING=1 $(BIN)/mkdocs build --strict
	$(BIN)/python tests/prose.py

# The cycle and its parts beside peers; ARGS="filter", ARGS="service --seconds 60".
bench: .venv/dev
	$(BIN)/python benchmarks/bench.py $(ARGS)

# Long runs: not part of `make test`; results are written to docs/.
campaign: .venv/dev
	$(BIN)/python benchmarks/campaign.py $(ARGS)

accuracy: .venv/dev
	$(BIN)/python benchmarks/accuracy_campaign.py $(ARGS)

# Operators who try to cause contact; ARGS="--plant torque" has motors of limited torque.
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

reach: .venv/dev
	$(BIN)/python benchmarks/reach_goals.py $(ARGS)

# Rates, proofs and plans of batches; ARGS=panda_59_spheres.json; writes docs/batch.*
batch-campaign: .venv/dev
	$(BIN)/python benchmarks/batch_campaign.py $(ARGS)

# Proofs of plans against dense samples of Coal; writes docs/verify.*
verify-campaign: .venv/dev
	$(BIN)/python benchmarks/verify_campaign.py $(ARGS)

# Maps and schedules of two arms against Coal; writes docs/map.*
map-campaign: .venv/dev
	$(BIN)/python benchmarks/map_campaign.py $(ARGS)

coordinate-campaign: .venv/dev
	$(BIN)/python benchmarks/coordinate_campaign.py $(ARGS)

# Audits of many episodes by every engine, with workers killed; writes docs/fleet.*
fleet-campaign: .venv/dev
	$(BIN)/python benchmarks/fleet_campaign.py $(ARGS)

# Maps of cells beside OctoMap and FCL; ARGS=FOLDER with recorded images; writes docs/sensing.*.
sensing: .venv/dev
	$(BIN)/python benchmarks/sensing_campaign.py $(ARGS)

# Sensors in a simulated bay: what gets into the map, and how soon it goes; docs/sense.*.
sense-campaign: .venv/dev
	$(BIN)/python benchmarks/sense_campaign.py $(ARGS)

# Operators who try to hit what sensors alone know; writes docs/sensed_loops.*.
sensed-loops: .venv/dev
	$(BIN)/python benchmarks/sensed_loops_campaign.py $(ARGS)

# Motion among objects that are modelled, sensed, or known by OctoMap; docs/freedom.*.
freedom: .venv/dev
	$(BIN)/python benchmarks/freedom_campaign.py $(ARGS)

# Infrared sensors, capacitive pads, calibration of sensors; docs/sensors.json.
sensors-campaign: .venv/dev
	$(BIN)/python benchmarks/sensors_campaign.py $(ARGS)

# Faults of sensors in motion, and what is named; writes docs/sensor_faults.*.
sensor-faults: .venv/dev
	$(BIN)/python benchmarks/sensor_faults_campaign.py $(ARGS)

# Blind patches of links against MuJoCo's rays; writes docs/coverage.*.
coverage: .venv/dev
	$(BIN)/python benchmarks/coverage_campaign.py $(ARGS)

# Planar arms follow unknown surfaces to their goals; writes docs/following.*.
following: .venv/dev
	$(BIN)/python benchmarks/following_campaign.py $(ARGS)

# A hundred million cycles of one guard; count is in millions.
soak: .venv/dev
	$(BIN)/python benchmarks/soak_campaign.py $(ARGS)

# Faults of guard, sensor and reflex: how soon arms have to stop; writes docs/reflex.*.
reflex-campaign: .venv/dev
	$(BIN)/python benchmarks/reflex_campaign.py --processes 1 $(ARGS)

# Published rows that were measured with other kernels than those of now.
campaigns-due: .venv/dev
	$(BIN)/python benchmarks/campaigns_due.py

# Attacks on a running guard, from outside: at most ten minutes; writes docs/security.*.
attack: .venv/dev
	$(BIN)/python benchmarks/attack_campaign.py $(ARGS)

# Mutants of the deciding code against the tests; writes docs/mutants.*.
mutants: .venv/dev
	$(BIN)/python benchmarks/mutants_campaign.py $(ARGS)

# Plays whose every cycle is known by its hashes: the first cycle and field that differ.
golden: .venv/dev
	$(BIN)/python benchmarks/golden_campaign.py $(ARGS)

# The wheel with its kernels compiled, for this version of Python and any x86-64-v3.
dist: .venv/core
	$(BIN)/python release/build_wheel.py

# The same, installed into an empty environment: compiles nothing, and has the same bits.
dist-check: dist
	$(BIN)/python release/check_wheel.py

format: .venv/dev
	$(BIN)/ruff format .
	$(BIN)/ruff check --fix .

clean:
	rm -rf .venv build dist out src/*.egg-info
