//! PNG files without an image library in Python.

use crate::error::{Error, Result};

/// 8-bit straight RGBA, row 0 on top.
pub fn encode(rgba: &[u8], width: u32, height: u32) -> Result<Vec<u8>> {
    let failed = |e: png::EncodingError| Error::Parameter(format!("cannot encode a PNG: {e}"));
    let mut bytes = Vec::new();
    let mut encoder = png::Encoder::new(&mut bytes, width, height);
    encoder.set_color(png::ColorType::Rgba);
    encoder.set_depth(png::BitDepth::Eight);
    let mut writer = encoder.write_header().map_err(failed)?;
    writer.write_image_data(rgba).map_err(failed)?;
    writer.finish().map_err(failed)?;
    Ok(bytes)
}
