#!/usr/bin/python3
"""Refuses nested conditional operators (a ? b : c ? d : e) and comma statements (a = b, c = d;) in C++.

Exit code: 0 none, 1 at least one.
"""
import re
import sys

sys.dont_write_bytecode = True  # no __pycache__ in the source tree
import sources

TOKEN = re.compile(r"::|[-+*/%&|^]=|[=!<>]=|->|\+\+|--|\w+|[^\s\w]")
DIRECTIVE = re.compile(r"^[ \t]*#(?:\\\n|[^\n])*", re.M)
ASSIGNED = ("=", "+=", "-=", "*=", "/=", "%=", "&=", "|=", "^=", "++", "--")
HEADS = ("if", "for", "while", "switch")


def nested_conditionals(tokens):
    """Positions of each ? that is an operand of another one."""
    operands, levels = [], [{"active": False, "operand": False}]
    before = ""
    for position, token in tokens:
        here = levels[-1]
        if token in "([{":
            levels.append({"active": False, "operand": token == "(" and here["active"] and before in ("?", ":")})
        elif token in ")]}":
            levels = levels[:-1] or levels
        elif token == "?":
            if here["active"] or here["operand"]:
                operands.append(position)
            here["active"] = True
        elif token in ",;":
            here["active"] = False
        before = token
    return operands


def without_head(statement):
    """if (c) a = b -> a = b"""
    while statement and statement[0][1] in (*HEADS, "else"):
        if statement[0][1] == "else":
            statement = statement[1:]
            continue
        depth = 0
        for k, (_, token) in enumerate(statement):
            depth += (token == "(") - (token == ")")
            if k > 0 and depth == 0 and token == ")":
                statement = statement[k + 1:]
                break
        else:
            return []
    return statement


def is_comma_statement(statement):
    """An expression that assigns, followed by another one behind a comma. A declaration begins with two names."""
    tokens = [token for _, token in without_head(statement)]
    depth, changed = 0, False
    for k, token in enumerate(tokens):
        if depth == 0 and not changed:
            if token in ASSIGNED:
                changed = True
            elif k > 0 and re.match(r"\w|[*&>]", token) and re.match(r"\w|[*&>]", tokens[k - 1]):
                return False
        depth += (token in "([{") - (token in ")]}")
        if depth == 0 and changed and token == ",":
            return True
    return False


def comma_statements(tokens):
    """Positions of the statements. Within parentheses a comma separates arguments, declarations or steps of a for."""
    found, statement, depth = [], [], 0
    for position, token in tokens:
        if depth == 0 and token in ("{", "}", ";"):
            if is_comma_statement(statement) and token == ";":
                found.append(statement[0][0])
            statement = []
            continue
        if token in "([":
            depth += 1
        elif token in ")]":
            depth = max(0, depth - 1)
        statement.append((position, token))
    return found


def main():
    options = sources.options("Refuses nested conditional operators and comma statements.")
    given = options.parse_args()
    paths = sources.paths(given.root, sources.CPP)
    faults = 0
    for path in paths:
        text = sources.read(given.root, path)
        code = DIRECTIVE.sub(lambda line: sources.masked(line[0], " "), sources.code(text, path))
        tokens = [(token.start(), token[0]) for token in TOKEN.finditer(code)]
        for what, positions in (("a conditional operator inside another one", nested_conditionals(tokens)),
                                ("a comma statement", comma_statements(tokens))):
            for position in positions:
                print(f"{path}:{sources.line_of(text, position)}: {what}")
            faults += len(positions)
    print(f"statements: {len(paths)} files, {faults} faults")
    return 1 if faults else 0


if __name__ == "__main__":
    sys.exit(main())
