//! Eight triangles at a time, in float32: those that clipping leaves whole, which are nearly all. The others go one
//! by one. Every operation is that of `triangle.rs`, `clip.rs` and `plane.rs`, in their order, for the same bits.
#![allow(
    clippy::needless_range_loop,
    reason = "iterators may be compiled apart, without the caller's instructions"
)]

use std::ops::Range;

use super::triangle::{Faces, Part, View};
use super::{FLAT, Record, SUBPIXELS};
use crate::cpu::lanes::Avx2;
use crate::cpu::lanes::{Instructions, Lanes, Plain};
use crate::cpu::plane::{Plane, Slopes};
use crate::real::split;
use crate::scene::Positions;

const EIGHT: usize = 8;

/// Adds what is visible of some faces.
pub fn add_faces(instructions: Instructions, part: &mut Part<f32>, of: &Faces<f32>, faces: Range<usize>) {
    match instructions {
        Instructions::Any => add_with(Plain, part, of, faces),
        #[cfg(target_arch = "x86_64")]
        // SAFETY: `detected` has found AVX2 on this processor.
        Instructions::Avx2 => unsafe { add_with_avx2(part, of, faces) },
    }
}

#[cfg(target_arch = "x86_64")]
#[target_feature(enable = "avx2")]
fn add_with_avx2(part: &mut Part<f32>, of: &Faces<f32>, faces: Range<usize>) {
    // SAFETY: this function is called where there is AVX2.
    let v = unsafe { Avx2::new() };
    add_with(v, part, of, faces);
}

#[inline(always)]
fn add_with(v: impl Lanes, part: &mut Part<f32>, of: &Faces<f32>, faces: Range<usize>) {
    let mut first = faces.start;
    while !of.view.multisampled && first + EIGHT <= faces.end {
        add_eight(v, part, of, first);
        first += EIGHT;
    }
    part.add_each(of, first..faces.end);
}

/// One corner of each of eight triangles, in clip space.
#[derive(Clone, Copy)]
struct Corner<V: Lanes> {
    x: V::F32,
    y: V::F32,
    w: V::F32,
    depth: V::F32,
    /// Which of the given three it is.
    given: V::I32,
}

impl<V: Lanes> Corner<V> {
    /// `self` in `lanes`, `other` elsewhere.
    #[inline(always)]
    fn or(self, v: V, lanes: V::I32, other: Self) -> Self {
        Self {
            x: v.choose(lanes, self.x, other.x),
            y: v.choose(lanes, self.y, other.y),
            w: v.choose(lanes, self.w, other.w),
            depth: v.choose(lanes, self.depth, other.depth),
            given: v.choose_ints(lanes, self.given, other.given),
        }
    }

    /// Lanes in which the corner is not finite, or outside the clip volume.
    #[inline(always)]
    fn outside(&self, v: V, view: &View<f32>) -> V::I32 {
        let Self { x, y, w, depth, .. } = *self;
        let volume = &view.volume;
        let sum = v.add(v.add(v.add(x, y), w), depth);
        let guard = v.mul(v.splat(volume.guard), w);
        let mut least = v.sub(depth, v.splat(volume.near));
        least = v.min(v.sub(v.splat(volume.far), depth), least);
        least = v.min(v.add(guard, x), least);
        least = v.min(v.sub(guard, x), least);
        least = v.min(v.add(guard, y), least);
        least = v.min(v.sub(guard, y), least);
        v.or(v.not(v.less(v.abs(sum), v.splat(f32::INFINITY))), v.less(least, v.splat(0.0)))
    }

    /// `plane::on_screen`.
    #[inline(always)]
    fn on_screen(&self, v: V, view: &View<f32>) -> [V::F32; 2] {
        let half = v.splat(0.5);
        let across = v.add(v.mul(v.div(self.x, self.w), half), half);
        let down = v.sub(half, v.mul(v.div(self.y, self.w), half));
        [v.mul(across, v.splat(view.width)), v.mul(down, v.splat(view.height))]
    }
}

/// `Real::relative` of one coordinate: positions as two floats each.
#[inline(always)]
fn relative<V: Lanes>(v: V, high: [f32; EIGHT], rest: [f32; EIGHT], center: f64) -> V::F32 {
    let (high, rest) = (v.floats(high), v.floats(rest));
    let (center, center_rest) = split(center);
    let sum = v.sub(high, v.splat(center));
    let shadow = v.sub(sum, high);
    let lost = v.add(v.sub(high, v.sub(sum, shadow)), v.sub(v.splat(-center), shadow));
    v.add(sum, v.add(lost, v.sub(rest, v.splat(center_rest))))
}

#[inline(always)]
fn transformed<V: Lanes>(v: V, of: &Faces<f32>, ids: &[[usize; 3]; EIGHT], corner: usize) -> Corner<V> {
    let (mut high, mut rest) = ([[0.0; EIGHT]; 3], [[0.0; EIGHT]; 3]);
    match of.mesh.positions {
        Positions::F32(given) => {
            for lane in 0..EIGHT {
                let [x, y, z] = given[ids[lane][corner]];
                (high[0][lane], high[1][lane], high[2][lane]) = (x, y, z);
            }
        }
        Positions::F64(given) => {
            for lane in 0..EIGHT {
                let position = given[ids[lane][corner]];
                for i in 0..3 {
                    (high[i][lane], rest[i][lane]) = split(position[i]);
                }
            }
        }
    }
    let center = of.view.center;
    let x = relative(v, high[0], rest[0], center.x);
    let y = relative(v, high[1], rest[1], center.y);
    let z = relative(v, high[2], rest[2], center.z);
    macro_rules! dot {
        ($row:expr) => {{
            let row = &of.view.rows[$row];
            let xy = v.add(v.mul(v.splat(row[0]), x), v.mul(v.splat(row[1]), y));
            v.add(v.add(xy, v.mul(v.splat(row[2]), z)), v.splat(row[3]))
        }};
    }
    let w = dot!(2);
    let depth = if of.view.volume.perspective { w } else { dot!(3) };
    Corner { x: dot!(0), y: dot!(1), w, depth, given: v.splat_int(corner as i32) }
}

/// What `plane::Frame` has, of eight triangles.
struct Frames<V: Lanes> {
    anchor: [V::F32; 2],
    /// Which corner that is, and its w.
    at: V::I32,
    at_w: V::F32,
    key: [V::F32; 5],
    slopes: [[V::F32; 2]; 3],
}

#[inline(always)]
fn frames<V: Lanes>(v: V, view: &View<f32>, [a, b, c]: [Corner<V>; 3]) -> Frames<V> {
    let perspective = view.volume.perspective;
    let mut largest = v.splat(0.0);
    for corner in [a, b, c] {
        largest = v.max(v.abs(corner.x), largest);
        largest = v.max(v.abs(corner.y), largest);
        largest = v.max(v.abs(corner.w), largest);
    }
    let scale = v.inverse_binade(largest);
    macro_rules! scaled {
        ($corner:expr) => {
            [v.mul($corner.x, scale), v.mul($corner.y, scale), v.mul($corner.w, scale)]
        };
    }
    macro_rules! minus {
        ($a:expr, $b:expr) => {
            [v.sub($a[0], $b[0]), v.sub($a[1], $b[1]), v.sub($a[2], $b[2])]
        };
    }
    macro_rules! cross {
        ($a:expr, $b:expr, $i:literal, $j:literal) => {
            v.sub(v.mul($a[$i], $b[$j]), v.mul($a[$j], $b[$i]))
        };
    }
    let origin = scaled!(a);
    let (ab, ac) = (minus!(scaled!(b), origin), minus!(scaled!(c), origin));
    let normal = [cross!(ab, ac, 1, 2), cross!(ab, ac, 2, 0), cross!(ab, ac, 0, 1)];
    let two_terms = v.add(v.mul(origin[0], normal[0]), v.mul(origin[1], normal[1]));
    let determinant = v.add(two_terms, v.mul(origin[2], normal[2]));
    let zero = v.splat(0.0);
    let some = v.or(v.less(determinant, zero), v.less(zero, determinant));
    // A NaN is no zero: it must come through.
    let none = v.not(v.or(some, v.not(v.less(v.abs(determinant), v.splat(f32::INFINITY)))));
    let inverse = v.choose(none, zero, v.div(scale, determinant));
    let to_pixels = [v.mul(v.splat(2.0 / view.width), inverse), v.mul(v.splat(-2.0 / view.height), inverse)];
    let slopes = [
        [v.mul(normal[0], to_pixels[0]), v.mul(normal[1], to_pixels[1])],
        [v.mul(cross!(ac, origin, 1, 2), to_pixels[0]), v.mul(cross!(ac, origin, 2, 0), to_pixels[1])],
        [v.mul(cross!(origin, ab, 1, 2), to_pixels[0]), v.mul(cross!(origin, ab, 2, 0), to_pixels[1])],
    ];

    // The corner that lands nearest the middle of the screen.
    let (mut at, mut least) = (a, v.div(v.max(v.abs(a.y), v.abs(a.x)), a.w));
    for corner in [b, c] {
        let off = v.div(v.max(v.abs(corner.y), v.abs(corner.x)), corner.w);
        let nearer = v.less(off, least);
        at = corner.or(v, nearer, at);
        least = v.choose(nearer, off, least);
    }
    macro_rules! of_key {
        ($corner:expr) => {
            if perspective { v.div(v.splat(1.0), $corner.w) } else { $corner.depth }
        };
    }
    let keys = [of_key!(a), of_key!(b), of_key!(c)];
    let attribute = if perspective { [v.splat(1.0); 3] } else { [a.depth, b.depth, c.depth] };
    let (db, dc) = (v.sub(attribute[1], attribute[0]), v.sub(attribute[2], attribute[0]));
    let mut gradient = [zero; 2];
    for i in 0..2 {
        let first = v.add(v.mul(attribute[0], slopes[0][i]), v.mul(db, slopes[1][i]));
        gradient[i] = v.add(first, v.mul(dc, slopes[2][i]));
    }
    let low = v.min(keys[2], v.min(keys[1], keys[0]));
    let high = v.max(keys[2], v.max(keys[1], keys[0]));
    Frames {
        anchor: at.on_screen(v, view),
        at: at.given,
        at_w: at.w,
        key: [of_key!(at), gradient[0], gradient[1], low, high],
        slopes,
    }
}

#[inline(always)]
fn add_eight<V: Lanes>(v: V, part: &mut Part<f32>, of: &Faces<f32>, first: usize) {
    let view = of.view;
    let mut ids = [[0; 3]; EIGHT];
    for lane in 0..EIGHT {
        ids[lane] = of.mesh.vertex_ids(first + lane);
    }
    let mut corners = [transformed(v, of, &ids, 0), transformed(v, of, &ids, 1), transformed(v, of, &ids, 2)];
    let mut apart = v.splat_int(0);
    let mut orders = [apart; 3];
    for i in 0..3 {
        apart = v.or(apart, corners[i].outside(v, view));
        orders[i] = v.orderable(corners[i].x);
    }
    // The canonical order, by x alone: where two are equal, more decides.
    let mut flipped = v.splat_int(0);
    for (i, j) in [(0, 1), (1, 2), (0, 1)] {
        let swap = v.greater_ints(orders[i], orders[j]);
        let (a, b) = (corners[i], corners[j]);
        (corners[i], corners[j]) = (b.or(v, swap, a), a.or(v, swap, b));
        let (a, b) = (orders[i], orders[j]);
        (orders[i], orders[j]) = (v.choose_ints(swap, b, a), v.choose_ints(swap, a, b));
        flipped = v.xor(flipped, swap);
    }
    apart = v.or(apart, v.not(v.greater_ints(orders[1], orders[0])));
    apart = v.or(apart, v.not(v.greater_ints(orders[2], orders[1])));

    let mut snapped = [[[0; EIGHT]; 2]; 3];
    let mut given = [[0; EIGHT]; 3];
    for i in 0..3 {
        let screen = corners[i].on_screen(v, view);
        for axis in 0..2 {
            let units = v.add(v.mul(screen[axis], v.splat(SUBPIXELS as f32)), v.splat(0.5));
            snapped[i][axis] = v.floor_to_ints(units);
        }
        given[i] = v.int_array(corners[i].given);
    }
    let frames = frames(v, view, corners);
    let anchor = [v.float_array(frames.anchor[0]), v.float_array(frames.anchor[1])];
    let mut key = [[0.0; EIGHT]; 5];
    for i in 0..5 {
        key[i] = v.float_array(frames.key[i]);
    }
    let mut slopes = [[[0.0; EIGHT]; 2]; 3];
    for i in 0..3 {
        slopes[i] = [v.float_array(frames.slopes[i][0]), v.float_array(frames.slopes[i][1])];
    }
    let (at, at_w) = (v.int_array(frames.at), v.float_array(frames.at_w));
    let (apart, flipped) = (v.int_array(apart), v.int_array(flipped));

    for lane in 0..EIGHT {
        let face = first + lane;
        if apart[lane] != 0 {
            part.add_each(of, face..face + 1);
            continue;
        }
        let corner = |i: usize| (snapped[i][0][lane], snapped[i][1][lane]);
        let piece = [corner(0), corner(1), corner(2)];
        let Some((x, y)) = view.visible_piece(piece, flipped[lane] != 0, of.mesh.cull) else { continue };
        let [value, gx, gy, low, high] =
            [key[0][lane], key[1][lane], key[2][lane], key[3][lane], key[4][lane]];
        let colors = of.mesh.corner_colors::<f32>(face, ids[lane]);
        let color = |i: usize| colors[given[i][lane] as usize];
        let slopes = Slopes {
            constant: [slopes[0][0][lane], slopes[0][1][lane]],
            along_b: [slopes[1][0][lane], slopes[1][1][lane]],
            along_c: [slopes[2][0][lane], slopes[2][1][lane]],
        };
        let planes =
            slopes.color_planes([color(0), color(1), color(2)], colors[at[lane] as usize], at_w[lane]);
        let (true, Some(planes)) = ((value + gx + gy).is_finite(), planes) else {
            part.rejected += 1;
            continue;
        };
        let gradient = planes.map_or(FLAT, |planes| {
            part.gradients.push(planes);
            part.gradients.len() as u32 - 1
        });
        part.records.push(Record {
            x,
            y,
            anchor: [anchor[0][lane], anchor[1][lane]],
            key_plane: Plane { value, gx, gy, low, high },
            color: color(0),
            gradient,
            primitive: (of.first_primitive + face) as u32,
            mesh: of.id as u32,
        });
    }
}
