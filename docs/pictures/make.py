#!/usr/bin/env python3
"""Makes the pictures of the pages from pictures that sdmgen writes.

Usage: docs/pictures/make.py FOLDER
FOLDER is a folder in which the commands of docs/tutorial.md ran. Needs Pillow, and sdmgen in PATH.
"""
import pathlib
import subprocess
import sys
import tempfile

from PIL import Image

HERE = pathlib.Path(__file__).parent


def save(image, name, scale):
    size = [round(scale * edge) for edge in image.size]
    image = image.resize(size, Image.LANCZOS).quantize(256, Image.Quantize.MAXCOVERAGE, 2, dither=Image.Dither.NONE)
    image.save(HERE / name, optimize=True)


def read(path, box=None):
    return Image.open(path).convert("RGB").crop(box)


def sdmgen(*words):
    subprocess.run(["sdmgen", *words, "-q"], check=True, stdout=subprocess.DEVNULL)


def cochlea(folder):
    """Three cochleae above three slices through the signed distance of the first."""
    shapes, slices = f"{folder}/shapes.png", f"{folder}/slices.png"
    sdmgen("shapes", "check", "cochlea", "-o", shapes)
    sdmgen("exact", "--shape", "cochlea", "--spacing", "0.1", "-o", slices)
    above = read(shapes, (0, 0, 1304, 350))
    parts = [read(slices, box) for box in ((0, 75, 428, 330), (0, 330, 428, 585), (0, 585, 428, 935))]
    whole = Image.new("RGB", (1304, 350 + 350), "white")
    whole.paste(above)
    for i, part in enumerate(parts):
        whole.paste(part, (i * 436, 350))
    return whole


def main(tutorial):
    with tempfile.TemporaryDirectory() as folder:
        save(cochlea(folder), "cochlea.png", 0.7)
        mugs = f"{folder}/mugs.png"
        sdmgen("shapes", "check", "mug", "--plugin", f"{tutorial}/mug/build/mug.so", "-o", mugs)
        save(read(mugs, (0, 0, 1232, 500)), "mug-check.png", 0.6)
    slices = read(f"{tutorial}/runs/mug/slices.png")
    middle, legend = slices.crop((0, 415, 1180, 758)), slices.crop((0, 1075, 1180, 1168))
    whole = Image.new("RGB", (1180, 60 + middle.height + legend.height), "white")
    whole.paste(slices.crop((0, 0, 1180, 60)))
    whole.paste(middle, (0, 60))
    whole.paste(legend, (0, 60 + middle.height))
    save(whole, "mug-slices.png", 0.75)
    save(read(f"{tutorial}/fit.png"), "mug-fit.png", 0.8)


if __name__ == "__main__":
    if len(sys.argv) != 2:
        sys.exit(__doc__)
    main(sys.argv[1])
