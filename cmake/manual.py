#!/usr/bin/python3
"""Writes the man pages of bms and its completions for bash, zsh and fish, from the texts of --help.

    manual.py BMS VERSION FOLDER

Writes FOLDER/man/bms.1, bms-replay.1 and so on, and FOLDER/completions/bms.bash, _bms, bms.fish.
"""
import pathlib
import re
import subprocess
import sys

COLUMN = 30  # where the help starts its texts


class Option:
    def __init__(self, head):
        words = head.split(" ")
        self.names, self.value, self.text = words[0].split(","), "", []
        self.rest = re.sub(r" ?(Excludes|Needs): .*", "", " ".join(words[1:]))
        if found := re.match(r"([A-Za-z0-9_.:=<>,]*?)(:\{([^}]*)\})?(=\S+)?( |$|:)", self.rest):
            self.value = found[1] or "VALUE" if self.rest else ""
            self.choices = (found[3] or "").split(",") if found[3] else []
        else:
            self.value, self.choices = self.rest, []

    @property
    def help(self):
        return " ".join(self.text)

    def is_flag(self):
        return not self.rest

    def values(self):
        """What can stand after it, or None for a file."""
        if self.choices:
            return self.choices
        if found := re.search(r"name of a built-in cell: ([\w, ]+)", self.help):
            return found[1].split(", ")
        return None


class Page:
    """The help of one command, in parts."""

    def __init__(self, text):
        self.about, self.usage, self.footer, self.groups = "", "", [], []
        items = None
        lines = text.rstrip().splitlines()
        for line, following in zip(lines, [*lines[1:], ""]):
            if not self.usage and not line.startswith("Usage: "):
                self.about += line
            elif line.startswith("Usage: "):
                self.usage = line[len("Usage: "):]
            elif re.match(r"\S.*:$", line):
                items = []
                self.groups.append((line[:-1], items))
            elif line.startswith(" " * COLUMN):
                items[-1].text.append(line.strip())
            elif line.startswith("  "):
                long = following.startswith(" " * COLUMN) or len(line) <= COLUMN  # the text is on the next line
                items.append(Option(line[2:].rstrip() if long else line[2:COLUMN].rstrip()))
                if not long:
                    items[-1].text.append(line[COLUMN:].strip())
            elif line:
                self.footer.append(line)

    def options(self):
        return [o for _, items in self.groups for o in items if o.names[0].startswith("-")]

    def words(self):
        """Choices of the first positional argument."""
        for heading, items in self.groups:
            if heading == "Positionals" and items:
                return items[0].choices
        return []


def help_of(bms, *command):
    return Page(subprocess.run([bms, *command, "--help"], capture_output=True, text=True, check=True).stdout)


def roff(text):
    text = text.replace("\\", "\\e").replace("-", "\\-")
    return re.sub(r"^([.'])", r"\\&\1", text, flags=re.M)


def man_page(name, version, page, commands=()):
    title = name.upper()
    lines = [f'.TH {title} 1 "" "greybox\\-bms {version}" "greybox\\-bms"', ".SH NAME",
             f"{roff(name)} \\- {roff(page.about)}", ".SH SYNOPSIS", f"{roff(page.usage)}"]
    for heading, items in page.groups:
        if heading == "Subcommands":
            continue
        lines.append(".SH " + roff({"Positionals": "ARGUMENTS"}.get(heading, heading.upper())))
        for option in items:
            head = ", ".join(option.names) + (" " + option.rest if option.rest else "")
            lines += [".TP", f".B {roff(head)}", roff(option.help) or "\\&"]
    if commands:
        lines.append(".SH COMMANDS")
        for command, about in commands:
            lines += [".TP", f".BR bms\\-{command} (1)", roff(about)]
    for line in page.footer:
        if line.startswith("Example: "):
            lines += [".SH EXAMPLE", ".nf", roff(line[len("Example: "):]), ".fi"]
        else:
            lines += [".PP", roff(line)]
    lines += [".SH EXIT STATUS",
              "0 done; 1 done, and the answer is no; 2 bad usage or bad input; 3 a fault of the tool"]
    if not commands:
        lines += [".SH SEE ALSO", ".BR bms (1)"]
    return "\n".join(lines) + "\n"


def bash(pages):
    cases = []
    for command, page in pages.items():
        values = [f"        {'|'.join(o.names)}) words='{' '.join(o.values())}'{'' if o.choices else '; files=1'} ;;"
                  for o in page.options() if o.values()]
        plain = [n for o in page.options() if not o.is_flag() and not o.values() for n in o.names]
        if plain:
            values.append(f"        {'|'.join(plain)}) files=1 ;;")
        names = " ".join(n for o in page.options() for n in o.names)
        first = " ".join(page.words())
        cases.append("\n".join([f"    {command})", '      case "$previous" in', *values,
                                f"        {command}) words='{first} {names}'; files=1 ;;",
                                f"        *) words='{names}'; files=1 ;;", "      esac ;;"]))
    return f"""# bash completion of bms, made from its --help
_bms() {{
  local current=${{COMP_WORDS[COMP_CWORD]}} previous=${{COMP_WORDS[COMP_CWORD - 1]}} words='' files=''
  if [ "$COMP_CWORD" -eq 1 ]; then
    COMPREPLY=($(compgen -W '{' '.join(pages)} --help --version' -- "$current"))
    return
  fi
  case "${{COMP_WORDS[1]}}" in
{chr(10).join(cases)}
  esac
  COMPREPLY=($(compgen -W "$words" -- "$current"))
  case "$current" in -*) files='' ;; esac
  if [ -n "$files" ]; then
    local IFS=$'\\n'
    COMPREPLY+=($(compgen -f -- "$current"))
  fi
}}
complete -o filenames -F _bms bms
"""


def quoted(text):
    return text.replace("'", "")


def zsh(pages, about):
    cases = []
    for command, page in pages.items():
        specs = []
        for option in page.options():
            text = re.sub(r"([\[\]:\\])", r"\\\1", quoted(option.help))
            action = ""
            if not option.is_flag():
                values = option.values()
                action = f":value:({' '.join(values)})" if values else ":file:_files"
            specs += [f"        '*{name}[{text}]{action}'" for name in option.names]
        first = f"'1:action:({' '.join(page.words())})' '*:file:_files'" if page.words() else "'*:file:_files'"
        arguments = " \\\n".join(["      _arguments", *specs, f"        {first}"])
        cases.append(f"    {command})\n{arguments} ;;")
    names = "\n".join(f"    '{c}:{quoted(text)}'" for c, text in about)
    return f"""#compdef bms
# zsh completion of bms, made from its --help
_bms() {{
  local -a commands=(
{names}
  )
  if (( CURRENT == 2 )); then
    _describe command commands
    return
  fi
  local command=$words[2]
  shift words
  (( CURRENT-- ))
  case $command in
{chr(10).join(cases)}
  esac
}}
_bms "$@"
"""


def fish(pages, about):
    lines = ["# fish completion of bms, made from its --help"]
    for command, text in about:
        lines.append(f"complete -c bms -n __fish_use_subcommand -f -a {command} -d '{quoted(text)}'")
    for command, page in pages.items():
        seen = f"complete -c bms -n '__fish_seen_subcommand_from {command}'"
        if page.words():
            lines.append(f"{seen} -a '{' '.join(page.words())}'")
        for option in page.options():
            names = " ".join(f"-l {n[2:]}" if n.startswith("--") else f"-s {n[1:]}" for n in option.names)
            values = "" if option.is_flag() else " -r"
            if option.values():
                values += f" -a '{' '.join(option.values())}'"
            lines.append(f"{seen} {names}{values} -d '{quoted(option.help)}'")
    return "\n".join(lines) + "\n"


def main():
    bms, version, folder = sys.argv[1], sys.argv[2], pathlib.Path(sys.argv[3])
    (folder / "man").mkdir(parents=True, exist_ok=True)
    (folder / "completions").mkdir(exist_ok=True)
    top = help_of(bms)
    about = [(o.names[0], o.help) for heading, items in top.groups if heading == "Subcommands" for o in items]
    pages = {command: help_of(bms, command) for command, _ in about}
    (folder / "man/bms.1").write_text(man_page("bms", version, top, about))
    for command, page in pages.items():
        (folder / f"man/bms-{command}.1").write_text(man_page(f"bms-{command}", version, page))
    (folder / "completions/bms.bash").write_text(bash(pages))
    (folder / "completions/_bms").write_text(zsh(pages, about))
    (folder / "completions/bms.fish").write_text(fish(pages, about))
    return 0


if __name__ == "__main__":
    sys.exit(main())
