"""The paper's cost model and Amdahl's law (eq. 11-13, 15, Table I), with nothing measured in it."""

from typing import NamedTuple

import numpy as np
from numpy.typing import ArrayLike

from mp2a.algebra.affine import DOUBLES, MATRIX_AND_VECTOR, VECTOR
from mp2a.exceptions import InputError
from mp2a.schedule import rounds_needed
from mp2a.spatial import Array

RECURRENCES = 3
"""R_e of eq. 12: velocity, acceleration, force."""

PAPER_POINTS = {512: (0.152, 6.4)}
"""Seconds of MP²A and of O(n) that the paper states, by n, for 2000 samples (section IV-A)."""


class Messages(NamedTuple):
    """Messages of one recurrence for one sample."""

    vectors: int
    """D_v"""
    matrices: int
    """D_mv: matrix and vector together."""

    @property
    def total(self) -> int:
        """D_C."""
        return self.vectors + self.matrices


class Network(NamedTuple):
    """Constants of eq. 11 and 13."""

    serial_time: float
    """T_s, s: what the O(n) computation of all samples takes."""
    latency: float
    """L_a, s."""
    speed: float
    """N_TS, bit/s."""
    bits: float = 64.0
    """Bits a number takes on the wire. Eq. 13 prints 2; a double has 64."""


def true_messages(n: int) -> Messages:
    """Messages Kogge-Stone recursive doubling sends in one recurrence: n - 1 vectors in all.

    In round e, n - 2^e senders have not reached the end of the chain and send matrix and vector, and
    min(2^(e-1), n - 2^(e-1)) have and send the vector alone.
    """
    rounds = range(1, rounds_needed(n) + 1)
    return Messages(
        sum(min(2 ** (e - 1), n - 2 ** (e - 1)) for e in rounds),
        sum(max(0, n - 2**e) for e in rounds),
    )


def table_one_messages(n: int) -> Messages:
    """Messages as Table I of the paper prints them; fewer than are needed from n = 4 on.

    D_v = 2^(⌈log2 n⌉-1) - (2^⌈log2 n⌉ - n), D_mv = Σ 2^(i-1) for i = 1 … ⌈log2 n⌉-1.
    """
    rounds = rounds_needed(n)
    if rounds == 0:
        return Messages(0, 0)
    return Messages(2 ** (rounds - 1) - (2**rounds - n), 2 ** (rounds - 1) - 1)


COUNTS = {"true": true_messages, "table I": table_one_messages}
"""Both ways of counting, by name."""


def numbers_sent(n: int, messages: Messages) -> int:
    """D_T of eq. 12: numbers sent for one sample, all three recurrences, and n - 1 vectors more."""
    carried = DOUBLES[MATRIX_AND_VECTOR] * messages.matrices + DOUBLES[VECTOR] * messages.vectors
    return RECURRENCES * carried + DOUBLES[VECTOR] * (n - 1)


def parallel_time(n: int, messages: Messages, network: Network) -> float:
    """T_p of eq. 11 in s, with b_N the bits of D_T: ⌈log2 n⌉ T_s / n + L_a + b_N / N_TS."""
    sent = network.bits * numbers_sent(n, messages)
    return rounds_needed(n) * network.serial_time / n + network.latency + sent / network.speed


def total_time(n: int, samples: int, messages: Messages, network: Network) -> float:
    """T of eq. 13 in s for p_t samples; it adds up the latencies of all messages as if none overlapped."""
    per_sample = network.latency * RECURRENCES * messages.total + network.bits / network.speed * numbers_sent(
        n, messages
    )
    return rounds_needed(n) * network.serial_time / n + samples * per_sample


def pipeline_time(n: int, samples: int, network: Network) -> float:
    """Messages of the hop-by-hop pipeline in s: n - 1 hops of 12 numbers, then n - 1 of 6, none overlapping."""
    return samples * (n - 1) * (2 * network.latency + 18 * network.bits / network.speed)


def amdahl(n: ArrayLike, parallel_part: float) -> Array:
    """Speedup on n processors of a program of which a part is parallel: n / (f_s n + f_p) (eq. 15)."""
    count = np.asarray(n, dtype=float)
    out: Array = count / ((1 - parallel_part) * count + parallel_part)
    return out


def karp_flatt(speedup: ArrayLike, n: ArrayLike) -> Array:
    """Parallel part that Amdahl's law needs for a measured speedup on n > 1 processors (Karp and Flatt 1990)."""
    measured, count = np.asarray(speedup, dtype=float), np.asarray(n, dtype=float)
    if (count <= 1).any() or (measured <= 0).any():
        raise InputError(
            f"speedup, n: got {measured.tolist()} on {count.tolist()}, "
            "expected a positive speedup on more than one processor"
        )
    out: Array = 1 - (1 / measured - 1 / count) / (1 - 1 / count)
    return out
