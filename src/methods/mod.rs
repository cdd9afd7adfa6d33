//! Methods: rules that turn the fragments of one pixel into a colour.
//!
//! A method is its parameters, a state, and a few functions, written twice with the same names: here, and in
//! shaders/methods. It sees fragments one at a time, in the order that it asks for, once or several times, and knows
//! nothing of pipelines. Methods never name each other; what several of them need is in
//! `common`.

mod adaptive;
mod additive;
mod bounds;
mod bucket_peeling;
mod common;
mod depth_peeling;
mod dual_depth_peeling;
pub mod exact;
mod fourier;
mod hybrid;
mod k_buffer;
mod mboit;
mod mlab;
mod phenomenological;
mod stencil_routed;
mod stochastic;
mod unsorted;
mod wavelet;
mod wboit;
mod weighted_average;
mod weighted_sum;

use std::sync::Arc;

use crate::real::Real;
pub use adaptive::Adaptive;
pub use additive::Additive;
pub use bounds::Bounds;
pub use bucket_peeling::BucketPeeling;
pub use common::own::Own;
pub use common::parameters::{Parameters, Value};
pub use depth_peeling::DepthPeeling;
pub use dual_depth_peeling::DualDepthPeeling;
pub use fourier::Fourier;
pub use hybrid::Hybrid;
pub use k_buffer::KBuffer;
pub use mboit::Mboit;
pub use mlab::Mlab;
pub use phenomenological::Phenomenological;
pub use stencil_routed::StencilRouted;
pub use stochastic::Stochastic;
pub use unsorted::Unsorted;
pub use wavelet::Wavelet;
pub use wboit::Wboit;
pub use weighted_average::WeightedAverage;
pub use weighted_sum::WeightedSum;

/// What a method sees of a fragment.
#[derive(Debug, Clone, Copy)]
pub struct Fragment<T: Real> {
    /// Straight RGBA.
    pub color: [T; 4],
    /// From the eye along the view axis, in world units.
    pub depth: T,
    /// Smaller is in front; no two of a pixel are equal.
    pub order: T::Entry,
    /// Its place in the order of submission.
    pub primitive: u32,
    /// An id of `blend::MODES`: `over`, but for methods that take modes.
    pub mode: u8,
}

/// Whose fragments these are.
#[derive(Debug, Clone, Copy, Default)]
pub struct Place {
    pub x: u32,
    pub y: u32,
    pub sample: u32,
}

/// The order in which a method sees the fragments of a pixel.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Order {
    FrontToBack,
    /// By primitive, rising.
    Submission,
}

/// A method that sees fragments in the order of submission. Implementors are its parameters.
pub trait Streamed<T: Real>: Described {
    type State;

    fn begin(&self, place: Place) -> Self::State;
    /// Called before each pass over the fragments, `pass` from 0 on: whether the state wants it.
    fn turn(&self, state: &mut Self::State, pass: u32) -> bool;
    fn insert(&self, state: &mut Self::State, fragment: &Fragment<T>, pass: u32);
    /// The premultiplied colour over a straight background.
    fn end(&self, state: &Self::State, behind: [T; 4]) -> [T; 4];
    /// Of `n` fragments, those that were merged into others or dropped.
    fn left_out(&self, _: &Self::State, _n: u32) -> u32 {
        0
    }
}

/// What a method is beside its arithmetic.
pub trait Described {
    /// What its shader is specialised for: names and values, as WGSL.
    fn constants(&self) -> Vec<(&'static str, String)> {
        vec![]
    }
    /// Files of shaders that its own needs.
    fn common(&self) -> &'static [&'static str] {
        &["methods/common/layer"]
    }
    /// What its shader is given with each frame.
    fn values(&self) -> Values {
        Values::default()
    }
    /// Passes over a list of `n` fragments, at most, and loop iterations of its shader's `insert`.
    fn work(&self, _n: u32) -> (u32, u32) {
        (1, 0)
    }
    /// What is left out was dropped, not merged into others.
    fn drops(&self) -> bool {
        false
    }
}

/// Parameters that a shader is not specialised for.
#[derive(Debug, Clone, Copy, Default)]
pub struct Values {
    pub range: DepthRange,
    pub beta: f64,
    pub seed: u32,
}

/// The depths of a scene's geometry in front of the camera, nearest and farthest, which depths are normalised by.
pub type DepthRange = (f64, f64);

macro_rules! methods {
    ($($id:literal $name:ident,)*) => {
        /// A method with its parameters.
        #[derive(Debug, Clone)]
        pub enum Method {
            Exact,
            Own(Arc<Own>),
            $($name($name),)*
        }

        /// Every method.
        pub static IDS: &[&str] = &["exact", $($id),*];

        impl Method {
            /// A method by its id, with parameters that are its own and checked.
            pub fn of(id: &str, parameters: &Parameters) -> Option<Self> {
                match id {
                    "exact" => Some(Self::Exact),
                    $($id => Some(Self::$name($name::of(parameters))),)*
                    _ => None,
                }
            }

            pub fn id(&self) -> &str {
                match self {
                    Self::Exact => "exact",
                    Self::Own(own) => &own.id,
                    $(Self::$name(_) => $id,)*
                }
            }

            /// Its parameters, as anything that streams; `None`: it is exact.
            fn described(&self) -> Option<&dyn Described> {
                match self {
                    Self::Exact => None,
                    Self::Own(own) => Some(own.as_ref()),
                    $(Self::$name(method) => Some(method),)*
                }
            }

            /// The colour that a method which streams makes of all fragments, in the order of submission, and how many
            /// it left out. `None`: it is exact, or no method of the core's.
            #[inline]
            pub fn streamed<T: Real>(
                &self,
                place: Place,
                fragments: impl Iterator<Item = Fragment<T>> + Clone,
                behind: [T; 4],
            ) -> Option<([T; 4], u32)> {
                match self {
                    Self::Exact | Self::Own(_) => None,
                    $(Self::$name(method) => Some(run(method, place, fragments, behind)),)*
                }
            }
        }
    };
}

// One line a method: its id, which names its files, and its parameters.
methods! {
    "bounds" Bounds,
    "additive" Additive,
    "depth_peeling" DepthPeeling,
    "dual_depth_peeling" DualDepthPeeling,
    "k_buffer" KBuffer,
    "phenomenological" Phenomenological,
    "unsorted" Unsorted,
    "mlab" Mlab,
    "hybrid" Hybrid,
    "adaptive" Adaptive,
    "bucket_peeling" BucketPeeling,
    "stencil_routed" StencilRouted,
    "weighted_average" WeightedAverage,
    "weighted_sum" WeightedSum,
    "wboit" Wboit,
    "wavelet" Wavelet,
    "fourier" Fourier,
    "stochastic" Stochastic,
    "mboit" Mboit,
}

impl Method {
    pub fn is_exact(&self) -> bool {
        matches!(self, Self::Exact)
    }

    pub fn order(&self) -> Order {
        if self.is_exact() { Order::FrontToBack } else { Order::Submission }
    }

    /// Constants of its shader, as WGSL.
    pub fn constants_text(&self) -> String {
        if let Self::Own(own) = self {
            return own.constants.clone();
        }
        let constants = self.described().map(Described::constants).unwrap_or_default();
        constants.into_iter().map(|(name, value)| format!("const {name} = {value};\n")).collect()
    }

    pub fn common(&self) -> &'static [&'static str] {
        self.described().map(Described::common).unwrap_or_default()
    }

    pub fn values(&self) -> Values {
        self.described().map(Described::values).unwrap_or_default()
    }

    pub fn work(&self, n: u32) -> (u32, u32) {
        self.described().map_or((1, 0), |method| method.work(n))
    }

    pub fn drops(&self) -> bool {
        self.described().is_some_and(Described::drops)
    }
}

/// Runs a streamed method over all fragments, in their order.
#[inline]
pub fn run<T: Real, M: Streamed<T>>(
    method: &M,
    place: Place,
    fragments: impl Iterator<Item = Fragment<T>> + Clone,
    behind: [T; 4],
) -> ([T; 4], u32) {
    let mut state = method.begin(place);
    let mut pass = 0;
    let mut count = 0;
    while method.turn(&mut state, pass) {
        count = 0;
        for fragment in fragments.clone() {
            method.insert(&mut state, &fragment, pass);
            count += 1;
        }
        pass += 1;
    }
    (method.end(&state, behind), method.left_out(&state, count))
}

#[cfg(test)]
pub mod tests {
    use super::*;
    use crate::blend::OVER;

    /// Every method that streams, with some parameters: between them they use every file of shaders.
    pub fn some_methods() -> Vec<Method> {
        let counts = ["k", "moments", "rank", "terms", "draws", "buckets"];
        let with = |count: f64, flag: bool| {
            let numbers = counts.map(|name| (name.to_string(), Value::Number(count)));
            let flags = [("trigonometric".to_string(), Value::Flag(flag))];
            Parameters(numbers.into_iter().chain(flags).collect())
        };
        let both = [with(4.0, false), with(8.0, true)];
        let all = both.iter().flat_map(|p| IDS[1..].iter().filter_map(move |id| Method::of(id, p)));
        let mut seen = std::collections::HashSet::new();
        all.filter(|method| seen.insert((method.id().to_string(), method.constants_text()))).collect()
    }

    /// A fragment at a depth; submitted in the order of an array.
    pub fn fragment(depth: u32, color: [f64; 4]) -> Fragment<f64> {
        let depth = f64::from(depth);
        Fragment { color, depth, order: f64::entry(depth.orderable(), 0), primitive: 0, mode: OVER }
    }

    /// Over transparent black: the image, and what was left out.
    pub fn run<M: Streamed<f64>>(method: &M, fragments: &[Fragment<f64>]) -> ([f64; 4], u32) {
        let submitted = fragments.iter().zip(0..).map(|(f, i)| Fragment {
            order: f64::entry(f.depth.orderable(), !i),
            primitive: i,
            ..*f
        });
        super::run(method, Place::default(), submitted, [0.0; 4])
    }
}
