"""Labels beside dots, where there is room."""

import math

# Points: of text, between a dot and its label, and of a step away from what is taken.
SIZE, GAP, STEP = 6.5, 2, 3
# Characters of a label; of a longer one the first.
LONGEST = 40
# Beyond so many points, a line leads to the dot.
FAR = 9


def labelled(ax, labels, dots):
    """Writes labels, each (x, y, text, is bold) in data, beside their dots: on neither another label nor a dot.

    To the right or to the left, at the height of the dot or above or below it: the nearest place that is free and inside the
    axes. The figure's layout must be done.

    Args:
        dots: (x, y) in data of all dots: their diameters in points.
    """
    pixels = ax.figure.dpi / 72
    inside = ax.get_window_extent()
    taken = []
    for place, diameter in dots.items():
        (x, y), half = ax.transData.transform(place), diameter / 2 * pixels
        taken.append((x - half, y - half, x + half, y + half))
    for x, y, text, is_bold in labels:
        dot, gap = ax.transData.transform((x, y)), (dots[x, y] / 2 + GAP) * pixels
        text = text if len(text) <= LONGEST else f"{text[: LONGEST - 1]}…"
        said = ax.annotate(
            text,
            (x, y),
            (0, 0),
            textcoords="offset points",
            fontsize=SIZE,
            weight="bold" if is_bold else "normal",
            color="0.15",
            annotation_clip=True,
            clip_on=True,
            parse_math=False,
            zorder=4,
        )
        said.set_in_layout(False)  # it has found its place in this one
        box = said.get_window_extent()
        place = _free(dot, gap, (box.width, box.height), taken, inside, STEP * pixels)
        taken.append((*place, place[0] + box.width, place[1] + box.height))
        off = [(place[i] - dot[i]) / pixels for i in range(2)]
        said.set_position(off)
        if abs(off[1] + SIZE / 2) > FAR:
            end = (place[0] + (0 if off[0] > 0 else box.width), place[1] + box.height / 2)
            xs, ys = zip((x, y), ax.transData.inverted().transform(end), strict=True)
            ax.plot(xs, ys, color="0.6", linewidth=0.4, zorder=1.5, scalex=False, scaley=False)


def _free(dot, gap, size, taken, inside, step):
    """The lower left corner of the free place that is nearest; where there is none, to the right of the dot."""
    width, height = size
    right, left = dot[0] + gap, dot[0] - gap - width
    middle = dot[1] - height / 2
    for i in range(math.ceil(inside.height / step)):
        for x in (right, left):
            for y in (middle + i * step, middle - i * step):
                box = (x, y, x + width, y + height)
                if _holds(inside, box) and not any(_overlap(box, other) for other in taken):
                    return x, y
    return right, middle


def _holds(inside, box):
    return inside.x0 <= box[0] and box[2] <= inside.x1 and inside.y0 <= box[1] and box[3] <= inside.y1


def _overlap(one, other):
    return one[0] < other[2] and other[0] < one[2] and one[1] < other[3] and other[1] < one[3]
