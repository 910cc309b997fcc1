#!/usr/bin/python3
"""Refuses bare numbers in the sources of the diagnosis. A number that a verdict depends on stands in thresholds.hpp.

Read are all .cpp files of inference/diagnosis/ and of its folders. A header such as thresholds.hpp is not read: there
each number has a name, a unit and a reason. Allowed in a .cpp file are
  * 0, 0.5, 1 and 2, with any sign, suffix or spelling (0.0, 1u, 2.0F, 0x1);
  * a factor between units (UNIT_FACTORS) that multiplies or divides, or that stands before the text of its unit:
    `1e3 * voltage_v`, `s / 60`, `{1e3, "mV"}`. In a comparison or a sum the same number is a threshold and is refused;
  * template arguments, written without a space before "<": Eigen::Matrix<double, 3, 1>, std::array<double, 4>;
  * values of an enum and labels of a case: they name something and are not compared with a quantity.
Not numbers of the code: what stands in comments, texts and character literals, such as the digits of a format.
An array index is a bare number: [3] says nothing to the reader, a named constant does.
The check cannot see whether `1e-6 * x` converts a unit or scales by a chosen number. That remains for the reviewer.

Exit code: 0 no bare number, 1 at least one.
"""
import re
import sys

sys.dont_write_bytecode = True  # no __pycache__ in the source tree
import sources

SMALL = {0, 0.5, 1, 2}
UNIT_FACTORS = {60, 100, 1000, 3600, 1e6, 1e9, 1e-3, 1e-6, 1e-9}  # per minute, percent, milli, per hour, micro, nano
TEMPLATE_ARGUMENTS = re.compile(r"(?<=\w)<[\w\s:,]*>")
ENUM = re.compile(r"\benum\b[^;{]*\{[^}]*\}")
CASE = re.compile(r"\bcase\b[^:;{]*:(?!:)")


def value_of(number):
    digits = number.replace("'", "")
    if digits[:2].lower() == "0x":
        return float.fromhex(re.sub(r"[uUlLzZ]+$", "", digits))
    if digits[:2].lower() == "0b":
        return float(int(re.sub(r"[uUlLzZ]+$", "", digits), 2))
    return float(re.match(r"(?:\d+\.?\d*|\.\d+)(?:[eE][+-]?\d+)?", digits)[0])


def bare_numbers(text, path="x.cpp"):
    """Yields (position, number as written)."""
    numbers, code = [], list(text)
    for kind, start, end in sources.parts(text, path):
        if kind == "number":
            numbers.append((start, end))
        else:
            mark = '"' if kind == "string" else " "
            code[start:end] = sources.masked(text[start:end], mark)
    code = "".join(code)
    named, inner = [found.span() for rule in (ENUM, CASE) for found in rule.finditer(code)], None
    while inner != code:  # from the innermost template arguments outwards
        inner = code
        named += [found.span() for found in TEMPLATE_ARGUMENTS.finditer(inner)]
        code = TEMPLATE_ARGUMENTS.sub(lambda found: sources.masked(found[0], "_"), inner)
    for start, end in numbers:
        value, before, after = value_of(text[start:end]), code[:start].rstrip(), code[end:].lstrip()
        is_factor = before[-1:] in ("*", "/", "%") or after[:1] in ("*", "/", "%") or re.match(r',\s*"', after)
        if value in SMALL or (value in UNIT_FACTORS and is_factor) or any(a <= start < b for a, b in named):
            continue
        yield start, text[start:end]


def main():
    options = sources.options("Refuses bare numbers in the sources of the diagnosis.")
    given = options.parse_args()
    paths = [path for path in sources.paths(given.root, [".cpp"]) if path.startswith("inference/diagnosis/")]
    count = 0
    for path in paths:
        text = sources.read(given.root, path)
        for position, number in bare_numbers(text):
            count += 1
            print(f"{path}:{sources.line_of(text, position)}: {number} is a bare number; name it in thresholds.hpp")
    print(f"literals: {len(paths)} files, {count} bare numbers")
    return 1 if count else 0


if __name__ == "__main__":
    sys.exit(main())
