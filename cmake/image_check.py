"""Writes into a firmware image the check that hal/cortex_m/image_check.cpp looks for: the same input, the same bytes.

    image_check.py IMAGE.elf

CRC-32 over what the flash holds, by the linker script's symbols: vectors, code and constants, initial values of data.
"""
import struct
import sys
import zlib


class Elf:
    """32 bits, little-endian: sections by header, symbols by name."""

    def __init__(self, data):
        self.data = data
        begin, = struct.unpack_from("<I", data, 32)
        size, count, self.shstrndx = struct.unpack_from("<HHH", data, 46)
        self.sections = [struct.unpack_from("<10I", data, begin + k * size) for k in range(count)]
        self.segments = [struct.unpack_from("<8I", data, struct.unpack_from("<I", data, 28)[0] + k * struct.unpack_from("<H", data, 42)[0])
                         for k in range(struct.unpack_from("<H", data, 44)[0])]

    def text(self, strings, at):
        begin = self.sections[strings][4] + at
        return self.data[begin:self.data.index(b"\0", begin)].decode()

    def symbols(self):
        table = next(s for s in self.sections if s[1] == 2)
        for at in range(table[4], table[4] + table[5], table[9]):
            name, value = struct.unpack_from("<II", self.data, at)
            yield self.text(table[6], name), value

    def offset_of(self, address):
        """In the file, of what is loaded at this address (of the flash: p_paddr); None: nothing is."""
        for kind, offset, _, physical, in_file, _, _, _ in self.segments:
            if kind == 1 and physical <= address < physical + in_file:
                return offset + address - physical
        return None

    def loaded(self, begin, end):
        return self.data[self.offset_of(begin):self.offset_of(end - 1) + 1] if begin < end else b""


def main(path):
    with open(path, "rb") as f:
        elf = Elf(bytearray(f.read()))
    at = dict(elf.symbols())
    if not any(elf.text(elf.shstrndx, s[0]) == ".image_check" and s[5] > 0 for s in elf.sections):
        return  # nothing looks for one
    crc = zlib.crc32(elf.loaded(at["image_vectors"], at["image_vectors_end"]))
    crc = zlib.crc32(elf.loaded(at["image_code_begin"], at["image_code_end"]), crc)
    crc = zlib.crc32(elf.loaded(at["image_data_load"], at["image_data_load"] + at["image_data_end"] - at["image_data_begin"]), crc)
    struct.pack_into("<II", elf.data, elf.offset_of(at["image_check"]), crc, crc ^ 0xFFFFFFFF)
    with open(path, "wb") as f:
        f.write(elf.data)


main(sys.argv[1])
