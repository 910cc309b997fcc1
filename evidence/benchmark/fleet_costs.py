#!/usr/bin/env python3
"""Measures what bms fleet costs next to its task: overhead of a recording, memory, a large report page.

  fleet_costs.py TOOL MAKE_DEPOT [--units 10000] [--readme FILE]

TOOL: bms. MAKE_DEPOT: the program that writes a depot. Overhead and memory are those of bms fleet itself, as the kernel
counts them; its units are the task. The page has 24,000 recordings: the rows of a small depot, repeated; its cost in a
headless browser is that above an empty page.
"""
import argparse
import os
import pathlib
import shutil
import sqlite3
import subprocess
import sys
import tempfile
import time

import depots

ROWS = 60  # of a small recording
IDLE = 0.5  # load average below which wall times mean something


def processor_s(command):
    """User and system time of a command and of all that it has waited for, and wall time."""
    began, wall = os.times(), time.monotonic()
    done = subprocess.run([str(c) for c in command], capture_output=True, text=True, check=False)
    if done.returncode not in (0, 1):
        sys.exit(f"{' '.join(map(str, command))}\n{done.stderr}")
    ended = os.times()
    used = ended.children_user + ended.children_system - began.children_user - began.children_system
    return used, time.monotonic() - wall


def write_recordings(folder, count, with_rows):
    """Small recordings of a cell table9, and their manifest. Those without rows are refused, each with its error."""
    folder.mkdir()
    names = []
    for n in range(count):
        names.append(f"r{n}.csv")
        if n >= with_rows:
            (folder / names[-1]).touch()
            continue
        rows = [f"{k},{0 if k < 20 else -1 - (k // 10 + n) % 4},{3.32 - 0.001 * (k % 7)}" for k in range(ROWS)]
        (folder / names[-1]).write_text("time_s,current_a,voltage_v\n" + "\n".join(rows) + "\n", encoding="utf-8")
    (folder / "depot.csv").write_text("recording,cell\n" + "".join(f"{name},table9\n" for name in names),
                                      encoding="utf-8")


def fleet_command(tool, folder, out, jobs):
    return [tool, "fleet", "run", "--manifest", folder / "depot.csv", "--task", "replay", "--pages", "none", "--jobs",
            jobs, "--out", out]


def own_ticks(process):
    """Processor time of a process without those that it has started, in clock ticks; 0 once it has ended."""
    try:
        fields = pathlib.Path(f"/proc/{process}/stat").read_text(encoding="utf-8").rpartition(")")[2].split()
    except OSError:
        return 0
    return int(fields[11]) + int(fields[12])


def overhead_ms(tool, folder, count):
    """Processor time of bms fleet run itself for a recording; its units are the task."""
    write_recordings(folder, count, count)
    most = 0
    with subprocess.Popen([str(c) for c in fleet_command(tool, folder, folder / "out", 1)], stdout=subprocess.DEVNULL,
                          stderr=subprocess.DEVNULL) as process:
        while process.poll() is None:
            most = max(most, own_ticks(process.pid))
            time.sleep(0.005)
    return 1e3 * most / os.sysconf("SC_CLK_TCK") / count


def largest_memory_kb(command):
    """Of the process itself, without its units."""
    most = 0
    with subprocess.Popen([str(c) for c in command], stdout=subprocess.DEVNULL, stderr=subprocess.PIPE) as process:
        status = pathlib.Path(f"/proc/{process.pid}/status")
        while process.poll() is None:
            lines = [line for line in status.read_text(encoding="utf-8").splitlines() if line.startswith("VmHWM:")]
            most = max([most] + [int(line.split()[1]) for line in lines])
            time.sleep(0.01)
        if process.returncode != 0:
            sys.exit(process.stderr.read().decode())
    return most


def speed_up(tool, make_depot, folder, load):
    """Wall time of a depot on one processor over that on two, a recording on each. load: before all measurements."""
    if load > IDLE:
        return f"not measured: other programs use the processors (load {load:.0f})"
    depots.run(make_depot, folder, "--trucks", 5, "--cells", 4, "--days", 12, "--hours", 1, "--step", 5)
    every, wall_s = os.sched_getaffinity(0), []
    for count in (1, 2):
        os.sched_setaffinity(0, sorted(every)[:count])
        wall_s.append(processor_s([tool, "fleet", "run", "--manifest", folder / "manifest.csv", "--task", "diagnose",
                                   "--pages", "none", "--jobs", count, "--out", folder / f"jobs_{count}"])[1])
    os.sched_setaffinity(0, every)
    return f"{wall_s[0] / wall_s[1]:.2f}"


def page_of(tool, make_depot, folder):
    """A report of 50 trucks x 16 cells x 30 days, and the processor time that it takes to write."""
    depots.run(make_depot, folder, "--trucks", 5, "--cells", 4, "--days", 3, "--hours", 1, "--step", 5)
    out = folder / "out"
    depots.run(tool, "fleet", "run", "--manifest", folder / "manifest.csv", "--task", "diagnose", "--out", out)
    with sqlite3.connect(out / "fleet.sqlite") as table:
        table.executescript("CREATE TABLE few AS SELECT * FROM fleet; DELETE FROM fleet;")
        cells = table.execute("SELECT DISTINCT truck, cell_index FROM few").fetchall()
        names = [column[1] for column in table.execute("PRAGMA table_info(few)")]
        values = ", ".join({"truck": "?", "cell_index": "?", "started_at": "? || substr(started_at, 11)"}.get(n, n)
                           for n in names)
        for n in range(50 * 16):
            truck, cell = cells[n % len(cells)]
            for day in range(30):
                table.execute(f"INSERT INTO fleet SELECT {values} FROM few WHERE truck = ? AND cell_index = ? AND "
                              "started_at LIKE ?",
                              (f"truck_{n // 16 + 1:02}", str(n % 16 + 1), f"2026-03-{day + 1:02}", truck, cell,
                               f"2026-03-0{5 + day % 3}%"))
        (count,) = table.execute("SELECT count(*) FROM fleet WHERE kind = 'verdict'").fetchone()
        table.execute("DROP TABLE few")
    if count != 24_000:
        sys.exit(f"the table has {count} recordings, expected 24000")
    page = folder / "page.html"
    used, _ = processor_s([tool, "fleet", "report", out, "--report", page, "--quiet"])
    return page, used


def session_ticks(session):
    """Processor time of each process of a session, in clock ticks."""
    ticks = {}
    for entry in pathlib.Path("/proc").iterdir():
        if not entry.name.isdigit():
            continue
        try:
            fields = (entry / "stat").read_text(encoding="utf-8").rpartition(")")[2].split()
        except OSError:
            continue  # has just ended
        if int(fields[3]) == session:
            ticks[entry.name] = int(fields[11]) + int(fields[12])
    return ticks


def browser_s(page, folder, shot=None):
    """Processor time of a headless browser that opens a page, draws it and ends. Its processes do not all wait for
    each other, so they are sampled."""
    shutil.rmtree(folder / "profile", ignore_errors=True)
    what = [f"--screenshot={shot}"] if shot else ["--dump-dom"]
    command = ["chromium", "--headless", "--no-sandbox", "--disable-gpu", "--disable-quic", "--no-first-run",
               "--disable-background-networking", "--disable-component-update", "--disable-sync",
               "--window-size=1400,1400", f"--user-data-dir={folder / 'profile'}", *what, f"file://{page}"]
    most = {}
    with subprocess.Popen(command, stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL,
                          start_new_session=True) as browser:
        while browser.poll() is None:
            for process, ticks in session_ticks(browser.pid).items():
                most[process] = max(most.get(process, 0), ticks)
            time.sleep(0.02)
    return sum(most.values()) / os.sysconf("SC_CLK_TCK")


def page_row(o, folder):
    page, writing_s = page_of(o.tool, o.make_depot, folder / "page")
    empty = folder / "empty.html"
    empty.write_text("<!doctype html><title>empty</title>", encoding="utf-8")
    without = min(browser_s(empty, folder) for _ in range(3))
    with_page = min(browser_s(page, folder) for _ in range(3))
    if o.screenshot:
        browser_s(page, folder, o.screenshot)
    return (f"page of 24,000 recordings ({page.stat().st_size / 1e6:.1f} MB), in a headless browser above an empty one",
            "<= 3 s", f"{with_page - without:.1f} s; writing it {writing_s:.1f} s")


def main():
    p = argparse.ArgumentParser(description="Measures what bms fleet costs next to its task")
    p.add_argument("tool", type=os.path.abspath)
    p.add_argument("make_depot", type=os.path.abspath)
    p.add_argument("--units", type=int, default=10_000)
    p.add_argument("--screenshot", type=pathlib.Path, help="of the page, as PNG")
    p.add_argument("--readme", type=pathlib.Path, help="write the table between '<!-- figures: costs -->' and its end")
    o = p.parse_args()
    load = os.getloadavg()[0]
    with tempfile.TemporaryDirectory() as own:
        folder = pathlib.Path(own)
        rows = [page_row(o, folder)]
        rows.append(("wall time of 240 recordings on one processor, over that on two", ">= 1.8",
                     speed_up(o.tool, o.make_depot, folder / "speed_up", load)))
        rows.append(("overhead of a recording next to its task", "<= 20 ms",
                     f"{overhead_ms(o.tool, folder / 'overhead', 200):.1f} ms"))
        write_recordings(folder / "few", 100, 50)
        write_recordings(folder / "many", o.units, 50)
        few = largest_memory_kb(fleet_command(o.tool, folder / "few", folder / "few_out", 2))
        many = largest_memory_kb(fleet_command(o.tool, folder / "many", folder / "many_out", 2))
        rows.append((f"memory with {o.units:,} recordings, with 100", "does not grow",
                     f"{many / 1024:.1f} MB, {few / 1024:.1f} MB"))
    lines = ["| figure (processor time) | required | measured |", "|---|---|---|"]
    text = "\n".join(lines + [f"| {' | '.join(row)} |" for row in rows]) + "\n"
    print(text, end="")
    if o.readme:
        depots.write_readme(o.readme, text, "costs")


if __name__ == "__main__":
    main()
