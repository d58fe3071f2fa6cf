//! What all scenes of a process share: pools of threads, and open devices.

use std::{
    collections::HashMap,
    process,
    sync::{
        Arc, Mutex, OnceLock, PoisonError,
        atomic::{AtomicUsize, Ordering},
    },
};

use kdray::{
    engine::Engine,
    gpu::{self, ContextOptions, Device, DeviceSelector, GpuError},
};
use pyo3::{
    exceptions::{PyRuntimeError, PyValueError},
    prelude::*,
};
use rayon::{ThreadPool, ThreadPoolBuilder};

/// The process that uses threads or devices. A forked child has neither of them.
static USER: OnceLock<u32> = OnceLock::new();

/// Number of threads of casts that ask for 0; 0 means one per core.
static N_THREADS: AtomicUsize = AtomicUsize::new(0);

/// Returns whether this process was forked from one that had threads or devices.
pub fn is_forked() -> bool {
    USER.get().is_some_and(|pid| *pid != process::id())
}

/// Refuses work in a forked child.
pub fn check_fork() -> PyResult<()> {
    USER.get_or_init(process::id);
    let why = "this process was forked from one that uses kdray, whose threads and devices it does not have: start \
               processes with multiprocessing.get_context(\"spawn\")";
    if is_forked() { Err(PyRuntimeError::new_err(why)) } else { Ok(()) }
}

/// Returns the pool of `n_threads` threads; 0 means the number that was set for the process.
pub fn pool(n_threads: usize) -> PyResult<Arc<ThreadPool>> {
    static POOLS: Mutex<Option<HashMap<usize, Arc<ThreadPool>>>> = Mutex::new(None);
    check_fork()?;
    let n_threads = if n_threads == 0 { N_THREADS.load(Ordering::Relaxed) } else { n_threads };
    let mut pools = POOLS.lock().unwrap_or_else(PoisonError::into_inner);
    let pools = pools.get_or_insert_default();
    if let Some(pool) = pools.get(&n_threads) {
        return Ok(Arc::clone(pool));
    }
    let made = ThreadPoolBuilder::new().num_threads(n_threads).thread_name(|ix| format!("kdray {ix}")).build();
    let made = made.map_err(|error| PyRuntimeError::new_err(format!("nthreads = {n_threads}: {error}")))?;
    Ok(Arc::clone(pools.entry(n_threads).or_insert(Arc::new(made))))
}

/// Sets the number of threads that work for casts and builds with ``nthreads=0``; 0 means one per core.
#[pyfunction]
pub fn set_threads(n: usize) {
    N_THREADS.store(n, Ordering::Relaxed);
}

/// Which device is used.
#[derive(FromPyObject)]
pub enum Selector {
    #[pyo3(transparent)]
    Index(usize),
    #[pyo3(transparent)]
    Name(String),
}

/// Returns the engine of a device, or of the CPU if there is no selector.
pub fn engine(py: Python, device: Option<Selector>) -> PyResult<Engine> {
    check_fork()?;
    let selector = device.map(|device| match device {
        Selector::Index(index) => DeviceSelector::Index(index),
        Selector::Name(name) => DeviceSelector::Name(name),
    });
    py.detach(|| match selector {
        Some(selector) => open(selector).map(Engine::on_device).map_err(failed),
        None => Ok(Engine::on_cpu()),
    })
}

/// Returns the name of an engine's device, or "cpu".
pub fn name_of(engine: &Engine) -> String {
    engine.device().map_or("cpu".to_owned(), |device| device.info().name.clone())
}

/// Returns what Python is told of a failed call.
pub fn failed(error: GpuError) -> PyErr {
    let what = error.to_string();
    match error {
        GpuError::BadOptions(_) => PyValueError::new_err(what),
        _ => PyRuntimeError::new_err(what),
    }
}

/// Opens a device, or returns the handle of an earlier scene to it.
fn open(selector: DeviceSelector) -> Result<Device, GpuError> {
    static DEVICES: Mutex<Vec<Device>> = Mutex::new(Vec::new());
    let info = gpu::chosen_device(Some(&selector))?;
    let mut devices = DEVICES.lock().unwrap_or_else(PoisonError::into_inner);
    devices.retain(|device| !device.is_lost());
    if let Some(open) = devices.iter().find(|device| device.info().index == info.index) {
        return Ok(open.clone());
    }
    let index = DeviceSelector::Index(info.index);
    let device = Device::open(&ContextOptions { for_streams: true, ..ContextOptions::new(Some(index), false) })?;
    devices.push(device.clone());
    Ok(device)
}

/// One Vulkan device: index, name, kind, driver, bytes of memory, and what it lacks.
type DeviceRow = (usize, String, String, String, u64, Vec<String>);

/// Lists the Vulkan devices. There are none without a Vulkan loader or driver.
#[pyfunction]
pub fn devices(py: Python) -> PyResult<Vec<DeviceRow>> {
    check_fork()?;
    let list = py.detach(gpu::devices).unwrap_or_default();
    Ok(list.into_iter().map(|it| (it.index, it.name, it.kind, it.driver, it.memory_bytes, it.missing)).collect())
}
