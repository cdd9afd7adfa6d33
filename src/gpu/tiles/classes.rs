//! The classes of tiles: how fragments are gathered, and how many of a pixel there is room for.

use std::fmt::Write;

use crate::gpu::device::Gpu;
use crate::gpu::unrolled::network;

pub const CLASS_COUNT: usize = 6;
/// Words of `Classes` in shaders/tiles/classes.wgsl.
pub const CLASS_WORDS: usize = CLASS_COUNT + 1 + 4;
/// For people.
pub const CLASS_NAMES: [&str; CLASS_COUNT] =
    ["triangles", "masks, short", "masks, longer", "masks, long", "deep triangles", "staged"];
/// Pixels of a tile, and of the smallest part of one.
const TILE_PIXELS: u32 = 256;
const UNIT: u32 = 32;
/// Workgroups of a dispatch, in one dimension.
const MOST_GROUPS: u32 = 65_535;
/// Invocations take triangles where a tile has at least so many, whose boxes cover less than so many of its pixels each.
const MANY_TRIANGLES: u32 = 48;
const SMALL_AREA: u32 = 48;

/// Fragments of a tile of small triangles: 9 KiB of workgroup memory.
const NODES: u32 = 2048;

/// How a class gathers fragments.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Gather {
    /// An invocation a triangle, with room for NODES fragments of all pixels together.
    Triangles,
    /// An invocation a pixel, a bit for each triangle that covers it.
    Masks,
    /// An invocation a triangle, with room for each pixel's deepest.
    Deep,
    /// An invocation a pixel, with room in workgroup memory.
    Staged,
}

#[derive(Debug, Clone, Copy)]
pub struct Class {
    pub gather: Gather,
    /// Fragments of a pixel that there is room for.
    pub depth: u32,
    /// Of the class that mostly hands parts over, 0 if none: pixels of fewer do with a network for as many, since what is
    /// written out takes long to compile (NVIDIA's driver took half a minute for all sizes in all classes).
    least: u32,
    /// Invocations, which is pixels.
    pub threads: u32,
    /// Where deeper parts go. `CLASS_COUNT`: nowhere.
    pub next: usize,
}

impl Class {
    /// The networks that are written out.
    fn sizes(&self) -> Vec<u32> {
        SIZES.into_iter().filter(|&n| n >= self.least && n <= self.depth).collect()
    }

    /// What sorts, as WGSL.
    pub fn sort(&self) -> Option<String> {
        match self.gather {
            Gather::Triangles => Some(sort_taken(&self.sizes(), 16)),
            Gather::Masks => Some(sort_taken(&self.sizes(), 8)),
            // Powers of two alone: with loads of keys each takes longer to compile.
            Gather::Deep => {
                let powers = self.sizes().into_iter().filter(|n| n.is_power_of_two());
                Some(sort_taken(&powers.collect::<Vec<_>>(), 16))
            }
            Gather::Staged => None, // loops: tiles/composite_staged.wgsl
        }
    }

    /// Entries in workgroup memory.
    fn entries(&self) -> u32 {
        match self.gather {
            Gather::Triangles => NODES,
            Gather::Masks => 0,
            Gather::Deep | Gather::Staged => self.depth * self.threads,
        }
    }
}

pub fn classes(gpu: &Gpu) -> [Class; CLASS_COUNT] {
    // Software drivers take seconds to compile longer networks, and minutes the longest.
    classes_of(if gpu.adapter.is_software() { [2, 4, 8] } else { [16, 32, 64] })
}

/// `depths`: of the networks.
pub fn classes_of([short, longer, long]: [u32; 3]) -> [Class; CLASS_COUNT] {
    let class = |gather, least, depth, threads, next| Class { gather, depth, least, threads, next };
    [
        class(Gather::Triangles, 0, long.min(16), TILE_PIXELS, 4),
        class(Gather::Masks, 0, short, TILE_PIXELS, 2),
        class(Gather::Masks, short, longer, TILE_PIXELS, 3),
        class(Gather::Masks, longer, long, 128, 5),
        class(Gather::Deep, short, long, 64, 5),
        class(Gather::Staged, 0, long, if long > 32 { 32 } else { 64 }, CLASS_COUNT),
    ]
}

/// The classes that a frame dispatches: each takes a device some µs though no tile is in it, and a driver up to seconds
/// to compile. A frame that turns out to have tiles of others is done again with all, which a driver compiles side by
/// side, and shows which the next ones need.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Wanted {
    classes: [bool; CLASS_COUNT],
    /// Those that frames of the scene have used.
    used: [bool; CLASS_COUNT],
    /// Only those are wanted.
    is_known: bool,
}

impl Default for Wanted {
    /// Those that most scenes do with.
    fn default() -> Self {
        let classes = std::array::from_fn(|class| class < 2);
        Self { classes, used: [false; CLASS_COUNT], is_known: false }
    }
}

impl Wanted {
    pub fn classes(&self) -> impl Iterator<Item = usize> + use<> {
        let classes = self.classes;
        (0..CLASS_COUNT).filter(move |&class| classes[class])
    }

    /// Before it is known what a scene uses: with those that cost no compilation too.
    pub fn with_made(mut self, made: [bool; CLASS_COUNT]) -> Self {
        if !self.is_known {
            self.classes = std::array::from_fn(|class| self.classes[class] || made[class]);
        }
        self
    }

    /// Whether a frame of so many parts of each class has none of others.
    pub fn suffice(&self, parts: &[u32]) -> bool {
        (0..CLASS_COUNT).all(|class| self.classes[class] || parts[class] == 0)
    }

    pub fn want_all(&mut self) {
        (self.classes, self.is_known) = ([true; CLASS_COUNT], false);
    }

    /// Learns from a whole frame what the scene uses.
    pub fn learn(&mut self, parts: &[u32]) {
        if !self.is_known {
            self.used = std::array::from_fn(|class| self.used[class] || parts[class] > 0);
            (self.classes, self.is_known) = (self.used, true);
        }
    }
}

/// Parts of a class, at most, of so many tiles.
pub fn most_parts(tiles: u32) -> u32 {
    tiles * (TILE_PIXELS / UNIT)
}

/// What shaders know of all classes.
pub fn constants(classes: &[Class]) -> String {
    let list = |of: fn(&Class) -> u32| {
        let values: Vec<_> = classes.iter().map(|c| format!("{}u", of(c))).collect();
        format!("array<u32, {CLASS_COUNT}>({})", values.join(", "))
    };
    format!(
        "const CLASS_SLOTS_OF_TILES = {}u;\nconst CLASS_THREADS = {};\n\
         const CLASS_DEPTHS = {};\nconst CLASS_ENTRIES = {};\nconst MOST_GROUPS = {MOST_GROUPS}u;\n\
         const MANY_TRIANGLES = {MANY_TRIANGLES}u;\nconst SMALL_AREA = {SMALL_AREA}u;\n",
        CLASS_COUNT + 1, // the last for parts that no class has room for
        list(|c| c.threads),
        list(|c| c.depth),
        list(Class::entries),
    )
}

/// What shaders know of one.
pub fn own_constants(classes: &[Class], class: usize) -> String {
    let own = classes[class];
    let next_threads = classes.get(own.next).map_or(own.threads, |next| next.threads);
    format!(
        "const OWN_CLASS = {class}u;\nconst DEPTH = {}u;\nconst THREADS = {}u;\nconst NEXT_CLASS = {}u;\n\
         const NEXT_THREADS = {next_threads}u;\nconst ENTRIES = {}u;\n",
        own.depth,
        own.threads,
        own.next,
        own.entries(),
    )
}

/// Fragments between two branches: drivers take much longer over branches than over what these leave out.
const STRAIGHT: usize = 4;

const SIZES: [u32; 8] = [2, 4, 8, 16, 24, 32, 48, 64];

/// `sort` of tiles/composite_taken.wgsl: keys are made and sorted without leaving registers. What is
/// composited in which order is kept in so many bits each.
fn sort_taken(sizes: &[u32], bits: u32) -> String {
    let mut text =
        format!("const PLACE_BITS = {bits}u;\nfn sort(n: u32, pixel: vec2u) {{\nlet all = widest(n);\n");
    for &size in sizes {
        if Some(&size) == sizes.last() {
            let _ = writeln!(text, "sort_{size}(n, pixel);\n}}");
        } else {
            let _ = writeln!(text, "if all <= {size}u {{ sort_{size}(n, pixel); return; }}");
        }
    }
    for &size in sizes {
        let _ = writeln!(text, "fn sort_{size}(n: u32, pixel: vec2u) {{");
        for i in 0..size {
            let _ = writeln!(text, "var k{i} = HIDDEN; var t{i} = 0u;");
        }
        for first in (0..size).step_by(STRAIGHT) {
            let _ = writeln!(text, "if n > {first}u {{");
            for i in first..size.min(first + STRAIGHT as u32) {
                let _ = writeln!(text, "t{i} = take({i}u); k{i} = taken_key(t{i}, n > {i}u, pixel);");
            }
            text.push_str("}\n");
        }
        order(&mut text, size);
        let each = 32 / bits;
        for first in (0..size).step_by(each as usize) {
            let parts = first..size.min(first + each);
            let parts: Vec<_> = parts.map(|t| format!("(t{t} << {}u)", bits * (t - first))).collect();
            let _ = writeln!(text, "order[{}] = {};", first / each, parts.join(" | "));
        }
        text.push_str("}\n");
    }
    text
}

/// Orders k0, k1, … and t0, t1, … with them: by key, and of equal ones the later triangle first.
fn order(text: &mut String, size: u32) {
    // What is past the end has the greatest key, and stays there.
    for (i, j) in network(size) {
        let _ = writeln!(
            text,
            "{{ let s = k{j} < k{i}; let k = select(k{i}, k{j}, s); let t = select(t{i}, t{j}, s); \
             k{j} = select(k{j}, k{i}, s); t{j} = select(t{j}, t{i}, s); k{i} = k; t{i} = t; }}"
        );
    }
    if size < 2 {
        return;
    }
    // Ties are seldom, and come apart. (& and | do not branch.)
    let ties: Vec<_> = (1..size).map(|i| format!("((k{i} != HIDDEN) & (k{} == k{i}))", i - 1)).collect();
    let _ = writeln!(text, "var ties = {};\nwhile ties {{\nties = false;", ties.join(" | "));
    for i in 1..size {
        let h = i - 1;
        let _ = writeln!(
            text,
            "{{ let s = (k{i} != HIDDEN) & (k{h} == k{i}) & (t{h} < t{i}); let t = select(t{h}, t{i}, s); \
             t{i} = select(t{i}, t{h}, s); t{h} = t; ties |= s; }}"
        );
    }
    text.push_str("}\n");
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn frames_want_what_frames_before_used_and_all_where_that_does_not_do() {
        let only = |class: usize| std::array::from_fn::<u32, CLASS_COUNT, _>(|c| u32::from(c == class));
        let classes = |wanted: &Wanted| wanted.classes().collect::<Vec<_>>();
        let all = Vec::from_iter(0..CLASS_COUNT);
        let mut wanted = Wanted::default();
        assert_eq!(classes(&wanted), [0, 1]);
        assert_eq!(classes(&wanted.with_made([true; CLASS_COUNT])), all);
        assert!(wanted.suffice(&only(1)) && !wanted.suffice(&only(4)));
        wanted.want_all();
        assert_eq!(classes(&wanted), all);
        wanted.learn(&only(4));
        assert_eq!(classes(&wanted), [4]);
        assert_eq!(classes(&wanted.with_made([true; CLASS_COUNT])), [4], "what is made is not used");
        assert!(wanted.suffice(&only(4)) && !wanted.suffice(&only(2)));
        wanted.want_all();
        wanted.learn(&only(2));
        assert_eq!(classes(&wanted), [2, 4], "what an earlier frame used comes again");
    }

    #[test]
    fn parts_are_whole_units_and_go_on_to_classes_with_more_room() {
        for depths in [[2, 4, 8], [16, 32, 64]] {
            let classes = classes_of(depths);
            for (i, c) in classes.iter().enumerate() {
                assert_eq!((c.threads % UNIT, TILE_PIXELS % c.threads), (0, 0));
                assert!(SIZES.contains(&c.depth), "the last network is as deep as the class");
                let deep = c.gather == Gather::Deep;
                assert!(
                    !deep || (c.threads <= 128 && c.depth % 2 == 0),
                    "a block is 8 rows, a word two places"
                );
                if let Some(next) = classes.get(c.next) {
                    assert!(c.next > i && next.depth >= c.depth && next.threads <= c.threads);
                }
            }
        }
    }
}
