"""Writes the second line of a firmware image as a table: what the measuring chip will do by itself, from the settings
that the image will write into it. Registers and units are those of the chip's manual (SLUUBY2B, 13.3 and 13.6), not of
the firmware's source.

    second_line_table.py IMAGE.elf TABLE.md       one image; no file for one without the chip
    second_line_table.py NAME=IMAGE.elf ...       several next to each other, to the output
"""
import os
import struct
import sys

from image_check import Elf

CONFIGURATION = "_ZN3bms3hal7bq7695219board_configurationE"
SHORT_CIRCUIT_MV = [10, 20, 40, 60, 80, 100, 125, 150, 175, 200, 250, 300, 350, 400, 450, 500]
# protection, register of the enabled ones, bit, registers that open DCHG and DDSG
A, B, C = (0x9261, 0x9265, 0x9269), (0x9262, 0x9266, 0x926A), (0x9263, 0x9267, 0x926B)
PROTECTIONS = [("COV", A, 3), ("CUV", A, 2), ("OCC", A, 4), ("OCD1", A, 5), ("OCD2", A, 6), ("OCD3", C, 7),
               ("SCD", A, 7), ("OTC", B, 4), ("OTD", B, 5), ("UTC", B, 0), ("host watchdog", C, 1)]


class Image:
    """The settings of the chip in an image; no `settings` for one without it."""

    def __init__(self, path):
        with open(path, "rb") as f:
            self.elf = Elf(f.read())
        at = dict(self.elf.symbols()).get(CONFIGURATION)
        self.settings = None
        if at is None:
            return
        # bms::hal::bq76952::Configuration: pointer and number of the settings, three words before the 32-bit counts
        settings, count, _, _, na_per_count = self.words("<IIiii", at)
        self.settings = {}
        for k in range(count):
            address, size, value = self.words("<HBxI", settings + 8 * k)
            self.settings.update({address + n: value >> 8 * n & 0xFF for n in range(size)})
        self.shunt_mohm = 7.5684e6 / 256 / na_per_count

    def words(self, form, address):
        begin = self.elf.offset_of(address)
        if begin is None:
            raise SystemExit(f"second_line_table.py: no byte of the image at {address:#x}")
        return struct.unpack_from(form, self.elf.data, begin)

    def opens(self, group, bit):
        enabled, charge, discharge = (self.settings[register] >> bit & 1 for register in group)
        if not enabled:
            return "off"
        return {(1, 0): "DCHG", (0, 1): "DDSG", (1, 1): "both"}.get((charge, discharge), "off")

    def threshold(self, name):
        s = self.settings
        signed = lambda at: (s[at] ^ 0x80) - 0x80
        ampere = lambda at: f"{2 * s[at] / self.shunt_mohm:.0f} A"
        word = lambda at: s[at] | s[at + 1] << 8
        user_a = 0.01 if s[0x9303] == 0x06 else 0.1
        return {"COV": lambda: f"{0.0506 * s[0x9278]:.3f} V", "CUV": lambda: f"{0.0506 * s[0x9275]:.3f} V",
                "OCC": lambda: ampere(0x9280), "OCD1": lambda: ampere(0x9282), "OCD2": lambda: ampere(0x9284),
                "OCD3": lambda: f"{user_a * (0x10000 - word(0x928A)):.0f} A",
                "SCD": lambda: f"{SHORT_CIRCUIT_MV[s[0x9286]] / self.shunt_mohm:.0f} A",
                "OTC": lambda: f"{signed(0x929A)} °C", "OTD": lambda: f"{signed(0x929D)} °C",
                "UTC": lambda: f"{signed(0x92A6)} °C", "host watchdog": lambda: "no transfer"}[name]()

    def delay(self, name):
        s = self.settings
        steps = {"COV": s[0x9279] | s[0x927A] << 8, "CUV": s[0x9276] | s[0x9277] << 8, "OCC": s[0x9281],
                 "OCD1": s[0x9283], "OCD2": s[0x9285]}
        seconds = {"OCD3": 0x928C, "OTC": 0x929B, "OTD": 0x929E, "UTC": 0x92A7, "host watchdog": 0x92B2}
        if name in steps:
            return f"{0.0033 * (steps[name] + 2):.2f} s"
        if name == "SCD":
            return f"{15e-3 * (s[0x9287] - 1):.2f} ms"
        return f"{s[seconds[name]]} s"


def table(images):
    """images: by the name of their column."""
    first = next(iter(images.values()))
    lines = ["| protection | opens | " + " | ".join(images) + " | delay |", "|---|---|" + "---|" * len(images) + "---|"]
    for name, group, bit in PROTECTIONS:
        thresholds = [image.threshold(name) if image.opens(group, bit) != "off" else "off" for image in images.values()]
        lines.append(f"| {name} | {first.opens(group, bit)} | {' | '.join(thresholds)} | {first.delay(name)} |")
    return "\n".join(lines) + "\n"


def main(arguments):
    if not (len(arguments) == 2 and arguments[1].endswith(".md")):
        sys.stdout.write(table({name: Image(path) for name, path in (a.split("=", 1) for a in arguments)}))
        return
    elf, out = arguments
    image = Image(elf)
    if image.settings is None:
        if os.path.exists(out):
            os.remove(out)
        return
    with open(out, "w", encoding="utf-8") as f:
        f.write(table({"threshold": image}))


main(sys.argv[1:])
