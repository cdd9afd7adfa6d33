"""Rows of run.py as text, and what their columns mean."""

HELP = """
**wall** is a whole `abuffer.render`, image returned. **GPU** is from the first begin to the last end of a GPU's
stages where one submission has them all (`stats.gpu_ms`), else their sum; software drivers have none, since what they
report of a compute pass leaves dispatches out. **Gfrag/s** are fragments by GPU time, or by wall time where there is
none. **MiB** is the sum of `stats.bytes`. **linked_list ÷** is how many times linked_list of the same device takes as
long, by wall and by GPU time, the median over turns; the CPU has none, and is compared with that of a software driver
if it ran beside it, which has the same cores. **blending ÷**, of GPUs, is the GPU time of the hardware's plain
blending of the same draw by this one's: it sorts nothing, blends opaque surfaces like all others, and so gives the
wrong image. For tiles it is of frames in turns, back to back. **floor** is the time in which the geometry as given is
read and the image is written once, at the bandwidth of copies: positions, faces and colours, and width × height × 16
bytes. **÷ floor** is GPU time by it, or wall time where there is none. **image** compares with the first row of the
scene.
"""
TIMES = ("wall ms", "GPU ms", "Gfrag/s")
RATIOS = ("linked_list ÷ wall", "linked_list ÷ GPU", "blending ÷", "floor ms", "÷ floor")
COLUMNS = ["scene", "device", "pipeline", "fragments", "deepest", *TIMES, "MiB", "bands", *RATIOS, "image"]
SCENE_COLUMNS = ["scene", "size", "triangles", "fragments", "deepest", "pixels by list length", "hard for"]


def cells(row, note):
    """A row as text; `note` makes a mark of what is to be said elsewhere."""
    first = [row["scene"], row["device"], row["pipeline"]]
    if "error" in row:
        return [*first, row["error"].replace("\n", " ").replace("|", "\\|"), *[""] * (len(COLUMNS) - 4)]
    longest = row["longest"] if row["longest"] is not None else ""
    gpu = row["gpu"] if row["is GPU"] else None
    times = [number(ms) for ms in (row["wall"], gpu, row["Gfrag/s"])]
    mib = number(sum(row["bytes"].values()) / (1 << 20))
    ratios = [
        number(row.get(key)) for key in ("linked_list ÷ wall", "linked_list ÷ gpu", "blending ÷", "floor", "÷ floor")
    ]
    if "no blending" in row:
        ratios[2] = note(f"no plain blending to compare with: {row['no blending']}")
    if row["no floor"]:
        ratios[3] = note(f"no floor: {row['no floor']}")
    facts = [f"{row['fragments']:,}", longest]
    return [*first, *facts, *times, mib, row["bands"], *ratios, row.get("image", "")]


def stages(row):
    said = row.get("error") or ", ".join(f"{stage} {number(ms)}" for stage, ms in row["stages"].items())
    return [row["scene"], row["device"], row["pipeline"], said.replace("\n", " ")]


def scene_cells(facts):
    if "error" in facts:
        return [facts["scene"], facts["error"], *[""] * 4, facts["hard for"]]
    bins = ", ".join(f"{length}: {pixels:,}" for length, pixels in facts["pixels by list length"].items() if pixels)
    counts = [f"{facts[key]:,}" for key in ("triangles", "fragments", "deepest")]
    return [facts["scene"], facts["size"], *counts, bins, facts["hard for"]]


def number(value):
    """Three digits, or nothing where there is none."""
    return "" if value is None else f"{value:.0f}" if value >= 100 else f"{value:.3g}"
