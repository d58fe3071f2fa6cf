"""What the installed wheel needs of a system."""

import platform
import re
import subprocess
from importlib import metadata

import kdray

LIBRARIES_OF_GLIBC = r"ld-linux-.*|lib(c|dl|m|pthread|rt)\.so\.\d"


def readelf(option: str, module: str) -> str:
    command = ["readelf", "--wide", option, module]
    return subprocess.run(command, check=True, capture_output=True, text=True).stdout


def needed_glibc(module: str) -> tuple[int, ...]:
    """The newest version of glibc whose symbols a module needs."""
    versions = re.findall(r"Name: GLIBC_([\d.]+)", readelf("--version-info", module))
    return max(tuple(map(int, version.split("."))) for version in versions)


def test_module_needs_no_newer_glibc_than_its_tag_says():
    tag = re.search("^Tag: (.*)$", metadata.distribution("kdray").read_text("WHEEL"), re.MULTILINE)[1]
    assert tag == f"cp311-abi3-manylinux_2_28_{platform.machine()}"
    module = kdray._kdray.__file__
    assert needed_glibc(module) <= (2, 28)
    libraries = re.findall(r"Shared library: \[(.*)\]", readelf("--dynamic", module))
    assert [name for name in libraries if not re.fullmatch(LIBRARIES_OF_GLIBC, name)] == []
