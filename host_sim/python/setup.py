"""Builds the module with the project's CMake. pip runs it; see README.md."""
import os
import pathlib
import re
import shlex
import subprocess
import sys

from setuptools import Extension, setup
from setuptools.command.build_ext import build_ext

HERE = pathlib.Path(__file__).resolve().parent
ROOT = HERE.parents[1]
VERSION = re.search(r"project\(greybox_bms VERSION ([0-9.]+)", (ROOT / "CMakeLists.txt").read_text())[1]


class CMakeBuild(build_ext):
    def build_extension(self, ext):
        build = pathlib.Path(self.build_temp).resolve()
        build.mkdir(parents=True, exist_ok=True)
        generator = ["-G", "Ninja"] if self.has("ninja") else []
        self.run_step(["cmake", "-S", ROOT, "-B", build, *generator, "-DBMS_PYTHON_MODULE=ON", "-DBMS_TESTS=OFF",
                       "-DCMAKE_BUILD_TYPE=Release", "-DCMAKE_CXX_FLAGS_RELEASE=-O2 -DNDEBUG",
                       f"-DPython3_EXECUTABLE={sys.executable}", *shlex.split(os.environ.get("CMAKE_ARGS", ""))])
        jobs = os.environ.get("CMAKE_BUILD_PARALLEL_LEVEL") or str(os.cpu_count() or 1)
        self.run_step(["cmake", "--build", build, "--target", "bms_python", "--parallel", jobs])
        target = pathlib.Path(self.get_ext_fullpath(ext.name)).resolve()
        target.parent.mkdir(parents=True, exist_ok=True)
        built = next((build / "python" / "greybox_bms").glob("_core*.so"))
        self.run_step(["cmake", "-E", "copy", built, target])

    @staticmethod
    def has(program):
        return subprocess.run(["sh", "-c", f"command -v {program}"], capture_output=True, check=False).returncode == 0

    @staticmethod
    def run_step(command):
        subprocess.run([str(part) for part in command], check=True)


setup(version=VERSION, packages=["greybox", "greybox_bms"], package_data={"greybox_bms": ["*.pyi", "py.typed"]},
      ext_modules=[Extension("greybox_bms._core", [])], cmdclass={"build_ext": CMakeBuild}, zip_safe=False)
