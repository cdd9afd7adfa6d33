// Parts of tiles, by the class that resolves them. A part is some rows of a tile: its first pixel in units of 32, below
// the tile's number.

struct Classes {
    // Parts of each class, which may exceed what one dispatch takes.
    counts: array<atomic<u32>, CLASS_SLOTS_OF_TILES>,
    // Of translucent fragments.
    fragments: atomic<u32>,
    deepest: atomic<u32>,
    // Tiles that hold triangles.
    filled_tiles: atomic<u32>,
    // Fragments that room was asked for, which may exceed what there is.
    listed: atomic<u32>,
}

const UNIT = 32u;
const UNITS = 8u;

fn part_of(tile: u32, first_pixel: u32) -> u32 {
    return tile * UNITS + first_pixel / UNIT;
}
