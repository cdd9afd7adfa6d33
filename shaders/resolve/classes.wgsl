// What classification found, in all stages that know of classes.

struct Classes {
    // Pixels of each class; the last one is of lists too long for any array.
    totals: array<atomic<u32>, CLASS_SLOTS>,
    bases: array<u32, CLASS_SLOTS>,
    // The longest list.
    longest: atomic<u32>,
    filled_tiles: atomic<u32>,
    // Fragments beyond the limit, of the lists that fit an array.
    dropped: atomic<u32>,
}
