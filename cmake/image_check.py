"""Writes the check code of a firmware image into the image, where hal/cortex_m/image_check.cpp reads it. The same input
gives the same bytes.

    image_check.py IMAGE.elf

CRC-32 over the flash content, by the symbols of the linker script: vectors, code and constants, initial data.
"""
import struct
import sys
import zlib


class Elf:
    """An ELF file of 32 bits, little-endian: sections by header, symbols by name."""

    def __init__(self, data):
        self.data = data
        begin, = struct.unpack_from("<I", data, 32)
        size, count, self.shstrndx = struct.unpack_from("<HHH", data, 46)
        self.sections = [struct.unpack_from("<10I", data, begin + k * size) for k in range(count)]
        segments, = struct.unpack_from("<I", data, 28)
        each, segment_count = struct.unpack_from("<HH", data, 42)
        self.segments = [struct.unpack_from("<8I", data, segments + k * each) for k in range(segment_count)]

    def text(self, strings, at):
        begin = self.sections[strings][4] + at
        return self.data[begin:self.data.index(b"\0", begin)].decode()

    def symbols(self):
        table = next(s for s in self.sections if s[1] == 2)
        for at in range(table[4], table[4] + table[5], table[9]):
            name, value = struct.unpack_from("<II", self.data, at)
            yield self.text(table[6], name), value

    def offset_of(self, address):
        """Position in the file of the byte that is loaded at this flash address (p_paddr); None if no byte is."""
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
        return  # this image does not check itself
    crc = zlib.crc32(elf.loaded(at["image_vectors"], at["image_vectors_end"]))
    crc = zlib.crc32(elf.loaded(at["image_code_begin"], at["image_code_end"]), crc)
    data_load, data_bytes = at["image_data_load"], at["image_data_end"] - at["image_data_begin"]
    crc = zlib.crc32(elf.loaded(data_load, data_load + data_bytes), crc)
    struct.pack_into("<II", elf.data, elf.offset_of(at["image_check"]), crc, crc ^ 0xFFFFFFFF)
    with open(path, "wb") as f:
        f.write(elf.data)


if __name__ == "__main__":
    main(sys.argv[1])
