//! What setup and binning count, and the room that they need.

use crate::error::{Error, Result};
use crate::gpu::device::Gpu;
use crate::gpu::rect::Rect;

/// Entries that there is room for, or that are needed.
#[derive(Debug, Clone, Copy)]
pub struct Room {
    pub pieces: u32,
    pub bin_entries: u32,
    pub tile_entries: u32,
}

/// What setup and binning counted.
#[derive(Debug, Clone, Copy, Default)]
pub struct Counted {
    pub rejected: u64,
    /// The longest list of a tile.
    pub longest: u32,
    /// Of all tiles together.
    pub entries: u32,
    /// The pixels where translucent triangles may land.
    pub rect: Option<Rect>,
}

impl Counted {
    /// With what another band counted.
    pub fn with(self, band: Self) -> Self {
        Self {
            rejected: band.rejected, // of the whole scene, in each
            longest: self.longest.max(band.longest),
            entries: self.entries.saturating_add(band.entries),
            rect: self.rect.map_or(band.rect, |own| Some(band.rect.map_or(own, |other| own.join(other)))),
        }
    }
}

/// Of a device whose demands do not end.
pub fn never_settles(gpu: &Gpu) -> Error {
    Error::Device(format!(
        "{} counts other triangles each time: its driver is at fault; device=\"cpu\" works",
        gpu.adapter.name
    ))
}

/// What a frame counted that had this room; or the room that it needs.
pub fn counted(gpu: &Gpu, words: &[u32], had: Room) -> Result<std::result::Result<Counted, Room>> {
    let [rejected, _, pieces, bin_entries, tile_entries, longest, left, top, x1, y1, ..] = *words else {
        return Err(Error::Device("the counters were not read back".into()));
    };
    if longest == u32::MAX {
        return Err(Error::Unsupported(format!(
            "{} ends loops too early to bin so many triangles in one place; pipeline=\"linked_list\" and \
             device=\"cpu\" do not mind",
            gpu.adapter.name
        )));
    }
    if pieces > had.pieces || bin_entries > had.bin_entries || tile_entries > had.tile_entries {
        return Ok(Err(Room { pieces, bin_entries, tile_entries }));
    }
    let (x0, y0) = (65536 - left, 65536 - top);
    let rect = (left > 0).then(|| Rect { x0, y0, w: x1 - x0, h: y1 - y0 });
    Ok(Ok(Counted { rejected: rejected.into(), longest, entries: tile_entries, rect }))
}
