"""Writes the bill of materials of one image (CycloneDX 1.5, JSON): what was linked, according to the linker's map. The
file NAME.cdx.json lies next to the image.

    sbom.py NAME VERSION COMPILER CELL.toml IMAGE.map IMAGE.elf

The headers of the libraries and the cell file (as constants) are part of the image, too. The same inputs give the same
bytes: no time, no serial number, no folder.
"""
import hashlib
import json
import os
import re
import subprocess
import sys

GCC = [{"expression": "GPL-3.0-or-later WITH GCC-exception-3.1"}]
NEWLIB = [{"license": {"name": "newlib: BSD-3-Clause, BSD-2-Clause and the like, file by file (COPYING.NEWLIB)"}}]
LIBRARIES = {"gcc": ("libgcc", GCC), "stdc++": ("libstdc++", GCC), "c": ("newlib", NEWLIB), "g": ("newlib", NEWLIB),
             "m": ("newlib", NEWLIB), "nosys": ("newlib", NEWLIB)}


def sha256(path):
    with open(path, "rb") as f:
        return [{"alg": "SHA-256", "content": hashlib.sha256(f.read()).hexdigest()}]


def output(*command, given=""):
    return subprocess.run(command, input=given, stdout=subprocess.PIPE, check=True, text=True).stdout


def linked(map_file):
    """Archives with their linked members, and the sources of the project's own objects."""
    with open(map_file) as f:
        text = f.read()
    included = text[: text.find("Discarded input sections")] if "Discarded input sections" in text else text
    archives = {}
    for path, member in re.findall(r"^(/\S+\.a)\(([^)]+)\)$", included, re.M):
        archives.setdefault(os.path.normpath(path), set()).add(member)
    return archives, sorted(set(re.findall(r"^LOAD (?:\S*/)?CMakeFiles/[^/]*\.dir/(\S+)\.obj?$", text, re.M)))


def versions(compiler):
    gcc = output(compiler, "-dumpfullversion").strip()
    asked = "#include <_newlib_version.h>\n_NEWLIB_VERSION\n"
    newlib = re.search(r'"(.+?)"', output(compiler, "-E", "-P", "-x", "c", "-", given=asked)).group(1)
    linker = output(output(compiler, "-print-prog-name=ld").strip(), "--version").split("\n")[0]
    return {"libgcc": gcc, "libstdc++": gcc, "newlib": newlib,
            "linker": re.search(r"([0-9]+(?:\.[0-9]+)+)", linker).group(1)}


def components_of(archives, versions_of, cell, image):
    """The cell file, the headers and each linked library."""
    components = [
        {"type": "data", "bom-ref": "cell-file", "name": "cell file", "hashes": sha256(cell),
         "data": [{"type": "configuration"}]},
        {"type": "library", "bom-ref": "libstdc++-headers", "name": "libstdc++", "version": versions_of["libstdc++"],
         "description": "headers: templates and inline functions", "licenses": GCC},
    ]
    for path in sorted(archives, key=os.path.basename):
        file = os.path.basename(path)
        key = re.sub(r"_nano$", "", file.removeprefix("lib").removesuffix(".a"))
        if key not in LIBRARIES:
            raise SystemExit(f"{file} is linked into {image}, but cmake/sbom.py has no entry for it")
        library, licences = LIBRARIES[key]
        components.append({"type": "library", "bom-ref": file, "name": library, "version": versions_of[library],
                           "description": file, "hashes": sha256(path), "licenses": licences,
                           "properties": [{"name": "linked", "value": member} for member in sorted(archives[path])]})
    return components


def main():
    name, version, compiler, cell, map_file, image = sys.argv[1:]
    archives, own_sources = linked(map_file)
    of = versions(compiler)
    components = components_of(archives, of, cell, image)
    bom = {
        "bomFormat": "CycloneDX", "specVersion": "1.5", "version": 1,
        "metadata": {
            "tools": {"components": [
                {"type": "application", "name": os.path.basename(compiler), "version": of["libgcc"]},
                {"type": "application", "name": "ld", "version": of["linker"]}]},
            "component": {
                "type": "firmware", "bom-ref": name, "name": name, "version": version, "hashes": sha256(image),
                "licenses": [{"license": {"id": "MIT"}}],
                "properties": [{"name": "linked", "value": source} for source in own_sources]}},
        "components": components,
        "dependencies": [{"ref": name, "dependsOn": [c["bom-ref"] for c in components]}]
        + [{"ref": c["bom-ref"]} for c in components],
    }
    with open(os.path.splitext(image)[0] + ".cdx.json", "w") as out:
        json.dump(bom, out, indent=1)
        out.write("\n")


main()
