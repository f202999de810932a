"""The linker fills in what an object refers to, and refuses what it does not know."""

import ctypes
import math
import platform
import struct
import sys

import pytest

llvm = pytest.importorskip("llvmlite.binding")

from mp2a.kernels.linker import LinkError, shared_object  # noqa: E402

PROGRAM = """
@numbers = internal constant [4 x double] [double 1.5, double 2.5, double 3.5, double 4.5], align 16
@more = internal constant [3 x i64] [i64 7, i64 11, i64 13], align 8

define internal double @number(i64 %i) noinline {
    %place = getelementptr [4 x double], ptr @numbers, i64 0, i64 %i
    %value = load double, ptr %place, align 16
    ret double %value
}
define double @twice(i64 %i) {
    %value = call double @number(i64 %i)
    %sum = fadd double %value, %value
    ret double %sum
}
define double @plus(double %x) {
    %sum = fadd double %x, 0x400921FB54442D18
    ret double %sum
}
define ptr @table() {
    ret ptr @more
}
define i64 @choose(i64 %i) {
    switch i64 %i, label %none [ i64 0, label %a i64 1, label %b i64 2, label %c i64 3, label %d i64 4, label %e ]
a:
    ret i64 12
b:
    ret i64 -7
c:
    %x = load i64, ptr @more
    ret i64 %x
d:
    %y = mul i64 %i, 5
    ret i64 %y
e:
    ret i64 99
none:
    ret i64 0
}
"""
ELF_HERE = sys.platform == "linux" and platform.machine() in ("x86_64", "aarch64")


def compiled(program, triple=None):
    """Object code of a program in LLVM's language."""
    llvm.initialize_all_targets()
    llvm.initialize_all_asmprinters()
    target = llvm.Target.from_triple(triple) if triple else llvm.Target.from_default_triple()
    machine = target.create_target_machine(opt=2, reloc="pic", codemodel="default")
    module = llvm.parse_assembly(program)
    module.triple = machine.triple
    return machine.emit_object(module)


@pytest.mark.skipif(not ELF_HERE, reason="shared objects of another kind here")
def test_functions_are_found_and_run(tmp_path):
    path = tmp_path / "program.so"
    path.write_bytes(shared_object(compiled(PROGRAM)))
    library = ctypes.CDLL(str(path))
    library.twice.restype, library.twice.argtypes = ctypes.c_double, [ctypes.c_int64]
    assert [library.twice(i) for i in range(4)] == [3, 5, 7, 9]
    library.table.restype = ctypes.POINTER(ctypes.c_int64)
    assert library.table()[:3] == [7, 11, 13]
    library.choose.restype, library.choose.argtypes = ctypes.c_int64, [ctypes.c_int64]
    assert [library.choose(i) for i in range(-1, 6)] == [0, 12, -7, 7, 15, 99, 0]
    with pytest.raises(AttributeError):
        library.number  # noqa: B018


def test_references_in_code_for_aarch64():
    """What instructions point to, worked out from their bits."""
    try:
        whole = shared_object(compiled(PROGRAM, "aarch64-unknown-linux-gnu"))
    except RuntimeError:
        pytest.skip("this LLVM does not compile for AArch64")
    numbers, more = whole.index(struct.pack("<4d", 1.5, 2.5, 3.5, 4.5)), whole.index(struct.pack("<3q", 7, 11, 13))
    code = {at: struct.unpack_from("<I", whole, at)[0] for at in range(0, len(whole) - 3, 4)}
    pages, calls = [], []
    for at, word in code.items():
        if word & 0x9F00001F == 0x90000000 or word & 0x9F00001F == 0x90000008:  # ADRP x0 or x8
            page = (at & ~0xFFF) + (signed((word >> 5 & 0x7FFFF) << 2 | word >> 29 & 3, 21) << 12)
            # The place in the page: ADD, or a load of a double (of which the instruction has an eighth).
            adds = {0x244: 1, 0x3F5: 8}
            pages += [page + adds[x >> 22] * (x >> 10 & 0xFFF) for x in (code[at + 4], code[at + 8]) if x >> 22 in adds]
        if word >> 26 == 0x25:  # BL
            calls.append(at + 4 * signed(word & 0x3FFFFFF, 26))
    assert numbers in pages
    assert more in pages
    assert whole.index(struct.pack("<d", math.pi)) in pages
    # ``number`` begins where its own reference to the numbers does.
    assert len(calls) == 1
    assert code[calls[0]] & 0x9F000000 == 0x90000000


def signed(number, bits):
    """Read a number of so many bits as one with a sign."""
    return number - (number >> bits - 1 << bits)


@pytest.mark.skipif(not ELF_HERE, reason="objects of another kind here")
@pytest.mark.parametrize(
    "program, what",
    [
        ("@n = global i64 0\ndefine void @f() {\n store i64 1, ptr @n\n ret void\n}", "n is not|relocation"),
        ("declare void @g()\ndefine void @f() {\n call void @g()\n ret void\n}", "g is not defined"),
        ("declare double @sin(double)\ndefine double @f(double %x) {\n %y = call double @sin(double %x)\n"
         " ret double %y\n}", "sin is not defined"),
        ("@n = internal global i64 0\ndefine void @f() {\n store i64 1, ptr @n\n ret void\n}", "read-only"),
        ("define internal void @f() {\n ret void\n}", "without global functions"),
    ],
)  # fmt: skip
def test_what_refers_to_something_outside_is_refused(program, what):
    with pytest.raises(LinkError, match=what):
        shared_object(compiled(program))


def test_what_is_no_object_is_refused():
    with pytest.raises(LinkError, match="not an ELF object"):
        shared_object(b"\xcf\xfa\xed\xfe" + bytes(100))
    with pytest.raises(LinkError, match="machine 8 "):
        shared_object(b"\x7fELF\x02\x01\x01" + bytes(11) + b"\x08\0" + bytes(100))
