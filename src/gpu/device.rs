//! Adapters and devices: found once, made lazily, kept for the process.

use std::collections::HashMap;
use std::sync::{Arc, Mutex, PoisonError};

use pollster::block_on;

use super::pipelines::{COLOR_FORMAT, COVERAGE_FORMAT, DEPTH_FORMAT, Pipelines};
use super::readback::{Staging, staging};
use super::variant::Variant;
use crate::error::{Error, Result};
use crate::samples::COUNTS;

/// An adapter as `devices()` lists it.
#[derive(Debug, Clone)]
pub struct Adapter {
    pub name: String,
    pub backend: String,
    /// "discrete", "integrated", "virtual", "other" or "software".
    pub kind: &'static str,
    pub driver: String,
    /// Why `linked_list` cannot run here, or `None`.
    pub lacks: Option<String>,
    /// The largest buffer that a shader can be given at once, bytes.
    pub max_binding: u64,
    /// Samples a pixel that it renders with, opaque geometry included.
    pub samples: Vec<u32>,
}

impl Adapter {
    pub fn is_software(&self) -> bool {
        self.kind == "software"
    }
}

/// A device that is ready to render.
pub struct Gpu {
    pub adapter: Adapter,
    pub device: wgpu::Device,
    pub queue: wgpu::Queue,
    pub features: wgpu::Features,
    pub limits: wgpu::Limits,
    pub staging: Staging,
    pipelines: Mutex<HashMap<Variant, Arc<Pipelines>>>,
    lost: Arc<Mutex<Option<String>>>,
    /// One render at a time: interleaved ones would hold twice the memory and gain nothing.
    busy: Mutex<()>,
}

/// The backends that render off screen without a window system. (wgpu's GL backend wants one, and says so.)
const BACKENDS: wgpu::Backends =
    wgpu::Backends::VULKAN.union(wgpu::Backends::METAL).union(wgpu::Backends::DX12);

/// Turns of its loops that an invocation has on a software driver: Mesa's llvmpipe ends every loop after 65,535, silently.
pub const SOFTWARE_TURNS: u32 = 60_000;
/// Variants whose pipelines are kept.
const MOST_VARIANTS: usize = 256;
/// Storage buffers that the stages for long lists bind.
const STORAGE_BUFFERS: u32 = 12;
/// What pipelines use where it exists.
const WANTED: wgpu::Features = wgpu::Features::SHADER_EARLY_DEPTH_TEST
    .union(wgpu::Features::TIMESTAMP_QUERY)
    .union(wgpu::Features::SUBGROUP)
    .union(wgpu::Features::DEPTH32FLOAT_STENCIL8)
    .union(wgpu::Features::FLOAT32_BLENDABLE)
    .union(wgpu::Features::TEXTURE_ADAPTER_SPECIFIC_FORMAT_FEATURES);

/// Features that `ABUFFER_WITHOUT` withholds (names of wgpu's, with commas), to test here what a lesser
/// device would do.
fn withheld() -> wgpu::Features {
    let names = std::env::var("ABUFFER_WITHOUT").unwrap_or_default();
    names
        .split(',')
        .filter_map(|name| wgpu::Features::from_name(name.trim()))
        .fold(wgpu::Features::empty(), |all, one| all | one)
}

/// Everything of the process that owns a device. A forked child cannot use its parent's, so it makes its own.
struct Process {
    id: u32,
    /// Its parent had devices.
    forked: bool,
    adapters: Vec<(wgpu::Adapter, Adapter)>,
    devices: Vec<Option<Arc<Gpu>>>,
}

static PROCESS: Mutex<Option<Process>> = Mutex::new(None);

fn with_process<R>(use_it: impl FnOnce(&mut Process) -> R) -> R {
    let mut guard = PROCESS.lock().unwrap_or_else(PoisonError::into_inner);
    let forked = guard.as_ref().is_some_and(|p| p.id != std::process::id());
    if forked {
        std::mem::forget(guard.take()); // its handles belong to the parent
    }
    use_it(guard.get_or_insert_with(|| Process::new(forked)))
}

impl Process {
    fn new(forked: bool) -> Self {
        let mut descriptor = wgpu::InstanceDescriptor::new_without_display_handle_from_env();
        descriptor.backends &= BACKENDS;
        // What this crate's own shaders write there is in bounds; checking it takes a dispatch for each (measured on an
        // H100: 8 µs, a tenth of a small frame).
        descriptor.flags.remove(wgpu::InstanceFlags::VALIDATION_INDIRECT_CALL);
        let instance = wgpu::Instance::new(descriptor);
        let mut adapters: Vec<_> = block_on(instance.enumerate_adapters(BACKENDS))
            .into_iter()
            .map(|adapter| {
                let described = describe(&adapter);
                (adapter, described)
            })
            .collect();
        // Best first, software last; a stable sort keeps the driver's order among equals.
        adapters.sort_by_key(|(_, a)| {
            ["discrete", "integrated", "virtual", "other", "software"].iter().position(|k| *k == a.kind)
        });
        let devices = adapters.iter().map(|_| None).collect();
        Self { id: std::process::id(), forked, adapters, devices }
    }
}

fn describe(adapter: &wgpu::Adapter) -> Adapter {
    let info = adapter.get_info();
    let limits = adapter.limits();
    let flags = adapter.get_downlevel_capabilities().flags;
    let lacks = if !flags.contains(wgpu::DownlevelFlags::FRAGMENT_WRITABLE_STORAGE) {
        Some("storage buffers that fragment shaders can write".to_string())
    } else if limits.max_storage_buffers_per_shader_stage < STORAGE_BUFFERS {
        Some(format!("{STORAGE_BUFFERS} storage buffers a shader stage"))
    } else {
        None
    };
    Adapter {
        name: info.name,
        backend: info.backend.to_string(),
        kind: match info.device_type {
            wgpu::DeviceType::DiscreteGpu => "discrete",
            wgpu::DeviceType::IntegratedGpu => "integrated",
            wgpu::DeviceType::VirtualGpu => "virtual",
            wgpu::DeviceType::Other => "other",
            wgpu::DeviceType::Cpu => "software",
        },
        driver: format!("{} {}", info.driver, info.driver_info).trim().to_string(),
        lacks,
        max_binding: limits.max_storage_buffer_binding_size,
        samples: sample_counts(adapter),
    }
}

/// Samples that every target of a render can have. Other counts than 1 and 4 are what an adapter adds.
fn sample_counts(adapter: &wgpu::Adapter) -> Vec<u32> {
    let formats = [COVERAGE_FORMAT, DEPTH_FORMAT, COLOR_FORMAT];
    let usable = adapter.features() & WANTED & !withheld();
    let flags = |format: wgpu::TextureFormat| {
        if usable.contains(wgpu::Features::TEXTURE_ADAPTER_SPECIFIC_FORMAT_FEATURES) {
            adapter.get_texture_format_features(format).flags
        } else {
            format.guaranteed_format_features(usable).flags
        }
    };
    let all = |count: u32| formats.iter().all(|&f| flags(f).sample_count_supported(count));
    COUNTS.into_iter().filter(|&count| count == 1 || all(count)).collect()
}

/// All adapters, best first.
pub fn adapters() -> Vec<Adapter> {
    with_process(|p| p.adapters.iter().map(|(_, a)| a.clone()).collect())
}

/// The device of an adapter, by its place in [`adapters`].
pub fn open(index: usize) -> Result<Arc<Gpu>> {
    with_process(|process| {
        let count = process.adapters.len();
        let (Some((adapter, described)), Some(slot)) =
            (process.adapters.get(index), process.devices.get_mut(index))
        else {
            return Err(Error::Device(format!("there is no adapter {index}: {count} were found")));
        };
        if let Some(gpu) = slot
            && gpu.lost.lock().unwrap_or_else(PoisonError::into_inner).is_none()
        {
            return Ok(gpu.clone());
        }
        let opened = Gpu::new(adapter, described.clone()).map_err(|e| match e {
            Error::Device(why) if process.forked => Error::Device(format!(
                "{why}. This process was forked from one that had used a GPU, which some drivers do not survive: \
                 start it with multiprocessing's \"spawn\""
            )),
            other => other,
        });
        let gpu = Arc::new(opened?);
        *slot = Some(gpu.clone());
        Ok(gpu)
    })
}

impl Gpu {
    fn new(adapter: &wgpu::Adapter, described: Adapter) -> Result<Self> {
        if let Some(lacks) = &described.lacks {
            return Err(Error::Unsupported(format!(
                "{} lacks {lacks}, which pipeline linked_list needs; device=\"cpu\" works everywhere",
                described.name
            )));
        }
        let features = adapter.features() & WANTED & !withheld();
        let limits = adapter.limits();
        let (device, queue) = block_on(adapter.request_device(&wgpu::DeviceDescriptor {
            label: Some("abuffer"),
            required_features: features,
            required_limits: limits.clone(),
            ..Default::default()
        }))
        .map_err(|e| {
            Error::Device(format!("cannot open {}: {e}; device=\"cpu\" works everywhere", described.name))
        })?;
        let lost = Arc::new(Mutex::new(None));
        let (on_loss, on_error) = (lost.clone(), lost.clone());
        device.set_device_lost_callback(move |reason, message| {
            *on_loss.lock().unwrap_or_else(PoisonError::into_inner) = Some(format!("{reason:?}: {message}"));
        });
        // Outside any scope nothing should fail; if it does, it must not take the process down.
        device.on_uncaptured_error(Arc::new(move |error: wgpu::Error| {
            *on_error.lock().unwrap_or_else(PoisonError::into_inner) = Some(error.to_string());
        }));
        Ok(Self {
            adapter: described,
            device,
            queue,
            features,
            limits,
            staging: staging(),
            pipelines: Mutex::new(HashMap::new()),
            lost,
            busy: Mutex::new(()),
        })
    }

    /// Runs wgpu calls with every kind of error caught: what wgpu would otherwise raise in a callback, or
    /// panic with, becomes the result.
    pub fn checked<R>(&self, what: &str, calls: impl FnOnce() -> Result<R>) -> Result<R> {
        let scopes =
            [wgpu::ErrorFilter::Internal, wgpu::ErrorFilter::OutOfMemory, wgpu::ErrorFilter::Validation]
                .map(|filter| self.device.push_error_scope(filter));
        let result = calls();
        // In reverse order of their pushes.
        let mut found = None;
        for scope in scopes.into_iter().rev() {
            found = block_on(scope.pop()).or(found);
        }
        match (found, result) {
            (Some(wgpu::Error::OutOfMemory { .. }), _) => Err(Error::Device(format!(
                "{} has no memory left for {what}: lower memory=, width or height",
                self.adapter.name
            ))),
            (Some(error), _) => {
                Err(Error::Device(format!("{what} failed on {}: {error}", self.adapter.name)))
            }
            (None, result) => {
                self.alive()?;
                result
            }
        }
    }

    pub fn alive(&self) -> Result<()> {
        match &*self.lost.lock().unwrap_or_else(PoisonError::into_inner) {
            None => Ok(()),
            Some(why) => Err(Error::Device(format!(
                "{} was lost ({why}); the next render opens it again, device=\"cpu\" works everywhere",
                self.adapter.name
            ))),
        }
    }

    /// The pipelines of a variant, each made when it is first used, and kept.
    pub fn pipelines(&self, variant: &Variant) -> Arc<Pipelines> {
        let mut all = self.pipelines.lock().unwrap_or_else(PoisonError::into_inner);
        if let Some(found) = all.get(variant) {
            return found.clone();
        }
        if all.len() >= MOST_VARIANTS {
            all.clear(); // whoever tries thousands of blends or limits
        }
        let made = Arc::new(Pipelines::new(self, variant.clone()));
        all.insert(variant.clone(), made.clone());
        made
    }

    pub fn has(&self, feature: wgpu::Features) -> bool {
        self.features.contains(feature)
    }

    pub fn exclusively<R>(&self, render: impl FnOnce() -> R) -> R {
        let _busy = self.busy.lock().unwrap_or_else(PoisonError::into_inner);
        render()
    }
}
