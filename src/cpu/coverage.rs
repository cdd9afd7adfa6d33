//! Which pixel centres a snapped triangle covers: integer edge functions and the top-left rule, so that
//! two triangles that share an edge never both cover a centre, and never both miss it (Pineda 1988).

use std::ops::Range;

use super::setup::Record;
use crate::samples::Offset;

/// The three edge functions of a triangle, relative to the centre of the first pixel of a region of at
/// most 16×16: pixel (i, j) is inside where `q + a·i + b·j ≥ 0` for all three.
#[derive(Debug, Clone, Copy)]
pub struct Edges {
    pub a: [i32; 3],
    pub b: [i32; 3],
    pub q: [i32; 3],
    /// What flooring q left, in 1/16 pixel: samples lie on that grid.
    r: [i32; 3],
}

impl Edges {
    /// `x0`, `y0`: the region's first pixel.
    #[inline(always)]
    pub fn new<T>(record: &Record<T>, x0: i32, y0: i32) -> Self {
        let mut edges = Self { a: [0; 3], b: [0; 3], q: [0; 3], r: [0; 3] };
        for i in 0..3 {
            let (dx, dy, value) = edge(record, i, x0, y0);
            // Whole pixels move an edge function by multiples of 256, so flooring by it changes no sign.
            // The clamp cannot either: |a|, |b| < 2^24.6, so 15 steps of each add less than 2^30.
            edges.q[i] = (value >> 8).clamp(-(1 << 30), 1 << 30) as i32;
            edges.r[i] = (value & 255) as i32 >> 4;
            edges.a[i] = -dy;
            edges.b[i] = dx;
        }
        edges
    }

    /// The same edges for the sample at (kx, ky)/16 pixel from each centre: inside where
    /// q + a·i + b·j + ⌊(r + a·kx + b·ky) / 16⌋ ≥ 0.
    pub fn at(&self, (kx, ky): Offset) -> Self {
        let q = |e: usize| self.q[e] + ((self.r[e] + self.a[e] * kx + self.b[e] * ky) >> 4);
        Self { q: [q(0), q(1), q(2)], ..*self }
    }

    /// Calls `row(j, columns)` for each of `rows` that has covered pixels among `columns`: one span, since
    /// a triangle is convex.
    ///
    /// An edge crosses a row between two columns; that column moves by the same quotient from row to row,
    /// and one more whenever the remainder is full, so that rows take additions only.
    #[inline]
    pub fn spans(&self, columns: Range<i32>, rows: Range<i32>, mut row: impl FnMut(i32, Range<i32>)) {
        let mut crossings: [Crossing; 3] =
            std::array::from_fn(|e| Crossing::new(self.a[e], self.b[e], self.q[e] + self.b[e] * rows.start));
        for j in rows {
            let (mut start, mut end) = (columns.start, columns.end);
            for crossing in &mut crossings {
                match crossing.side {
                    // q + a i ≥ 0 ⇔ i ≥ −⌊q / a⌋, or for negative a ⇔ i ≤ ⌊q / −a⌋.
                    Side::Left => start = start.max(-crossing.quotient),
                    Side::Right => end = end.min(crossing.quotient + 1),
                    Side::Level => end = if crossing.quotient < 0 { start } else { end },
                }
                crossing.next_row();
            }
            if start < end {
                row(j, start..end);
            }
        }
    }

    /// All pixels of a `w` × `h` region are inside.
    pub fn contains(&self, w: i32, h: i32) -> bool {
        (0..3).all(|e| self.q[e] + (self.a[e] * (w - 1)).min(0) + (self.b[e] * (h - 1)).min(0) >= 0)
    }
}

/// Edge i of a triangle: its extent, and its function at the centre of pixel (x0, y0), in 64 bits.
#[inline(always)]
pub fn edge<T>(record: &Record<T>, i: usize, x0: i32, y0: i32) -> (i32, i32, i64) {
    // The centre of pixel i lies at 256 i + 128.
    let (cx, cy) = (256 * x0 + 128, 256 * y0 + 128);
    let j = (i + 1) % 3;
    let (dx, dy) = (record.x[j] - record.x[i], record.y[j] - record.y[i]);
    let value = i64::from(dx) * i64::from(cy - record.y[i]) - i64::from(dy) * i64::from(cx - record.x[i]);
    let top_or_left = dy < 0 || (dy == 0 && dx > 0);
    (dx, dy, value - i64::from(!top_or_left))
}

/// Which end of a row's span an edge bounds.
#[derive(Clone, Copy)]
enum Side {
    Left,
    Right,
    /// Horizontal: the whole row is inside, or none of it.
    Level,
}

/// An edge function along the first column, divided by its slope along a row.
#[derive(Clone, Copy)]
struct Crossing {
    side: Side,
    divisor: i32,
    /// ⌊value / divisor⌋ and the remainder.
    quotient: i32,
    remainder: i32,
    /// What a row adds to them.
    step: i32,
    step_remainder: i32,
}

impl Crossing {
    fn new(a: i32, b: i32, value: i32) -> Self {
        let side = match a.signum() {
            1 => Side::Left,
            -1 => Side::Right,
            _ => Side::Level,
        };
        let divisor = a.abs().max(1);
        let (quotient, step) = (value.div_euclid(divisor), b.div_euclid(divisor));
        Self {
            side,
            divisor,
            quotient,
            remainder: value - quotient * divisor,
            step,
            step_remainder: b - step * divisor,
        }
    }

    #[inline]
    fn next_row(&mut self) {
        self.quotient += self.step;
        self.remainder += self.step_remainder;
        if self.remainder >= self.divisor {
            self.remainder -= self.divisor;
            self.quotient += 1;
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::cpu::plane::Plane;
    use crate::cpu::setup::FLAT;
    use crate::cpu::tile_walk::TileWalk;

    fn record(x: [i32; 3], y: [i32; 3]) -> Record<f32> {
        let plane = Plane { value: 0.0, gx: 0.0, gy: 0.0, low: 0.0, high: 0.0 };
        Record {
            x,
            y,
            anchor: [0.0; 2],
            key_plane: plane,
            color: [0.0; 4],
            gradient: FLAT,
            primitive: 0,
            mesh: 0,
        }
    }

    /// A small deterministic generator: the fuzz needs spread, not quality.
    struct Lcg(u64);
    impl Lcg {
        fn within(&mut self, range: i64) -> i32 {
            self.0 = self.0.wrapping_mul(6364136223846793005).wrapping_add(1442695040888963407);
            (((self.0 >> 33) as i64) % (2 * range) - range) as i32
        }
    }

    /// The spans of 16 rows of 16 columns.
    fn all_spans(edges: &Edges) -> [Range<i32>; 16] {
        let mut spans = std::array::from_fn(|_| 0..0);
        edges.spans(0..16, 0..16, |j, span| spans[j as usize] = span);
        spans
    }

    /// The definition, in 128 bits at the snapped scale.
    fn inside(r: &Record<f32>, px: i32, py: i32) -> bool {
        inside_at(r, (256 * px + 128, 256 * py + 128))
    }

    fn inside_at(r: &Record<f32>, (x, y): (i32, i32)) -> bool {
        (0..3).all(|i| {
            let j = (i + 1) % 3;
            let (dx, dy) = (i128::from(r.x[j] - r.x[i]), i128::from(r.y[j] - r.y[i]));
            let e = dx * (i128::from(y) - i128::from(r.y[i])) - dy * (i128::from(x) - i128::from(r.x[i]));
            if dy < 0 || (dy == 0 && dx > 0) { e >= 0 } else { e > 0 }
        })
    }

    /// A walk over tiles visits the one at this pixel, a corner of a tile or not.
    fn visits(r: &Record<f32>, (x0, y0): (i32, i32), multisampled: bool) -> bool {
        let shift = |v: [i32; 3], by: i32| v.map(|v| v - 256 * by);
        let moved = Record { x: shift(r.x, x0), y: shift(r.y, y0), ..*r };
        let mut found = false;
        // From a tile before, so that steps are walked too.
        TileWalk::new(&moved, (-1, -1), multisampled)
            .each(-1..=0, -1..=0, |tx, ty| found |= (tx, ty) == (0, 0));
        found
    }

    #[test]
    fn spans_equal_the_definition_for_coordinates_of_any_size() {
        let mut random = Lcg(7);
        let mut covered = 0;
        for round in 0..20_000 {
            // From a few pixels to the guard band of a 16384-pixel viewport, 2^23 units and over.
            let range = [600, 5_000, 300_000, 12_000_000][round % 4];
            let mut x: [i32; 3] = std::array::from_fn(|_| random.within(range));
            let mut y: [i32; 3] = std::array::from_fn(|_| random.within(range));
            if round % 3 == 0 {
                (x[0], y[1]) = (256 * (x[0] >> 8) + 128, y[0]); // through centres, and horizontal
            }
            let area = i64::from(x[1] - x[0]) * i64::from(y[2] - y[0])
                - i64::from(x[2] - x[0]) * i64::from(y[1] - y[0]);
            if area < 0 {
                x.swap(1, 2);
                y.swap(1, 2);
            }
            let r = record(x, y);
            // A region near a vertex, where edges are.
            let (x0, y0) = ((x[0] >> 8) + random.within(20), (y[0] >> 8) + random.within(20));
            let edges = Edges::new(&r, x0, y0);
            let mut any = false;
            let mut all = true;
            let spans = all_spans(&edges);
            for j in 0..16 {
                for i in 0..16 {
                    let wanted = area != 0 && inside(&r, x0 + i, y0 + j);
                    let got = area != 0 && spans[j as usize].contains(&i);
                    assert_eq!(got, wanted, "{x:?} {y:?} pixel {i} {j}");
                    covered += usize::from(wanted);
                    any |= wanted;
                    all &= wanted;
                }
            }
            assert!(!any || visits(&r, (x0, y0), false));
            assert!(area == 0 || edges.contains(16, 16) == all);
        }
        assert!(covered > 100_000, "the fuzz must hit triangles: {covered}");
    }

    #[test]
    fn samples_equal_the_definition_at_every_sixteenth_of_a_pixel() {
        let mut random = Lcg(11);
        let mut covered = 0;
        for round in 0..4_000 {
            let range = [600, 5_000, 300_000, 12_000_000][round % 4];
            let mut x: [i32; 3] = std::array::from_fn(|_| random.within(range));
            let mut y: [i32; 3] = std::array::from_fn(|_| random.within(range));
            let area = i64::from(x[1] - x[0]) * i64::from(y[2] - y[0])
                - i64::from(x[2] - x[0]) * i64::from(y[1] - y[0]);
            if area < 0 {
                x.swap(1, 2);
                y.swap(1, 2);
            }
            let r = record(x, y);
            let (x0, y0) = ((x[0] >> 8) + random.within(20), (y[0] >> 8) + random.within(20));
            let (kx, ky) = (random.within(8), random.within(8));
            let edges = Edges::new(&r, x0, y0);
            let spans = all_spans(&edges.at((kx, ky)));
            let mut any = false;
            for j in 0..16 {
                for i in 0..16 {
                    let wanted = area != 0
                        && inside_at(&r, (256 * (x0 + i) + 128 + 16 * kx, 256 * (y0 + j) + 128 + 16 * ky));
                    assert_eq!(
                        area != 0 && spans[j as usize].contains(&i),
                        wanted,
                        "{x:?} {y:?} {i} {j} {kx} {ky}"
                    );
                    covered += usize::from(wanted);
                    any |= wanted;
                }
            }
            assert!(!any || visits(&r, (x0, y0), true));
        }
        assert!(covered > 20_000, "the fuzz must hit triangles: {covered}");
    }

    #[test]
    fn a_shared_edge_through_pixel_centres_is_covered_exactly_once() {
        let at = |px: i32| 256 * px + 128;
        // The diagonal of a square, on centres.
        let upper = record([at(0), at(8), at(8)], [at(0), at(0), at(8)]);
        let lower = record([at(0), at(8), at(0)], [at(0), at(8), at(8)]);
        for j in 0..8 {
            for i in 0..8 {
                let hits = [&upper, &lower]
                    .iter()
                    .filter(|r| all_spans(&Edges::new(r, 0, 0))[j].contains(&i))
                    .count();
                assert_eq!(hits, 1, "pixel {i} {j}");
            }
        }
    }
}
