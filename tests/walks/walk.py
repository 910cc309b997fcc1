"""What a walk is made of: commands as a user types them, what he must and must not see, and the page with all of it."""
import gzip
import json
import os
import pathlib
import re
import shutil
import signal
import subprocess
import tempfile
import time

ROOT = pathlib.Path(__file__).resolve().parents[2]
MOST_LINES, MOST_WIDTH = 14, 240  # of an output on the page


class Walk:
    """One person's first minutes, in a folder of his own. Expectations are counted, and none ends the walk."""

    def __init__(self, tool, who, goal):
        self.tool, self.who, self.goal = str(pathlib.Path(tool).resolve()), who, goal
        self.folder = pathlib.Path(tempfile.mkdtemp(prefix="walk."))
        os.symlink(ROOT / "evidence", self.folder / "evidence")
        self.steps, self.failed, self.output, self.status = [], 0, "", None

    def close(self):
        shutil.rmtree(self.folder)

    # --- what the person does

    def does(self, text):
        """A step that is not a command: "cuts the first hour out"."""
        self.steps.append({"text": text, "expected": []})

    def runs(self, command, interrupt_at_cpu_s=None):
        """command: as typed in a shell; `bms` is the tool. Its exit status and all it prints are what is seen next."""
        environment = dict(os.environ, BMS_PROGRESS="off", LC_ALL="C.UTF-8")
        arguments = [self.tool if word == "bms" else word for word in command.split()]
        begin = time.monotonic()
        process = subprocess.Popen(arguments, cwd=self.folder, env=environment, stdout=subprocess.PIPE,
                                   stderr=subprocess.STDOUT, text=True)
        if interrupt_at_cpu_s is not None:
            while process.poll() is None and cpu_seconds(process.pid) < interrupt_at_cpu_s:
                time.sleep(0.02)
            process.send_signal(signal.SIGINT)
            command += "   # and Ctrl-C"
        self.output = process.communicate(timeout=1200)[0].replace(str(self.folder) + "/", "")
        self.status = process.returncode
        self.steps.append({"command": command, "status": self.status, "output": self.output, "expected": [],
                           "seconds": time.monotonic() - begin})

    def writes(self, name, text):
        (self.folder / name).write_text(text)

    def cuts(self, source, name, seconds, change=lambda row: row):
        """The first seconds of a CSV file. change: of a row as a dictionary of texts."""
        lines = self.text(source).splitlines()
        head = next(k for k, line in enumerate(lines) if not line.startswith("#"))
        columns = lines[head].split(",")
        rows = []
        for line in lines[head + 1:]:
            row = dict(zip(columns, line.split(",")))
            if float(row["time_s"]) >= seconds:
                break
            rows.append(change(row))
        columns = list(rows[0])
        self.writes(name, "\n".join([",".join(columns)] + [",".join(row[c] for c in columns) for row in rows]) + "\n")

    # --- what he has to see

    def expects(self, text, holds):
        self.steps[-1]["expected"].append((text, bool(holds)))
        self.failed += not holds

    def exits(self, status):
        self.expects(f"exit status {status}", self.status == status)

    def sees(self, pattern):
        self.expects(f"sees `{pattern}`", re.search(pattern, self.output))

    def does_not_see(self, pattern):
        self.expects(f"does not see `{pattern}`", not re.search(pattern, self.output))

    def number(self, name, value, expected, tolerance):
        """value: a function that reads it, as a missing one is a failed expectation."""
        try:
            found = float(value())
        except (KeyError, IndexError, TypeError, ValueError, OSError, AttributeError) as error:
            return self.expects(f"{name} is {expected:g} ± {tolerance:g}, not missing ({error!r})", False)
        return self.expects(f"{name} is {expected:g} ± {tolerance:g}: {found:.4g}", abs(found - expected) <= tolerance)

    def text(self, name):
        raw = (self.folder / name).read_bytes()
        return (gzip.decompress(raw) if raw[:2] == b"\x1f\x8b" else raw).decode()

    def json(self, name):
        return json.loads(self.text(name))

    def has(self, name):
        return (self.folder / name).exists()

    # --- the page

    def page(self, number):
        lines = [f"## {number}. {self.who}", "", self.goal, ""]
        for step in self.steps:
            if "text" in step:
                lines += [f"*{step['text']}*", ""]
            else:
                lines += ["```", "$ " + step["command"]] + shortened(step["output"]) + ["```", ""]
            lines += [f"* {'' if good else '**FAILED:** '}{text}" for text, good in step["expected"]]
            lines += [""] if step["expected"] else []
        return lines


def cpu_seconds(pid):
    """What a process has computed, which does not depend on the load of the machine."""
    with open(f"/proc/{pid}/stat", encoding="ascii") as stat:
        user, system = stat.read().rsplit(")", 1)[1].split()[11:13]
    return (int(user) + int(system)) / os.sysconf("SC_CLK_TCK")


def shortened(output):
    lines = [line.rstrip() for line in output.splitlines()]
    lines = [line if len(line) <= MOST_WIDTH else line[:MOST_WIDTH - 4] + " ..." for line in lines]
    if len(lines) > MOST_LINES:
        lines = lines[:MOST_LINES - 1] + [f"... {len(lines) - MOST_LINES + 1} more lines"]
    return lines
