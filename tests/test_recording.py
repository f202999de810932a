"""Recordings and their pictures: what is read back is what happened."""

import dataclasses
import errno
import json
import os
import pickle
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest
from foxglove.messages import LogLevel
from hypothesis import given, settings
from hypothesis import strategies as st
from mcap.reader import make_reader
from mcap_protobuf.decoder import DecoderFactory
from numpy.testing import assert_allclose, assert_array_equal
from PIL import Image

from mp2a import plot
from mp2a.cli import main
from mp2a.exceptions import DependencyError, InputError, OutputError
from mp2a.formation.robot_models import HUSKY, TRADR
from mp2a.plot.animation import frame_ticks
from mp2a.plot.march import march_figure
from mp2a.plot.speeds import speeds_figure
from mp2a.simulator import (
    NO_SLIP,
    EventKind,
    Lidar,
    Recording,
    RobotEvent,
    RunRecorder,
    Simulation,
    World,
    box,
    load_recording,
    save_recording,
    simulate,
)

WORLD = World([[[-4, -3], [6, -3], [6, 3]]], [box((4, 0), (0.6, 0.6))], "a place")


def record(n=2, seconds=6.0, points=True, world=WORLD):
    """A run in which robot 1 drives into the box."""
    poses = np.array([[-1.5 * i, 0.3 * (i % 2), 0] for i in range(n)])
    simulation = Simulation(world, [HUSKY, TRADR] * (n // 2) + [HUSKY] * (n % 2), poses, slip=NO_SLIP, lidar=Lidar(32))
    recorder = RunRecorder(simulation, points=points)
    commands = np.tile([0.7, 0.0], (n, 1))
    commands[1:] = (0.3, 0.1)
    simulate(simulation, lambda sensed: commands if sensed.time < 5 else np.full((n, 2), np.nan), seconds, recorder)
    lost = RobotEvent(1.0, n - 1, (0.0, 1.0), EventKind.ERROR_STATE)
    return recorder.recording(events=[lost], leader_paths=[np.array([[0, 0], [4.5, 0.5]]), np.zeros((1, 2))])


RECORDING = record()


def test_recording_tells_what_happened():
    assert_allclose(RECORDING.times, np.arange(61) * 0.1, atol=1e-9)
    assert RECORDING.poses.shape == (61, 2, 3)
    assert_array_equal(np.isnan(RECORDING.commands[..., 0]), RECORDING.times[:, None] > 4.95 + np.zeros((1, 2)))
    assert [event.kind for event in RECORDING.events] == [EventKind.ERROR_STATE, EventKind.COLLISION]
    texts = [event.text(("a", "b")) for event in RECORDING.events]
    assert texts == ["b is in its error state and stays there", "a drives into a wall or an obstacle"]
    assert RECORDING.roles == ("R1", "R2")
    assert len(RECORDING.points) == RECORDING.counts.sum() > 0
    # A point on the box seen by robot 1 lies on the box when put where the robot was at the time of the scan.
    k = 30
    then = int(np.argmin(abs(RECORDING.times - RECORDING.stamps[k, 0])))
    assert RECORDING.times[k] - RECORDING.times[then] == pytest.approx(0.3)
    ahead = RECORDING.new_points(k, 0)[0] + RECORDING.poses[then, 0, :2]
    assert_allclose(ahead, (3.7, 0), atol=1e-6)


def test_file_holds_the_same(tmp_path):
    back = load_recording(save_recording(RECORDING, tmp_path / "new" / "run.npz"))
    for field in dataclasses.fields(Recording):
        mine, read = getattr(RECORDING, field.name), getattr(back, field.name)
        if isinstance(mine, np.ndarray):
            assert_array_equal(mine, read)
            assert mine.dtype == read.dtype
        elif field.name == "leader_paths":
            assert [line.tolist() for line in mine] == [line.tolist() for line in read]
        elif field.name != "world":
            assert mine == read
    assert back.world.name == WORLD.name
    assert_array_equal(back.world.segments, WORLD.segments)
    assert [shape.area for shape in back.world.shapes] == [shape.area for shape in WORLD.shapes]


@pytest.mark.parametrize("world", [World(), World(obstacles=[box((9, 9), (1, 1))]), World([[[8, 8], [9, 9]]])])
def test_file_holds_empty_lists_too(tmp_path, world):
    plain = record(1, 0.2, points=False, world=world)
    back = load_recording(save_recording(dataclasses.replace(plain, events=(), leader_paths=()), tmp_path / "run.npz"))
    assert back.events == back.leader_paths == ()
    assert back.points.shape == (0, 2)
    assert [len(back.world.walls), len(back.world.obstacles)] == [len(world.walls), len(world.obstacles)]


def read_mcap(path):
    """All messages by topic, decoded by another library than the one that wrote them."""
    topics = {}
    with path.open("rb") as file:
        for message in make_reader(
            file, validate_crcs=True, decoder_factories=[DecoderFactory()]
        ).iter_decoded_messages():
            topics.setdefault(message.channel.topic, []).append(
                (message.schema.name, message.message, message.decoded_message)
            )
    return topics


class PlainJson(DecoderFactory):
    """Decodes protobuf as its parent does, and JSON too."""

    def decoder_for(self, message_encoding, schema):
        if message_encoding == "json":
            return json.loads
        return super().decoder_for(message_encoding, schema)


def test_mcap_holds_the_same(tmp_path, monkeypatch):
    monkeypatch.setattr(sys.modules[__name__], "DecoderFactory", PlainJson)
    topics = read_mcap(save_recording(RECORDING, tmp_path / "run.mcap"))
    assert set(topics) == {
        "/world", "/robots", "/tf", "/events",
        "/robot_1/points", "/robot_2/points", "/robot_1/motion", "/robot_2/motion",
    }  # fmt: skip
    assert {name for name, _, _ in topics["/robot_1/points"]} == {"foxglove.PointCloud"}
    assert len(topics["/tf"]) == len(RECORDING.times)
    for k, (_, raw, decoded) in enumerate(topics["/tf"]):
        assert raw.log_time == round(1e9 * RECORDING.times[k])
        for i, found in enumerate(decoded.transforms):
            x, y, heading = RECORDING.poses[k, i]
            assert (found.parent_frame_id, found.child_frame_id) == ("ground", f"robot_{i + 1}")
            assert_allclose((found.translation.x, found.translation.y), (x, y))
            assert_allclose(2 * np.arctan2(found.rotation.z, found.rotation.w), heading)
    [(_, _, robots)] = topics["/robots"]
    sizes = [(entity.cubes[0].size.x, entity.cubes[0].size.y) for entity in robots.entities]
    assert_allclose(sizes, [(m.length, m.width) for m in RECORDING.models])
    assert all(entity.frame_locked for entity in robots.entities)
    for entity, model in zip(robots.entities, RECORDING.models, strict=True):
        [front] = entity.arrows
        assert_allclose(front.pose.position.x + front.shaft_length + front.head_length, model.length / 2)
    [(_, _, world)] = topics["/world"]
    for entity, lines in zip(world.entities, (WORLD.lines, RECORDING.leader_paths), strict=True):
        corners = [[(p.x, p.y) for p in line.points] for line in entity.lines]
        for mine, read in zip(lines, corners, strict=True):
            assert_allclose(mine, read)
    for k, (_, raw, decoded) in enumerate(topics["/robot_2/points"]):
        xyz = np.frombuffer(decoded.data, "<f4").reshape(-1, 3)
        assert_array_equal(xyz[:, :2], RECORDING.new_points(k, 1))
        stamp = decoded.timestamp.seconds + 1e-9 * decoded.timestamp.nanos
        assert stamp == pytest.approx(max(RECORDING.stamps[k, 1], 0))
        assert raw.log_time == round(1e9 * RECORDING.times[k])
    told = [decoded for _, _, decoded in topics["/robot_1/motion"]]
    assert told[10]["commanded_speed"] == 0.7
    assert "commanded_speed" not in told[-1]
    assert_allclose([row["speed"] for row in told], RECORDING.twists[:, 0, 0])
    assert [decoded.message for _, _, decoded in topics["/events"]] == [
        event.text(RECORDING.roles) for event in RECORDING.events
    ]
    assert [entity.texts[0].text for entity in robots.entities] == ["R1", "R2"]


def test_the_end_of_a_state_is_no_warning(tmp_path):
    kinds = [EventKind.CATCH_UP, EventKind.CAUGHT_UP, EventKind.STOP, EventKind.GO_ON, EventKind.COLLISION]
    events = tuple(RobotEvent(0.1 * k, 0, (0.0, 0.0), kind) for k, kind in enumerate(kinds))
    path = save_recording(dataclasses.replace(record(1, 0.5), events=events), tmp_path / "run.mcap")
    with path.open("rb") as file:
        told = make_reader(file, decoder_factories=[DecoderFactory()]).iter_decoded_messages(topics=["/events"])
        levels = [message.level for _, _, _, message in told]
    warning, info = int(LogLevel.Warning), int(LogLevel.Info)
    assert levels == [warning, info, warning, info, warning]


def test_the_layout_asks_for_what_is_recorded(tmp_path, monkeypatch):
    monkeypatch.setattr(sys.modules[__name__], "DecoderFactory", PlainJson)
    led = dataclasses.replace(RECORDING, leaders=np.zeros_like(RECORDING.poses))
    topics = read_mcap(save_recording(led, tmp_path / "run.mcap"))
    layout = json.loads((Path(__file__).parents[1] / "examples" / "foxglove.json").read_text())
    asked = 0
    for name, panel in layout["configById"].items():
        assert f'"{name}"' in json.dumps(layout["layout"])
        if name.startswith("3D"):
            assert panel["followTf"] == topics["/tf"][0][2].transforms[0].parent_frame_id
            assert set(panel["topics"]) == {"/world", "/robots", "/robot_1/points", "/robot_2/points"} <= set(topics)
        for path in panel.get("paths", []):
            topic, field = path["value"].split(".")
            assert any(field in decoded for _, _, decoded in topics[topic]), path
            asked += 1
        assert panel.get("topicToRender", "/events") in topics
    assert asked == 8


def test_without_foxglove_the_error_says_how_to_get_it(tmp_path, monkeypatch):
    monkeypatch.setitem(sys.modules, "foxglove", None)
    with pytest.raises(DependencyError, match=r"pip install 'mp2a\[record\]'"):
        save_recording(RECORDING, tmp_path / "run.mcap")


@settings(max_examples=100)
@given(st.integers(0, 10**6), st.integers(0, 255), st.integers(1, 40))
def test_broken_files_are_refused_or_read(tmp_path, place, byte, many):
    path = tmp_path / "broken.npz"
    whole = bytearray(record_bytes(tmp_path))
    place %= len(whole)
    whole[place : place + many] = bytes([byte]) * many
    path.write_bytes(whole)
    try:
        load_recording(path)
    except InputError as error:
        assert "cannot be read as a recording" in str(error)
        assert "pickle" not in str(error)


def record_bytes(tmp_path, _kept=[]):  # noqa: B006 (once for all examples)
    if not _kept:
        _kept.append(save_recording(record(1, 0.3), tmp_path / "whole.npz").read_bytes())
    return _kept[0]


def test_wrong_input_is_named(tmp_path):
    for content in (b"", b"PK\x03\x04", b"no"):
        (tmp_path / "a.npz").write_bytes(content)
        with pytest.raises(InputError, match="cannot be read as a recording"):
            load_recording(tmp_path / "a.npz")
    np.savez(tmp_path / "b.npz", format=1)
    with pytest.raises(InputError, match=r"b\.npz: .* it holds format, … and no about, expected one of mp2a"):
        load_recording(tmp_path / "b.npz")
    with pytest.raises(InputError, match=r"path: got 'x\.bag', expected a name that ends in"):
        save_recording(RECORDING, tmp_path / "x.bag")
    with pytest.raises(InputError, match="recording: got no tick"):
        RunRecorder(Simulation(WORLD, HUSKY, [[0, 0, 0]])).recording()
    short = dataclasses.replace(RECORDING, times=RECORDING.times[:1], poses=RECORDING.poses[:1])
    for draw in (march_figure, speeds_figure, lambda recording: plot.save_animation(recording, tmp_path / "a.gif")):
        with pytest.raises(InputError, match="recording: got 1 times, expected at least two"):
            draw(short)
    with pytest.raises(InputError, match=r"path: got 'a\.bmp', expected"):
        plot.save_animation(RECORDING, tmp_path / "a.bmp")
    with pytest.raises(InputError, match=r"path: got 'a\.bmp', expected"):
        plot.save_figure(march_figure(RECORDING), tmp_path / "a.bmp")


@pytest.mark.parametrize(
    ("name", "content", "kind"),
    [
        ("run.mcap", None, "an MCAP file"),
        ("text.npz", b"hello", "a text"),
        ("data.npz", b'{"format": 1}', "a text, perhaps JSON"),
        ("picture.npz", b"\x89PNG\r\n\x1a\n", "a PNG picture"),
        ("data.npz", pickle.dumps([1]), "a Python pickle"),
        ("noise.npz", b"\x07\xff\x00" * 99, "of an unknown binary kind"),
        ("empty.npz", b"", "empty"),
        ("bag.db3", b"SQLite format 3\x00", "an SQLite database, as rosbag2 writes"),
    ],
)
@pytest.mark.parametrize("picture", ["march", "speeds", "animation"])
def test_a_file_of_another_kind_is_called_by_its_name(tmp_path, capsys, picture, name, content, kind):
    path = tmp_path / name
    if content is None:
        save_recording(RECORDING, path)
    else:
        path.write_bytes(content)
    assert main(["plot", picture, str(path)]) == 2
    said = capsys.readouterr().err
    assert f"{path}: cannot be read as a recording: it is {kind}, expected one of mp2a march (.npz" in said
    assert "pickle=" not in said and "unpickle" not in said


@pytest.mark.parametrize("arguments", [["check"], ["check", "SCENARIO", "--world"], ["march", "--world"], ["march"]])
@pytest.mark.parametrize(("ending", "kind"), [("npz", "a zip archive, as numpy's .npz are"), ("mcap", "an MCAP file")])
def test_a_recording_where_something_else_is_meant_is_called_by_its_name(tmp_path, capsys, arguments, ending, kind):
    path = save_recording(RECORDING, tmp_path / f"run.{ending}")
    scenario = str(Path(__file__).parents[1] / "examples" / "scenarios" / "listing_7_1.txt")
    options = [scenario if word == "SCENARIO" else word for word in arguments]
    assert main([*options, str(path)]) == 2
    assert f"{path}: cannot be read as" in (said := capsys.readouterr().err)
    assert f"it is {kind}, expected" in said


@pytest.mark.parametrize("many", [False, True])
def test_objects_within_an_array_file_are_neither_loaded_nor_is_that_advised(tmp_path, many):
    path = tmp_path / "x.npz"
    if many:
        whole = dict(np.load(save_recording(RECORDING, path)))
        np.savez(path, **(whole | {"times": np.array([{}, []], dtype=object)}))
    else:
        with path.open("wb") as file:
            np.save(file, np.array([{}], dtype=object))
    with pytest.raises(InputError, match="cannot be read as a recording") as caught:
        load_recording(path)
    assert "pickle" not in str(caught.value)


def test_a_recording_of_another_format_says_so(tmp_path):
    path = save_recording(RECORDING, tmp_path / "x.npz")
    np.savez(path, **(dict(np.load(path)) | {"format": 2}))
    with pytest.raises(InputError, match=r"format 2, expected 4"):
        load_recording(path)


@pytest.mark.parametrize("ending", ["npz", "mcap"])
def test_saving_is_whole_or_not_at_all(tmp_path, monkeypatch, ending):
    path = tmp_path / f"run.{ending}"
    path.write_bytes(b"the old one")

    def full(self, content):
        with self.open("wb") as file:
            file.write(content[:99])
        raise OSError(errno.ENOSPC, os.strerror(errno.ENOSPC))

    with monkeypatch.context() as patch, pytest.raises(OutputError, match=rf"run\.{ending}: .*No space left"):
        patch.setattr(Path, "write_bytes", full)
        save_recording(RECORDING, path)
    assert path.read_bytes() == b"the old one"
    assert [file.name for file in tmp_path.iterdir()] == [path.name]
    save_recording(RECORDING, path)
    assert len(path.read_bytes()) > 1000


def test_saving_that_is_killed_leaves_the_old_file(tmp_path):
    path = tmp_path / "run.npz"
    path.write_bytes(b"the old one")
    code = (
        "import os, signal, sys, pathlib, numpy as np\n"
        "from mp2a.simulator import RunRecorder, Simulation, World, save_recording, simulate\n"
        "from mp2a.formation.robot_models import HUSKY\n"
        "simulation = Simulation(World(), HUSKY, [[0, 0, 0]]); recorder = RunRecorder(simulation)\n"
        "simulate(simulation, lambda sensed: [[0.5, 0]], 1, recorder)\n"
        "def killed(self, content):\n"
        "    self.open('wb').write(content[:99])\n"
        "    os.kill(os.getpid(), signal.SIGKILL)\n"
        "pathlib.Path.write_bytes = killed\n"
        "save_recording(recorder.recording(), sys.argv[1])\n"
    )
    done = subprocess.run([sys.executable, "-c", code, str(path)], check=False, timeout=120)
    assert done.returncode == -9
    assert path.read_bytes() == b"the old one"


def test_a_device_stays_a_device(tmp_path):
    for ending in ("npz", "mcap"):
        link = tmp_path / f"nowhere.{ending}"
        link.symlink_to("/dev/null")
        save_recording(RECORDING, link)
        assert link.is_symlink()
        assert Path("/dev/null").is_char_device()


# Pictures


@pytest.mark.parametrize("n", [1, 2, 20])
def test_pictures_show_the_recording(n):
    recording = record(n, 1.0, points=False)
    [axes] = march_figure(recording).axes
    drawn = {line.get_gid(): line for line in axes.lines}
    for i in range(n):
        assert_array_equal(np.transpose(drawn[f"path {i + 1}"].get_data()), recording.poses[:, i, :2])
    assert axes.get_aspect() == 1
    panels = speeds_figure(recording).axes
    assert len(panels) == (2 if n == 1 else 3)
    drawn = {line.get_gid(): line for panel in panels for line in panel.lines}
    for i in range(n):
        assert_array_equal(drawn[f"speed {i + 1}"].get_ydata(), recording.commands[:, i, 0])
        assert_array_equal(drawn[f"turn rate {i + 1}"].get_ydata(), recording.commands[:, i, 1])
    for i in range(n - 1):
        apart = recording.poses[:, i + 1, :2] - recording.poses[:, i, :2]
        assert_allclose(drawn[f"distance {i + 1} {i + 2}"].get_ydata(), np.hypot(*apart.T))


@given(st.floats(0.2, 900))
def test_animation_runs_to_the_end_in_no_more_than_its_time(seconds):
    times = np.append(np.arange(0, seconds, 0.1), seconds)
    ticks, faster = frame_ticks(times)
    assert ticks[0] == 0 and ticks[-1] == len(times) - 1
    assert (np.diff(ticks[:-1]) > 0).all() and len(ticks) <= 202
    assert faster == 1 or seconds > 20


def test_command_line_draws_recordings(tmp_path, capsys):
    file = save_recording(record(3, 1.0), tmp_path / "run.npz")
    for picture, ending in (("march", "png"), ("speeds", "png"), ("animation", "gif")):
        assert main(["plot", picture, str(file)]) == 0
        out = tmp_path / f"run-{picture}.{ending}"
        assert capsys.readouterr().out.strip() == str(out)
        with Image.open(out) as drawn:
            assert min(drawn.size) > 300
            assert getattr(drawn, "n_frames", 1) == (11 if ending == "gif" else 1)
    assert main(["plot", "march", str(tmp_path / "none.npz")]) == 2
    assert "none.npz: cannot be read as a recording: it is not there" in capsys.readouterr().err


def test_pictures_and_simulator_leave_pyplot_and_foxglove_alone():
    code = "import sys, mp2a.plot, mp2a.simulator; assert not {'matplotlib.pyplot', 'foxglove'} & set(sys.modules)"
    subprocess.run([sys.executable, "-c", code], check=True, timeout=120)
