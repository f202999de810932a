"""The march: followers retrace, robots make way and come back, what goes wrong has an answer."""

import doctest

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

import mp2a.formation.controller
from mp2a import InputError, placements, rnea
from mp2a.formation import (
    SHAPES,
    Discs,
    Formation,
    FormationController,
    Limits,
    LocalExchange,
    SensedPoints,
    Setpoints,
    Springs,
    pack,
    spline,
    waypoints,
)
from mp2a.formation.exchange import scan_formation
from mp2a.formation.springs import energy, joint, none
from mp2a.methods import METHODS
from mp2a.se2 import PlanarMotion, wrap

BEND = waypoints([[0, 0], [8, 0], [8, 8], [16, 12]], 2.0, Limits(1.0, 0.5, 0.5))
WAVE = spline([[0, 0], [6, 2], [12, -2], [18, 0]], Limits(1.0, 0.5, 0.5))
STRAIGHT = waypoints([[0, 0], [30, 0]])
DISC = Discs([[10, 0.0, 0.5]])


def run(march, ticks, world=None, change=lambda tick, sensed: sensed):
    """Poses ``(ticks, n, 3)``, twists ``(ticks, n, 2)`` and reports."""
    poses, twists, reports = [], [], []
    for tick in range(ticks):
        sensed = (world or Discs()).sense(march.state.pose)
        setpoints = march.step(change(tick, sensed))
        poses.append(setpoints.pose)
        twists.append(setpoints.twist)
        reports.append(march.report)
    return np.array(poses), np.array(twists), reports


def places(poses):
    return poses[..., 0] + 1j * poses[..., 1]


def track_of(path, before):
    """Places closely along a path, and the straight way of some length up to it, on which robots stand at the start."""
    motions = np.array([path.at(time).pose for time in np.linspace(0, path.duration, 4000)])
    start = places(motions[:1]) - before * np.exp(1j * motions[0, 2])
    return np.append(start, places(motions))


def distance_from(track, points):
    """Of points from a polyline, m."""
    start, way = track[:-1], np.diff(track)
    keep = np.abs(way) > 1e-9
    start, way = start[keep], way[keep]
    share = np.clip(((points[:, None] - start) / way).real, 0, 1)
    return np.abs(points[:, None] - start - share * way).min(1)


@pytest.mark.parametrize("path", [BEND, WAVE], ids=["bend", "wave"])
def test_followers_retrace_the_leaders_path_at_their_spacing(path):
    march = FormationController(Formation.of("line", 8), path)
    poses, twists, _ = run(march, int(10 * path.duration) + 40)
    track = track_of(path, 20)
    for i in range(8):
        # Chords of the fine track and the cubics of seven queues.
        assert distance_from(track, places(poses[:, i])).max() < (1e-4 if path is BEND else 5e-6)
    # A robot does what its predecessor did a spacing and a tick ago: at speed v the spacing is 2 m + v · tick.
    assert np.allclose(twists[8:, 1:, 0], twists[7:-1, :-1, 0], atol=2e-3)
    assert twists[..., 0].min() > -1e-12
    # When the leader has stopped all stop, a spacing apart along the path.
    assert np.allclose(twists[-1], 0, atol=1e-9)
    arcs = np.append(0, np.cumsum(np.abs(np.diff(track))))
    along = [arcs[np.abs(track - place).argmin()] for place in places(poses[-1])]
    assert np.allclose(-np.diff(along), 2.0, atol=2e-2)


def test_a_long_line_keeps_to_the_path():
    march = FormationController(Formation.of("line", 100, spacing=1.0), WAVE)
    poses, _, _ = run(march, 400)
    track = track_of(WAVE, 100)
    assert (np.abs(wrap(poses[-1, :, 2] - poses[0, :, 2])) > 1e-3).sum() > 10  # so many have gone into the wave
    assert max(distance_from(track, places(poses[::10, i])).max() for i in range(0, 100, 5)) < 1e-3


def test_setpoints_are_consistent_in_time():
    march = FormationController(Formation.of("line", 5), WAVE)
    poses, twists, reports = run(march, 250)
    z = places(poses)
    velocity = (z[2:] - z[:-2]) / 0.2 * np.exp(-1j * poses[1:-1, :, 2])
    assert np.abs(velocity - twists[1:-1, :, 0])[3:].max() < 5e-2
    turning = wrap(poses[2:, :, 2] - poses[:-2, :, 2]) / 0.2
    assert np.abs(turning - twists[1:-1, :, 1]).max() < 5e-2
    rates = np.array([report.scan.motion.rate for report in reports])
    change = (twists[2:, :, 0] - twists[:-2, :, 0]) / 0.2
    assert np.median(np.abs(change - rates[1:-1, :, 0])) < 1e-2


@pytest.mark.parametrize("shape", [shape for shape in SHAPES if shape != "line"])
def test_rigid_shapes_keep_their_shape(shape):
    formation = Formation.of(shape, 3 if shape == "box" else 6)
    march = FormationController(formation, BEND)
    poses, _, reports = run(march, 150)
    for tick in (0, 50, 100, 149):
        assert np.allclose(poses[tick], formation.layout.poses(poses[tick, 0]), atol=1e-9)
    # One body: all turn alike, and none is closer to another than at the start.
    turning = np.array([report.scan.motion.velocity[:, 2] for report in reports])
    assert np.allclose(turning, turning[:, :1])


@pytest.mark.parametrize("shape", ["line", "column", "triangle"])
def test_force_and_motion_are_those_of_the_recurrences(shape):
    """The scan is inverse dynamics of the chain: with its joints put into `rnea`, the same F."""
    formation = Formation.of(shape, 6, mass=40.0 + np.arange(6))
    march = FormationController(formation, BEND, LocalExchange(formation.model, "compact"))
    seen = []
    run_scan = march.exchange.run

    def listen(joints, external):
        seen.append((PlanarMotion(*(x[0] for x in joints)), external[0]))
        return run_scan(joints, external)

    march.exchange.run = listen
    _, _, reports = run(march, 120, Discs([[4, 0.2, 0.4]]))
    tick = int(np.argmax([np.abs(external).max() for _, external in seen]))
    joints, external = seen[tick]
    report = reports[tick]
    forces = np.zeros((6, 6))
    forces[:, 3:5], forces[:, 2] = external[:, :2], external[:, 2]
    assert np.abs(forces).max() > 1
    done = rnea(
        formation.model,
        joints.coordinates().ravel(),
        joints.velocity.ravel(),
        joints.rate.ravel(),
        forces,
        bodies=True,
    )
    assert np.allclose(report.scan.force, done.force[:, [3, 4, 2]], atol=1e-6)
    still = rnea(formation.model, joints.coordinates().ravel(), *np.zeros((2, 18)), forces, bodies=True)
    assert np.allclose(report.scan.obstacles, -still.force[:, [3, 4, 2]], atol=1e-9)
    # What obstacles press with adds up towards the leader.
    headings = report.scan.motion.pose[:, 2]
    total = (places(external) * np.exp(1j * headings)).sum() * np.exp(-1j * headings[0])
    assert np.allclose(complex(*report.scan.obstacles[0, :2]), total)


def test_the_load_of_a_joint_is_the_work_that_its_displacement_makes_the_obstacles_do():
    """Virtual work: forces that keep their direction, and the derivative of their work by every displacement."""
    rng = np.random.default_rng(4)
    formation = Formation.of("triangle", 6)
    exchange = LocalExchange(formation.model)
    forces, displaced = rng.normal(size=6) + 1j * rng.normal(size=6), rng.normal(scale=0.3, size=(6, 3))

    def displaced_scan(displacement):
        bend = joint(none(6)._replace(value=displacement))
        joints = PlanarMotion.at_rest(formation.layout.slots).compose(bend)
        pose = placements(formation.model, joints.coordinates().ravel())
        heading = np.arctan2(pose[0][:, 1, 0], pose[0][:, 0, 0])
        own = forces * np.exp(-1j * heading)
        external = np.stack((own.real, own.imag, np.zeros(6)), axis=-1)
        return scan_formation(exchange.run, joints, external)

    def work(displacement):
        return (np.conj(forces) * places(displaced_scan(displacement).motion.pose)).real.sum()

    load = displaced_scan(displaced).obstacles
    turned = places(load) * np.exp(1j * displaced[:, 2])
    step = 1e-5
    for i in range(6):
        for k, wanted in enumerate((turned[i].real, turned[i].imag, load[i, 2])):
            change = np.zeros((6, 3))
            change[i, k] = step
            got = (work(displaced + change) - work(displaced - change)) / (2 * step)
            assert got == pytest.approx(wanted, abs=1e-6)


@pytest.mark.parametrize("method", METHODS)
@pytest.mark.parametrize("shape", ["line", "column"])
def test_every_method_gives_the_same_march(shape, method):
    formation = Formation.of(shape, 5)
    world = Discs([[4, 0.1, 0.4]])
    expected, *_ = run(FormationController(formation, BEND, LocalExchange(formation.model, "serial")), 100, world)
    got, *_ = run(FormationController(formation, BEND, LocalExchange(formation.model, method)), 100, world)
    assert np.allclose(got, expected, atol=1e-9)
    assert np.abs(expected[..., 1]).max() > 0.1


def test_robots_make_way_and_come_back():
    march = FormationController(Formation.of("line", 8), STRAIGHT)
    poses, _, _ = run(march, 700, DISC)
    clear = DISC.clearance(poses).min(0)
    assert (clear > march.law.radius).all()
    assert (np.diff(clear) > -1e-3).all()  # nobody comes closer than the one in front
    assert np.abs(poses[..., 1]).max() < 3
    # All have passed, or stand before it; those that have are on the path again.
    past = poses[-1, :, 0] > 19
    assert past.sum() >= 5
    assert np.abs(poses[-1, past, 1]).max() < 2e-2


def test_those_behind_take_the_path_that_one_in_the_middle_changed():
    """Only robot 3 senses the disc, and those behind it go round as well; those in front do not."""

    def only_third(tick, sensed):
        keep = sensed.robot == 2
        return SensedPoints(sensed.points[keep], sensed.robot[keep], sensed.heard)

    march = FormationController(Formation.of("line", 6), STRAIGHT)
    poses, _, _ = run(march, 600, DISC, only_third)
    aside = np.abs(poses[..., 1]).max(0)
    assert aside[:2].max() < 1e-9
    assert aside[2] > 1.0
    assert np.allclose(aside[3:], aside[2], atol=1e-2)
    track = places(poses[:, 2])
    for i in (3, 4, 5):
        assert distance_from(np.append(-30, track), places(poses[:, i])).max() < 1e-2
    assert (DISC.clearance(poses[:, 2:]).min(0) > march.law.radius).all()


def test_a_rigid_shape_yields_as_a_whole_and_recovers():
    formation = Formation.of("column", 4)
    march = FormationController(formation, STRAIGHT)
    poses, _, reports = run(march, 700, Discs([[10, 0.2, 0.3]]))
    aside = np.abs(poses[..., 1]).max(0)
    assert aside[0] > 0.3
    assert (np.diff(aside) > 0).all()  # joints add up, outwards
    assert np.allclose(poses[-1], formation.layout.poses(poses[-1, 0]), atol=1e-2)
    assert max(np.abs(report.scan.obstacles[0]).max() for report in reports) > 10


@pytest.mark.parametrize("shape", ["line", "column", "triangle"])
def test_energy_that_obstacles_put_in_is_dissipated(shape):
    formation = Formation.of(shape, 5)
    march = FormationController(formation, waypoints([[0, 0], [12, 0]]))
    world = Discs([[5, 0.1, 0.4], [8, 1.0, 0.3]])
    levels, work = [0.0], []
    for tick in range(1400):
        march.step(world.sense(march.state.pose) if tick < 250 else None)
        levels.append(energy(march.springs, march.state.displacement).sum())
        work.append(march.report.work.sum())
    levels, work = np.array(levels), np.array(work)
    assert levels.max() > 1.0
    # At every tick the work of the obstacles is what is stored and something more, which the dampers have taken.
    assert (work - np.diff(levels) > -1e-9).all()
    assert (np.diff(levels[251:]) <= 1e-12).all()
    assert levels[-1] < 1e-9 * levels.max()


def test_a_leader_without_a_path_stands_and_so_do_all():
    march = FormationController(Formation.of("line", 4))
    poses, twists, _ = run(march, 20)
    assert (poses == poses[0]).all()
    assert (twists == 0).all()
    # It gets one that begins somewhere else, a while later: it starts from where it stands, and comes to the path.
    march.lead(waypoints([[0.5, 0.2], [5, 0.2]]))
    poses, twists, _ = run(march, 300)
    assert np.abs(poses[0] - march.formation.layout.poses(np.zeros(3))).max() < 1e-9
    assert np.abs(np.diff(poses[:, 0, :2], axis=0)).max() < 0.15
    assert np.allclose(poses[-1, 0], [5, 0.2, 0], atol=1e-6)
    assert (twists[-1] < 1e-6).all()


def test_a_leader_without_a_path_stands_where_it_is_put():
    start = np.array([[3.0, 4.0, 1.0], [1.0, 4.0, 1.0]])
    for shape in ("line", "row"):
        poses, _, _ = run(FormationController(Formation.of(shape, 2), start=start), 5)
        assert np.allclose(poses[:, 0], start[0])


def test_robots_in_one_place_wait_until_there_is_room():
    start = np.zeros((4, 3))
    march = FormationController(Formation.of("line", 4), STRAIGHT, start=start)
    poses, twists, _ = run(march, 600)
    assert np.isfinite(poses).all()
    for i in (1, 2, 3):
        moved = np.flatnonzero(twists[:, i, 0] > 0)[0]
        ahead = np.abs(places(poses[moved, i - 1]) - places(poses[moved, i]))
        assert ahead >= 2 - 1e-6
        assert np.abs(places(poses[:moved, i])).max() < 1e-15  # what the scan rounds
    assert np.allclose(poses[-1, :, 0], [30, 28, 26, 24])


def test_a_robot_far_behind_catches_up():
    start = Formation.of("line", 3).layout.poses(np.zeros(3))
    start[2, 0] -= 3
    march = FormationController(Formation.of("line", 3), STRAIGHT, start=start)
    poses, twists, _ = run(march, 600)
    assert poses[-1, 2, 0] == pytest.approx(poses[-1, 1, 0] - 2, abs=1e-6)
    assert twists[:, 2, 0].max() < STRAIGHT.profile.speed.max() + 0.3


def test_a_rigid_robot_out_of_place_comes_to_its_place():
    formation = Formation.of("triangle", 3)
    start = formation.layout.poses(np.zeros(3))
    start[1, :2] += [0.3, -0.4]
    march = FormationController(formation, None, start=start)
    poses, _, _ = run(march, 300)
    assert np.abs(poses[0, 1] - start[1]).max() < 1e-9
    assert np.allclose(poses[-1], formation.layout.poses(np.zeros(3)), atol=1e-4)


def test_a_leader_that_stops_stops_all_without_running_into_each_other():
    march = FormationController(
        Formation.of("line", 6, spacing=1.0), waypoints([[0, 0], [4, 0]], limits=Limits(1.0, 0.5, 5.0))
    )
    poses, twists, _ = run(march, 200)
    assert np.abs(np.diff(poses[..., 0], axis=1)).min() > 1 - 1e-9
    assert np.allclose(twists[-1], 0, atol=1e-9)


def test_an_obstacle_inside_a_robot_pushes_with_a_finite_force_and_is_reported():
    march = FormationController(Formation.of("line", 3))
    march.step(pack([[[0.0, 0.0]], [[0.1, 0.2]], [[1.0, 0.0]]]))
    assert march.report.contact.tolist() == [True, True, False]
    assert np.abs(march.report.push).max() <= march.law.force * (1 + 1e-9)
    poses, _, _ = run(march, 50, Discs([[0, 0, 0.2], [-2, 0.1, 0.3]]))
    assert np.isfinite(poses).all()
    assert poses[-1, 0, 1] > 0.5


def test_the_predecessor_is_no_obstacle():
    march = FormationController(Formation.of("line", 3))
    march.step(pack([[], [[1.4, 0.0]], [[1.4, 0.3]]]))
    assert (march.report.push == 0).all()
    march.step(pack([[], [[0.9, 0.1]], []]))
    assert march.report.push[1, 1] < 0


def test_a_silent_sensor_stops_its_robot_for_good_and_the_others_go_on():
    def silence(tick, sensed):
        heard = np.ones(5, dtype=bool)
        heard[2] = not 100 <= tick < 110
        heard[4] = not 100 <= tick < 103  # 0.3 s: not long enough
        return sensed._replace(heard=heard)

    formation = Formation.of("line", 5)
    march = FormationController(formation, STRAIGHT)
    failed, twists, poses = [], [], []
    for tick in range(600):
        setpoints = march.step(silence(tick, Discs().sense(march.state.pose)))
        failed.append(setpoints.failed)
        twists.append(setpoints.twist)
        poses.append(setpoints.pose)
    failed, twists, poses = np.array(failed), np.array(twists), np.array(poses)
    assert not failed[:103].any()
    assert failed[103:, 2].all()  # it last spoke at 9.9 s, and 10.3 s is the first tick more than 0.3 s later
    assert not failed[:, [0, 1, 3, 4]].any()
    assert (twists[103:, 2] == 0).all()
    assert (poses[103:, 2] == poses[102, 2]).all()
    expected, *_ = run(FormationController(formation, STRAIGHT), 600)
    others = [0, 1, 3, 4]
    assert np.allclose(poses[:, others], expected[:, others])


def test_a_short_silence_leaves_the_last_force_in_place():
    march = FormationController(Formation.of("line", 1))
    march.step(pack([[[1.0, 0.3]]]))
    before = march.report.push.copy()
    march.step(pack([None]))
    assert (march.report.push == before).all() and np.abs(before).max() > 0
    for _ in range(3):
        setpoints = march.step(pack([None]))
    assert setpoints.failed.all()
    assert (march.report.push == 0).all()


def test_a_march_goes_back_to_a_state_it_was_in():
    march = FormationController(Formation.of("line", 4), BEND)
    run(march, 50, DISC)
    kept = march.state
    first, *_ = run(march, 30, DISC)
    march.state = kept
    again, *_ = run(march, 30, DISC)
    assert (first == again).all()


def test_any_tick_gives_a_stable_march():
    for tick in (0.01, 0.5, 3.0):
        march = FormationController(
            Formation.of("line", 4), STRAIGHT, springs=Springs(stiffness=1e5, mass=1.0), tick=tick
        )
        poses, _, _ = run(march, 60, DISC)
        assert np.isfinite(poses).all()
        assert np.abs(poses[..., 1]).max() < 5


@pytest.mark.parametrize(
    ("make", "error"),
    [
        (lambda: FormationController(Formation.of("line", 2), tick=0), "tick: got 0"),
        (lambda: FormationController(Formation.of("line", 2), start=np.zeros((3, 3))), r"start: got shape \(3, 3\)"),
        (lambda: FormationController(Formation.of("line", 2)).step(pack([[]])), "heard: got shape"),
        (
            lambda: FormationController(Formation.of("line", 1)).step(SensedPoints(np.ones((1, 3)), [0], [True])),
            "points: got shape",
        ),
    ],
)
def test_bad_input_is_refused(make, error):
    with pytest.raises(InputError, match=error):
        make()


def test_a_setpoints_twist_is_what_a_velocity_command_holds():
    setpoints = Setpoints(np.zeros((1, 3)), np.array([0.4]), np.array([0.2]), np.zeros((1, 2)), np.zeros(1, dtype=bool))
    assert setpoints.twist.tolist() == [[0.4, 0.2]]


def test_the_example_of_the_docstring():
    assert doctest.testmod(mp2a.formation.controller).failed == 0


def test_every_public_name_is_there():
    for name in mp2a.formation.__all__:
        assert getattr(mp2a.formation, name) is not None
    assert len(set(mp2a.formation.__all__)) == len(mp2a.formation.__all__)
    with pytest.raises(AttributeError, match="no attribute 'nothing'"):
        mp2a.formation.nothing  # noqa: B018


coordinate = st.floats(-6, 6).map(lambda x: round(x, 1))


@settings(max_examples=15)
@given(
    st.sampled_from(sorted(set(SHAPES) - {"box"})),
    st.lists(st.tuples(coordinate, coordinate, st.floats(0, 3.1)), min_size=1, max_size=6),
    st.lists(st.tuples(coordinate, coordinate, st.floats(0, 1)), max_size=5),
    st.integers(0, 10_000),
    st.sampled_from([0.05, 0.1, 0.7]),
)
def test_any_start_and_any_obstacles_make_a_march(shape, start, discs, seed, tick):
    """Whatever is given: finite setpoints, bounded forces, energy that falls, and rest in the end."""
    rng = np.random.default_rng(seed)
    march = FormationController(Formation.of(shape, len(start)), waypoints([[0, 0], [3, 1]]), start=start, tick=tick)
    world = Discs(discs)
    for _ in range(60):
        sensed = world.sense(march.state.pose)
        setpoints = march.step(sensed._replace(heard=rng.random(len(start)) > 0.2))
        assert all(np.isfinite(part).all() for part in setpoints)
        assert np.isfinite(march.report.scan.force).all()
        assert (setpoints.twist[setpoints.failed] == 0).all()
        assert np.abs(march.report.push).max() < 10 * march.law.force
    levels = []
    for _ in range(400):
        setpoints = march.step()
        levels.append(energy(march.springs, march.state.displacement).sum())
    assert (np.diff(levels) <= 1e-9 * (1 + levels[0])).all()
    if tick >= 0.1:
        assert np.abs(setpoints.twist).max() < 0.25  # at most someone far behind is closing up still
