"""Compiling the kernels for this processor; what the separate process does, which may import numba."""

from __future__ import annotations

import os
import tempfile
from collections.abc import Sequence
from concurrent.futures import ProcessPoolExecutor
from contextlib import suppress
from multiprocessing import get_context
from pathlib import Path
from typing import Any

from mp2a.cores import usable_cores
from mp2a.kernels.library import ARGUMENTS, CPU_FEATURES, ELEMENTWISE, RESULTS, checksum
from mp2a.kernels.linker import LinkError, shared_object


def make(folder: str, stem: str, names: Sequence[str]) -> None:
    """Compile kernels into a file of a folder.

    Several processes compile; LLVM puts what they have made into one module and that into one object.
    """
    with ProcessPoolExecutor(usable_cores(), mp_context=get_context("fork")) as processes:
        modules = list(processes.map(bitcode, names))
    content, suffix = machine_code(modules), "o"
    with suppress(LinkError):  # on another system or processor the object is what there is, and LLVM loads it
        content, suffix = shared_object(content), "so"
    with tempfile.TemporaryDirectory(dir=folder, prefix="building-") as workshop:
        whole = Path(workshop) / "kernels"
        whole.write_bytes(content)
        whole.replace(Path(folder) / f"{stem}-{checksum(content)}.{suffix}")


def bitcode(name: str) -> bytes:
    """Compile a kernel to LLVM's bitcode, with a function ``mp2a_<name>``."""
    return bytes(compile_kernel(name).as_bitcode())


def machine_code(modules: list[bytes]) -> bytes:
    """Make one object of modules for this processor."""
    import llvmlite.binding as llvm

    target = target_machine()
    first, *others = (llvm.parse_bitcode(module) for module in modules)
    for other in others:
        first.link_in(other)
    return bytes(target.emit_object(first))


def assembly(name: str) -> str:
    """Compile a kernel for this processor; what a person can read of it."""
    return str(target_machine().emit_assembly(compile_kernel(name)))


def compile_kernel(name: str) -> Any:
    """Compile a kernel to a module of LLVM, in which only ``mp2a_<name>`` is seen from outside."""
    return _compile_formula(name) if name in ELEMENTWISE else _compile_function(name)


def _compile_formula(name: str) -> Any:
    import llvmlite.binding as llvm

    from mp2a.kernels.elementwise import elementwise
    from mp2a.kernels.source import formula

    module = llvm.parse_assembly(elementwise(name, formula(name), ELEMENTWISE[name]))
    passes = llvm.create_pass_builder(target_machine(), llvm.create_pipeline_tuning_options(speed_level=2))
    passes.getModulePassManager().run(module, passes)
    return module


def _compile_function(name: str) -> Any:
    import llvmlite.binding as llvm
    import numba
    from numba import types

    from mp2a.kernels.source import KERNELS

    array = types.CPointer(types.CPointer(types.float64))
    kinds = [types.int64 if kind == "n" else array for kind in ARGUMENTS[name]]
    form = (types.int64 if name in RESULTS else types.void)(*kinds)
    options = {"no_cpython_wrapper": True, "no_cfunc_wrapper": True, "error_model": "numpy"}
    compiled = numba.njit(form, **options)(KERNELS[name])
    (result,) = compiled.overloads.values()
    module = llvm.parse_assembly(result.library.get_llvm_str() + _entry(name, result.fndesc.llvm_func_name))
    for value in (*module.functions, *module.global_variables):
        # Modules that several processes make use the same names.
        if not value.is_declaration and value.name != f"mp2a_{name}":
            value.linkage = "internal"
    return module


def _entry(name: str, inner: str) -> str:
    """Write a function to call from outside; numba's own take places for a result and an exception first."""
    arguments = ", ".join(f"{'i64' if kind == 'n' else 'ptr'} %a{i}" for i, kind in enumerate(ARGUMENTS[name]))
    has_result = name in RESULTS
    result = "%value = load i64, ptr %result\nret i64 %value" if has_result else "ret void"
    return f"""
        define {"i64" if has_result else "void"} @mp2a_{name}({arguments}) {{
            %result = alloca i64
            %exception = alloca ptr
            %status = call i32 @{inner}(ptr %result, ptr %exception, {arguments})
            {result}
        }}"""


def target_machine() -> Any:
    """Return LLVM's idea of this processor, with the changes that ``MP2A_CPU_FEATURES`` asks for."""
    import llvmlite.binding as llvm

    llvm.initialize_native_target()
    llvm.initialize_native_asmprinter()
    features = llvm.get_host_cpu_features().flatten(), os.environ.get(CPU_FEATURES)
    return llvm.Target.from_default_triple().create_target_machine(
        cpu=llvm.get_host_cpu_name(), features=",".join(filter(None, features)), opt=3, reloc="pic", codemodel="default"
    )
