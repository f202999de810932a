"""A linker for one object that refers to nothing outside itself: LLVM's object code to a shared object for dlopen.

No compiler and no linker need be installed then. There is little to do, since the compiled kernels are position
independent and closed: their read-only sections are laid out one after the other, the references between them are
filled in, and a table of the exported functions is added. What does not fit is refused (`LinkError`): writable data,
names that are not defined, and references of kinds not listed in `_RELOCATIONS`. The System V ABI describes the format
(elf(5)), its supplements for x86-64 and AArch64 the relocations.
"""

from __future__ import annotations

import struct
from collections.abc import Callable
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

_SECTION = np.dtype(
    [
        ("name", "<u4"), ("type", "<u4"), ("flags", "<u8"), ("address", "<u8"), ("offset", "<u8"), ("size", "<u8"),
        ("link", "<u4"), ("info", "<u4"), ("align", "<u8"), ("entry", "<u8"),
    ]
)  # fmt: skip
_SYMBOL = np.dtype(
    [("name", "<u4"), ("info", "u1"), ("other", "u1"), ("section", "<u2"), ("value", "<u8"), ("size", "<u8")]
)
_RELOCATION = np.dtype([("offset", "<u8"), ("type", "<u4"), ("symbol", "<u4"), ("addend", "<i8")])

_PROGBITS, _SYMTAB, _RELA = 1, 2, 4
_WRITE, _ALLOC = 1, 2
_GLOBAL = 1
_SHARED = 3
_SEGMENTS = 4
_PT_LOAD, _PT_DYNAMIC, _PT_STACK = 1, 2, 0x6474E551
_READ_EXECUTE, _READ_WRITE = 5, 6
_DT_HASH, _DT_STRTAB, _DT_SYMTAB, _DT_STRSZ, _DT_SYMENT = 4, 5, 6, 10, 11

_HEADER, _PROGRAM_HEADER = "<16s2HI3QI6H", "<2I6Q"
_MACHINE_AT, _SECTIONS_AT, _SECTION_COUNT_AT, _NAMES_AT = 0x12, 0x28, 0x3C, 0x3E
_PAGE = 0x10000
"""Bytes of the largest page that either processor may have."""


class LinkError(Exception):
    """The object is not one that this linker takes."""


class _Object(NamedTuple):
    """A relocatable object taken apart."""

    content: bytes
    machine: int
    sections: NDArray[Any]
    symbols: NDArray[Any]
    names: bytes
    """Of the symbols."""

    def name(self, symbol: Any) -> str:
        """Return the name of a symbol."""
        start = int(symbol["name"])
        return self.names[start : self.names.index(b"\0", start)].decode()

    def bytes_of(self, section: Any) -> bytes:
        """Return what a section holds."""
        return self.content[int(section["offset"]) : int(section["offset"] + section["size"])]


def shared_object(content: bytes) -> bytes:
    """Make a shared object of a relocatable one, with all its global functions.

    Parameters
    ----------
    content
        An ELF object for x86-64 or AArch64, position independent.

    Returns
    -------
    bytes
        What the file of the shared object has to hold.

    Raises
    ------
    LinkError
        If it is no such object, or refers to something outside itself.
    """
    parts = _take_apart(content)
    exported = [symbol for symbol in parts.symbols if symbol["info"] >> 4 == _GLOBAL and symbol["section"]]
    if not exported:
        raise LinkError("an object without global functions")
    names = [parts.name(symbol).encode() + b"\0" for symbol in exported]
    strings, count = b"\0" + b"".join(names), 1 + len(exported)
    # Names are looked up in lists by their hash; here one list has them all.
    lists = struct.pack(f"<{3 + count}I", 1, count, 1, 0, *range(2, count), 0)
    image = bytearray(struct.calcsize(_HEADER) + _SEGMENTS * struct.calcsize(_PROGRAM_HEADER))
    lists_at, strings_at = _append(image, lists, 8), _append(image, strings, 1)
    symbols_at = _append(image, bytes(count * _SYMBOL.itemsize), 8)
    places = {}
    for i, section in enumerate(parts.sections):
        if section["type"] == _PROGBITS and section["flags"] & _ALLOC and not section["flags"] & _WRITE:
            places[i] = _append(image, parts.bytes_of(section), int(section["align"]) or 1)
    symbols = np.zeros(count, _SYMBOL)
    symbols[1:] = exported
    symbols["name"][1:] = np.cumsum([1, *map(len, names)])[:-1]
    symbols["section"][1:] = 1  # defined here; which section it was is of no interest any more
    symbols["value"][1:] = [_address(parts, symbol, places) for symbol in exported]
    image[symbols_at : symbols_at + symbols.nbytes] = symbols.tobytes()
    for section in parts.sections:
        if section["type"] == _RELA and int(section["info"]) in places:
            _fill_in(image, parts, section, places)
    dynamic = struct.pack(
        "<12Q", _DT_HASH, lists_at, _DT_STRTAB, strings_at, _DT_SYMTAB, symbols_at, _DT_STRSZ, len(strings),
        _DT_SYMENT, _SYMBOL.itemsize, 0, 0,
    )  # fmt: skip
    code = len(image)
    _put_headers(image, parts.machine, code, _append(image, dynamic, 8))
    return bytes(image)


def _append(image: bytearray, content: bytes, align: int) -> int:
    """Append to the image; returns where."""
    image += bytes(-len(image) % align)
    place = len(image)
    image += content
    return place


def _take_apart(content: bytes) -> _Object:
    if content[:7] != b"\x7fELF\x02\x01\x01":
        raise LinkError("not an ELF object of 64 bits, least significant byte first")
    (machine,) = struct.unpack_from("<H", content, _MACHINE_AT)
    if machine not in _RELOCATIONS:
        raise LinkError(f"an object for machine {machine} of the ELF list")
    (at,), (count,) = (struct.unpack_from(f, content, p) for f, p in (("<Q", _SECTIONS_AT), ("<H", _SECTION_COUNT_AT)))
    sections = np.frombuffer(content, _SECTION, count, at)
    (table,) = sections[sections["type"] == _SYMTAB]
    symbols = np.frombuffer(content, _SYMBOL, int(table["size"]) // _SYMBOL.itemsize, int(table["offset"]))
    names = sections[table["link"]]
    return _Object(content, machine, sections, symbols, content[int(names["offset"]) :][: int(names["size"])])


def _address(parts: _Object, symbol: Any, places: dict[int, int]) -> int:
    if int(symbol["section"]) not in places:
        where = "is not defined" if not symbol["section"] else "is not read-only"
        raise LinkError(f"{parts.name(symbol) or 'a section'} {where}")
    return places[int(symbol["section"])] + int(symbol["value"])


def _fill_in(image: bytearray, parts: _Object, section: Any, places: dict[int, int]) -> None:
    """Fill in the references of a section."""
    for reference in np.frombuffer(parts.bytes_of(section), _RELOCATION):
        kinds = _RELOCATIONS[parts.machine]
        if int(reference["type"]) not in kinds:
            raise LinkError(f"a relocation of type {reference['type']}")
        place = places[int(section["info"])] + int(reference["offset"])
        target = _address(parts, parts.symbols[reference["symbol"]], places) + int(reference["addend"])
        try:
            kinds[int(reference["type"])](image, place, target)
        except struct.error as error:
            raise LinkError("a reference across more than there is room for") from error


def _put_headers(image: bytearray, machine: int, code: int, dynamic_at: int) -> None:
    """Write the headers of an image that begins with room for them, has so many bytes of code, and then a table.

    The system's loader writes into the table, so that this goes to pages of its own.
    """
    header = struct.calcsize(_HEADER), struct.calcsize(_PROGRAM_HEADER)
    ident = b"\x7fELF\x02\x01\x01"
    numbers = _SHARED, machine, 1, 0, header[0], 0, 0, header[0], header[1], _SEGMENTS, _SECTION.itemsize, 0, 0
    struct.pack_into(_HEADER, image, 0, ident, *numbers)
    size, address = len(image) - dynamic_at, -(-code // _PAGE) * _PAGE + dynamic_at % _PAGE
    table = dynamic_at, address, address, size, size
    segments = (
        (_PT_LOAD, _READ_EXECUTE, 0, 0, 0, code, code, _PAGE),
        (_PT_LOAD, _READ_WRITE, *table, _PAGE),
        (_PT_DYNAMIC, _READ_WRITE, *table, 8),
        (_PT_STACK, _READ_WRITE, 0, 0, 0, 0, 0, 16),
    )
    for i, segment in enumerate(segments):
        struct.pack_into(_PROGRAM_HEADER, image, header[0] + i * header[1], *segment)


Fill = Callable[[bytearray, int, int], None]
"""Writes into an image, at a place, a reference to a target."""


def _difference(form: str) -> Fill:
    """Write the distance from the place to the target as a number of its own."""

    def fill(image: bytearray, place: int, target: int) -> None:
        struct.pack_into(form, image, place, target - place)

    return fill


def _bits(number: Callable[[int, int], int], width: int, *pieces: tuple[int, int]) -> Fill:
    """Put the lowest bits of a number into an instruction of 32 bits, in pieces of (width, where they go)."""

    def fill(image: bytearray, place: int, target: int) -> None:
        value = number(place, target)
        if not -(1 << width - 1) <= value < 1 << width - 1:
            raise LinkError("a reference across more than there is room for")
        (word,) = struct.unpack_from("<I", image, place)
        for size, at in pieces:
            word = word & ~(((1 << size) - 1) << at) | (value & ((1 << size) - 1)) << at
            value >>= size
        struct.pack_into("<I", image, place, word)

    return fill


def _low(shift: int) -> Fill:
    """Put the target's place in its page into an instruction, in units of what is read there."""
    return _bits(lambda place, target: (target & 0xFFF) >> shift, 13, (12, 10))


_PAGES = _bits(lambda place, target: (target >> 12) - (place >> 12), 21, (2, 29), (19, 5))
_BYTES = _bits(lambda place, target: target - place, 21, (2, 29), (19, 5))
_BRANCH = _bits(lambda place, target: (target - place) >> 2, 26, (26, 0))

_RELOCATIONS: dict[int, dict[int, Fill]] = {
    62: {2: _difference("<i"), 4: _difference("<i"), 24: _difference("<q")},  # x86-64: PC32, PLT32, PC64
    183: {  # AArch64
        260: _difference("<q"),  # PREL64
        261: _difference("<i"),  # PREL32
        274: _BYTES,  # ADR_PREL_LO21
        275: _PAGES,  # ADR_PREL_PG_HI21
        277: _low(0),  # ADD_ABS_LO12_NC
        278: _low(0),  # LDST8_ABS_LO12_NC
        282: _BRANCH,  # JUMP26
        283: _BRANCH,  # CALL26
        284: _low(1),  # LDST16_ABS_LO12_NC
        285: _low(2),  # LDST32_ABS_LO12_NC
        286: _low(3),  # LDST64_ABS_LO12_NC
        299: _low(4),  # LDST128_ABS_LO12_NC
    },
}
"""The kinds of references of each machine, by their numbers in the machine's supplement of the ABI."""
