"""Renders every mesh and scene file of a folder as a newcomer would, and shows all pictures on one sheet.

Needs from PyPI: pillow. Usage:

    python3 tests/long/gallery.py KDRAY FOLDER [-o SHEET.png] [--size WxH] [--seconds N] [-- OPTION...]

FOLDER and the folders in it are searched for .gltf, .glb, .obj, .ply, .stl and .toml files. Each is rendered by
`KDRAY render FILE` with nothing but the size and the options after `--`, such as `--cpu`. Below each picture stand the
file's name, the seconds that the command took, and what it warned of. A file that is refused, that crashes the command,
or that takes longer than N seconds (60) has the message in place of a picture. The command ends with an error if a file
crashed it or took too long: a refusal with one line is a right answer.
"""

import argparse
import subprocess
import sys
import tempfile
import textwrap
import time
from dataclasses import dataclass
from pathlib import Path

from PIL import Image, ImageDraw, ImageFont

ENDINGS = {".gltf", ".glb", ".obj", ".ply", ".stl", ".toml"}
COLUMNS = 4
LINES = 9
LINE_HEIGHT = 13
GREY, WHITE, YELLOW, RED = (48, 48, 52), (230, 230, 230), (200, 190, 140), (255, 150, 140)


@dataclass
class Outcome:
    """What a command made of a file. `picture` is None if there is none."""

    name: str
    seconds: float
    picture: Image.Image | None
    messages: list[str]
    is_fault: bool


def files_of(folder):
    """Returns the files of a folder and of the folders in it that kdray should open, sorted by path."""
    return sorted(path for path in folder.rglob("*") if path.suffix.lower() in ENDINGS and path.is_file())


def messages_of(stderr):
    """Returns the warnings, notes and errors among the lines that a command wrote."""
    marks = ("warning:", "error:", "note:", "panicked")
    return [line.strip() for line in stderr.splitlines() if any(mark in line for mark in marks)]


def render(kdray, path, name, size, seconds, options):
    """Renders a file by its defaults, and returns the outcome."""
    with tempfile.TemporaryDirectory() as folder:
        picture = Path(folder) / "picture.png"
        command = [kdray, "render", str(path.resolve()), "--size", size, "-o", str(picture), *options]
        start = time.monotonic()
        try:
            done = subprocess.run(
                command, capture_output=True, text=True, errors="replace", timeout=seconds, check=False
            )
        except subprocess.TimeoutExpired:
            return Outcome(name, seconds, None, [f"error: took more than {seconds} s"], True)
        took = time.monotonic() - start
        shown = Image.open(picture).convert("RGB") if picture.exists() else None
        # Rust ends with 101 after a panic. A negative code is a signal's.
        is_fault = done.returncode in (101, 134) or done.returncode < 0 or (done.returncode == 0 and shown is None)
        messages = messages_of(done.stderr) or ([] if shown else [f"error: exit code {done.returncode}"])
        return Outcome(name, took, shown, messages, is_fault)


def lines_of(outcome, width):
    """Returns the lines below a picture, each with its colour. `width`: the number of characters in a line."""
    lines = [(f"{outcome.name}  {outcome.seconds:.1f} s", WHITE)]
    for message in outcome.messages:
        colour = RED if "error" in message or "panicked" in message else YELLOW
        lines += [(line, colour) for line in textwrap.wrap(message, width)]
    return lines[:LINES]


def sheet_of(outcomes, size):
    """Returns the sheet of all outcomes, from left to right and from top to bottom."""
    font = ImageFont.load_default(size=11)
    width, height = size
    cell = (width + 8, height + LINES * LINE_HEIGHT + 12)
    n_rows = -(-len(outcomes) // COLUMNS)
    sheet = Image.new("RGB", (COLUMNS * cell[0], n_rows * cell[1]), GREY)
    draw = ImageDraw.Draw(sheet)
    for ix, outcome in enumerate(outcomes):
        x, y = ix % COLUMNS * cell[0] + 4, ix // COLUMNS * cell[1] + 4
        if outcome.picture:
            sheet.paste(outcome.picture, (x, y))
        else:
            draw.rectangle((x, y, x + width, y + height), fill=(20, 20, 24))
        for line_ix, (line, colour) in enumerate(lines_of(outcome, width // 6)):
            draw.text((x, y + height + 4 + line_ix * LINE_HEIGHT), line, fill=colour, font=font)
    return sheet


def main():
    arguments, options = sys.argv[1:], []
    if "--" in arguments:
        at = arguments.index("--")
        arguments, options = arguments[:at], arguments[at + 1 :]
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("kdray")
    parser.add_argument("folder", type=Path)
    parser.add_argument("-o", "--output", type=Path, default=Path("gallery.png"))
    parser.add_argument("--size", default="320x240")
    parser.add_argument("--seconds", type=float, default=60)
    given = parser.parse_args(arguments)
    paths = files_of(given.folder)
    if not paths:
        sys.exit(f"{given.folder}: holds no file that kdray opens")
    size = tuple(int(number) for number in given.size.split("x"))
    outcomes = []
    for path in paths:
        name = str(path.relative_to(given.folder))
        outcome = render(given.kdray, path, name, given.size, given.seconds, options)
        print(f"{outcome.seconds:6.1f} s  {name}", *outcome.messages, sep="\n          ", flush=True)
        outcomes.append(outcome)
    sheet_of(outcomes, size).save(given.output)
    faults = [outcome.name for outcome in outcomes if outcome.is_fault]
    print(f"{len(outcomes)} files, {len(faults)} faults; the sheet is {given.output}")
    if faults:
        sys.exit("faults: " + ", ".join(faults))


if __name__ == "__main__":
    main()
