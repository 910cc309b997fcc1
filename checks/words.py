#!/usr/bin/python3
"""Refuses words that are not the field's words. words.toml lists them and says what to write instead.

Its [[word]] tables hold for comments, texts (string literals) and whole pages (.md, .html). Its [[name]] tables hold
for the names of the code and of the files. Names in `relied_on` are left out. An #include line is not
read: the included file reports its own name.

Exit code: 0 none of the words, 1 at least one, 2 words.toml cannot be used.
"""
import collections
import os
import re
import sys
import tomllib

sys.dont_write_bytecode = True  # no __pycache__ in the source tree
import sources

PAGES = (".md", ".html")
READ = (*sources.CPP, *PAGES, ".py", ".js", ".css", ".cmake", ".sh", ".toml", ".dbc", "CMakeLists.txt", "bms")
COMMENT_MARKS = re.compile(r"^\s*(///?[<!]?|#+|/?\*+)|(?<=\s)///?[<!]?|\*/$")
DATA = (".toml", ".dbc")  # their keys and signals are relied on from outside, so only their comments and texts are read
BARRIER = "\0"  # stands for what is not read, so that no phrase reaches over it


def prose_and_code(text, path):
    """Two texts of the same length: one with only what people read, one with only code."""
    if path.endswith(PAGES):
        return text, ""
    prose, code, last = [], [], 0
    for kind, start, end in sources.parts(text, path):
        piece, between = text[start:end], text[last:start]
        prose.append(sources.masked(between, BARRIER))
        code.append(between)
        if kind == "comment":
            prose.append(COMMENT_MARKS.sub(lambda mark: sources.masked(mark[0], " "), piece))
        elif kind in ("string", "letter"):  # JavaScript writes texts in single quotes
            prose.append(re.sub(r"""^\w*["'`]+|["'`]+$""", lambda mark: " " * len(mark[0]), piece))
        else:
            prose.append(sources.masked(piece, BARRIER))
        code.append(sources.masked(piece, " "))
        last = end
    prose.append(sources.masked(text[last:], BARRIER))
    return "".join(prose), "" if path.endswith(DATA) else "".join(code) + text[last:]


def without_avoided(text, path):
    """The text without the last column of tables headed "not": the glossary lists the words to avoid there."""
    if not path.endswith(".md"):
        return text
    lines, inside = text.split("\n"), False
    for k, line in enumerate(lines):
        inside = line.startswith("|") and (inside or line.endswith("| not |"))
        if inside:
            start = line.rstrip(" |").rfind("|") + 1
            lines[k] = line[:start] + sources.masked(line[start:], BARRIER)
    return "\n".join(lines)


def words_of(name):
    """know_anew, KnowAnew -> " know anew " """
    return " " + re.sub(r"_+|(?<=[a-z0-9])(?=[A-Z])|(?<=[A-Z])(?=[A-Z][a-z])", " ", name).lower().strip() + " "


def refused_names(names):
    """A function that returns what to write instead of a name, or None."""
    whole = {name: entry["write"] for entry in names for name in entry.get("whole", ())}
    part = {f" {words} ": entry["write"] for entry in names for words in entry.get("part", ())}
    known = {}

    def instead(name):
        if name not in known:
            words = words_of(name)
            known[name] = whole.get(name) or next((write for key, write in part.items() if key in words), None)
        return known[name]

    return instead


def findings(root, data):
    """Yields (path, line, what is written, what to write)."""
    rules = [(re.compile(word["refuse"].replace(" ", r"\s+"), re.I), word["write"], tuple(word.get("only", [""])))
             for word in data["word"]]
    instead = refused_names(data["name"])
    relied_on = re.compile("|".join(data.get("relied_on", ())) or r"(?!)")
    for path in sources.paths(root, READ):
        if path in data.get("skip", ()):
            continue
        text = without_avoided(sources.read(root, path), path)
        text = relied_on.sub(lambda name: sources.masked(name[0], BARRIER), text)
        prose, code = prose_and_code(text, path)
        found = {(m.start(), " ".join(m[0].split()), write) for rule, write, only in rules if path.startswith(only)
                 for m in rule.finditer(prose)}
        found |= {(m.start(), m[0], write) for m in re.finditer(r"[A-Za-z_]\w*", code) if (write := instead(m[0]))}
        if write := instead(os.path.splitext(os.path.basename(path))[0]):
            found.add((0, os.path.basename(path), write))
        for position, word, write in sorted(found):
            yield path, sources.line_of(text, position), word, write


def main():
    own = os.path.dirname(os.path.abspath(__file__))
    options = sources.options("Refuses words that are not the field's words.")
    options.add_argument("--words", default=os.path.join(own, "words.toml"), help="another words.toml")
    options.add_argument("--count", action="store_true", help="print only how often, by replacement and by room")
    options.add_argument("paths", nargs="*", help="only files whose path begins so")
    given = options.parse_args()
    try:
        with open(given.words, "rb") as file:
            data = tomllib.load(file)
        found = [f for f in findings(given.root, data) if not given.paths or f[0].startswith(tuple(given.paths))]
    except (OSError, KeyError, ValueError, re.error) as error:
        print(f"words.toml: {error}", file=sys.stderr)
        return 2
    if given.count:
        for title, column in (("written", 3), ("room", 0)):
            counts = collections.Counter(f[column] if column else f[0].split("/")[0] for f in found)
            print(f"{'count':>6}  {'write instead' if column else title}")
            print("\n".join(f"{count:>6}  {key}" for key, count in counts.most_common()))
    else:
        print("\n".join(f"{path}:{line}: {word} -> {write}" for path, line, word, write in found))
    print(f"words: {len(found)} to replace in {len({f[0] for f in found})} files")
    return 1 if found else 0


if __name__ == "__main__":
    sys.exit(main())
