"""What one core of this machine can do at most, measured: vector arithmetic, and memory of several sizes.

The kernels are written in LLVM's language, as those of the library are, so that nothing but the processor decides how
fast they are.
"""

import ctypes
import time
from collections.abc import Callable
from functools import partial
from typing import Any, NamedTuple

import llvmlite.binding as llvm
import numpy as np

from mp2a.kernels.symbols import LANES

CHAINS = 16
"""Sums that do not wait for each other; a processor needs latency times units of them."""

_TURNS = 7


class Peaks(NamedTuple):
    """What was measured."""

    products: float
    """Vectors of doubles multiplied, or multiplied and added, a second; each a vector of `LANES` doubles."""
    sums: float
    """Vectors added a second, when nothing is multiplied."""
    both: float
    """Vectors a second when every other one is added and the rest multiplied and added: more where processors have
    units for sums alone."""
    wait: float
    """Seconds until the result of a product with a sum can go into the next."""


class Native:
    """Functions compiled from LLVM's language for this processor; they live as long as this does."""

    def __init__(self, text: str) -> None:
        llvm.initialize_native_target()
        llvm.initialize_native_asmprinter()
        machine = llvm.Target.from_default_triple().create_target_machine(
            cpu=llvm.get_host_cpu_name(), features=llvm.get_host_cpu_features().flatten(), opt=3
        )
        module = llvm.parse_assembly(text)
        module.verify()
        self.assembly: str = machine.emit_assembly(module)
        self._engine = llvm.create_mcjit_compiler(module, machine)
        self._engine.finalize_object()

    def function(self, name: str, *kinds: Any) -> Callable[..., None]:
        """Return a function that returns nothing."""
        return ctypes.CFUNCTYPE(None, *kinds)(self._engine.get_function_address(name))


def measure() -> Peaks:
    """Measure arithmetic; takes a second."""
    fma = f"call {_VECTOR} @llvm.fma.v{LANES}f64({_VECTOR} %x{{k}}, {_VECTOR} %c, {_VECTOR} %d)"
    add = f"fadd {_VECTOR} %x{{k}}, %d"
    kernels = {"products": (fma, fma), "sums": (add, add), "both": (fma, add)}
    native = Native(_DECLARED + "".join(_loop(name, *pair) for name, pair in kernels.items()))
    count, numbers = 1_000_000, np.zeros(CHAINS * LANES)
    found = {}
    for name in kernels:
        run = native.function(name, ctypes.c_int64, ctypes.c_void_p)
        found[name] = CHAINS * count / _fastest(partial(run, count, numbers.ctypes.data))
    single = Native(_DECLARED + _loop("one", fma, chains=1))
    one = single.function("one", ctypes.c_int64, ctypes.c_void_p)
    return Peaks(**found, wait=_fastest(partial(one, count, numbers.ctypes.data)) / count)


def streams(numbers: int, outputs: int, inputs: int = 3) -> float:
    """Measure bytes a second when arrays of so many doubles are read, and others written, all at once.

    The bytes counted are those that are read and written; that lines are read before they are written is the
    memory's own affair.
    """
    native = Native(_stream(inputs, outputs))
    run = native.function("stream", ctypes.c_int64, ctypes.c_int64, *[ctypes.c_void_p] * (inputs + outputs))
    arrays = [np.ones(max(numbers // LANES, 1) * LANES) for _ in range(inputs + outputs)]
    count = len(arrays[0]) // LANES
    times = max(1, 4_000_000 // (count * LANES * len(arrays)))
    work = partial(run, times, count, *(array.ctypes.data for array in arrays))
    return times * sum(array.nbytes for array in arrays) / _fastest(work)


def new_memory(numbers: int) -> float:
    """Measure bytes a second when so many doubles are written to memory that was asked for anew."""

    def work() -> None:
        np.empty(numbers).fill(1.0)

    return 8 * numbers / _fastest(work)


def _fastest(work: Callable[[], None]) -> float:
    """Least time of several turns: a peak is what there is when nothing disturbs."""
    work()
    found = []
    for _ in range(_TURNS):
        start = time.perf_counter()
        work()
        found.append(time.perf_counter() - start)
    return min(found)


_VECTOR = f"<{LANES} x double>"
_DECLARED = f"declare {_VECTOR} @llvm.fma.v{LANES}f64({_VECTOR}, {_VECTOR}, {_VECTOR})\n"


def _loop(name: str, *operations: str, chains: int = CHAINS) -> str:
    """Write a loop in which vectors go through operations, each through one."""
    starts = "\n".join(
        f"%p{k} = getelementptr {_VECTOR}, ptr %at, i64 {k}\n%s{k} = load {_VECTOR}, ptr %p{k}, align 8"
        for k in range(chains)
    )
    phis = "\n".join(f"%x{k} = phi {_VECTOR} [ %s{k}, %entry ], [ %y{k}, %loop ]" for k in range(chains))
    work = "\n".join(f"%y{k} = {operations[k % len(operations)].format(k=k)}" for k in range(chains))
    ends = "\n".join(f"store {_VECTOR} %y{k}, ptr %p{k}, align 8" for k in range(chains))
    return f"""
        define void @{name}(i64 %count, ptr %at) {{
        entry:
            {starts}
            %c = load {_VECTOR}, ptr %at, align 8
            %d = load {_VECTOR}, ptr %at, align 8
            br label %loop
        loop:
            %i = phi i64 [ 0, %entry ], [ %j, %loop ]
            {phis}
            {work}
            %j = add i64 %i, 1
            %more = icmp slt i64 %j, %count
            br i1 %more, label %loop, label %end
        end:
            {ends}
            ret void
        }}"""


def _stream(inputs: int, outputs: int) -> str:
    """Write a loop that adds up arrays and puts the sum into others."""
    arguments = ", ".join(f"ptr noalias %a{k}" for k in range(inputs + outputs))
    reads = "\n".join(
        f"%p{k} = getelementptr {_VECTOR}, ptr %a{k}, i64 %i\n%v{k} = load {_VECTOR}, ptr %p{k}, align 8"
        for k in range(inputs)
    )
    sums, total = [], "%v0"
    for k in range(1, inputs):
        sums.append(f"%t{k} = fadd {_VECTOR} {total}, %v{k}")
        total = f"%t{k}"
    writes = "\n".join(
        f"%p{k} = getelementptr {_VECTOR}, ptr %a{k}, i64 %i\nstore {_VECTOR} {total}, ptr %p{k}, align 8"
        for k in range(inputs, inputs + outputs)
    )
    body = "\n".join([reads, *sums, writes])
    return f"""
        define void @stream(i64 %times, i64 %count, {arguments}) {{
        entry:
            br label %pass
        pass:
            %t = phi i64 [ 0, %entry ], [ %u, %passed ]
            br label %loop
        loop:
            %i = phi i64 [ 0, %pass ], [ %j, %loop ]
            {body}
            %j = add i64 %i, 1
            %more = icmp slt i64 %j, %count
            br i1 %more, label %loop, label %passed
        passed:
            %u = add i64 %t, 1
            %again = icmp slt i64 %u, %times
            br i1 %again, label %pass, label %end
        end:
            ret void
        }}"""
