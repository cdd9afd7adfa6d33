"""Writes scenes.png, a picture of each standard scene, and the table of scenes.md: `python docs/scenes.py`.

It needs Pillow, and what `ab.scenes.model` needs.
"""

import inspect
import re
from pathlib import Path

import numpy as np

import abuffer as ab

FOLDER = Path(__file__).parent
# Pixels of the picture's tiles, of the gaps between them and of the names below.
WIDTH, HEIGHT, GAP, CAPTION, COLUMNS = 320, 240, 10, 26, 4
SUPERSAMPLING = 3  # each way: smooth edges
PAGE = {"width": 480, "height": 360}  # what the table counts
BEGIN, END = "<!-- from the scenes, by scenes.py -->\n", "<!-- until here -->\n"


def corner(index):
    """Left and top of a tile."""
    return GAP + index % COLUMNS * (WIDTH + GAP), GAP + index // COLUMNS * (HEIGHT + CAPTION)


def tile(standard):
    """(HEIGHT, WIDTH, 3) uint8. What is brighter than 1 is shown as 1."""
    size = {"width": WIDTH * SUPERSAMPLING, "height": HEIGHT * SUPERSAMPLING}
    frame = ab.render(standard.scene, standard.camera, background=standard.background, device="cpu", **size)
    blocks = frame.image[..., :3].clip(0, 1).reshape(HEIGHT, SUPERSAMPLING, WIDTH, SUPERSAMPLING, 3)
    return np.round(255 * blocks.mean(axis=(1, 3), dtype=np.float64)).astype(np.uint8)


def sheet(scenes):
    """All tiles with their names, as a Pillow image."""
    from PIL import Image, ImageDraw, ImageFont

    right, bottom = np.max([corner(i) for i in range(len(scenes))], axis=0)
    image = Image.new("RGB", (int(right) + WIDTH + GAP, int(bottom) + HEIGHT + CAPTION), "white")
    draw = ImageDraw.Draw(image)
    font = ImageFont.load_default(14)
    for i, standard in enumerate(scenes):
        left, top = corner(i)
        draw.rectangle((left - 1, top - 1, left + WIDTH, top + HEIGHT), outline=(190, 190, 190))
        image.paste(Image.fromarray(tile(standard)), (left, top))
        draw.text((left + WIDTH / 2, top + HEIGHT + 11), standard.name, fill=(40, 40, 40), font=font, anchor="mm")
    return image


def known(name):
    """What a scene's docstring says is known of it, in a line."""
    text = inspect.getdoc(getattr(ab.scenes, name))
    found = re.search(r"^(?:Closed form(?:, |: )|Known: )(.+?)(?:\n\n|\Z)", text, re.DOTALL | re.MULTILINE)
    return " ".join(found.group(1).split()) if found else ""


def table():
    """The rows of the newest suite."""
    text = f"{BEGIN}| scene | hard for | triangles | fragments a pixel | most | known |\n"
    text += "| --- | --- | --- | --- | --- | --- |\n"
    for name, standard in ab.scenes.suite().items():
        frame = ab.render(standard.scene, standard.camera, fragments="count", device="cpu", **PAGE)
        mean, most = frame.counts[frame.counts > 0].mean(), frame.counts.max()
        cells = (f"`{name}`", standard.hard_for, f"{standard.scene.triangle_count:,}", f"{mean:.1f}", str(most))
        text += f"| {' | '.join(cells)} | {known(name)} |\n"
    return text + END


def refreshed(text):
    """The page with the table as it is now."""
    before, _, rest = text.partition(BEGIN)
    return before + table() + rest.partition(END)[2]


def main():
    page = FOLDER / "scenes.md"
    page.write_text(refreshed(page.read_text(encoding="utf-8")), encoding="utf-8")
    sheet([*ab.scenes.suite().values(), ab.scenes.model()]).save(FOLDER / "scenes.png", optimize=True)


if __name__ == "__main__":
    main()
