"""The files of the project and their text in parts: code, comments, strings. Used by every check of this folder."""
import argparse
import os
import re
import subprocess

CPP = (".cpp", ".hpp", ".c", ".h")
HASH_COMMENTS = (".py", ".cmake", ".txt", ".sh", ".toml", "bms")

C_PARTS = re.compile(r'''
    (?P<comment>//(?:\\\n|[^\n])*|/\*.*?\*/)
  | (?P<include>^[ \t]*\#[ \t]*include[^\n]*?(?=//|$))
  | (?P<string>R"(?P<end>[^ ()\\\t\n]*)\(.*?\)(?P=end)"|"(?:\\.|[^"\\\n])*"|`(?:\\.|[^`\\])*`)
  | (?P<number>(?<![\w.])\.?\d(?:[eEpP][+-]|'(?=\w)|[\w.])*)
  | (?P<letter>'(?:\\.|[^'\\\n])*')
''', re.S | re.X | re.M)
HASH_PARTS = re.compile(r'''
    (?P<comment>(?<!\S)\#[^\n]*)
  | (?P<string>""".*?"""|\'\'\'.*?\'\'\'|"(?:\\.|[^"\\])*"|'(?:\\.|[^'\\\n])*')
''', re.S | re.X)


def paths(root, endings):
    """Sorted paths, relative to root, of all files with one of these endings. Leaves out folders that are hidden, of a
    build, or generated."""
    found = []
    for folder, folders, names in os.walk(root):
        folders[:] = sorted(f for f in folders if not f.startswith(".")
                            and f not in ("build", "generated", "__pycache__")
                            and not os.path.exists(os.path.join(folder, f, "CMakeCache.txt")))
        found += [os.path.relpath(os.path.join(folder, n), root) for n in names if n.endswith(tuple(endings))]
    return sorted(found)


def read(root, path):
    with open(os.path.join(root, path), encoding="utf-8", errors="replace") as file:
        return file.read()


def parts(text, path):
    """Yields (kind, start, end) of each comment, include, string, number and letter. The text between them is code."""
    rule = HASH_PARTS if path.endswith(HASH_COMMENTS) else C_PARTS
    for found in rule.finditer(text):
        yield found.lastgroup if found.lastgroup != "end" else "string", found.start(), found.end()


def masked(piece, mark):
    """The piece with every character but white space replaced, so that positions and lines stay."""
    return re.sub(r"\S", mark, piece)


def code(text, path):
    """The text without comments, strings and includes, every position as it was."""
    kept = list(text)
    for kind, start, end in parts(text, path):
        if kind != "number":
            kept[start:end] = masked(text[start:end], " ")
    return "".join(kept)


def line_of(text, position):
    return text.count("\n", 0, position) + 1


def options(description):
    """The command line of a check: --root, and what the check adds."""
    parser = argparse.ArgumentParser(description=description)
    parser.add_argument("--root", default=os.path.dirname(os.path.dirname(os.path.abspath(__file__))),
                        help="top folder of the project")
    return parser


def run(command, **options):
    return subprocess.run(command, capture_output=True, text=True, check=False, **options)
