//! Node formats (GPU Pro 2, sections 2.4.3 and 2.8.1): how a fragment is packed into words. Written twice, here to
//! read lists back and in shaders/nodes to write them; this side also says what they cost.

use crate::real::sort_key;

/// The layout of a node's own words.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash)]
pub enum NodeFormat {
    /// Nothing is lost.
    Float32,
    Rgba8Depth32,
    Rgba8Depth24Coverage8,
    Rgb565Depth16,
    Rgb9e5Alpha8Depth24,
}

use NodeFormat::*;

impl NodeFormat {
    pub const ALL: [Self; 5] =
        [Float32, Rgba8Depth32, Rgba8Depth24Coverage8, Rgb565Depth16, Rgb9e5Alpha8Depth24];

    pub fn name(self) -> &'static str {
        match self {
            Float32 => "float32",
            Rgba8Depth32 => "rgba8_depth32",
            Rgba8Depth24Coverage8 => "rgba8_depth24_coverage8",
            Rgb565Depth16 => "rgb565_depth16",
            Rgb9e5Alpha8Depth24 => "rgb9e5_alpha8_depth24",
        }
    }

    pub fn named(name: &str) -> Option<Self> {
        Self::ALL.into_iter().find(|f| f.name() == name)
    }

    /// Words that every node has.
    pub fn base_words(self) -> u32 {
        match self {
            Float32 => 6,
            Rgb565Depth16 => 2,
            _ => 3,
        }
    }

    /// The last depth code, where depths are codes. Of 24 bits it is one less than there could be: with all the bits
    /// beside it a key would equal what fills up the array of a sort.
    pub fn last_code(self) -> Option<u32> {
        match self {
            Float32 | Rgba8Depth32 => None,
            Rgb565Depth16 => Some((1 << 16) - 1),
            Rgba8Depth24Coverage8 | Rgb9e5Alpha8Depth24 => Some((1 << 24) - 2),
        }
    }

    /// Nodes that links can tell apart; 0 is no node.
    pub fn most_nodes(self) -> u64 {
        if self == Rgb565Depth16 { (1 << 24) - 1 } else { u64::from(u32::MAX >> 1) }
    }

    /// Spare bits beside depth and colour: a byte, for coverage, a blend mode, or both.
    fn spare_bits(self) -> u32 {
        if self == Rgba8Depth24Coverage8 { 8 } else { 0 }
    }
}

/// The words of a node in a scene: only what it requires.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash)]
pub struct NodeLayout {
    pub format: NodeFormat,
    pub samples: u32,
    /// The scene mixes blend modes.
    pub mixed: bool,
    /// A word for the primitive, and the blend mode with it.
    pub has_order: bool,
    /// A word for the sample mask.
    pub has_coverage: bool,
}

impl NodeLayout {
    /// `wants_order`: something asks for primitives.
    pub fn new(format: NodeFormat, samples: u32, mixed: bool, wants_order: bool) -> Self {
        let has_coverage = samples > 1 && samples > format.spare_bits();
        // The mode takes the upper half of the spare byte, if coverage leaves it.
        let mode_fits = format.spare_bits() == 8 && (samples <= 4 || has_coverage);
        let has_order = format == Float32 || wants_order || (mixed && !mode_fits);
        Self { format, samples, mixed, has_order, has_coverage }
    }

    pub fn words(&self) -> u32 {
        self.format.base_words() + u32::from(self.has_order) + u32::from(self.has_coverage)
    }

    pub fn bytes(&self) -> u64 {
        4 * u64::from(self.words())
    }

    pub fn order_word(&self) -> u32 {
        self.format.base_words()
    }

    pub fn coverage_word(&self) -> u32 {
        self.format.base_words() + u32::from(self.has_order)
    }

    /// Triangles that the order word can tell apart.
    pub fn most_triangles(&self) -> usize {
        if self.mixed && self.has_order { 1 << 27 } else { i32::MAX as usize }
    }

    pub fn next(&self, node: &[u32]) -> u32 {
        if self.format == Rgb565Depth16 { node[1] & 0xff_ffff } else { node[0] }
    }

    /// What a node holds of its fragment.
    pub fn decode(&self, node: &[u32], codes: &DepthCodes) -> Decoded {
        let unorm8 = |word: u32| word.to_le_bytes().map(|b| f32::from(b) / 255.0);
        // What is stored decides the order: distinct codes may stand for one float32 value.
        let code = match self.format {
            Float32 | Rgba8Depth32 => node[1],
            Rgba8Depth24Coverage8 | Rgb9e5Alpha8Depth24 => node[1] >> 8,
            Rgb565Depth16 => node[0] & 0xffff,
        };
        let key = if self.format.last_code().is_some() { codes.key(code) } else { code };
        let color = match self.format {
            Float32 => [node[2], node[3], node[4], node[5]].map(f32::from_bits),
            Rgba8Depth32 | Rgba8Depth24Coverage8 => unorm8(node[2]),
            Rgb565Depth16 => {
                let c = node[0];
                let rgba = [c >> 27, c >> 21 & 63, c >> 16 & 31, node[1] >> 24];
                let most = [31.0, 63.0, 31.0, 255.0];
                std::array::from_fn(|i| rgba[i] as f32 / most[i])
            }
            Rgb9e5Alpha8Depth24 => {
                let c = node[2];
                let scale = f32::from_bits(((c >> 27) + 127 - 24) << 23);
                let [r, g, b] = [c & 511, c >> 9 & 511, c >> 18 & 511].map(|m| m as f32 * scale);
                [r, g, b, (node[1] & 255) as f32 / 255.0]
            }
        };
        let order = if self.has_order { node[self.order_word() as usize] } else { 0 };
        let spare = node[1] & 255;
        let coverage = match (self.samples, self.has_coverage) {
            (1, _) => 1,
            (_, true) => node[self.coverage_word() as usize],
            (samples, false) => spare & crate::samples::full(samples),
        };
        let mode = match (self.mixed, self.has_order) {
            (false, _) => 0,
            (true, true) => order & 15,
            (true, false) => spare >> 4,
        };
        let primitive = if self.mixed { !order >> 4 & 0x7ff_ffff } else { !order & 0x7fff_ffff };
        Decoded { code, key, order, color, coverage, mode: mode as u8, primitive: primitive as i32 }
    }
}

/// A fragment as a node held it.
#[derive(Debug, Clone, Copy)]
pub struct Decoded {
    /// What was sorted by, then the order.
    pub code: u32,
    pub key: u32,
    pub order: u32,
    pub color: [f32; 4],
    pub coverage: u32,
    pub mode: u8,
    pub primitive: i32,
}

/// Depth codes over a frame's own range of the values that keys are made from (1/w under a perspective, else eye
/// depth), never over near to far: code 0 is the nearest.
#[derive(Debug, Clone, Copy)]
pub struct DepthCodes {
    pub origin: f32,
    /// Codes a unit, and units a code.
    pub scale: f32,
    pub step: f32,
    pub perspective: bool,
}

impl DepthCodes {
    /// `low`, `high`: the values of the frame's fragments.
    pub fn new((low, high): (f64, f64), last: Option<u32>, perspective: bool) -> Self {
        let last = f64::from(last.unwrap_or(1));
        let origin = if perspective { high } else { low } as f32;
        // Stretched by what rounding may move values past the range.
        let range = (high - low) * (1.0 + 1e-6);
        let scale = last / range;
        // All at one depth, or nothing at all: one code.
        if !(scale.is_finite() && scale < f64::from(f32::MAX)) || range / last < f64::from(f32::MIN_POSITIVE)
        {
            return Self { origin, scale: 0.0, step: 0.0, perspective };
        }
        Self { origin, scale: scale as f32, step: (range / last) as f32, perspective }
    }

    /// The code of a value, as shaders/nodes/common.wgsl computes it.
    pub fn code(&self, value: f32, last: u32) -> u32 {
        let from_nearest = if self.perspective { self.origin - value } else { value - self.origin };
        ((from_nearest * self.scale).max(0.0).round_ties_even() as u32).min(last)
    }

    pub fn value(&self, code: u32) -> f32 {
        let from_nearest = code as f32 * self.step;
        if self.perspective { self.origin - from_nearest } else { self.origin + from_nearest }
    }

    /// The sort key of a code's value.
    pub fn key(&self, code: u32) -> u32 {
        sort_key(self.value(code), self.perspective)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_code_of_24_bits_comes_back_within_one_and_codes_rise_with_depth() {
        let last = (1 << 24) - 1;
        for (range, perspective) in [((0.25, 4.0), true), ((1e-3, 1e3), true), ((-2.0, 9.0), false)] {
            let codes = DepthCodes::new(range, Some(last), perspective);
            let mut before = 0;
            for i in 0..=last {
                // Values in the order of depth, over the whole range.
                let t = f64::from(i) / f64::from(last);
                let near_to_far = if perspective {
                    range.1 - (range.1 - range.0) * t
                } else {
                    range.0 + (range.1 - range.0) * t
                };
                let code = codes.code(near_to_far as f32, last);
                assert!(code >= before, "code {code} after {before} at {near_to_far}");
                before = code;
                // To a code and back there are four roundings to 24 bits, each half a code at the far end, and
                // one to a whole code; the value itself is rounded where it is given and where it comes back.
                let ulp = f64::from(f32::EPSILON) * near_to_far.abs().max(f64::from(codes.origin.abs()));
                let error = (f64::from(codes.value(code)) - near_to_far).abs();
                assert!(error <= 2.5 * f64::from(codes.step) + ulp, "{near_to_far}: {error}");
            }
            assert!(before > last - 20, "the range is used: {before}");
        }
    }

    #[test]
    fn one_depth_has_one_code() {
        for range in [(1.0, 1.0), (0.0, 0.0), (1e-30, 1e-30 + 1e-44)] {
            let codes = DepthCodes::new(range, Some(65_535), true);
            assert_eq!(codes.code(range.0 as f32, 65_535), 0);
        }
    }

    #[test]
    fn nodes_hold_only_what_a_scene_requires() {
        let bytes = |format, samples, mixed, order| NodeLayout::new(format, samples, mixed, order).bytes();
        assert_eq!(bytes(Float32, 1, false, false), 28);
        assert_eq!(bytes(Float32, 4, false, false), 32);
        assert_eq!(bytes(Float32, 1, true, false), 28); // the mode rides with the primitive
        assert_eq!(bytes(Rgba8Depth32, 1, false, false), 12);
        assert_eq!(bytes(Rgba8Depth32, 1, true, false), 16);
        assert_eq!(bytes(Rgba8Depth24Coverage8, 1, false, false), 12);
        assert_eq!(bytes(Rgba8Depth24Coverage8, 8, false, false), 12);
        assert_eq!(bytes(Rgba8Depth24Coverage8, 4, true, false), 12); // four bits each
        assert_eq!(bytes(Rgba8Depth24Coverage8, 8, true, false), 16);
        assert_eq!(bytes(Rgba8Depth24Coverage8, 16, false, false), 16);
        assert_eq!(bytes(Rgb565Depth16, 1, false, false), 8);
        assert_eq!(bytes(Rgb565Depth16, 4, false, true), 16);
        assert_eq!(bytes(Rgb9e5Alpha8Depth24, 1, false, false), 12);
    }

    #[test]
    fn colours_of_nine_bits_and_an_exponent_decode_to_their_definition() {
        let layout = NodeLayout::new(Rgb9e5Alpha8Depth24, 1, false, false);
        let codes = DepthCodes::new((0.5, 1.0), Some((1 << 24) - 1), true);
        // 256 · 2^(16 − 24) = 1
        let node = [0, 255, 16 << 27 | 511 << 18 | 256 << 9 | 1];
        let got = layout.decode(&node, &codes).color;
        assert_eq!(got, [1.0 / 256.0, 1.0, 511.0 / 256.0, 1.0]);
    }

    #[test]
    fn no_key_equals_what_fills_up_a_sort() {
        for format in NodeFormat::ALL {
            let last = format.last_code().unwrap_or(0);
            assert!(last << 8 | 255 != u32::MAX, "{format:?}");
        }
    }

    #[test]
    fn links_of_24_bits_bound_the_pool() {
        assert_eq!(Rgb565Depth16.most_nodes(), (1 << 24) - 1);
    }
}
