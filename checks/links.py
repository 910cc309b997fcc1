#!/usr/bin/env python3
"""Refuses a relative link in a Markdown file that leads nowhere: checks/links.py [--root FOLDER]

A link is `[text](path)` or `[text](path#heading)`; the path must exist, and the heading must be one of the target's (in
GitHub's form: lower case, words joined by hyphens). Links with a scheme (https:) are not looked at. Exit code: 0 no
fault, 1 faults.
"""
import argparse
import re
import subprocess
import sys
from pathlib import Path

LINK = re.compile(r"\]\(([^)\s]+)\)")


def anchors(page: Path) -> set[str]:
    """Headings of a page as GitHub links them."""
    found = set()
    for line in page.read_text(encoding="utf-8").splitlines():
        if heading := re.match(r"#+ +(.*)", line):
            text = re.sub(r"\[([^\]]*)\]\([^)]*\)|[`*]", r"\1", heading.group(1)).strip().lower()
            found.add(re.sub(r"[^\w\- ]", "", text).replace(" ", "-"))
    return found


def faults(root: Path):
    command = ["git", "ls-files", "-co", "--exclude-standard", "*.md"]
    listed = subprocess.run(command, cwd=root, capture_output=True, text=True)
    pages = [root / name for name in listed.stdout.split()] or sorted(root.rglob("*.md"))
    for page in pages:
        if not page.exists():
            continue
        for number, line in enumerate(page.read_text(encoding="utf-8").splitlines(), 1):
            for link in LINK.findall(line):
                if re.match(r"[a-z]+:", link):
                    continue
                path, _, anchor = link.partition("#")
                target = (page.parent / path) if path else page
                if not target.exists():
                    yield f"{page.relative_to(root)}:{number}: {link} does not exist"
                elif anchor and target.suffix == ".md" and anchor not in anchors(target):
                    yield f"{page.relative_to(root)}:{number}: {path or 'this page'} has no heading #{anchor}"


def main() -> int:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--root", type=Path, default=Path(__file__).resolve().parent.parent)
    found = list(faults(parser.parse_args().root))
    print("\n".join(found) if found else "links: no fault")
    return 1 if found else 0


if __name__ == "__main__":
    sys.exit(main())
