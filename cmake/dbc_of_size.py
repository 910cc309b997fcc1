#!/usr/bin/python3
"""Writes the DBC file of a battery of a number of cells: cmake/dbc_of_size.py CELLS [DBC]

The file is firmware/can/greybox_bms.dbc without what such a battery does not send: further cells, the messages of
further cells alone, and PackVoltage of a pack of at most 16 cells (PackElectrical.Voltage of a larger one is never
known and goes instead). Identifiers, layouts, comments and values stay. The result is written to standard output.
Exit code: 0 written, 2 another number of cells, or no such file.
"""
import os
import re
import sys

ROOT = os.path.dirname(os.path.dirname(os.path.abspath(__file__)))
FEWEST, LARGEST_OF_PACK_ELECTRICAL = 2, 16
CELL = re.compile(r" SG_ (Cell(\d+)) :")
OF_A_MESSAGE = re.compile(r'(?:CM_ (?:BO_|SG_)|BA_ "\w+" (?:BO_|SG_)|VAL_|SIG_VALTYPE_) ?(\d+)(?: (\w+))?')


def blocks(lines):
    """Yields (identifier, name, lines) of each message, and (None, None, [line]) of each other line."""
    at = 0
    while at < len(lines):
        head = re.match(r"BO_ (\d+) (\w+):", lines[at])
        if not head:
            yield None, None, [lines[at]]
            at += 1
            continue
        end = at + 1
        while end < len(lines) and lines[end].startswith(" SG_ "):
            end += 1
        yield head[1], head[2], lines[at:end]
        at = end


def of_size(text, cells):
    """Returns the text of the file for this number of cells; raises ValueError if the messages end before."""
    lines = text.split("\n")
    known = [int(m[2]) for line in lines if (m := CELL.match(line))]
    if not FEWEST <= cells <= max(known):
        raise ValueError(f"{cells} cells: the messages are for {FEWEST} to {max(known)}")
    gone_messages, gone_signals, kept = set(), set(), []
    for identifier, name, block in blocks(lines):
        if identifier is None:
            kept += block
            continue
        signals = [m for line in block if (m := CELL.match(line))]
        further = {m[1] for m in signals if int(m[2]) > cells}
        if name == "PackVoltage" and cells <= LARGEST_OF_PACK_ELECTRICAL or signals and len(further) == len(signals):
            gone_messages.add(identifier)
            continue
        if name == "PackElectrical" and cells > LARGEST_OF_PACK_ELECTRICAL:
            further.add("Voltage")
        gone_signals |= {(identifier, signal) for signal in further}
        kept += [line for line in block if not any(line.startswith(f" SG_ {signal} :") for signal in further)]
    result, before = [], None
    for line in kept:
        m = OF_A_MESSAGE.match(line)
        if m and (m[1] in gone_messages or (m[1], m[2]) in gone_signals):
            continue
        if line == "" and before == "":  # behind a message that is gone
            continue
        result.append(line)
        before = line
    return "\n".join(result)


def main():
    dbc = sys.argv[2] if len(sys.argv) == 3 else os.path.join(ROOT, "firmware", "can", "greybox_bms.dbc")
    if len(sys.argv) not in (2, 3) or not sys.argv[1].isdigit():
        sys.exit(__doc__.split("\n", maxsplit=1)[0])
    try:
        with open(dbc, encoding="utf-8") as file:
            sys.stdout.write(of_size(file.read(), int(sys.argv[1])))
    except (OSError, ValueError) as problem:
        print(problem, file=sys.stderr)
        sys.exit(2)


if __name__ == "__main__":
    main()
