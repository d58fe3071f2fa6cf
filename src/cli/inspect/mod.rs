//! `kdray inspect`: the contents of a scene, and the figures of its acceleration structure.

mod contents;
mod lighting;
mod text;

use glam::DVec3;
use kdray::{
    accel::Statistics,
    buffers::{PathQueue, Pixels},
    engine::{
        Builder, LoadError, Loaded, Work,
        choices::{BuildPolicy, Processor, Request},
    },
    layout::{LIGHT_DIRECTIONAL, LIGHT_SPOT, Light},
    world::{Emitters, FlatScene},
};
use serde::Serialize;

use self::{
    contents::{Contents, MaterialDetails, TextureMemory},
    lighting::Lighting,
    text::{cut_table, shortened},
};
use super::{
    args::InspectArgs,
    error::CliError,
    print, print_raw,
    progress::Progress,
    report::{SCHEMA, json},
    table::table,
};

/// Loads the scene, builds its structure and describes both.
pub fn run(args: &InspectArgs) -> Result<(), CliError> {
    let progress = Progress::new(false, 2);
    let opened = progress.read(&args.scene, &args.load.scene(Default::default()))?;
    let scene = &opened.scene;
    let contents = Contents::from(scene);
    let lighting = Lighting::from(scene);
    let details: Vec<_> = scene.materials.iter().map(|material| MaterialDetails::new(material, scene)).collect();
    let n_triangles = scene.n_triangles();
    let choices = Request { accel: Some(args.accel), build: BuildPolicy::Best, ..Request::default() };
    let builder = Builder::new(Processor::Gpu, choices);
    let building = builder.describe(&opened.scene);
    let build = || {
        let loaded = builder.build(opened, &Work::Rays(0))?;
        let statistics = loaded.world.statistics(); // builds the structure if it is a grid
        Ok::<_, LoadError>((loaded, statistics))
    };
    let (built, build_ms) = progress.stage(&building, build);
    let (Loaded { world, load_ms, .. }, statistics) = built?;
    let scene = world.scene();
    drop(progress);

    let inspection = Inspection {
        schema: SCHEMA,
        triangles: n_triangles,
        origin: (scene.origin != DVec3::ZERO).then(|| scene.origin.to_array()),
        bounds: world.bounds().map(|corner| corner.to_array()),
        materials: material_uses(scene, details),
        lights: scene.lights.iter().map(LightUse::from).collect(),
        lighting,
        contents,
        texture_memory: TextureMemory::from(&*scene.textures),
        path_lights: PathLights::from(world.emitters()),
        path_memory: PathMemory::of_samples(scene.defaults.of_paths.samples),
        accel: statistics,
        load_ms,
        build_ms,
        scene: scene.name.clone(),
    };
    if args.json { print_raw(&json(&inspection)) } else { print(&inspection.text()) }
}

/// The description, as it is printed.
#[derive(Serialize)]
struct Inspection {
    schema: u32,
    scene: String,
    triangles: usize,
    /// Minimum and maximum corner, world units.
    bounds: [[f32; 3]; 2],
    /// The point of the file from which all coordinates count, if it is not 0.
    #[serde(skip_serializing_if = "Option::is_none")]
    origin: Option<[f64; 3]>,
    materials: Vec<MaterialUse>,
    lights: Vec<LightUse>,
    lighting: Lighting,
    #[serde(flatten)]
    contents: Contents,
    texture_memory: TextureMemory,
    path_lights: PathLights,
    path_memory: PathMemory,
    /// Statistics of the acceleration structure, serialized under the key `tree` or `grid`.
    #[serde(flatten)]
    accel: Statistics,
    load_ms: f64,
    build_ms: f64,
}

/// The lights from which `--integrator path` picks: those above, lamps, emitting triangles and the environment.
#[derive(Serialize)]
struct PathLights {
    lights: usize,
    picked_by: &'static str,
}

impl From<&Emitters> for PathLights {
    fn from(emitters: &Emitters) -> Self {
        Self { lights: emitters.n_lights(), picked_by: if emitters.has_tree() { "tree" } else { "table" } }
    }
}

impl PathLights {
    fn text(&self) -> String {
        // The surroundings of the scene count as one light source.
        let rows = [
            ["light sources: lights, shining triangles, surroundings", &self.lights.to_string()],
            ["a ray's source is picked from a", self.picked_by],
        ];
        table(["path tracing", ""], &rows.map(|row| row.map(str::to_owned)))
    }
}

/// The memory on a device that `--integrator path` takes beside the scene.
#[derive(Serialize)]
struct PathMemory {
    samples: u32,
    bytes_per_path: usize,
    bytes_per_pixel: u64,
}

impl PathMemory {
    fn of_samples(samples: u32) -> Self {
        let bytes_per_pixel = Pixels::bytes_per_pixel_of_paths(samples);
        Self { samples, bytes_per_path: PathQueue::BYTES_PER_PATH, bytes_per_pixel }
    }

    fn text(&self) -> String {
        let rows = [
            ["for each path that is traced at a time".to_owned(), self.bytes_per_path.to_string()],
            [format!("for each pixel of {} samples", self.samples), self.bytes_per_pixel.to_string()],
        ];
        table(["path tracing on a device", "bytes"], &rows)
    }
}

#[derive(Serialize)]
struct MaterialUse {
    name: String,
    triangles: usize,
    #[serde(flatten)]
    details: MaterialDetails,
}

#[derive(Serialize)]
struct LightUse {
    kind: &'static str,
    /// Position of a point light or a spot light in world units; unit vector towards a directional light.
    position: [f32; 3],
    /// Radiant intensity of a point light or a spot light, irradiance of a directional light; linear RGB.
    intensity: [f32; 3],
    /// Unit vector along which a spot light shines.
    #[serde(skip_serializing_if = "Option::is_none")]
    direction: Option<[f32; 3]>,
    /// Angle from there up to which a spot light is whole, degrees.
    #[serde(skip_serializing_if = "Option::is_none")]
    inner_angle: Option<f32>,
    /// Angle beyond which a spot light is dark, degrees.
    #[serde(skip_serializing_if = "Option::is_none")]
    outer_angle: Option<f32>,
}

impl From<&Light> for LightUse {
    fn from(light: &Light) -> Self {
        let is_spot = light.kind == LIGHT_SPOT;
        let angle = |cosine: f32| is_spot.then(|| cosine.acos().to_degrees());
        Self {
            kind: match light.kind {
                LIGHT_DIRECTIONAL => "directional",
                LIGHT_SPOT => "spot",
                _ => "point",
            },
            position: light.position.to_array(),
            intensity: light.intensity.to_array(),
            direction: is_spot.then(|| light.axis.to_array()),
            inner_angle: angle(light.inner_cos),
            outer_angle: angle(light.outer_cos),
        }
    }
}

fn material_uses(scene: &FlatScene, details: Vec<MaterialDetails>) -> Vec<MaterialUse> {
    let named = scene.material_names.iter().zip(details).zip(scene.triangles_of_materials());
    named.map(|((name, details), triangles)| MaterialUse { name: name.clone(), triangles, details }).collect()
}

impl Inspection {
    fn text(&self) -> String {
        // Both corners have the digits of the larger one.
        let largest = self.bounds.as_flattened().iter().fold(0.0_f32, |largest, x| largest.max(x.abs()));
        let [min, max] = self.bounds.map(|corner| rounded(corner, largest));
        let mut text = format!("{}: {} triangles, loaded in {:.0} ms\n", self.scene, self.triangles, self.load_ms);
        let size = std::array::from_fn(|axis| self.bounds[1][axis] - self.bounds[0][axis]);
        text += &format!("bounds {min} to {max}, size {}\n", vector(size));
        if let Some(origin) = self.origin {
            text += &format!("coordinates count from {origin:?} of the file\n");
        }
        text.push('\n');
        text += &cut_table(["material", "triangles"], &self.materials, |_, used| {
            [shortened(&used.name), used.triangles.to_string()]
        });
        text.push('\n');
        let header = ["light", "position, or direction towards it", "intensity or irradiance"];
        text += &cut_table(header, &self.lights, |_, light| {
            [light.kind.to_owned(), vector(light.position), vector(light.intensity)]
        });
        text.push('\n');
        text += &self.lighting.text();
        text.push('\n');
        text += &self.accel_text();
        text.push('\n');
        text += &text::contents(&self.contents, &self.materials, &self.lights, &self.texture_memory);
        text.push('\n');
        text += &self.path_lights.text();
        text.push('\n');
        text + &self.path_memory.text()
    }

    fn accel_text(&self) -> String {
        let bytes = ("bytes", self.accel.bytes().to_string());
        let build_ms = ("build ms", format!("{:.1}", self.build_ms));
        let rows = self.accel.rows().into_iter().chain([bytes, build_ms]);
        let rows: Vec<_> = rows.map(|(name, value)| [name.to_owned(), value]).collect();
        table([self.accel.kind().name(), ""], &rows)
    }
}

/// Returns a vector with five digits of its largest number, which are enough to read. `--json` prints all digits.
fn vector(components: [f32; 3]) -> String {
    rounded(components, components.iter().fold(0.0, |largest, x| largest.max(x.abs())))
}

/// Returns a vector with the digits with which a number has five.
fn rounded(components: [f32; 3], number: f32) -> String {
    let n_decimals = (4.0 - f64::from(number).max(1e-30).log10().floor()).clamp(0.0, 34.0) as usize;
    let component = |x: f32| {
        let text = format!("{x:.n_decimals$}");
        let short = if text.contains('.') { text.trim_end_matches('0').trim_end_matches('.') } else { &text };
        if short == "-0" { "0".to_owned() } else { short.to_owned() }
    };
    format!("({})", components.map(component).join(", "))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn vectors_have_five_digits() {
        assert_eq!(vector([-2.750042, -0.000041, 5.5]), "(-2.75, 0, 5.5)");
        assert_eq!(vector([123456.7, -99.4, 0.0]), "(123457, -99, 0)");
        assert_eq!(vector([1.23456e-7, 0.0, -1e-7]), "(0.00000012346, 0, -0.0000001)");
        assert_eq!(vector([0.0; 3]), "(0, 0, 0)");
    }
}
