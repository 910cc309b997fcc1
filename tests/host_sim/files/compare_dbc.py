"""Compares values of CAN frames as the tool reads them with those of canmatrix, for random DBC files.

    compare_dbc.py DECODE_FRAMES [--files 120] [--seed 1]

DECODE_FRAMES is the built program of decode_frames.cpp. Each file has messages of all kinds: signals of both byte
orders, signed, float, multiplexed in two levels and by ranges, CAN FD. The values must be equal to the last bit. Float
signals with a factor are computed in double precision by the tool and in decimals by canmatrix: they may differ by one
part in 10^15. Exit code: 1 a value differs or is missing, 77 canmatrix is not installed.
"""
import argparse
import contextlib
import math
import os
import random
import struct
import subprocess
import sys
import tempfile

try:
    with open(os.devnull, "w") as nowhere, contextlib.redirect_stdout(nowhere), contextlib.redirect_stderr(nowhere):
        import canmatrix.formats
except ImportError:
    print("canmatrix is not installed: nothing compared")
    sys.exit(77)

NEW_SYMBOLS = """NS_DESC_ CM_ BA_DEF_ BA_ VAL_ CAT_DEF_ CAT_ FILTER BA_DEF_DEF_ EV_DATA_ ENVVAR_DATA_ SGTYPE_
SGTYPE_VAL_ BA_DEF_SGTYPE_ BA_SGTYPE_ SIG_TYPE_REF_ VAL_TABLE_ SIG_GROUP_ SIG_VALTYPE_ SIGTYPE_VALTYPE_ BO_TX_BU_
BA_DEF_REL_ BA_REL_ BA_DEF_DEF_REL_ BU_SG_REL_ BU_EV_REL_ BU_BO_REL_ SG_MUL_VAL_""".split()
FACTORS = ["1", "0.1", "0.001", "0.25", "1E-005", "0.0078125", "0.3", "2", "10", "1.5",
           "0.00390625", "-0.1", "100"]
OFFSETS = ["0", "0", "-40", "0.5", "-1600", "273.15", "1E3", "-0.001"]


class Bits:
    """Bits of a frame that no signal has."""

    def __init__(self, size):
        self.free = set(range(8 * size))

    def place(self, rng, length, little):
        """Start bit as in the file, or None; the bits are taken."""
        for _ in range(40):
            start = rng.choice(sorted(self.free))
            bits, bit = [], start
            for _ in range(length):
                bits.append(bit)
                if little:
                    bit += 1
                else:
                    bit = bit - 1 if bit % 8 else bit + 15
            if self.free.issuperset(bits):
                self.free.difference_update(bits)
                return start
        return None


def signal(rng, name, bits, mux="", plain=False, most=64):
    little, kind = rng.random() < 0.5, "int" if plain else rng.choice(["int"] * 8 + ["float32", "float64"])
    length = {"int": rng.randint(1, rng.choice([8, 16, min(32, most), most])), "float32": 32, "float64": 64}[kind]
    if plain:
        length = rng.randint(2, 5)
    start = bits.place(rng, length, little)
    if start is None:
        return None
    signed = not plain and rng.random() < 0.5
    factor, offset = ("1", "0") if plain or (kind != "int" and rng.random() < 0.7) else (
        rng.choice(FACTORS), rng.choice(OFFSETS))
    unit = rng.choice(["", "A", "mV", "\xb0C", "%"])
    space = rng.choice(["", " "])
    text = (f' SG_ {name} {mux}{" " if mux else ""}: {start}|{length}@{int(little)}{"-" if signed else "+"} '
            f'({factor},{offset}) [{rng.choice(["0|0", "-10|10", "0|1E6"])}] "{unit}" {space}Vector__XXX')
    return {"name": name, "text": text, "kind": kind, "plain": (factor, offset) == ("1", "0")}


def multiplexed(rng, signals, bits, ranges):
    """A multiplexor with signals, one of them a multiplexor again; returns the lines of SG_MUL_VAL_."""
    free = set(bits.free)
    lines = []
    page = signal(rng, "Page", bits, "M", plain=True)
    if page is None:
        return lines
    signals.append(page)
    inner = signal(rng, "Inner", bits, "m1M", plain=True) if ranges else None
    if inner:
        signals.append(inner)
        lines.append(("Inner", "Page", "1-1"))
    for k in range(rng.randint(2, 6)):
        alone = Bits(0)
        alone.free = set(bits.free)  # signals of different values share bits
        one = signal(rng, f"Muxed{k}", alone, f"m{k % 4}", most=16)
        if one is None:
            continue
        signals.append(one)
        if inner and rng.random() < 0.5:
            lines.append((one["name"], "Inner", f"{k % 4}-{k % 4 + rng.randint(0, 2)}, 12-14"))
        elif ranges:
            lines.append((one["name"], "Page", rng.choice([f"{k % 4}-{k % 4}", f"{k % 4}-3, 5-6"])))
    bits.free &= free
    return lines


def message(rng, k):
    long_id = rng.random() < 0.4
    number = (rng.randint(0, 0x1FFFFF) << 8 | k) | 0x80000000 if long_id else 0x100 + k
    size = rng.choice([8, 8, 8, 4, 12, 24, 64])
    bits, signals, ranges = Bits(size), [], []
    if rng.random() < 0.4:
        ranges = multiplexed(rng, signals, bits, rng.random() < 0.5)
    for n in range(rng.randint(1, 6)):
        one = bits.free and signal(rng, f"S{n}_of_{k}", bits)
        if one:
            signals.append(one)
    return {"id": number, "long": long_id, "size": size, "signals": signals, "ranges": ranges, "name": f"Message{k}"}


def text_of(rng, messages):
    lines = ['VERSION "1.0"', "", "NS_ :"] + ["\t" + s for s in NEW_SYMBOLS] + ["", "BS_:", ""]
    lines += ["BU_: Node_A Node_B", ""]
    lines += ['VAL_TABLE_ States 1 "on" 0 "off" ;', ""]
    for m in messages:
        lines += [f'BO_ {m["id"]} {m["name"]}: {m["size"]} Node_A'] + [s["text"] for s in m["signals"]] + [""]
    lines += ["BO_ 3221225472 VECTOR__INDEPENDENT_SIG_MSG: 0 Vector__XXX",
              ' SG_ Alone : 0|8@1+ (1,0) [0|0] "" Vector__XXX', ""]
    lines += [f'BO_TX_BU_ {messages[0]["id"]} : Node_A,Node_B;', ""]
    for m in messages:
        lines.append(f'CM_ BO_ {m["id"]} "A comment; with SG_ words\nand a second line";')
        if m["signals"]:
            lines.append(f'CM_ SG_ {m["id"]} {m["signals"][0]["name"]} "Text";')
    lines += ['BA_DEF_ BO_  "GenMsgCycleTime" INT 0 65535;', 'BA_DEF_ SG_  "GenSigStartValue" FLOAT 0 1E9;',
              'BA_DEF_DEF_  "GenMsgCycleTime" 100;', 'BA_DEF_DEF_  "GenSigStartValue" 0;']
    for m in messages:
        lines.append(f'BA_ "GenMsgCycleTime" BO_ {m["id"]} {rng.choice([10, 100, 1000])};')
    for m in messages:
        for s in m["signals"]:
            if s["kind"] == "int" and rng.random() < 0.3:
                lines.append(f'VAL_ {m["id"]} {s["name"]} 1 "one" 0 "zero" ;')
    for m in messages:
        for s in m["signals"]:
            if s["kind"] != "int":
                lines.append(f'SIG_VALTYPE_ {m["id"]} {s["name"]} : {1 if s["kind"] == "float32" else 2};')
    for m in messages:
        for name, by, ranges in m["ranges"]:
            lines.append(f'SG_MUL_VAL_ {m["id"]} {name} {by} {ranges};')
    return rng.choice(["\n", "\r\n"]).join(lines) + "\n"


def bits_of(value):
    return struct.pack(">d", value).hex()


def compare(decode, rng, folder, problems):
    messages = [message(rng, k) for k in range(rng.randint(1, 6))]
    path = os.path.join(folder, "random.dbc")
    with open(path, "w", encoding="latin-1", newline="") as file:
        file.write(text_of(rng, messages))
    with open(os.devnull, "w") as nowhere, contextlib.redirect_stdout(nowhere):
        matrix = canmatrix.formats.loadp_flat(path)
    frames = [(m, rng.randbytes(m["size"])) for m in messages for _ in range(12)]
    text = "".join(f'{m["id"] & 0x1FFFFFFF:X}{"x" if m["long"] else ""} {data.hex()}\n' for m, data in frames)
    run = subprocess.run([decode, path], input=text, capture_output=True, text=True, check=False)
    if run.returncode != 0:
        problems.append(run.stderr.strip())
        return 0
    ours = {}
    for line in run.stdout.splitlines():
        at, name, of, value = line.split()
        ours[int(at), name, of] = value
    compared = 0
    for at, (m, data) in enumerate(frames, 1):
        frame = next(f for f in matrix.frames if f.name == m["name"])
        decoded = frame.decode(data)
        for s in m["signals"]:
            mine = ours.pop((at, m["name"], s["name"]), None)
            if s["name"] not in decoded:
                if mine is not None:
                    problems.append(f'{m["name"]}.{s["name"]}: canmatrix does not have it in this frame')
                continue
            raw = decoded[s["name"]].raw_value
            exact = s["kind"] == "int" or s["plain"]
            theirs = float(raw) if s["kind"] != "int" and s["plain"] else float(decoded[s["name"]].phys_value)
            compared += 1
            if mine is None:
                problems.append(f'{m["name"]}.{s["name"]}: missing, {theirs} by canmatrix')
                continue
            value = struct.unpack(">d", bytes.fromhex(mine))[0]
            same = mine == bits_of(theirs) or value == theirs or (math.isnan(value) and math.isnan(theirs))
            if not same and not (not exact and math.isclose(value, theirs, rel_tol=1e-15)):
                problems.append(f'{m["name"]}.{s["name"]}: {value!r}, {theirs!r} by canmatrix; {s["text"].strip()}')
    problems += [f"frame {at}: {name}.{of} is not a signal of the file" for at, name, of in ours]
    return compared


def main():
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("decode")
    parser.add_argument("--files", type=int, default=120)
    parser.add_argument("--seed", type=int, default=1)
    options = parser.parse_args()
    rng, problems, compared = random.Random(options.seed), [], 0
    with tempfile.TemporaryDirectory() as folder:
        for _ in range(options.files):
            compared += compare(options.decode, rng, folder, problems)
            if len(problems) > 20:
                break
    print(f"{options.files} DBC files, {compared} values, {len(problems)} problems")
    print("\n".join(problems[:20]))
    return 1 if problems or compared == 0 else 0


if __name__ == "__main__":
    sys.exit(main())
