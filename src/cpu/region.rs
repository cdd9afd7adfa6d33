//! Tiles, and parts of them.

/// Tile width and height in pixels.
pub const TILE: u32 = 16;

/// A rectangle of pixels, at most one tile.
#[derive(Debug, Clone, Copy)]
pub struct Region {
    pub x0: i32,
    pub y0: i32,
    pub w: i32,
    pub h: i32,
}

impl Region {
    pub fn pixels(&self) -> usize {
        (self.w * self.h) as usize
    }

    /// Two halves, across the longer side.
    pub fn halves(&self) -> [Self; 2] {
        if self.w >= self.h {
            let w = self.w / 2;
            [Self { w, ..*self }, Self { x0: self.x0 + w, w: self.w - w, ..*self }]
        } else {
            let h = self.h / 2;
            [Self { h, ..*self }, Self { y0: self.y0 + h, h: self.h - h, ..*self }]
        }
    }
}
