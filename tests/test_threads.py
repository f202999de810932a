"""Working alone or sharing: what has been quicker of late, for very little spent on trying the other."""

import numpy as np
from hypothesis import given
from hypothesis import strategies as st

import mp2a
from mp2a import Model, cores
from mp2a.kernels.thread_choice import CHOICES, ThreadChoice

times = st.floats(1e-5, 1e-2)


def work(choice, jobs, alone, shared):
    """Seconds in all, and how many jobs were shared, of a machine on which jobs take so long."""
    total, count = 0.0, 0
    for _ in range(jobs):
        is_shared = choice.is_shared()
        seconds = shared if is_shared else alone
        choice.note(is_shared, seconds)
        total, count = total + seconds, count + is_shared
    return total, count


@given(alone=times, shared=times)
def test_what_is_slower_costs_little(alone, shared):
    """Beside a few tries of each way a few hundredths, and a sixth where the two take nearly as long."""
    jobs = 500
    total, _ = work(ThreadChoice(), jobs, alone, shared)
    best = min(alone, shared)
    most = 1.03 * (alone if 0.85 * alone <= shared else best)
    assert total <= jobs * most + 4 * (alone + shared)


@given(alone=times)
def test_sharing_has_to_be_clearly_quicker(alone):
    _, count = work(ThreadChoice(), 1000, alone, 0.95 * alone)
    assert count < 30
    _, count = work(ThreadChoice(), 1000, alone, 0.6 * alone)
    assert count > 950


@given(alone=times)
def test_choice_follows_the_machine(alone):
    """Another program comes, and goes again."""
    choice = ThreadChoice()
    work(choice, 1000, alone, 0.6 * alone)
    assert choice.is_shared()
    total, _ = work(choice, 1000, alone, 2 * alone)
    assert total < 1.05 * 1000 * alone
    _, count = work(choice, 2000, alone, 0.6 * alone)
    assert count > 1000


@given(alone=times)
def test_one_hold_up_does_not_count(alone):
    choice = ThreadChoice()
    work(choice, 100, alone, 0.6 * alone)
    choice.note(True, 100 * alone)
    assert work(choice, 100, alone, 0.6 * alone)[1] >= 97


@given(alone=times, way=st.booleans(), job=st.integers(0, 2))
def test_one_hold_up_in_the_beginning_does_not_count(alone, way, job):
    choice, count = ThreadChoice(), {False: 0, True: 0}
    for _ in range(6):
        shared = choice.is_shared()
        held_up = shared is way and count[way] == job
        choice.note(shared, (100 if held_up else 1) * (0.6 if shared else 1.0) * alone)
        count[shared] += 1
    assert count == {False: 3, True: 3}
    assert choice.is_shared()


def test_rnea_notes_how_long_jobs_take(monkeypatch):
    monkeypatch.setattr(cores, "threads_per_rank", lambda: 2)
    model = Model.random(8)
    state = model.random_state(2000)
    results = [mp2a.rnea(model, *state) for _ in range(20)]
    assert all(np.array_equal(result, results[0]) for result in results)
    choice = CHOICES.get(model, "rnea_double", (8 * 2000).bit_length())
    assert all(len(seconds) > 0 for seconds in choice._seconds.values())
