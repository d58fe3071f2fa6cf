//! The class `CoreScene`: a scene of a file, and its pictures.

use std::{
    path::{Path, PathBuf},
    sync::{
        Arc, Mutex, PoisonError,
        atomic::{AtomicBool, Ordering},
        mpsc::{self, RecvTimeoutError},
    },
    thread,
    time::Duration,
};

use glam::{DVec3, Vec3};
use kdray::{
    cpu,
    engine::{AnimatedWorld, Engine, LoadError, LoadRequest, Loaded, Opened, Rendered, Work},
    frame::{Aov, Crop, Goal, Integrator, RenderOptions, Samples, Watcher},
    scene::{Camera, PictureChoices, Projection, Scene},
    world::World,
};
use numpy::{IntoPyArray, PyArrayMethods};
use pyo3::{
    exceptions::{PyRuntimeError, PyValueError},
    prelude::*,
    types::PyDict,
};

use super::process::{Selector, check_fork, engine, failed, name_of, pool};

/// Time between two looks at Ctrl-C.
const LOOK_AT_SIGNALS: Duration = Duration::from_millis(50);

/// Frames a second, as those of the command's films.
const FRAME_RATE: f64 = 24.0;

/// What is chosen of a file before its structure is built.
#[derive(Clone, PartialEq, FromPyObject)]
#[pyo3(from_item_all)]
pub struct Choices {
    size: Option<(u32, u32)>,
    /// The file's camera, by name or index.
    camera: Option<String>,
    /// The moment of animations, seconds.
    at: Option<f64>,
    integrator: Option<String>,
}

/// What replaces parts of the camera: points in the coordinates of the file, and degrees.
#[derive(FromPyObject)]
#[pyo3(from_item_all)]
pub struct View {
    eye: Option<[f64; 3]>,
    target: Option<[f64; 3]>,
    up: Option<[f32; 3]>,
    vertical_fov: Option<f32>,
}

/// The number of triangles, the minimum and the maximum corner, and what was assumed about the file.
type Facts = (usize, [f64; 3], [f64; 3], Vec<String>);

/// A scene that was loaded.
struct Shown {
    choices: Choices,
    loaded: Loaded,
    /// The world and camera one frame later.
    next: (World, Camera),
    /// Samples per pixel, if the caller asks for no number.
    n_samples: u32,
}

/// A scene of a file.
#[pyclass(frozen, module = "kdray._kdray")]
pub struct CoreScene {
    engine: Engine,
    path: PathBuf,
    /// The scene by the last choices.
    shown: Mutex<Option<Arc<Shown>>>,
}

impl Choices {
    fn request(&self) -> PyResult<LoadRequest> {
        let word = |word: &String| word.parse::<Integrator>();
        let integrator = self.integrator.as_ref().map(word).transpose();
        let integrator = integrator.map_err(|what| PyValueError::new_err(format!("integrator: {what}")))?;
        let mut request =
            LoadRequest::pictures(PictureChoices { size: self.size, integrator, ..PictureChoices::default() });
        (request.scene.camera, request.scene.at) = (self.camera.clone(), self.at);
        Ok(request)
    }
}

impl View {
    fn camera(&self, scene_origin: DVec3, camera: Camera) -> Camera {
        let point = |given: Option<[f64; 3]>, own: Vec3| {
            given.map_or(own, |point| (DVec3::from(point) - scene_origin).as_vec3())
        };
        let fov = self.vertical_fov;
        Camera {
            eye: point(self.eye, camera.eye),
            target: point(self.target, camera.target),
            up: self.up.map_or(camera.up, |up| Vec3::from(up).normalize_or_zero()),
            projection: fov
                .map_or(camera.projection, |vertical_fov_degrees| Projection::Perspective { vertical_fov_degrees }),
        }
    }
}

impl Shown {
    fn load(engine: &Engine, path: &Path, choices: &Choices) -> PyResult<Self> {
        let request = choices.request()?;
        let mut opened = Opened::read(path, &request).map_err(|error| refused(error.into()))?;
        opened.options.check().map_err(|error| failed(error.into()))?;
        opened.options = RenderOptions { pixel_aovs: true, light_layers: true, surface_layers: true, ..opened.options };
        let n_samples = opened.scene.defaults.for_integrator(Some(opened.options.integrator)).samples;
        let scene: Option<Scene> = choices.at.map(|_| opened.scene.clone());
        let (mut loaded, methods) = engine.build(opened, &Work::picture()).map_err(refused)?;
        loaded.options = methods.apply(&loaded.options);
        let now = (loaded.world.clone(), loaded.world.scene().camera);
        let next = match (choices.at, scene) {
            (Some(at), Some(scene)) => {
                let mut animated = AnimatedWorld::new(path, &request, scene, &loaded.world);
                animated.at(at + 1.0 / FRAME_RATE).map_err(refused)?
            }
            _ => now,
        };
        Ok(Self { choices: choices.clone(), loaded, next, n_samples })
    }

    /// Draws what a camera sees. `next`: the camera one frame later. Returns the vectors of the layer `motion`, too.
    fn draw(
        &self,
        engine: &Engine,
        [camera, next]: [Camera; 2],
        n_samples: u32,
        stops: &AtomicBool,
    ) -> PyResult<(Rendered, Vec<[f32; 2]>)> {
        let Loaded { world, options, .. } = &self.loaded;
        let mut renderer = engine.renderer(world, options).map_err(failed)?;
        let drawn = renderer.draw(&camera, Goal::Samples(n_samples), Stop(stops)).map_err(failed)?;
        let picture = renderer.picture().map_err(failed)?.into_owned();
        let same = self.next.0.scene().n_triangles() == world.scene().n_triangles();
        let views = [(world, &camera), (if same { &self.next.0 } else { world }, &next)];
        let whole = Crop::whole(options.width, options.height);
        let motion = cpu::motion_vectors(views, (options.width, options.height), &whole, &drawn.pixel_aovs);
        Ok((Rendered { picture, drawn }, motion))
    }
}

/// Ends a drawing at Ctrl-C.
struct Stop<'a>(&'a AtomicBool);

impl Watcher for Stop<'_> {
    fn sample(&mut self) {}

    fn ends(&mut self) -> bool {
        self.0.load(Ordering::Relaxed)
    }
}

/// Calls `work` on the pool, while the caller's own thread lets Python raise KeyboardInterrupt.
fn interruptible<T: Send>(work: impl FnOnce(&AtomicBool) -> PyResult<T> + Send) -> PyResult<T> {
    let (pool, stops) = (pool(0)?, AtomicBool::new(false));
    let (done, waits) = mpsc::channel();
    thread::scope(|scope| {
        scope.spawn(|| done.send(pool.install(|| work(&stops))));
        loop {
            match waits.recv_timeout(LOOK_AT_SIGNALS) {
                Ok(result) => return result,
                Err(RecvTimeoutError::Timeout) => {
                    Python::attach(|py| py.check_signals()).inspect_err(|_| stops.store(true, Ordering::Relaxed))?
                }
                Err(RecvTimeoutError::Disconnected) => return Err(PyRuntimeError::new_err("the drawing broke off")),
            }
        }
    })
}

/// Returns what Python is told of a file that was not loaded.
fn refused(error: LoadError) -> PyErr {
    match error {
        LoadError::Scene(_) | LoadError::Mismatch(_) => PyValueError::new_err(error.to_string()),
        LoadError::Memory(_) | LoadError::Device(_) => PyRuntimeError::new_err(error.to_string()),
    }
}

#[pymethods]
impl CoreScene {
    /// Loads a file.
    #[new]
    fn new(py: Python, path: PathBuf, device: Option<Selector>, choices: Choices) -> PyResult<Self> {
        let scene = Self { engine: engine(py, device)?, path, shown: Mutex::default() };
        scene.shown(py, &choices)?;
        Ok(scene)
    }

    /// The name of the device, or "cpu".
    #[getter]
    fn device_name(&self) -> String {
        name_of(&self.engine)
    }

    fn facts(&self, py: Python, choices: Choices) -> PyResult<Facts> {
        let shown = self.shown(py, &choices)?;
        let (Loaded { world, bounds, notes, .. }, origin) = (&shown.loaded, shown.loaded.world.scene().origin);
        let [low, high] = [bounds.0, bounds.1].map(|corner| (corner.as_dvec3() + origin).to_array());
        Ok((world.scene().n_triangles(), low, high, notes.clone()))
    }

    /// Draws a picture. Returns arrays of (height, width) or (height, width, N) by the names of layers.
    fn render<'py>(
        &self,
        py: Python<'py>,
        choices: Choices,
        view: View,
        n_samples: Option<u32>,
    ) -> PyResult<Bound<'py, PyDict>> {
        let shown = self.shown(py, &choices)?;
        let n_samples = n_samples.unwrap_or(shown.n_samples);
        let origin = shown.loaded.world.scene().origin;
        let cameras = [shown.loaded.world.scene().camera, shown.next.1].map(|camera| view.camera(origin, camera));
        let (rendered, motion) =
            py.detach(|| interruptible(|stops| shown.draw(&self.engine, cameras, n_samples, stops)))?;
        layers_of(py, rendered, motion, shown.loaded.options.integrator)
    }
}

impl CoreScene {
    /// Returns the scene by these choices, which is loaded again if they differ from the last ones.
    fn shown(&self, py: Python, choices: &Choices) -> PyResult<Arc<Shown>> {
        check_fork()?;
        let pool = pool(0)?;
        py.detach(|| {
            let mut last = self.shown.lock().unwrap_or_else(PoisonError::into_inner);
            if let Some(shown) = last.as_ref().filter(|shown| shown.choices == *choices) {
                return Ok(Arc::clone(shown));
            }
            let shown = Arc::new(pool.install(|| Shown::load(&self.engine, &self.path, choices))?);
            *last = Some(Arc::clone(&shown));
            Ok(shown)
        })
    }
}

/// Returns a picture and all its layers as arrays.
fn layers_of(
    py: Python<'_>,
    Rendered { picture, drawn }: Rendered,
    motion: Vec<[f32; 2]>,
    integrator: Integrator,
) -> PyResult<Bound<'_, PyDict>> {
    let size = [picture.height as usize, picture.width as usize];
    let arrays = PyDict::new(py);
    let colour = |pixels: &[[f32; 4]]| -> PyResult<_> {
        let floats: Vec<f32> = pixels.iter().flat_map(|[r, g, b, _]| [*r, *g, *b]).collect();
        floats.into_pyarray(py).reshape([size[0], size[1], 3])
    };
    let display: Vec<u8> = picture.display.iter().flat_map(|[r, g, b, _]| [*r, *g, *b]).collect();
    arrays.set_item("picture", display.into_pyarray(py).reshape([size[0], size[1], 3])?)?;
    arrays.set_item("radiance", colour(&picture.radiance)?)?;
    let is_made = |aov: &&Aov| integrator == Integrator::Path || !aov.is_of_paths();
    for aov in Aov::ALL.iter().filter(is_made) {
        let name = aov.to_string();
        if let Some(layer) = Aov::OF_MEANS.iter().position(|mean| mean == aov) {
            arrays.set_item(name, colour(&drawn.layers.0[layer])?)?;
        } else if *aov == Aov::Motion {
            arrays.set_item(name, motion.as_flattened().to_vec().into_pyarray(py).reshape([size[0], size[1], 2])?)?;
        } else if *aov == Aov::Position {
            let points: Vec<f32> = drawn.pixel_aovs.iter().flat_map(|aovs| aovs.position_world.to_array()).collect();
            arrays.set_item(name, points.into_pyarray(py).reshape([size[0], size[1], 3])?)?;
        } else {
            for channel in aov.channels(&drawn.pixel_aovs) {
                match channel.samples {
                    Samples::Float(values) => arrays.set_item(&name, values.into_pyarray(py).reshape(size)?)?,
                    Samples::Uint(values) => arrays.set_item(&name, values.into_pyarray(py).reshape(size)?)?,
                }
            }
        }
    }
    Ok(arrays)
}
