#!/usr/bin/python3
"""Checks that each room (folder) includes only what rooms.toml allows.

A room is a table of rooms.toml: a folder with a list of its own. One without a purpose ("hal/stm32f4") is a part of the
room around it. A file belongs to the room with the longest name that matches its path. Read is every #include of every
C++ file, with the include roots of rooms.toml.
It fails when
  * a room includes a room that its `sees` does not list, or an included file belongs to no room;
  * a folder with C++ files is missing in rooms.toml, or a room of rooms.toml is missing in the tree;
  * the allowed arrows have a circle, between rooms or between rooms with their parts;
  * a room of the controller sees a room that is not on the controller (`controller = true`);
  * a room reaches a room of its `never` list, also through headers of other rooms;
  * an allowed arrow is not used by any include.

Exit code: 0 all arrows allowed, 1 a rule is broken, 2 rooms.toml cannot be used.
"""
import graphlib
import os
import re
import sys
import tomllib

sys.dont_write_bytecode = True  # no __pycache__ in the source tree
import sources

INCLUDE = re.compile(r'^[ \t]*#[ \t]*include[ \t]*(["<])([^">\n]+)[">]', re.M)


def room_of(path, rooms):
    folders = path.split("/")[:-1]
    for depth in range(len(folders), 0, -1):
        if "/".join(folders[:depth]) in rooms:
            return "/".join(folders[:depth])
    return None


def whole(room, rooms):
    """The room that `room` is a part of, or itself: the next one up with a purpose."""
    around = room
    while "purpose" not in rooms.get(around, {}):
        around = os.path.dirname(around)
        if not around:
            raise ValueError(f"room {room} has no purpose, and no room around it has one")
    return around


def includes(root, rooms, roots, generated, broken):
    """{path: [(place, included path, its room)]}. Appends a message to `broken` for what belongs to no room."""
    found = {}
    tops = [top for top in ("", *roots) if os.path.isdir(os.path.join(root, top))]
    folders = {name for top in tops for name in os.listdir(os.path.join(root, top))
               if os.path.isdir(os.path.join(root, top, name))}
    for path in sources.paths(root, sources.CPP):
        text = sources.read(root, path)
        if room_of(path, rooms) is None:
            broken.append(f"{path}:1: the folder {os.path.dirname(path) or '.'} is missing in rooms.toml")
            continue
        found[path] = []
        for include in INCLUDE.finditer(text):
            mark, target = include.groups()
            if mark == "<" and (target.split("/")[0] not in folders or "/" not in target):
                continue  # a library outside the project
            place = f"{path}:{sources.line_of(text, include.start(1))}"
            target = next((path for path in (os.path.join(top, target) for top in tops)
                           if os.path.isfile(os.path.join(root, path))), target)
            room = generated.get(target) or room_of(target, rooms)
            if room is None:
                broken.append(f'{place}: "{target}" belongs to no room of rooms.toml')
            else:
                found[path].append((place, target, room))
    return found


def reached(path, found, known):
    """The rooms that a file sees, also through the headers that it includes."""
    if path not in known:
        known[path] = set()
        for _, target, room in found.get(path, ()):
            known[path] |= {room} | reached(target, found, known)
    return known[path]


def circle(arrows):
    """The rooms of a circle, in order, or []."""
    try:
        graphlib.TopologicalSorter(arrows).prepare()
        return []
    except graphlib.CycleError as error:
        return error.args[1][::-1]


def check(root, rooms, roots, generated):
    broken, known, used = [], {}, set()
    found = includes(root, rooms, roots, generated, broken)
    for path, rows in found.items():
        room = room_of(path, rooms)
        for place, target, seen in rows:
            used.add((room, seen))
            refused = [] if seen in (room, *rooms[room]["sees"]) else [f"includes {seen}"]
            for never in rooms[room].get("never", ()):
                if seen != room and never in reached(target, found, known):
                    refused.append(f"reaches {never} through {target}")
            broken += [f"{place}: room {room} {what}, which rooms.toml does not allow" for what in refused]
    for room, data in rooms.items():
        if not os.path.isdir(os.path.join(root, room)):
            broken.append(f"rooms.toml: room {room} is missing in the tree")
        for seen in data["sees"]:
            if (room, seen) not in used:
                broken.append(f"rooms.toml: room {room} may see {seen}, but no file of it includes {seen}")
            if data.get("controller") and not rooms[seen].get("controller"):
                broken.append(f"rooms.toml: room {room} runs on the controller and must not see {seen}, which does not")
    if names := circle({room: data["sees"] for room, data in rooms.items()}):
        broken.append("rooms.toml: a circle: " + " -> ".join(names))
    elif names := circle(floors_of(rooms)):
        broken.append("rooms.toml: a circle of rooms with their parts: " + " -> ".join(names))
    return broken, sorted(arrow for arrow in used if arrow[0] != arrow[1])


def floors_of(rooms):
    """{room: set of rooms that it or a part of it sees}"""
    arrows = {}
    for room, data in rooms.items():
        name = whole(room, rooms)
        seen = {whole(seen, rooms) for seen in data["sees"]}
        arrows.setdefault(name, set()).update(seen - {name})
    return arrows


def shown(room, roots):
    """The name by which a room is included."""
    return next((room[len(top) + 1:] for top in roots if room.startswith(top + "/")), room)


def drawing(rooms, roots):
    """The rooms by floor. Each room sees only rooms of lower floors."""
    arrows, floor = floors_of(rooms), {}
    for room in graphlib.TopologicalSorter(arrows).static_order():
        floor[room] = 1 + max((floor[seen] for seen in arrows[room]), default=-1)
    seen_by_others = set().union(*arrows.values())
    drawn = sorted(room for room in arrows if room != "tests" and (arrows[room] or room in seen_by_others))
    rows = [("floor", "on the controller", "only on the host")]
    for number in range(max(floor[room] for room in drawn), -1, -1):
        here = sorted((room for room in drawn if floor[room] == number), key=lambda room: shown(room, roots))
        sides = ["  ".join(shown(r, roots) for r in here if rooms[r].get("controller", False) is side)
                 for side in (True, False)]
        rows.append((str(number), *sides))
    width = 2 + max(len(row[1]) for row in rows)
    return "\n".join(f"{row[0]:>5}  {row[1]:<{width}}{row[2]}".rstrip() for row in rows)


def main():
    options = sources.options("Checks that each room includes only what rooms.toml allows.")
    options.add_argument("--rooms", help="another rooms.toml (default: ROOT/checks/rooms.toml)")
    options.add_argument("--draw", action="store_true", help="print the rooms by floor and check nothing")
    options.add_argument("--found", action="store_true", help="print what each room includes, as lines for rooms.toml")
    given = options.parse_args()
    try:
        with open(given.rooms or os.path.join(given.root, "checks/rooms.toml"), "rb") as file:
            data = tomllib.load(file)
        rooms, roots, generated = data["room"], data.get("include_roots", []), data.get("generated", {})
        for room, entry in rooms.items():
            if unknown := [name for name in entry.setdefault("sees", []) if name not in rooms]:
                raise ValueError(f"room {room} names {unknown[0]}, which is not a room")
            whole(room, rooms)
        if given.draw:
            print(drawing(rooms, roots))
            return 0
    except (OSError, KeyError, ValueError) as error:
        print(f"rooms.toml: {error}", file=sys.stderr)
        return 2
    broken, found = check(given.root, rooms, roots, generated)
    if given.found:
        for room in sorted(rooms):
            print(f'[room."{room}"]\nsees = {sorted(seen for r, seen in found if r == room)}'.replace("'", '"'))
        return 0
    print("\n".join(broken + [f"arrows: {len(rooms)} rooms, {len(found)} arrows, {len(broken)} faults"]))
    return 1 if broken else 0


if __name__ == "__main__":
    sys.exit(main())
