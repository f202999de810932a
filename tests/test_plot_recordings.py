"""Pictures of recordings: who is who, what happened to whom, where the leader went, and what the dots are."""

import dataclasses

import numpy as np
import pytest
from numpy.testing import assert_allclose
from PIL import Image
from test_plot import assert_legible, texts

from mp2a.exceptions import InputError, OutputError
from mp2a.formation.robot_models import HUSKY
from mp2a.plot import march_figure, save_animation, speeds_figure
from mp2a.plot.recorded import COLORS, event_symbol, robot_colors
from mp2a.simulator import EventKind, RobotEvent, RunRecorder, Simulation, World, box, simulate

PATH = np.array([[0.0, 0.0], [1.0, 0.0], [1.5, 0.5]])


def record(n, seconds=0.5, roles=None, kinds=tuple(EventKind), apart=2.0):
    """A drive of n robots side by side towards a wall, with an event of each kind."""
    world = World([[[4.0, -2.0], [4.0, apart * n]]], [box((3.0, -1.5), (0.5, 0.5), 0.3)])
    simulation = Simulation(world, HUSKY, [[0, apart * i, 0] for i in range(n)])
    recorder = RunRecorder(simulation, roles)
    simulate(simulation, lambda sensed: np.tile([0.5, 0.1], (n, 1)), until=seconds, recorder=recorder)
    events = [RobotEvent(0.1 * k, k % n, (0.05 * k, apart * (k % n)), kind) for k, kind in enumerate(kinds)]
    return dataclasses.replace(recorder.recording(), events=tuple(events), leader_paths=(PATH,))


def written(figure):
    """All texts of a figure."""
    return [text for text, _ in texts(figure)]


def symbols(figure):
    """The markers and their faces that stand for each kind of event."""
    lines = [line for axes in figure.axes for line in axes.lines if str(line.get_gid()).startswith("event ")]
    return {line.get_gid()[6:]: (line.get_marker(), line.get_markerfacecolor()) for line in lines}


@pytest.mark.parametrize("figure", [march_figure, speeds_figure])
def test_every_kind_of_event_has_a_symbol_of_its_own_and_a_line_in_the_legend(figure):
    drawn = symbols(figure(record(2)))
    assert set(drawn) == {kind.value for kind in EventKind}
    assert len(set(drawn.values())) == len(EventKind)
    labels = written(figure(record(2)))
    assert all(event_symbol(kind)["label"] in labels for kind in EventKind)
    quiet = figure(record(2, kinds=()))
    assert "event" not in written(quiet) and not symbols(quiet)


def test_events_at_one_time_do_not_hide_each_other():
    recording = record(2, kinds=())
    at_once = tuple(RobotEvent(0.2, k % 2, (0.0, 0.0), kind) for k, kind in enumerate(list(EventKind)[:3]))
    panel = speeds_figure(dataclasses.replace(recording, events=at_once)).axes[0]
    heights = {line.get_ydata()[0] for line in panel.lines if str(line.get_gid()).startswith("event ")}
    assert len(heights) == 3


@pytest.mark.parametrize("figure", [march_figure, speeds_figure])
def test_robots_are_called_by_their_roles(figure):
    assert {"Alice", "Bob"} <= set(written(figure(record(2, roles=("Alice", "Bob")))))
    assert {"R1", "R2", "R3"} <= set(written(figure(record(3))))


def test_the_path_of_the_leader_is_drawn_and_explained():
    figure = march_figure(record(2))
    [line] = [line for line in figure.axes[0].lines if line.get_gid() == "leader path"]
    assert_allclose(line.get_xydata(), PATH)
    assert "path of the leader" in written(figure)
    alone = dataclasses.replace(record(2), leader_paths=())
    assert "path of the leader" not in written(march_figure(alone))


def test_a_path_beyond_the_robots_is_within_the_picture():
    far = dataclasses.replace(record(2), leader_paths=(np.array([[0.0, 0.0], [0.0, 30.0]]),))
    assert march_figure(far).axes[0].get_ylim()[1] > 30


@pytest.mark.parametrize("n", [1, 2, 8, 12, 30])
def test_nothing_is_cut_off_or_overprinted(n):
    assert_legible(march_figure(record(n, kinds=())))
    assert_legible(speeds_figure(record(n)))


def test_names_of_a_dense_crowd_do_not_cover_each_other():
    figure = march_figure(record(70, 0.2, kinds=(), apart=1.0))
    names = [text for text in figure.axes[0].texts if text.get_text()]
    assert 3 < len(names) < 70
    assert_legible(figure)


@pytest.mark.parametrize("n", [2, 8, len(COLORS), 40, 150])
def test_no_two_robots_have_one_colour(n):
    assert len(set(robot_colors(n))) == n


def test_few_robots_have_colours_far_apart():
    rgb = np.array([[int(color[k : k + 2], 16) for k in (1, 3, 5)] for color in COLORS])
    apart = np.linalg.norm(rgb[:, None] - rgb, axis=-1)
    assert apart[~np.eye(len(rgb), dtype=bool)].min() > 40


@pytest.mark.parametrize("n", [2, 8, len(COLORS)])
def test_robots_of_an_animation_keep_their_colours(tmp_path, n):
    path = save_animation(record(n, 0.3, kinds=()), tmp_path / "run.gif")
    with Image.open(path) as frames:
        frames.seek(frames.n_frames - 1)
        pixels = np.asarray(frames.convert("RGB")).reshape(-1, 3)
    assert_allclose(pixels[0], 255)
    for color in robot_colors(n):
        rgb = [int(color[k : k + 2], 16) for k in (1, 3, 5)]
        assert (pixels == rgb).all(axis=1).sum() > 10, color


def test_an_animation_explains_its_dots(monkeypatch, tmp_path):
    groups = {}
    monkeypatch.setattr("mp2a.plot.animation.legends", lambda figure, held: groups.update(held))
    save_animation(record(2, 0.2), tmp_path / "run.gif")
    labels = {title: [handle.get_label() for handle in handles] for title, handles in groups.items()}
    assert labels["drawn"] == ["path of the leader", "points that LIDARs see"]
    assert labels["robot"] == ["R1", "R2"]
    assert len(labels["event"]) == len(EventKind)


def test_an_animation_that_cannot_be_written_is_not_drawn(monkeypatch, tmp_path):
    monkeypatch.setattr("mp2a.plot.animation._frames", None)
    with pytest.raises(InputError, match=r"path: got 'run\.png', expected a name that ends in \.gif"):
        save_animation(record(2, 0.2), tmp_path / "run.png")
    (tmp_path / "file").write_text("")
    with pytest.raises(OutputError, match="cannot be written"):
        save_animation(record(2, 0.2), tmp_path / "file" / "run.gif")
