"""Draws pictures/<id>.png, what each method gets wrong: `python docs/methods/pictures.py [id ...]`. It needs matplotlib."""

import sys
from pathlib import Path

import matplotlib

matplotlib.use("Agg")

import matplotlib.pyplot as plt
from failures import FAILURES, HEIGHT, LEFTS, SIDE, TOP, WIDTH

DPI = 100
FOLDER = Path(__file__).with_name("pictures")


def picture(failure):
    figure = plt.figure(figsize=(WIDTH / DPI, HEIGHT / DPI), dpi=DPI)
    bottom = HEIGHT - TOP - SIDE
    scale = matplotlib.cm.ScalarMappable(matplotlib.colors.Normalize(0, failure.off.max()), "Reds")
    times = SIDE // len(failure.off)
    off = failure.off.repeat(times, axis=0).repeat(times, axis=1)
    titles = (*failure.titles, "largest difference of a channel")
    for image, title, left in zip((*failure.panels(), scale.to_rgba(off)), titles, LEFTS, strict=True):
        figure.figimage(image, left, bottom, origin="upper")  # pixel by pixel
        figure.text((left + SIDE / 2) / WIDTH, (bottom + SIDE + 14) / HEIGHT, title, ha="center", size=11)
    axes = figure.add_axes([998 / WIDTH, bottom / HEIGHT, 13 / WIDTH, SIDE / HEIGHT])
    figure.colorbar(scale, cax=axes).ax.tick_params(labelsize=8, pad=2, length=3)
    return figure


def main(ids):
    FOLDER.mkdir(exist_ok=True)
    for id in ids or FAILURES:
        figure = picture(FAILURES[id]())
        # Without matplotlib's version, the same pixels are the same file.
        figure.savefig(FOLDER / f"{id}.png", dpi=DPI, metadata={"Software": None})
        plt.close(figure)


if __name__ == "__main__":
    main(sys.argv[1:])
