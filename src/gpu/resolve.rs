//! The resolve of one rectangle's lists: classified by length, then each class by its own pipeline, dispatched or
//! drawn indirectly; what is longer than any class by the stages in `long`.

use super::buffers::bind;
use super::passes::Frame;
use super::pool::Pool;
use super::rect::Rect;
use super::timing::Timing;
use super::variant::Variant;
use crate::error::{Error, Result};

/// Tile width and height, as classification counts them.
pub const TILE: u32 = 16;

/// What a resolve found.
#[derive(Debug, Default, Clone)]
pub struct Outcome {
    pub longest: u32,
    pub filled_tiles: u64,
    /// Fragments beyond the limit.
    pub dropped: u64,
    /// Pixels of each class, the last one of longer lists.
    pub totals: Vec<u64>,
}

impl Outcome {
    pub fn join(&mut self, other: &Self) {
        self.longest = self.longest.max(other.longest);
        self.filled_tiles += other.filled_tiles;
        self.dropped += other.dropped;
        self.totals.resize(other.totals.len(), 0);
        self.totals.iter_mut().zip(&other.totals).for_each(|(all, own)| *all += own);
    }
}

/// What classification counted.
pub struct Found {
    /// Pixels of each class, the last one of longer lists, and where each lies among the classified pixels.
    totals: Vec<u32>,
    bases: Vec<u32>,
    longest: u32,
    filled_tiles: u32,
    /// Fragments beyond the limit, once the classes are resolved.
    dropped: u32,
}

impl Found {
    pub fn of(variant: &Variant, words: &[u32]) -> Result<Self> {
        let slots = variant.classes.len() + 1;
        let [longest, filled_tiles, dropped, ..] = words[2 * slots..] else {
            return Err(Error::Device("the classes were not read back whole".into()));
        };
        let (totals, bases) = (words[..slots].to_vec(), words[slots..2 * slots].to_vec());
        Ok(Self { totals, bases, longest, filled_tiles, dropped })
    }

    /// The lists that no class has room for: the first of their pixels, and how many they are.
    pub fn long_lists(&self) -> Option<(u32, u32)> {
        let (first, count) = (self.bases.last()?, self.totals.last()?);
        (*count > 0).then_some((*first, *count))
    }

    pub fn outcome(&self, dropped_of_long_lists: u64) -> Outcome {
        Outcome {
            longest: self.longest,
            filled_tiles: u64::from(self.filled_tiles),
            dropped: u64::from(self.dropped) + dropped_of_long_lists,
            totals: self.totals.iter().copied().map(u64::from).collect(),
        }
    }
}

/// List lengths of a class, for people: "1", "2–4".
pub fn class_name(variant: &Variant, class: usize) -> String {
    let least = if class == 0 { 1 } else { variant.classes[class - 1] + 1 };
    match variant.classes.get(class) {
        Some(&most) if most == least => least.to_string(),
        Some(most) => format!("{least}–{most}"),
        None => format!("over {}", least - 1),
    }
}

pub fn encode_classify(
    frame: &Frame,
    encoder: &mut wgpu::CommandEncoder,
    pool: &Pool,
    read_group: &wgpu::BindGroup,
    rect: Rect,
    timing: &Timing,
) -> Result<()> {
    let (gpu, pipelines) = (frame.gpu, &frame.pipelines);
    let layouts = &pipelines.layouts;
    let (x, y) = (rect.w.div_ceil(TILE), rect.h.div_ceil(TILE));
    let classify = pipelines.classify(gpu)?;
    let group = bind(
        gpu,
        "classify",
        &layouts.classify,
        &[
            (&pool.classes).into(),
            (&pool.class_pixels).into(),
            (&pool.arguments).into(),
            (&pool.class_places).into(),
        ],
    );
    encoder.clear_buffer(&pool.classes, 0, None);
    let mut pass = encoder.begin_compute_pass(&wgpu::ComputePassDescriptor {
        label: Some("classify"),
        timestamp_writes: timing.compute("classify"),
    });
    pass.set_bind_group(0, read_group, &[]);
    pass.set_bind_group(1, &group, &[]);
    for (pipeline, (x, y)) in
        [(&classify.classify, (x, y)), (&classify.plan, (1, 1)), (&classify.place, (x, y))]
    {
        pass.set_pipeline(pipeline);
        pass.dispatch_workgroups(x, y, 1);
    }
    Ok(())
}

/// The classes that there are pixels of, and the mean of samples that are resolved apart.
pub fn encode_classes(
    frame: &Frame,
    encoder: &mut wgpu::CommandEncoder,
    pool: &Pool,
    read_group: &wgpu::BindGroup,
    rect: Rect,
    found: &Found,
    timing: &Timing,
) -> Result<()> {
    let (gpu, pipelines) = (frame.gpu, &frame.pipelines);
    let (variant, layouts) = (&pipelines.variant, &pipelines.layouts);
    let group = bind(
        gpu,
        "class",
        &layouts.class,
        &[(&pool.classes).into(), (&pool.class_pixels).into(), (&pool.sample_colors).into()],
    );
    let classes: Vec<_> = (0..variant.classes.len()).filter(|&class| found.totals[class] > 0).collect();
    pipelines.prepare_classes(gpu, &classes)?;
    for class in classes {
        let name = format!("resolve {}", class_name(variant, class));
        if variant.fullscreen {
            let pipeline = pipelines.fullscreen(gpu, class)?;
            let mut pass = encoder.begin_render_pass(&wgpu::RenderPassDescriptor {
                label: Some("resolve"),
                color_attachments: frame.targets.nothing_on_screen().as_slice(),
                depth_stencil_attachment: frame.targets.stencil_to_test(),
                timestamp_writes: timing.render(name),
                ..Default::default()
            });
            pass.set_pipeline(pipeline);
            pass.set_scissor_rect(rect.x0, rect.y0, rect.w, rect.h);
            pass.set_bind_group(0, read_group, &[]);
            pass.set_bind_group(1, &group, &[]);
            let slots = variant.classes.len() as u64 + 1;
            pass.draw_indirect(&pool.arguments, 12 * slots + 16 * class as u64);
        } else {
            let pipeline = pipelines.class(gpu, class)?;
            let mut pass = encoder.begin_compute_pass(&wgpu::ComputePassDescriptor {
                label: Some("resolve"),
                timestamp_writes: timing.compute(name),
            });
            pass.set_pipeline(pipeline);
            pass.set_bind_group(0, read_group, &[]);
            pass.set_bind_group(1, &group, &[]);
            pass.dispatch_workgroups_indirect(&pool.arguments, 12 * class as u64);
        }
    }
    if variant.per_sample() {
        let pipeline = pipelines.average(gpu)?;
        let group = bind(gpu, "average", &layouts.average, &[(&pool.sample_colors).into()]);
        let mut pass = encoder.begin_compute_pass(&wgpu::ComputePassDescriptor {
            label: Some("average"),
            timestamp_writes: timing.compute("average"),
        });
        pass.set_pipeline(pipeline);
        pass.set_bind_group(0, read_group, &[]);
        pass.set_bind_group(1, &group, &[]);
        pass.dispatch_workgroups(rect.w.div_ceil(TILE), rect.h.div_ceil(TILE), 1);
    }
    Ok(())
}
