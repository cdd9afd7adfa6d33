//! Rectangles of pixels, and their parts.

/// A rectangle of pixels.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Rect {
    pub x0: u32,
    pub y0: u32,
    pub w: u32,
    pub h: u32,
}

impl Rect {
    pub fn pixels(&self) -> u64 {
        u64::from(self.w) * u64::from(self.h)
    }

    /// The least one that holds both.
    pub fn join(self, other: Self) -> Self {
        let (x0, y0) = (self.x0.min(other.x0), self.y0.min(other.y0));
        let (x1, y1) =
            ((self.x0 + self.w).max(other.x0 + other.w), (self.y0 + self.h).max(other.y0 + other.h));
        Self { x0, y0, w: x1 - x0, h: y1 - y0 }
    }

    /// Parts between rows that begin with these, rising; the top one last.
    pub fn cut(&self, rows: &[u32]) -> Vec<Self> {
        let end = self.y0 + self.h;
        let between = |i: usize| {
            let (first, last) = (rows[i].max(self.y0), rows.get(i + 1).map_or(end, |&next| next.min(end)));
            (first < last).then(|| Self { y0: first, h: last - first, ..*self })
        };
        (0..rows.len()).rev().filter_map(between).collect()
    }

    /// Parts of whole rows with at most `pixels` pixels, the top one last; parts of rows where those are longer.
    pub fn parts(&self, pixels: u64) -> Vec<Self> {
        let w = u64::from(self.w).min(pixels.max(1)) as u32;
        let h = ((pixels / u64::from(w)).max(1)).min(u64::from(self.h)) as u32;
        let mut parts = Vec::new();
        for y in (0..self.h).step_by(h as usize) {
            for x in (0..self.w).step_by(w as usize) {
                let (w, h) = (w.min(self.w - x), h.min(self.h - y));
                parts.push(Self { x0: self.x0 + x, y0: self.y0 + y, w, h });
            }
        }
        parts.reverse();
        parts
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_rectangle_is_cut_at_the_rows_that_are_in_it() {
        let rect = Rect { x0: 5, y0: 7, w: 3, h: 4 };
        let parts = rect.cut(&[0, 4, 8, 10, 16]);
        let [top, middle, bottom] = [(7, 1), (8, 2), (10, 1)].map(|(y0, h)| Rect { y0, h, ..rect });
        assert_eq!(parts, [bottom, middle, top]);
        assert_eq!(rect.cut(&[0]), [rect]);
        assert_eq!(rect.cut(&[0, 11]), [rect]);
    }
}
